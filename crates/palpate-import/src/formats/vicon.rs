//! CSV files that Vicon's Nexus exports: the section "Trajectories".

use super::Format;
use super::table::{Trajectories, bare_names, cell, is_empty, rows};
use crate::Watch;
use crate::capture::Capture;
use crate::error::{ImportError, refuse};
use crate::options::{Options, Unit};
use crate::place::{Place, head_text};
use glam::DVec3;
use palpate_io::InputError;

/// See the file's head.
pub const FORMAT: Format = Format {
    name: "vicon",
    what: "CSV of Vicon's Nexus",
    detect: |place| {
        let file = place.only(&["csv"])?;
        let text = head_text(file);
        let named = text.lines().any(|l| l.trim().trim_matches([',', '"']) == "Trajectories");
        // Other sections may go before, and be long.
        let other = ["Devices", "Joints", "Model Outputs", "Segments"].iter().any(|w| text.starts_with(w));
        (named || other).then(|| format!("{} has a section of Nexus", place.name(file)))
    },
    read,
};

fn read(place: &Place, _: &Options, watch: &mut Watch) -> Result<Capture, ImportError> {
    let Some(path) = place.only(&["csv"]) else { return refuse(&place.path, "is no CSV file, and does not hold a single one") };
    watch.at(0, 1, "motion capture")?;
    let rows = rows(path, ',')?;
    let Some(first) = rows.iter().position(|r| cell(r, 0) == "Trajectories") else {
        return refuse(path, "holds no section \"Trajectories\"; export the trajectories of markers");
    };
    let [title, rate, names, header, units, ..] = &rows[first..] else {
        return refuse(path, "ends in the head of its section \"Trajectories\"");
    };
    let wrong = |line: usize, text: String| -> Result<Capture, ImportError> { Err(InputError::line(path, line, text).into()) };
    let Some(hertz) = cell(rate, 0).parse().ok().filter(|x: &f64| *x > 0.0 && x.is_finite()) else {
        return wrong(title.0 + 1, format!("\"{}\" is no rate: frames per second follow the word Trajectories", cell(rate, 0)));
    };
    if !cell(header, 0).eq_ignore_ascii_case("frame") {
        return wrong(header.0, format!("begins with \"{}\", expected \"Frame\"", cell(header, 0)));
    }
    let mut columns: Vec<(String, [usize; 3])> = Vec::new();
    let mut unit: Option<&str> = None;
    let mut i = 2;
    while i < header.1.len() {
        let axes = [0, 1, 2].map(|k| cell(header, i + k).to_ascii_uppercase());
        if axes != ["X", "Y", "Z"] || cell(names, i).is_empty() {
            return wrong(header.0, format!("column {} is no X, Y, Z under a marker's name", i + 1));
        }
        for k in 0..3 {
            let u = cell(units, i + k);
            if *unit.get_or_insert(u) != u {
                let text = format!("columns are in \"{}\" and in \"{u}\"; one unit is wanted", unit.unwrap_or_default());
                return wrong(units.0, text);
            }
        }
        columns.push((cell(names, i).to_string(), [i, i + 1, i + 2]));
        i += 3;
        // A line may end with a comma.
        if header.1[i.min(header.1.len())..].iter().all(String::is_empty) {
            break;
        }
    }
    let unit = match unit.unwrap_or_default() {
        "" => None,
        text => match text.parse::<Unit>() {
            Ok(u) => Some((u, format!("the row of units, {text}"))),
            Err(e) => return wrong(units.0, e),
        },
    };
    let labels: Vec<String> = columns.iter().map(|c| c.0.clone()).collect();
    let mut t = Trajectories::new(path, bare_names(&labels), names.0)?;
    let mut begin = None;
    for row in rows[first + 5..].iter().take_while(|r| !is_empty(r)) {
        let Some(frame) = cell(row, 0).parse().ok().filter(|x: &f64| x.is_finite()) else {
            return wrong(row.0, format!("\"{}\" is no number of a frame", cell(row, 0)));
        };
        let cells: Vec<[&str; 3]> = columns.iter().map(|c| c.1.map(|i| cell(row, i))).collect();
        t.push(row.0, (frame - *begin.get_or_insert(frame)) / hertz, &cells, false)?;
    }
    let mut losses = Vec::new();
    let markers = t.finish(&mut losses)?;
    Ok(Capture {
        title: place.title(),
        unit,
        usual_unit: Some((Unit::Millimetre, "what Nexus exports")),
        up: Some((DVec3::Z, "z, Vicon's own".into())),
        markers: Some(markers),
        facts: vec![format!("{hertz} frames a second, the first of them at 0 s")],
        losses,
        ..Capture::default()
    })
}

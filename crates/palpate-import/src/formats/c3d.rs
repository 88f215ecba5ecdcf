//! C3D files of any motion-capture system, read by the room of recordings.

use super::Format;
use crate::Watch;
use crate::capture::{Capture, Markers};
use crate::error::{ImportError, refuse};
use crate::options::{Options, Unit};
use crate::place::{Place, head};
use glam::DVec3;
use palpate_io::recording::read_c3d;

/// See the file's head.
pub const FORMAT: Format = Format {
    name: "c3d",
    what: "C3D file of markers",
    detect: |place| {
        let file = place.only(&["c3d"])?;
        (head(file, 2).get(1) == Some(&0x50)).then(|| format!("{} begins as a C3D file does", place.name(file)))
    },
    read,
};

fn read(place: &Place, _: &Options, watch: &mut Watch) -> Result<Capture, ImportError> {
    let Some(path) = place.only(&["c3d"]) else { return refuse(&place.path, "is no C3D file, and does not hold a single one") };
    watch.at(0, 1, "motion capture")?;
    crate::error::read(path)?;
    let read = read_c3d(path)?;
    let (names, samples, losses) = (read.value.names, read.value.samples, read.warnings);
    let mut m = Markers { names, ..Markers::default() };
    let n = m.names.len();
    for s in &samples {
        if m.times.last() != Some(&s.time) {
            m.times.push(s.time);
            m.places.resize(m.times.len() * n, None);
        }
        let row = m.places.len() - n;
        m.places[row + s.marker] = Some(s.position);
    }
    Ok(Capture {
        title: place.title(),
        // The reader has used POINT:UNITS.
        unit: Some((Unit::Metre, "POINT:UNITS, converted to m".into())),
        up: Some((DVec3::Z, "z, as in most C3D files".into())),
        markers: Some(m),
        losses,
        ..Capture::default()
    })
}

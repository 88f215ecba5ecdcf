//! `[[target]]`: where points of the body shall be.

use super::rows::rows;
use crate::document::Table;
use crate::error::InputError;
use glam::DVec3;
use palpate_model::observation::target::Target;
use std::path::Path;

const COLUMNS: [&str; 6] = ["x", "y", "z", "to_x", "to_y", "to_z"];

/// All targets of a scene. They share one tolerance, as readings of one instrument do.
pub(super) fn targets(root: &Table) -> Result<Vec<Target>, InputError> {
    let tables = root.tables("target")?;
    if let Some(first) = tables.first()
        && root.has("observation")
    {
        return Err(first.own_error("a scene is compared with a recording ([observation]) or with targets, not with both"));
    }
    let mut all: Vec<Target> = Vec::new();
    for t in &tables {
        let target = target(t)?;
        if let Some(before) = all.first().filter(|b| b.tolerance != target.tolerance) {
            let message = format!("{} m, and an earlier target has {} m; all share one", target.tolerance, before.tolerance);
            return Err(t.error("tolerance", message));
        }
        all.push(target);
    }
    Ok(all)
}

fn target(t: &Table) -> Result<Target, InputError> {
    let time = t.optional_f64("time")?.ok_or_else(|| t.missing("time", "a time (s)"))?;
    let tolerance = t.f64_where("tolerance", |x| x > 0.0, "is not allowed: must be > 0 (m)")?;
    let tolerance = tolerance.ok_or_else(|| t.missing("tolerance", "a length > 0 (m): a miss that is as good as met"))?;
    let given = (t.optional_file("file")?, t.optional_points("points")?, t.optional_points("positions")?);
    let (points, positions) = match given {
        (Some(path), None, None) => read(&path)?,
        (None, Some(points), Some(positions)) => {
            if points.len() != positions.len() || points.is_empty() {
                let message = format!("has {} places for {} points", positions.len(), points.len());
                return Err(t.error("positions", message));
            }
            (points, positions)
        }
        (Some(_), ..) => return Err(t.error("file", "and points exclude each other; give one".to_string())),
        _ => return Err(t.missing("points", "points = [[x, y, z], …] and positions = [[x, y, z], …], or file = \"FILE.csv\"")),
    };
    Ok(Target { points, positions, time, tolerance })
}

/// Rows `x,y,z,to_x,to_y,to_z` (m).
fn read(path: &Path) -> Result<(Vec<DVec3>, Vec<DVec3>), InputError> {
    let (mut points, mut positions) = (Vec::new(), Vec::new());
    for (_, v) in rows(path, COLUMNS)? {
        points.push(DVec3::from_slice(&v[..3]));
        positions.push(DVec3::from_slice(&v[3..]));
    }
    if points.is_empty() { Err(InputError::file(path, "holds no point")) } else { Ok((points, positions)) }
}

#[cfg(test)]
mod tests {
    use crate::scene::parse_scene;
    use crate::scene::tests::BASE;

    fn error(tables: &str) -> String {
        parse_scene(&format!("{BASE}{tables}"), "scene.toml").expect_err(tables).to_string()
    }

    #[test]
    fn targets_are_read_from_the_scene_or_a_file() {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("t.csv"), "x,y,z,to_x,to_y,to_z\n0,0,0.05,0,0,0.06\n0,0.05,0,0,0.06,0\n").unwrap();
        let text = "[[target]]\ntime = 0.2\ntolerance = 1e-3\npoints = [[0, 0, -0.05]]\npositions = [[0, 0, -0.07]]\n\
                    [[target]]\ntime = 0.1\ntolerance = 1e-3\nfile = \"t.csv\"\n";
        let scene = parse_scene(&format!("{BASE}{text}"), folder.path().join("scene.toml")).unwrap().value;
        let all: Vec<_> = scene.targets.iter().map(|t| (t.time, t.points.len(), t.positions[0].z)).collect();
        assert_eq!(all, [(0.2, 1, -0.07), (0.1, 2, 0.06)]);
        let o = palpate_model::observation::Observation::of_targets(&scene.targets);
        let frames: Vec<_> = o.frames.iter().map(|f| (f.time, f.markers.iter().map(|m| m.site).collect::<Vec<_>>())).collect();
        assert_eq!(frames, [(0.1, vec![1, 2]), (0.2, vec![0])]);
    }

    #[test]
    fn what_is_no_target_is_refused() {
        let with = |keys: &str| error(&format!("[[target]]\ntime = 0.1\n{keys}\n"));
        for (message, said) in [
            ("target.0.tolerance", with("points = [[0, 0, 0]]\npositions = [[0, 0, 0]]")),
            ("must be > 0", with("tolerance = 0")),
            ("target.0.points", with("tolerance = 1")),
            ("has 2 places for 1 points", with("tolerance = 1\npoints = [[0, 0, 0]]\npositions = [[0, 0, 0], [1, 0, 0]]")),
            ("three numbers", with("tolerance = 1\npoints = [[0, 0]]\npositions = [[0, 0, 0]]")),
            ("known: time, tolerance, points, positions, file", with("tolerance = 1\nweight = 2")),
            (
                "all share one",
                error(
                    &["0.1", "0.2"]
                        .map(|t| {
                            format!("[[target]]\ntime = {t}\ntolerance = {t}\npoints = [[0, 0, 0]]\npositions = [[0, 0, 0]]\n")
                        })
                        .concat(),
                ),
            ),
            (
                "not with both",
                error("[observation]\nrecording = \"r\"\ncost = \"markers\"\n[[target]]\ntime = 1\ntolerance = 1\n"),
            ),
        ] {
            assert!(said.contains(message), "{said}");
        }
    }
}

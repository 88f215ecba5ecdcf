//! Wavefront OBJ by lines: vertices are replaced, normals left out (every viewer makes them of the faces), and the rest is kept.

use super::Moved;
use glam::DVec3;
use std::io::Write;

/// A line, or a vertex with what stands behind its coordinates (a colour).
#[derive(Debug)]
enum Line {
    Kept(String),
    Vertex(String),
}

/// The lines of a file.
#[derive(Debug)]
pub(super) struct Lines(Vec<Line>);

pub(super) fn read(bytes: &[u8]) -> Result<(Vec<DVec3>, Lines), String> {
    let text = String::from_utf8_lossy(bytes);
    let (mut places, mut lines) = (Vec::new(), Vec::new());
    for (number, line) in text.lines().enumerate() {
        let mut words = line.split_whitespace();
        match words.next() {
            Some("v") => {
                let coordinates: Vec<f64> = words.by_ref().take(3).filter_map(|w| w.parse().ok()).collect();
                let [x, y, z] = coordinates[..] else {
                    return Err(format!("line {}: a vertex has three coordinates, found \"{line}\"", number + 1));
                };
                places.push(DVec3::new(x, y, z));
                lines.push(Line::Vertex(words.map(|w| format!(" {w}")).collect()));
            }
            // They no longer point where the surface does.
            Some("vn") => {}
            Some("f") => lines.push(Line::Kept(words.fold("f".into(), |text, corner| text + " " + without_normal(corner)))),
            _ => lines.push(Line::Kept(line.to_string())),
        }
    }
    Ok((places, Lines(lines)))
}

/// A face's corner without the number of its normal: `1/2` of `1/2/3`, and `1` of `1//3`.
fn without_normal(corner: &str) -> &str {
    let mut slashes = corner.match_indices('/').map(|(k, _)| k);
    match (slashes.next(), slashes.next()) {
        (Some(first), Some(second)) if second == first + 1 => &corner[..first],
        (_, Some(second)) => &corner[..second],
        _ => corner,
    }
}

impl Lines {
    pub(super) fn moved(&self, moved: impl Fn(usize) -> Moved) -> Vec<u8> {
        let (mut out, mut vertex) = (Vec::new(), 0);
        for line in &self.0 {
            // Memory takes every line.
            let _ = match line {
                Line::Kept(text) => writeln!(out, "{text}"),
                Line::Vertex(behind) => {
                    let p = moved(vertex).0;
                    vertex += 1;
                    writeln!(out, "v {:?} {:?} {:?}{behind}", p.x, p.y, p.z)
                }
            };
        }
        out
    }
}

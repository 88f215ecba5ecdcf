//! Synthetic recordings, in the format that is read.

use super::{DepthPixels, FORMAT, RecordedDisplacements, RecordedMarkers, RecordedPoints, Recording, SeenFrom, Sequence};
use crate::cloud::{ending, write_cloud};
use crate::error::OutputError;
use crate::npy::{Array, write_npz};
use crate::output::{make_folder, write_file};
use glam::{DAffine3, DVec3};
use image::{ExtendedColorType, ImageEncoder, codecs::png::PngEncoder};
use std::fmt::Write as _;
use std::path::Path;
use tiff::TiffError;
use tiff::encoder::TiffEncoder;
use tiff::encoder::colortype::Gray32Float;

/// Writes a recording as a folder: `recording.toml`, `depth/`, `mask/`, `cloud/`, `markers.csv`, `points.npz`,
/// `displacements.npz`. [`super::read_recording`] gives it back.
///
/// # Errors
/// The file that could not be written and why.
pub fn write_recording(folder: impl AsRef<Path>, recording: &Recording) -> Result<(), OutputError> {
    write(folder.as_ref(), recording)
}

fn write(folder: &Path, recording: &Recording) -> Result<(), OutputError> {
    make_folder(folder)?;
    let mut toml = String::new();
    // Writing to a string cannot fail.
    let _ = head(&mut toml, recording);
    let mut counts = vec![0usize; recording.cameras.len()];
    for f in &recording.frames {
        let camera = &recording.cameras[f.camera];
        let number = counts[f.camera];
        counts[f.camera] += 1;
        // Folders are numbered: a camera's name may hold characters that a file name may not.
        let place = |kind: &str| format!("{kind}/cam{}/{number:06}.png", f.camera);
        let _ = write!(toml, "\n[[frame]]\ncamera = {}\ntime = {:?}\n", quoted(&camera.name), f.time);
        let size = (camera.width as u32, camera.height as u32);
        if let Some(d) = &f.depth {
            let mut file = place("depth");
            match &d.pixels {
                DepthPixels::Counts(counts) => {
                    let bytes: Vec<u8> = counts.iter().flat_map(|c| c.to_ne_bytes()).collect();
                    png(folder, &file, &bytes, size, ExtendedColorType::L16)?;
                }
                DepthPixels::Metres(metres) => {
                    file = file.replace(".png", ".tiff");
                    tiff(folder, &file, metres, size)?;
                }
            }
            let _ = writeln!(toml, "depth = \"{file}\"");
        }
        if let Some(m) = &f.mask {
            let bytes: Vec<u8> = m.iter().map(|b| if *b { 255 } else { 0 }).collect();
            png(folder, &place("mask"), &bytes, size, ExtendedColorType::L8)?;
            let _ = writeln!(toml, "mask = \"{}\"", place("mask"));
        }
    }
    write_clouds(folder, &mut toml, recording)?;
    if let Some(m) = &recording.markers {
        write_markers(folder, &mut toml, m)?;
    }
    if let Some(p) = &recording.points {
        write_points(folder, &mut toml, p)?;
    }
    if let Some(d) = &recording.displacements {
        write_displacements(folder, &mut toml, d)?;
    }
    // Last, so that a folder with this file is complete.
    write_file(folder.join("recording.toml"), |w| w.write_all(toml.as_bytes()))
}

fn quoted(text: &str) -> String {
    toml_edit::Value::from(text).to_string()
}

fn vector(v: DVec3) -> String {
    format!("[{:?}, {:?}, {:?}]", v.x, v.y, v.z)
}

fn matrix(a: &DAffine3) -> String {
    let m = a.matrix3;
    let row = |i: usize| format!("  [{:?}, {:?}, {:?}, {:?}],\n", m.col(0)[i], m.col(1)[i], m.col(2)[i], a.translation[i]);
    format!("[\n{}{}{}  [0, 0, 0, 1],\n]", row(0), row(1), row(2))
}

fn head(toml: &mut String, r: &Recording) -> std::fmt::Result {
    writeln!(toml, "format = \"{FORMAT}\"\ntitle = {}\nsource = {}\nunits = \"m, s\"", quoted(&r.title), quoted(&r.source))?;
    for c in &r.cameras {
        writeln!(toml, "\n[[camera]]\nname = {}\nwidth = {}\nheight = {}", quoted(&c.name), c.width, c.height)?;
        writeln!(toml, "fx = {:?}\nfy = {:?}\ncx = {:?}\ncy = {:?}", c.focal[0], c.focal[1], c.center[0], c.center[1])?;
        let coefficients = if c.distortion[5..] == [0.0; 3] { 5 } else { 8 };
        writeln!(toml, "distortion = {:?}", &c.distortion[..coefficients])?;
        writeln!(toml, "world_from_camera = {}", matrix(&c.world_from_camera))?;
        if let Some(s) = c.depth_scale {
            writeln!(toml, "depth_scale = {s:?}")?;
        }
        writeln!(toml, "depth_offset = {:?}", c.depth_offset)?;
        if let Some(s) = c.noise_sigma {
            writeln!(toml, "noise_sigma = {s:?}")?;
        }
        writeln!(toml, "noise_systematic = {:?}", c.noise_systematic)?;
    }
    Ok(())
}

fn png(folder: &Path, place: &str, bytes: &[u8], (w, h): (u32, u32), color: ExtendedColorType) -> Result<(), OutputError> {
    let path = folder.join(place);
    if let Some(parent) = path.parent() {
        make_folder(parent)?;
    }
    write_file(&path, |out| PngEncoder::new(out).write_image(bytes, w, h, color).map_err(std::io::Error::other))
}

fn tiff(folder: &Path, place: &str, metres: &[f32], (w, h): (u32, u32)) -> Result<(), OutputError> {
    let path = folder.join(place);
    if let Some(parent) = path.parent() {
        make_folder(parent)?;
    }
    let encoded = (|| {
        let mut bytes = std::io::Cursor::new(Vec::new());
        TiffEncoder::new(&mut bytes)?.write_image::<Gray32Float>(w, h, metres)?;
        Ok::<_, TiffError>(bytes.into_inner())
    })();
    write_file(&path, |out| out.write_all(&encoded.map_err(std::io::Error::other)?))
}

/// Clouds, each in a file of the kind that it came from.
fn write_clouds(folder: &Path, toml: &mut String, recording: &Recording) -> Result<(), OutputError> {
    for (number, c) in recording.clouds.iter().enumerate() {
        let kind = match ending(&c.file).as_str() {
            "pcd" => "pcd",
            "npz" | "npy" => "npz",
            _ => "ply",
        };
        let place = format!("cloud/{number:06}.{kind}");
        let _ = writeln!(toml, "\n[[cloud]]\nfile = \"{place}\"\ntime = {:?}", c.time);
        match c.from {
            SeenFrom::Camera(k) => writeln!(toml, "camera = {}", quoted(&recording.cameras[k].name)),
            SeenFrom::Origin(o) => writeln!(toml, "origin = {}", vector(o)),
            SeenFrom::Unknown => Ok(()),
        }
        .unwrap_or_default();
        if let Some(s) = c.noise_sigma {
            let _ = writeln!(toml, "noise_sigma = {s:?}");
        }
        let _ = writeln!(toml, "noise_systematic = {:?}", c.noise_systematic);
        make_folder(folder.join("cloud"))?;
        match kind {
            "npz" => write_npz(folder.join(place), &[("points", &array(&[c.points.len(), 3], &c.points))])?,
            _ => write_cloud(folder.join(place), &c.points)?,
        }
    }
    Ok(())
}

fn write_markers(folder: &Path, toml: &mut String, m: &RecordedMarkers) -> Result<(), OutputError> {
    let _ = writeln!(toml, "\n[markers]\nfile = \"markers.csv\"");
    if let Some(s) = m.noise_sigma {
        let _ = writeln!(toml, "noise_sigma = {s:?}");
    }
    let _ = writeln!(toml, "noise_systematic = {:?}", m.noise_systematic);
    for r in &m.rest {
        let _ = writeln!(toml, "\n[[markers.rest]]\nname = {}\nposition = {}", quoted(&r.name), vector(r.position));
        if let Some(s) = r.surface {
            let _ = writeln!(toml, "surface = {}", vector(s));
        }
    }
    write_file(folder.join("markers.csv"), |out| {
        let mut csv = csv::Writer::from_writer(out);
        csv.write_record(["time", "name", "x", "y", "z"])?;
        for s in &m.samples {
            let p = s.position;
            let numbers = [s.time, p.x, p.y, p.z].map(|x| format!("{x:?}"));
            csv.write_record([&numbers[0], &m.names[s.marker], &numbers[1], &numbers[2], &numbers[3]])?;
        }
        csv.flush()
    })
}

/// Vectors as an array.
fn array(shape: &[usize], vectors: &[DVec3]) -> Array {
    Array { shape: shape.to_vec(), values: vectors.iter().flat_map(|v| v.to_array()).collect() }
}

/// Array and times of a sequence, and the lines about them.
fn sequence(toml: &mut String, name: &str, s: &Sequence) -> [Array; 2] {
    let _ = writeln!(toml, "\n[{name}]\nfile = \"{name}.npz\"\ntimes = \"times\"");
    if let Some(s) = s.noise_sigma {
        let _ = writeln!(toml, "noise_sigma = {s:?}");
    }
    let _ = writeln!(toml, "noise_systematic = {:?}", s.noise_systematic);
    let times = Array { shape: vec![s.times.len()], values: s.times.clone() };
    [array(&[s.times.len(), s.count(), 3], &s.vectors), times]
}

fn write_points(folder: &Path, toml: &mut String, p: &RecordedPoints) -> Result<(), OutputError> {
    let [points, times] = sequence(toml, "points", &p.track);
    let _ = writeln!(toml, "rest = \"rest\"");
    if let Some(t) = p.tolerance {
        let _ = writeln!(toml, "tolerance = {t:?}");
    }
    let rest = array(&[p.rest.len(), 3], &p.rest);
    write_npz(folder.join("points.npz"), &[("points", &points), ("times", &times), ("rest", &rest)])
}

fn write_displacements(folder: &Path, toml: &mut String, d: &RecordedDisplacements) -> Result<(), OutputError> {
    let [displacements, times] = sequence(toml, "displacements", &d.track);
    let nodes = array(&[d.nodes.len(), 3], &d.nodes);
    let mut arrays = vec![("displacements", &displacements), ("times", &times)];
    if !d.nodes.is_empty() {
        let _ = writeln!(toml, "nodes = \"nodes\"");
        arrays.push(("nodes", &nodes));
    }
    write_npz(folder.join("displacements.npz"), &arrays)
}

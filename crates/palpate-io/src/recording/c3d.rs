//! Tracked points: C3D files of motion-capture systems.

use super::MarkerSample;
use crate::error::InputError;
use c3dio::C3d;
use glam::DVec3;
use std::path::Path;

/// Names and samples of a C3D file, in metres; frame k of the capture (from 0) is at k / rate.
pub(super) fn read_c3d(
    path: &Path,
    bytes: &[u8],
    warnings: &mut Vec<String>,
) -> Result<(Vec<String>, Vec<MarkerSample>), InputError> {
    let refuse = |text: String| InputError::file(path, text);
    // The parser indexes into damaged files without looking; a panic there is a fault of the file.
    let parsed = std::panic::catch_unwind(|| C3d::from_bytes(bytes).map_err(|e| e.to_string()))
        .map_err(|_| refuse("not a readable C3D file: damaged".into()))?;
    let c3d = parsed.map_err(|e| refuse(format!("not a readable C3D file: {e}")))?;
    let p = &c3d.points;
    let unit: String = p.units.iter().filter(|c| !c.is_whitespace() && **c != '\0').collect();
    let scale = match unit.to_ascii_lowercase().as_str() {
        "mm" => 1e-3,
        "cm" => 1e-2,
        "m" => 1.0,
        _ => return Err(refuse(format!("POINT:UNITS is \"{unit}\", expected mm, cm or m"))),
    };
    let rate = f64::from(p.frame_rate);
    if !(rate > 0.0 && rate.is_finite()) {
        return Err(refuse(format!("POINT:RATE is {rate}, must be > 0 (frames per second)")));
    }
    let (frames, columns) = (p.points.rows(), p.points.cols());
    let announced = usize::from(p.last_frame).saturating_sub(usize::from(p.first_frame)) + 1;
    if frames < announced {
        warnings.push(format!("{}: holds {frames} frames, its header announces {announced} (truncated?)", path.display()));
    }
    let names: Vec<String> = (0..columns)
        .map(|j| match p.labels.get(j).map(|l| l.trim_matches(|c: char| c.is_whitespace() || c == '\0')) {
            Some(l) if !l.is_empty() => l.to_string(),
            _ => format!("point{}", j + 1),
        })
        .collect();
    for (j, name) in names.iter().enumerate() {
        if names[..j].contains(name) {
            return Err(refuse(format!("POINT:LABELS holds \"{name}\" twice")));
        }
    }
    let mut samples = Vec::new();
    for k in 0..frames {
        for j in 0..columns {
            let m = &p.points[k][j];
            // −1 marks a point that was not seen. The crate multiplies residuals by the scale factor, whose sign
            // tells integers from floats.
            let absent = m.residual / p.scale_factor < -0.5;
            let position = DVec3::from_array(m.point.map(f64::from)) * scale;
            if !absent && position.is_finite() {
                samples.push(MarkerSample { time: k as f64 / rate, marker: j, position });
            }
        }
    }
    if samples.is_empty() {
        return Err(refuse("holds no marker that was seen".into()));
    }
    Ok((names, samples))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A parameter of a C3D file: type −1 text, 2 integers, 4 floats.
    fn parameter(name: &str, kind: i8, dimensions: &[u8], data: &[u8]) -> Vec<u8> {
        let mut body = vec![kind as u8, dimensions.len() as u8];
        body.extend(dimensions);
        body.extend(data);
        body.push(0);
        entry(name, 1, &body)
    }

    fn entry(name: &str, group: i8, body: &[u8]) -> Vec<u8> {
        let mut out = vec![name.len() as u8, group as u8];
        out.extend(name.as_bytes());
        out.extend((body.len() as i16 + 2).to_le_bytes());
        out.extend(body);
        out
    }

    /// Two points, three frames in floats (scale −0.1), Intel byte order, after the C3D user guide (www.c3d.org).
    fn file(units: &str, rows: [[f32; 8]; 3]) -> Vec<u8> {
        let mut header = vec![2, 0x50];
        for word in [2u16, 0, 1, 3, 10] {
            header.extend(word.to_le_bytes());
        }
        header.extend((-0.1f32).to_le_bytes());
        header.extend(3u16.to_le_bytes());
        header.extend(0u16.to_le_bytes());
        header.extend(50.0f32.to_le_bytes());
        header.resize(512, 0);
        let mut p = vec![1, 0x50, 1, 84];
        p.extend(entry("POINT", -1, &[0]));
        p.extend(parameter("USED", 2, &[], &2i16.to_le_bytes()));
        p.extend(parameter("SCALE", 4, &[], &(-0.1f32).to_le_bytes()));
        p.extend(parameter("RATE", 4, &[], &50.0f32.to_le_bytes()));
        p.extend(parameter("FRAMES", 2, &[], &3i16.to_le_bytes()));
        p.extend(parameter("DATA_START", 2, &[], &3i16.to_le_bytes()));
        p.extend(parameter("UNITS", -1, &[units.len() as u8], units.as_bytes()));
        p.extend(parameter("LABELS", -1, &[4, 2], b"tip base"));
        p.resize(512, 0);
        header.extend(p);
        header.extend(rows.iter().flatten().flat_map(|x| x.to_le_bytes()));
        let whole = header.len().next_multiple_of(512);
        header.resize(whole, 0);
        header
    }

    const ROWS: [[f32; 8]; 3] = [
        [100.0, 0.0, 20.0, 0.0, 1.0, 2.0, 3.0, 0.0],
        // Residual word −1: the first point was not seen.
        [0.0, 0.0, 0.0, -1.0, 1.0, 2.0, 4.0, 7.0],
        [110.0, 0.0, 20.0, 0.0, 1.0, 2.0, 5.0, 0.0],
    ];

    #[test]
    fn points_come_in_metres_with_times_and_without_unseen_ones() {
        let mut warnings = Vec::new();
        let (names, samples) = read_c3d(Path::new("m.c3d"), &file("mm", ROWS), &mut warnings).unwrap();
        assert_eq!(names, ["tip", "base"]);
        assert_eq!(samples.len(), 5, "an unseen point has no sample: {samples:?}");
        assert_eq!((samples[0].time, samples[4].time), (0.0, 0.04));
        assert_eq!((samples[2].marker, samples[3].marker), (1, 0));
        // Single precision in the file.
        assert!((samples[3].position - DVec3::new(0.11, 0.0, 0.02)).length() < 1e-8);
        assert!(warnings.is_empty(), "{warnings:?}");
        let (_, metres) = read_c3d(Path::new("m.c3d"), &file("m", ROWS), &mut warnings).unwrap();
        assert_eq!(metres[0].position.x, 100.0);
    }

    #[test]
    fn damaged_files_are_refused() {
        let whole = file("mm", ROWS);
        let read = |bytes: &[u8]| read_c3d(Path::new("m.c3d"), bytes, &mut Vec::new()).unwrap_err().to_string();
        for n in [0, 100, 512, 700, 1024] {
            let e = read(&whole[..n]);
            assert!(e.starts_with("m.c3d: not a readable C3D file"), "{n}: {e}");
        }
        assert!(read(&file("ft", ROWS)).contains("POINT:UNITS is \"ft\", expected mm, cm or m"));
        // Last frame 200 in the header, three in the file.
        let mut short = whole;
        short[8..10].copy_from_slice(&200u16.to_le_bytes());
        let mut warnings = Vec::new();
        let (_, samples) = read_c3d(Path::new("m.c3d"), &short, &mut warnings).unwrap();
        assert!(samples.len() == 5 && warnings[0].contains("holds 3 frames, its header announces 200"), "{warnings:?}");
    }
}

//! A scene in space as a picture, without a browser: both motions side by side in one frame, with floor, axes, marks and colour bar.

use crate::render::{Anchor, DepthImage, Picture, Pinhole, residual_colour, shade_on};
use crate::report::data::bar;
use crate::report::quantity::millimetres;
use crate::results::report::{ReportData, SceneData, ShownMotion};
use glam::DVec3;

/// Height of the words above and of the colour bar below [pixels].
const MARGIN: (usize, usize) = (26, 44);
const INK: [u8; 3] = [40, 40, 40];
const FAINT: [u8; 3] = [150, 150, 150];

/// Names of the axes.
const AXES: [&str; 3] = ["x", "y", "z"];

/// A shown frame, `width` pixels each motion.
pub fn pair(data: &ReportData, scene: &SceneData, frame: usize, width: usize) -> Picture {
    let shown = &scene.shown[frame];
    let both: Vec<(usize, &ShownMotion)> = (0..2).filter_map(|m| Some((m, shown.motions[m].as_ref()?))).collect();
    let height = width * 3 / 4;
    let mut out = Picture::blank((width + 8) * both.len().max(1) - 8, height + MARGIN.0 + MARGIN.1);
    for (place, (m, motion)) in both.iter().enumerate() {
        let x = place * (width + 8);
        out.paste(&view(scene, motion, width, height), (x, MARGIN.0));
        let words = format!("{}, t = {:.4} s", data.motions[*m], shown.time);
        out.text(x as f64 + 4.0, 0.5 * MARGIN.0 as f64, 15.0, Anchor::Start, INK, &words);
    }
    let end = millimetres(scene.scale);
    let y = (height + MARGIN.0 + 6) as f64;
    let depth = shown.motions.iter().flatten().any(|m| !m.points.0.is_empty());
    let length = (out.width as f64 - 40.0).min(320.0);
    if depth {
        let words = [format!("−{end} inside"), "0".into(), format!("outside +{end}")];
        let colour = |t: f64| residual_colour(2.0 * t - 1.0, 1.0);
        bar(&mut out, (10.0, y), length, colour, words.each_ref().map(String::as_str));
    } else {
        bar(&mut out, (10.0, y), length, |t| residual_colour(t, 1.0), ["0", "distance", &end]);
    }
    let marks = format!("marks every {}", millimetres(scene.tick));
    if out.width as f64 > length + 200.0 {
        out.text(out.width as f64 - 8.0, y + 6.0, 13.0, Anchor::End, INK, &marks);
    }
    out
}

/// The camera of a scene's pictures: the same for all frames and both motions.
fn camera(scene: &SceneData, width: usize, height: usize) -> Pinhole {
    let [lo, hi] = scene.bounds.map(DVec3::from_array);
    Pinhole::facing(lo, hi, DVec3::from_array(scene.view), DVec3::from_array(scene.up), width, height)
}

fn view(scene: &SceneData, motion: &ShownMotion, width: usize, height: usize) -> Picture {
    let camera = camera(scene, width, height);
    let mut picture = Picture::blank(width, height);
    floor(&mut picture, scene, &camera);
    axes(&mut picture, scene, &camera);
    let vertices = motion.vertices.vectors();
    let triangles: Vec<[u32; 3]> = scene.triangles.0.chunks_exact(3).map(|t| [t[0], t[1], t[2]]).collect();
    let residual: Vec<f64> = motion.residual.numbers().collect();
    let colour = |v: usize| match residual.get(v).filter(|r| r.is_finite()) {
        Some(r) => DVec3::from_array(residual_colour(*r, scene.scale).map(|c| f64::from(c) / 255.0)),
        None => DVec3::splat(0.78),
    };
    let seen = shade_on(&mut picture, &camera, &vertices, &triangles, DVec3::from_array(scene.up), colour);
    points(&mut picture, scene, motion, &camera, &seen);
    others(&mut picture, scene, motion, &camera);
    picture
}

/// The grids on planes.
fn floor(picture: &mut Picture, scene: &SceneData, camera: &Pinhole) {
    for line in scene.floor.vectors().chunks_exact(2) {
        segment(picture, camera, line[0], line[1], 1.0, FAINT, 0.55);
    }
}

/// Three edges of the bounds with marks in millimetres.
fn axes(picture: &mut Picture, scene: &SceneData, camera: &Pinhole) {
    let corner = DVec3::from_array(scene.corner);
    let bounds = scene.bounds.map(DVec3::from_array);
    // Numbers that would stand in each other's way are left out.
    let mut taken: Vec<(f64, f64)> = Vec::new();
    for axis in 0..3 {
        let mut end = corner;
        end[axis] = if corner[axis] == bounds[0][axis] { bounds[1][axis] } else { bounds[0][axis] };
        segment(picture, camera, corner, end, 1.5, INK, 0.8);
        let (from, to) = (corner[axis].min(end[axis]), corner[axis].max(end[axis]));
        let outwards = outwards(camera, bounds, corner, end);
        for k in (from / scene.tick).ceil() as i64..=(to / scene.tick).floor() as i64 {
            let mut p = corner;
            p[axis] = k as f64 * scene.tick;
            let q = camera.project(p);
            picture.line((q.x, q.y), (q.x + 5.0 * outwards.0, q.y + 5.0 * outwards.1), 1.0, INK, 0.8);
            let (x, y) = (q.x + 16.0 * outwards.0, q.y + 13.0 * outwards.1);
            if taken.iter().all(|t| (t.0 - x).abs() > 30.0 || (t.1 - y).abs() > 14.0) {
                let text = format!("{}", (p[axis] * 1e6).round() / 1e3).replace('-', "−");
                picture.text(x, y, 11.0, Anchor::Middle, INK, &text);
                taken.push((x, y));
            }
        }
        // Behind the axis' far end, where no number stands.
        let mut beyond = end;
        beyond[axis] += 0.045 * (bounds[1] - bounds[0]).length() * (end[axis] - corner[axis]).signum();
        let q = camera.project(beyond);
        picture.text(q.x, q.y, 12.0, Anchor::Middle, INK, &format!("{} [mm]", AXES[axis]));
    }
}

/// Unit direction in the picture that leads away from the middle, across an axis.
fn outwards(camera: &Pinhole, bounds: [DVec3; 2], a: DVec3, b: DVec3) -> (f64, f64) {
    let (p, q, m) = (camera.project(a), camera.project(b), camera.project(0.5 * (bounds[0] + bounds[1])));
    let (dx, dy) = (q.x - p.x, q.y - p.y);
    let length = dx.hypot(dy).max(1e-9);
    let (nx, ny) = (-dy / length, dx / length);
    let side = nx * (0.5 * (p.x + q.x) - m.x) + ny * (0.5 * (p.y + q.y) - m.y);
    if side < 0.0 { (-nx, -ny) } else { (nx, ny) }
}

fn segment(picture: &mut Picture, camera: &Pinhole, a: DVec3, b: DVec3, width: f64, colour: [u8; 3], share: f64) {
    let (p, q) = (camera.project(a), camera.project(b));
    if p.z > 0.0 && q.z > 0.0 {
        picture.line((p.x, p.y), (q.x, q.y), width, colour, share);
    }
}

/// Depth points where the body does not hide them by more than what is coloured.
fn points(picture: &mut Picture, scene: &SceneData, motion: &ShownMotion, camera: &Pinhole, seen: &DepthImage) {
    for (place, d) in motion.points.vectors().into_iter().zip(motion.distances.numbers()) {
        let q = camera.project(place);
        let inside = q.z > 0.0 && (0.0..camera.width as f64).contains(&q.x) && (0.0..camera.height as f64).contains(&q.y);
        if !inside {
            continue;
        }
        let depth = seen.depth[(q.y as usize) * camera.width + q.x as usize];
        if q.z < depth + 2.0 * scene.scale.max(d.abs()) {
            let colour =
                if d.is_finite() { residual_colour(d, scene.scale).map(|c| (f64::from(c) * 0.8) as u8) } else { [20, 20, 20] };
            picture.disc(q.x, q.y, 1.1, colour);
        }
    }
}

/// Everything else: a ring where it was measured, a line to where the simulation has it, and a dot there.
fn others(picture: &mut Picture, scene: &SceneData, motion: &ShownMotion, camera: &Pinhole) {
    let all: Vec<(DVec3, DVec3)> = motion.measured.vectors().into_iter().zip(motion.simulated.vectors()).collect();
    let few = all.len() <= 60;
    for (m, s) in all {
        let (a, b) = (camera.project(m), camera.project(s));
        if a.z <= 0.0 || b.z <= 0.0 {
            continue;
        }
        let colour = residual_colour((s - m).length(), scene.scale);
        picture.line((a.x, a.y), (b.x, b.y), 2.0, colour, 1.0);
        if few {
            picture.disc(a.x, a.y, 5.0, [20, 20, 20]);
            picture.disc(a.x, a.y, 3.5, [255, 255, 255]);
        } else {
            picture.disc(a.x, a.y, 2.0, [20, 20, 20]);
        }
        picture.disc(b.x, b.y, if few { 3.0 } else { 1.5 }, colour);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::results::report::{Floats, Indices, ShownFrame};

    /// A triangle over a floor, with a depth point outside it and a marker that is off.
    fn data() -> ReportData {
        let motion = ShownMotion {
            vertices: Floats(vec![0.0, 0.0, 0.1, 0.1, 0.0, 0.1, 0.0, 0.1, 0.1]),
            residual: Floats(vec![1e-3, -1e-3, f32::NAN]),
            points: Floats(vec![0.03, 0.03, 0.101]),
            distances: Floats(vec![1e-3]),
            measured: Floats(vec![0.0, 0.0, 0.1]),
            simulated: Floats(vec![0.0, 0.0, 0.12]),
        };
        let scene = SceneData {
            up: [0.0, 0.0, 1.0],
            bounds: [[0.0, 0.0, 0.0], [0.1, 0.1, 0.12]],
            tick: 0.02,
            floor: Floats(vec![0.0, 0.0, 0.0, 0.1, 0.0, 0.0]),
            view: DVec3::new(0.5, -0.8, 0.4).normalize().to_array(),
            scale: 2e-3,
            triangles: Indices(vec![0, 1, 2]),
            shown: vec![ShownFrame { frame: 0, time: 0.0, motions: [Some(motion.clone()), Some(motion)] }],
            ..SceneData::default()
        };
        ReportData { motions: ["start".into(), "fitted".into()], scenes: vec![scene], ..ReportData::default() }
    }

    #[test]
    fn both_motions_stand_in_the_same_frame() {
        let data = data();
        let p = pair(&data, &data.scenes[0], 0, 200);
        assert_eq!((p.width, p.height), (408, 150 + MARGIN.0 + MARGIN.1));
        // But for their names the two halves of the same motion are alike, pixel by pixel.
        for y in MARGIN.0..MARGIN.0 + 150 {
            assert_eq!(p.rgb[y * 408..y * 408 + 200], p.rgb[y * 408 + 208..y * 408 + 408], "row {y}");
        }
        let red = residual_colour(1.0, 1.0);
        assert!(p.rgb[MARGIN.0 * 408..].contains(&red), "the marker is off by more than the colours show");
    }
}

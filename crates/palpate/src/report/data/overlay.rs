//! What cameras saw: measured depth and mask with the outlines of the simulated body, beside how far both depths are apart.

use crate::experiment::Experiment;
use crate::render::{Anchor, DepthImage, Picture, Pinhole, rasterise, residual_colour};
use crate::report::quantity::{digits, millimetres};
use crate::residuals::spread;
use crate::results::report::{Overlay, SceneData, ShownFrame};
use crate::viewers::pinhole;
use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use glam::DVec3;
use palpate_io::recording::{RecordedCamera, RecordedFrame};

/// Most cameras, and most frames of each.
const MOST: (usize, usize) = (4, 3);
/// Width of one of the two pictures [pixels].
const WIDTH: usize = 420;
/// Height of the line of words above, and of the colour bar below [pixels].
const MARGIN: (usize, usize) = (24, 44);

/// Colours of both motions' outlines, and of the measured mask.
pub const OUTLINES: [[u8; 3]; 2] = [[213, 94, 0], [0, 90, 200]];
const MASK: [u8; 3] = [0, 0, 0];

/// The overlays of a scene: every camera's first, worst and last frame among those that are shown.
pub fn overlays(e: &Experiment, scene: &SceneData) -> Vec<Overlay> {
    let Some(recording) = e.recording() else { return Vec::new() };
    let triangles: Vec<[u32; 3]> = scene.triangles.0.chunks_exact(3).map(|t| [t[0], t[1], t[2]]).collect();
    let mut out = Vec::new();
    for (number, camera) in recording.cameras.iter().enumerate().take(MOST.0) {
        let of = |f: &ShownFrame| {
            let mine = recording.frames.iter().filter(|r| r.camera == number);
            mine.min_by(|a, b| (a.time - f.time).abs().total_cmp(&(b.time - f.time).abs()))
                .filter(|r| (r.time - f.time).abs() < 1e-6)
        };
        let seen: Vec<usize> = (0..scene.shown.len()).filter(|k| of(&scene.shown[*k]).is_some()).collect();
        let mut some = spread(&seen, MOST.1);
        if seen.len() > MOST.1 && seen.contains(&scene.worst) && !some.contains(&scene.worst) {
            some[MOST.1 / 2] = scene.worst;
            some.sort_unstable();
        }
        for k in some {
            let shown = &scene.shown[k];
            out.extend(of(shown).and_then(|r| overlay(scene, camera, r, shown, &triangles)));
        }
    }
    out
}

/// A camera's view through a window around the body.
struct View<'a> {
    camera: &'a RecordedCamera,
    frame: &'a RecordedFrame,
    window: Pinhole,
    /// Corner of the window in the image [pixels], and picture pixels per image pixel.
    corner: (f64, f64),
    zoom: f64,
}

impl View<'_> {
    /// The image's pixel behind a pixel of the picture.
    fn pixel(&self, x: usize, y: usize) -> usize {
        let u = (self.corner.0 + x as f64 / self.zoom).round().clamp(0.0, self.camera.width as f64 - 1.0);
        let v = (self.corner.1 + y as f64 / self.zoom).round().clamp(0.0, self.camera.height as f64 - 1.0);
        v as usize * self.camera.width + u as usize
    }

    /// Measured depth [m] there.
    fn depth(&self, x: usize, y: usize) -> Option<f64> {
        let reading = self.frame.depth.as_ref()?.pixels.reading(self.pixel(x, y))?;
        Some(self.camera.depth(reading))
    }

    /// True where the image says that the object is; `None` without a mask.
    fn mask(&self, x: usize, y: usize) -> Option<bool> {
        self.frame.mask.as_ref().map(|m| m[self.pixel(x, y)])
    }
}

fn overlay(
    scene: &SceneData,
    camera: &RecordedCamera,
    frame: &RecordedFrame,
    shown: &ShownFrame,
    triangles: &[[u32; 3]],
) -> Option<Overlay> {
    let surfaces = [0, 1].map(|m: usize| shown.motions[m].as_ref().map(|m| m.vertices.vectors()));
    let view = window(camera, frame, surfaces[1].as_ref()?)?;
    let images = surfaces.each_ref().map(|s| s.as_ref().map(|s| rasterise(&view.window, s, triangles)));
    let found = images[1].as_ref()?;
    let (w, h) = (view.window.width, view.window.height);
    let mut picture = Picture::blank(2 * w + 12, h + MARGIN.0 + MARGIN.1);
    let range = range(&view, found);
    let mut left = seen(&view, range);
    for (image, colour) in images.iter().zip(OUTLINES) {
        if let Some(image) = image {
            outline(&mut left, |i| image.triangle[i] != DepthImage::NONE, colour, 1);
        }
    }
    if frame.mask.is_some() {
        outline(&mut left, |i| view.mask(i % w, i / w) == Some(true), MASK, 0);
    }
    let (right, share) = apart(&view, found, scene.scale);
    picture.paste(&left, (0, MARGIN.0));
    picture.paste(&right, (w + 12, MARGIN.0));
    let ink = [40, 40, 40];
    let row = 0.5 * MARGIN.0 as f64;
    picture.text(2.0, row, 14.0, Anchor::Start, ink, &format!("{}, t = {:.4} s", camera.name, frame.time));
    picture.text((w + 14) as f64, row, 14.0, Anchor::Start, ink, "measured − simulated depth");
    let bottom = (h + MARGIN.0 + 6) as f64;
    let grey = |t: f64| [shade_of(t); 3];
    let ends = |r: f64| format!("{} m", digits(r, 3));
    bar(&mut picture, (10.0, bottom), (w as f64 - 40.0).min(240.0), grey, [&ends(range.0), "", &ends(range.1)]);
    let end = millimetres(scene.scale);
    let far = |t: f64| residual_colour(2.0 * t - 1.0, 1.0);
    bar(
        &mut picture,
        ((w + 22) as f64, bottom),
        (w as f64 - 40.0).min(240.0),
        far,
        [&format!("−{end}"), "0", &format!("+{end}")],
    );
    Some(Overlay {
        camera: camera.name.clone(),
        time: frame.time,
        png: STANDARD.encode(picture.png()),
        words: format!(
            "Camera {} at {:.4} s. Left: measured depth in grey with the outlines of the simulated body. Right: measured minus simulated depth; {share}",
            camera.name, frame.time
        ),
    })
}

/// The camera looking through a window around the body, as wide as a picture.
fn window<'a>(camera: &'a RecordedCamera, frame: &'a RecordedFrame, vertices: &[DVec3]) -> Option<View<'a>> {
    let whole = pinhole(camera);
    let (mut lo, mut hi) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    for p in vertices.iter().map(|v| whole.project(*v)).filter(|p| p.z > 0.0 && p.is_finite()) {
        (lo, hi) = (lo.min(p), hi.max(p));
    }
    let (w, h) = (camera.width as f64, camera.height as f64);
    let margin = 0.25 * (hi.x - lo.x).max(hi.y - lo.y) + 3.0;
    let (x0, x1) = ((lo.x - margin).clamp(0.0, w - 1.0), (hi.x + margin).clamp(0.0, w - 1.0));
    let (y0, y1) = ((lo.y - margin).clamp(0.0, h - 1.0), (hi.y + margin).clamp(0.0, h - 1.0));
    let (x0, x1, y0, y1) = match x1 - x0 >= 8.0 && y1 - y0 >= 8.0 {
        true => (x0.floor(), x1.ceil(), y0.floor(), y1.ceil()),
        // A body outside the image leaves the whole image.
        false => (0.0, w - 1.0, 0.0, h - 1.0),
    };
    let zoom = WIDTH as f64 / (x1 - x0 + 1.0).max(y1 - y0 + 1.0);
    let window = Pinhole {
        width: (((x1 - x0 + 1.0) * zoom).round() as usize).max(1),
        height: (((y1 - y0 + 1.0) * zoom).round() as usize).max(1),
        fx: whole.fx * zoom,
        fy: whole.fy * zoom,
        cx: (whole.cx - x0) * zoom,
        cy: (whole.cy - y0) * zoom,
        ..whole
    };
    Some(View { camera, frame, window, corner: (x0, y0), zoom })
}

/// Nearest and farthest depth [m] around the simulated body, which greys run between.
fn range(view: &View, found: &DepthImage) -> (f64, f64) {
    let all = found.depth.iter().copied().filter(|d| d.is_finite());
    let (lo, hi) = all.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), d| (a.min(d), b.max(d)));
    if lo <= hi {
        let pad = 0.3 * (hi - lo).max(1e-3);
        return (lo - pad, hi + pad);
    }
    let measured = (0..view.window.height).flat_map(|y| (0..view.window.width).filter_map(move |x| view.depth(x, y)));
    let (lo, hi) = measured.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), d| (a.min(d), b.max(d)));
    if lo < hi { (lo, hi) } else { (0.0, 1.0) }
}

/// Grey of a depth, 0 near to 1 far: near is dark, and the far end stays darker than where nothing was measured.
fn shade_of(t: f64) -> u8 {
    (95.0 + 130.0 * t.clamp(0.0, 1.0)).round() as u8
}

/// Measured depth in grey; white where there is none, or the mask in grey without depth.
fn seen(view: &View, (near, far): (f64, f64)) -> Picture {
    let (w, h) = (view.window.width, view.window.height);
    let mut out = Picture::blank(w, h);
    for y in 0..h {
        for x in 0..w {
            let grey = match (view.depth(x, y), view.mask(x, y)) {
                // What the mask leaves out is there, but does not count.
                (Some(d), Some(false)) => 255 - (255 - shade_of((d - near) / (far - near))) / 3,
                (Some(d), _) => shade_of((d - near) / (far - near)),
                (None, Some(true)) if view.frame.depth.is_none() => 170,
                _ => 255,
            };
            out.rgb[y * w + x] = [grey; 3];
        }
    }
    out
}

/// Measured minus simulated depth in colours, and in words what share of the body was seen.
fn apart(view: &View, found: &DepthImage, scale: f64) -> (Picture, String) {
    let (w, h) = (view.window.width, view.window.height);
    let mut out = Picture::blank(w, h);
    let (mut both, mut sum, mut body) = (0usize, 0.0, 0usize);
    for i in 0..w * h {
        let (x, y) = (i % w, i / w);
        let simulated = found.triangle[i] != DepthImage::NONE;
        body += usize::from(simulated);
        let counts = view.mask(x, y) != Some(false);
        out.rgb[i] = match (view.depth(x, y).filter(|_| counts), simulated) {
            (Some(d), true) => {
                both += 1;
                sum += d - found.depth[i];
                residual_colour(d - found.depth[i], scale)
            }
            // Hatched: the body should be seen here, and nothing was measured.
            (None, true) if (x + y) % 8 < 2 => [120, 120, 120],
            (Some(_), false) if view.frame.mask.is_some() => [60, 60, 60],
            _ => [255, 255, 255],
        };
    }
    let share = match both {
        0 => "none of the simulated body was measured.".into(),
        n => format!(
            "{:.0} % of the simulated body was measured, on average {} {} than simulated.",
            100.0 * n as f64 / body.max(1) as f64,
            millimetres((sum / n as f64).abs()),
            if sum > 0.0 { "farther" } else { "nearer" }
        ),
    };
    (out, share)
}

/// Draws the edge of an area, thicker by so many pixels on each side.
fn outline(picture: &mut Picture, inside: impl Fn(usize) -> bool, colour: [u8; 3], thick: i64) {
    let (w, h) = (picture.width, picture.height);
    let area: Vec<bool> = (0..w * h).map(inside).collect();
    for y in 0..h {
        for x in 0..w {
            let i = y * w + x;
            let edge = (x + 1 < w && area[i] != area[i + 1]) || (y + 1 < h && area[i] != area[i + w]);
            if edge {
                picture.dot(x as f64, y as f64, thick, colour);
            }
        }
    }
}

/// A horizontal colour bar with words at its ends and in its middle.
pub fn bar(picture: &mut Picture, (x, y): (f64, f64), length: f64, colour: impl Fn(f64) -> [u8; 3], words: [&str; 3]) {
    let steps = length.round() as usize;
    for k in 0..steps {
        picture.fill((x as usize + k, y as usize), (1, 12), colour(k as f64 / (steps.max(2) - 1) as f64));
    }
    let ink = [40, 40, 40];
    for (at, anchor, text) in
        [(x, Anchor::Start, words[0]), (x + 0.5 * length, Anchor::Middle, words[1]), (x + length, Anchor::End, words[2])]
    {
        picture.text(at, y + 22.0, 12.0, anchor, ink, text);
    }
}

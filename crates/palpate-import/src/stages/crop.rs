//! Images are cut to where the object is ever seen: nothing of it is lost, and a recording is small.

use super::settle::Said;
use palpate_io::Recording;
use palpate_io::recording::DepthImage;

/// Cuts the images of every camera whose masks leave much of them empty.
pub fn apply(r: &mut Recording, said: &mut Said) {
    for c in 0..r.cameras.len() {
        let mut frames = r.frames.iter().filter(|f| f.camera == c).peekable();
        if frames.peek().is_none() || frames.any(|f| f.mask.is_none()) {
            continue;
        }
        let mut rect = [usize::MAX, usize::MAX, 0, 0];
        for (u, v, _) in r.frames.iter().filter(|f| f.camera == c).flat_map(|f| f.readings()) {
            rect = [rect[0].min(u), rect[1].min(v), rect[2].max(u), rect[3].max(v)];
        }
        let [u0, v0, u1, v1] = rect;
        if u0 > u1 {
            continue;
        }
        let (w, h) = (u1 - u0 + 1, v1 - v0 + 1);
        let camera = &mut r.cameras[c];
        // A tenth less is not worth other pixel numbers than those of the source.
        if 10 * w * h > 9 * camera.width * camera.height {
            continue;
        }
        let old = camera.width;
        said.facts.push(format!(
            "camera \"{}\": images are cut from {} × {} to {w} × {h} pixels, from column {u0} and row {v0}",
            camera.name, camera.width, camera.height
        ));
        (camera.width, camera.height) = (w, h);
        camera.center = [camera.center[0] - u0 as f64, camera.center[1] - v0 as f64];
        let pixels: Vec<usize> = (0..w * h).map(|i| u0 + i % w + (v0 + i / w) * old).collect();
        for f in r.frames.iter_mut().filter(|f| f.camera == c) {
            if let Some(d) = &mut f.depth {
                *d = DepthImage { width: w, height: h, pixels: d.pixels.pick(&pixels) };
            }
            if let Some(m) = &mut f.mask {
                *m = pixels.iter().map(|p| m[*p]).collect();
            }
        }
    }
}

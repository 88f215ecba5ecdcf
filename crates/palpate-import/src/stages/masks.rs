//! What of the images is the object: by depth range, by a box, by what was there without it, and without the largest plane.

use super::plane::{Plane, largest};
use super::settle::{DEPTH_NOISE, Said};
use crate::Watch;
use crate::error::{ImportError, refuse_option};
use crate::options::{Background, Options};
use glam::DVec3;
use palpate_io::Recording;
use palpate_io::recording::{DepthImage, DepthPixels, RawDepth, RecordedFrame};
use rayon::prelude::*;

/// A reading is before the background where it is nearer by so many times its noise.
const BEFORE: f64 = 5.0;

/// A reading is of the plane where it is nearer to it than so many times its noise.
pub const ON_PLANE: f64 = 4.0;

/// Marks the object in every image, and drops images without it. Returns the plane that was removed. `empty` is the image that the user gave as background.
pub fn apply(
    r: &mut Recording,
    o: &Options,
    empty: Option<DepthImage>,
    said: &mut Said,
    watch: &mut Watch,
) -> Result<Option<Plane>, ImportError> {
    if r.frames.is_empty() {
        return Ok(None);
    }
    check_range(o)?;
    let noise = o.noise.unwrap_or(DEPTH_NOISE);
    let background = background(r, o, empty)?;
    let scene: Vec<DVec3> = if o.remove_plane { points(r, &r.frames[0], o) } else { Vec::new() };
    let plane = match o.remove_plane.then(|| largest(&scene, ON_PLANE * noise)) {
        Some(None) => return refuse_option("remove-plane", "", "the first image holds no plane: too few readings"),
        Some(p) => p,
        None => None,
    };
    let by_any = o.near.or(o.far).is_some() || o.within.is_some() || background.is_some() || plane.is_some();
    if by_any {
        let n = r.frames.len();
        let cameras = &r.cameras;
        watch.at(0, n, "masks")?;
        r.frames.par_iter_mut().for_each(|f| {
            let (camera, Some(depth)) = (&cameras[f.camera], &f.depth) else { return };
            let is = |i: usize| -> bool {
                let Some(z) = depth.pixels.reading(i).map(|r| camera.depth(r)) else { return false };
                let given = f.mask.as_ref().is_none_or(|m| m[i]);
                if !given || o.near.is_some_and(|n| z < n) || o.far.is_some_and(|n| z > n) {
                    return false;
                }
                let behind = |b: &DepthImage| b.pixels.reading(i).is_some_and(|r| z > camera.depth(r) - BEFORE * noise);
                if background.as_ref().is_some_and(behind) {
                    return false;
                }
                if o.within.is_none() && plane.is_none() {
                    return true;
                }
                let Some(p) = camera.point((i % depth.width) as f64, (i / depth.width) as f64, z) else { return false };
                o.within.is_none_or(|[low, high]| p.clamp(low, high) == p)
                    && plane.as_ref().is_none_or(|plane| plane.height(p) > ON_PLANE * noise)
            };
            let mask: Vec<bool> = (0..depth.pixels.count()).map(is).collect();
            f.mask = Some(if background.is_some() { without_specks(&mask, depth.width) } else { mask });
        });
        if let Some(Background::Frames(a, b)) = o.background {
            let mut number = 0;
            r.frames.retain(|_| {
                number += 1;
                !(a..=b).contains(&(number - 1))
            });
        }
    }
    let before = r.frames.len();
    r.frames.retain(|f| f.readings().next().is_some());
    let dropped = before - r.frames.len();
    if r.frames.is_empty() {
        let used = [
            ("near", o.near.is_some()),
            ("far", o.far.is_some()),
            ("box", o.within.is_some()),
            ("background", background.is_some()),
            ("remove-plane", plane.is_some()),
        ];
        let option = used.iter().find(|u| u.1).map_or("far", |u| u.0);
        return refuse_option(option, "", "no reading of any image is left");
    }
    if dropped > 0 {
        said.losses.push(format!("{dropped} of {before} depth images hold no reading of the object and are left out"));
    }
    if by_any {
        let [all, kept] = r.frames.iter().fold([0, 0], |[all, kept], f| {
            let read = |d: &DepthImage| (0..d.pixels.count()).filter(|i| d.pixels.reading(*i).is_some()).count();
            let full = f.depth.as_ref().map_or(0, read);
            [all + full, kept + f.readings().count()]
        });
        said.facts.push(format!("masks: {kept} of {all} readings are taken for the object"));
    } else if r.frames.iter().all(|f| f.mask.is_none()) {
        said.facts.push(
            "masks: none, every reading counts as the object; --far, --box, --background or --remove-plane take the rest away"
                .into(),
        );
    }
    Ok(plane)
}

/// Refuses ranges of depth that are none.
pub fn check_range(o: &Options) -> Result<(), ImportError> {
    for (option, value) in [("near", o.near), ("far", o.far)] {
        if let Some(x) = value.filter(|x| !(*x >= 0.0 && x.is_finite())) {
            return refuse_option(option, x, "must be ≥ 0 (m)");
        }
    }
    match (o.near, o.far) {
        (Some(near), Some(far)) if near >= far => refuse_option("near", near, format!("is not nearer than --far {far}")),
        _ => Ok(()),
    }
}

/// World points of an image, as far as range and box leave them.
fn points(r: &Recording, f: &RecordedFrame, o: &Options) -> Vec<DVec3> {
    let camera = &r.cameras[f.camera];
    f.readings()
        .map(|(u, v, c)| (u, v, camera.depth(c)))
        .filter(|(_, _, z)| o.near.is_none_or(|n| *z >= n) && o.far.is_none_or(|n| *z <= n))
        .filter_map(|(u, v, z)| camera.point(u as f64, v as f64, z))
        .filter(|p| o.within.is_none_or(|[low, high]| p.clamp(low, high) == *p))
        .collect()
}

/// The image without the object: the one given, or the median of the frames named.
fn background(r: &Recording, o: &Options, empty: Option<DepthImage>) -> Result<Option<DepthImage>, ImportError> {
    let Some(Background::Frames(a, b)) = o.background else { return Ok(empty) };
    let given = if a == b { a.to_string() } else { format!("{a}..{b}") };
    if r.cameras.len() > 1 {
        return refuse_option("background", given, "needs one camera that stands still");
    }
    if b >= r.frames.len() {
        return refuse_option("background", given, format!("there are frames 0 to {}", r.frames.len() - 1));
    }
    if b - a + 1 == r.frames.len() {
        return refuse_option("background", given, "leaves no frame for the object");
    }
    let images: Vec<&DepthImage> = r.frames[a..=b].iter().filter_map(|f| f.depth.as_ref()).collect();
    let Some(first) = images.first() else { return Ok(None) };
    // Counts and floats are ordered alike by their depth, whatever a count is.
    let number = |r: RawDepth| match r {
        RawDepth::Count(c) => f64::from(c),
        RawDepth::Metres(z) => f64::from(z),
    };
    let middle = |i: usize| {
        let mut all: Vec<f64> = images.iter().filter_map(|d| d.pixels.reading(i)).map(number).collect();
        all.sort_by(f64::total_cmp);
        all.get(all.len() / 2).copied().unwrap_or(0.0)
    };
    let all = (0..first.pixels.count()).map(middle);
    let pixels = match first.pixels {
        DepthPixels::Counts(_) => DepthPixels::Counts(all.map(|c| c as u16).collect()),
        DepthPixels::Metres(_) => DepthPixels::Metres(all.map(|z| z as f32).collect()),
    };
    Ok(Some(DepthImage { pixels, ..(*first).clone() }))
}

/// A mask without pixels that have fewer than three of their eight neighbours: noise of the background passes for an object there.
fn without_specks(mask: &[bool], width: usize) -> Vec<bool> {
    let height = mask.len() / width;
    let count = |i: usize| {
        let (u, v) = (i % width, i / width);
        let around = (v.saturating_sub(1)..(v + 2).min(height))
            .flat_map(|y| (u.saturating_sub(1)..(u + 2).min(width)).map(move |x| x + y * width));
        around.filter(|j| *j != i && mask[*j]).count()
    };
    (0..mask.len()).map(|i| mask[i] && count(i) >= 3).collect()
}

/// The removed plane in words.
pub fn describe(plane: &Plane) -> String {
    let n = plane.normal;
    format!(
        "the largest plane, normal ({:.3}, {:.3}, {:.3}), holds {:.0} % of the first image",
        n.x,
        n.y,
        n.z,
        100.0 * plane.share
    )
}

/// Lowest and highest corner of points; `None` of none.
pub fn bounds(points: &[DVec3]) -> Option<[DVec3; 2]> {
    let first = *points.first()?;
    Some(points.iter().fold([first, first], |[a, b], p| [a.min(*p), b.max(*p)]))
}

//! Is the recording where the body is?

use crate::mesh::bounds;
use crate::scene::scale::FAR_SMALLER;
use glam::DVec3;
use palpate_model::observation::{Frame, Observation};
use palpate_model::shape::LARGE;

/// What a recording in another unit spans at least of the object: markers may hardly move, and what a camera sees is a part of the surface.
const SPANS: [f64; 2] = [0.02, 0.1];

fn positions(frame: &Frame) -> impl Iterator<Item = DVec3> {
    frame.points.iter().map(|p| p.position).chain(frame.markers.iter().map(|m| m.position))
}

fn millimetres(observation: &Observation, min: DVec3, max: DVec3) -> Result<(), String> {
    let (extent, all) = (max - min, observation.frames.iter().flat_map(positions).collect::<Vec<_>>());
    let (low, high) = bounds(&all);
    let spread = (high - low).length();
    let about_origin = all.iter().all(|p| p.length() < FAR_SMALLER * extent.max_element());
    if all.is_empty() || extent.max_element() < LARGE || spread > FAR_SMALLER * extent.min_element() || !about_origin {
        return Ok(());
    }
    Err(format!(
        "all {} points of the recording lie within {spread:.4} m, the object's longest side is {:.4} m; is the object in millimetres? \
         convert it to metres (scale by 0.001)",
        all.len(),
        extent.max_element()
    ))
}

/// True if in some frame one in a hundred points comes closer than `reach` [m], with all lengths multiplied by `scale`.
fn meets(observation: &Observation, scale: f64, distance: impl Fn(DVec3) -> f64, reach: f64) -> bool {
    observation.frames.iter().any(|f| {
        let (near, all) = positions(f).fold((0, 0), |(near, all), p| (near + usize::from(distance(scale * p) < reach), all + 1));
        near > 0 && near * 100 >= all
    })
}

/// Checks that what was measured lies near the body's bounding box at rest, `min` to `max` [m].
///
/// In at least one frame, at least one in a hundred points or markers must come closer to the box than half its diagonal: bodies
/// move and images show more than the body, but nothing near the body at any time is a wrong pose or unit.
///
/// An object of some metres around a recording that lies about the world's origin and spans less than a hundredth of the object's
/// shortest side was written in millimetres.
///
/// # Errors
/// One line with the numbers and what to look at.
pub fn check_overlap(observation: &Observation, min: DVec3, max: DVec3) -> Result<(), String> {
    let size = (max - min).length();
    millimetres(observation, min, max)?;
    let distance = |p: DVec3| (p - p.clamp(min, max)).length();
    if meets(observation, 1.0, distance, 0.5 * size) {
        return Ok(());
    }
    let mut all: Vec<f64> = observation.frames.iter().flat_map(positions).map(distance).collect();
    if all.is_empty() {
        return Ok(());
    }
    // About the origin a small multiple of anything lies at the object: it must span a part of it as well.
    let (low, high) = bounds(&observation.frames.iter().flat_map(positions).collect::<Vec<_>>());
    let spread = (high - low).length();
    let spans = SPANS[usize::from(observation.frames.iter().any(|f| !f.points.is_empty()))];
    let fits = |factor: f64| factor * spread > spans * size && meets(observation, factor, distance, 0.5 * size);
    let units = [(0.001, "millimetres"), (0.01, "centimetres")];
    let unit = match units.into_iter().find(|u| fits(u.0)) {
        Some((factor, name)) => {
            format!("is the recording in {name}? Multiplied by {factor} it lies at the object: convert it to metres")
        }
        None => "check object.pose, world_from_camera and the units".to_string(),
    };
    let nearest = all.iter().copied().fold(f64::INFINITY, f64::min);
    let middle = all.len() / 2;
    let median = *all.select_nth_unstable_by(middle, f64::total_cmp).1;
    let (factor, of) = (median / size, all.len());
    Err(format!(
        "the recording lies nowhere near the object: the median distance of {of} points from it is {median:.4} m \
         (nearest {nearest:.4} m, {factor:.1} × the object's diagonal of {size:.4} m); {unit}"
    ))
}

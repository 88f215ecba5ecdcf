//! Is the recording where the body is?

use glam::DVec3;
use palpate_model::observation::Observation;

/// Checks that what was measured lies near the body's bounding box at rest, `min` to `max` [m].
///
/// In at least one frame, at least one in a hundred points or markers must come closer to the box than half its diagonal: bodies
/// move and images show more than the body, but nothing near the body at any time is a wrong pose or unit.
///
/// # Errors
/// One line with the numbers and what to look at.
pub fn check_overlap(observation: &Observation, min: DVec3, max: DVec3) -> Result<(), String> {
    let size = (max - min).length();
    let distance = |p: DVec3| (p - p.clamp(min, max)).length();
    let mut all = Vec::new();
    for f in &observation.frames {
        let positions = f.points.iter().map(|p| p.position).chain(f.markers.iter().map(|m| m.position));
        let d: Vec<f64> = positions.map(distance).collect();
        let near = d.iter().filter(|d| **d < 0.5 * size).count();
        if near > 0 && near * 100 >= d.len() {
            return Ok(());
        }
        all.extend(d);
    }
    if all.is_empty() {
        return Ok(());
    }
    let nearest = all.iter().copied().fold(f64::INFINITY, f64::min);
    let middle = all.len() / 2;
    let median = *all.select_nth_unstable_by(middle, f64::total_cmp).1;
    let (factor, of) = (median / size, all.len());
    Err(format!(
        "the recording lies nowhere near the object: the median distance of {of} points from it is {median:.4} m \
         (nearest {nearest:.4} m, {factor:.1} × the object's diagonal of {size:.4} m); \
         check object.pose, world_from_camera and the units"
    ))
}

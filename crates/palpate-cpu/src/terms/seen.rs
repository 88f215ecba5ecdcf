//! What a nozzle sees of a surface: a depth pass over its patches.
//!
//! Every patch is drawn as a square into a picture as the nozzle sees it, and each pixel keeps the nearest depth. A patch is seen where it lies
//! no deeper than its pixel, give or take what its own slope makes over its size.

use glam::DVec3;
use palpate_model::effects::jet::{REACH, SIDE, STEEPEST};
use palpate_model::space::body::Body;

/// Patches that face the jet, lie within its cone, and are hidden by nothing; `places` [m] are those of the patches from the jet's origin,
/// `areas` [m²] their area vectors.
pub fn seen(body: &Body, places: &[DVec3], areas: &[DVec3], axis: DVec3, spread: f64) -> Vec<bool> {
    let (e1, e2) = axis.any_orthonormal_pair();
    // Place in the picture and depth of patches in the cone.
    let drawn: Vec<Option<([f64; 2], f64)>> = places
        .iter()
        .map(|w| {
            let s = w.dot(axis);
            let p = [w.dot(e1) / s, w.dot(e2) / s];
            (s > 0.0 && p[0].hypot(p[1]) <= REACH * spread).then_some((p, s))
        })
        .collect();
    let mean = (body.area / body.patches.len().max(1) as f64).sqrt();
    let (mut low, mut high, mut farthest) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2], 0.0f64);
    for (p, s) in drawn.iter().flatten() {
        for a in 0..2 {
            (low[a], high[a]) = (low[a].min(p[a]), high[a].max(p[a]));
        }
        farthest = farthest.max(*s);
    }
    if farthest == 0.0 {
        return vec![false; places.len()];
    }
    // Pixels of half a mean patch, as the farthest one looks.
    let extent = (high[0] - low[0]).max(high[1] - low[1]);
    let pixel = (0.5 * mean / farthest).max(extent / (SIDE - 1) as f64);
    let side = (extent / pixel) as usize + 1;
    let of = |a: usize, p: f64| (((p - low[a]) / pixel).max(0.0) as usize).min(side - 1);
    let mut depths = vec![f64::INFINITY; side * side];
    // Cut cells have splinters: those are drawn as large as the mean, so that no gap is left between patches.
    let size = |area: DVec3| area.length().sqrt().max(mean);
    for (area, (p, s)) in areas.iter().zip(&drawn).filter_map(|(area, d)| d.map(|d| (*area, d))) {
        let half = 0.5 * size(area) / s;
        for y in of(1, p[1] - half)..=of(1, p[1] + half) {
            for x in of(0, p[0] - half)..=of(0, p[0] + half) {
                let depth = &mut depths[y * side + x];
                *depth = depth.min(s);
            }
        }
    }
    let looks = |(area, d): (&DVec3, &Option<([f64; 2], f64)>)| {
        let facing = -axis.dot(*area) / area.length();
        // Rounding takes the cosine of a patch right across the jet beyond one.
        let slope = (1.0 / facing.clamp(STEEPEST, 1.0).powi(2) - 1.0).sqrt();
        let allowed = size(*area) * (1.0 + 1.5 * slope);
        facing > 0.0 && d.is_some_and(|(p, s)| s <= depths[of(1, p[1]) * side + of(0, p[0])] + allowed)
    };
    areas.iter().zip(&drawn).map(looks).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DAffine3;
    use palpate_model::plan::build::build_body;
    use palpate_model::scene::{Analytic, BodySource, Material, Object, Resolution, Scene};

    #[test]
    fn a_turned_nozzle_sees_a_face_right_across_it() {
        let shape = Analytic::Box { min: DVec3::ZERO, max: DVec3::splat(0.05) };
        let (source, pose) = (BodySource::Analytic(shape), DAffine3::IDENTITY);
        let object = Object { source, pose, resolution: Resolution::CellSize(0.01) };
        let (body, _) = build_body(&Scene::at_rest("in-code.toml", object, Material::undamped(5000.0, 0.4))).unwrap();
        let places: Vec<DVec3> = body.patches.iter().map(|p| p.point - DVec3::new(0.025, -0.1, 0.025)).collect();
        let areas: Vec<DVec3> = body.patches.iter().map(|p| p.area * p.normal).collect();
        let face: Vec<usize> = (0..places.len()).filter(|n| body.patches[*n].normal.y < -0.99).collect();
        // Unit vectors along y but for rounding, some of them longer than one by a unit in the last place.
        for (short, turn) in (1..40).map(|k| f64::from(k) * 0.04).map(|a| (DVec3::new(a.sin(), a.cos(), 0.0), a)) {
            let axis = glam::DMat3::from_quat(glam::DQuat::from_rotation_z(turn)) * short;
            let found = seen(&body, &places, &areas, axis, 0.3);
            assert!(face.iter().all(|n| found[*n]), "{axis} of length 1 + {:e}", axis.length() - 1.0);
        }
    }

    #[test]
    fn it_is_what_lines_of_sight_meet() {
        let shape = Analytic::Torus { major: 0.05, minor: 0.015, center: DVec3::ZERO, axis: DVec3::Z };
        let (source, pose) = (BodySource::Analytic(shape), DAffine3::from_rotation_x(0.25));
        let object = Object { source, pose, resolution: Resolution::CellSize(0.005) };
        let scene = Scene::at_rest("in-code.toml", object, Material::undamped(5000.0, 0.4));
        let (body, shape) = build_body(&scene).unwrap();
        let (origin, axis) = (DVec3::new(0.3, 0.01, 0.02), -DVec3::X);
        let places: Vec<DVec3> = body.patches.iter().map(|p| p.point - origin).collect();
        let areas: Vec<DVec3> = body.patches.iter().map(|p| p.area * p.normal).collect();
        let found = seen(&body, &places, &areas, axis, 0.3);
        let size = (body.area / body.patches.len() as f64).sqrt();
        let (mut right, mut hidden) = (0, 0);
        for ((patch, w), seen) in body.patches.iter().zip(&places).zip(found) {
            let facing = -axis.dot(patch.normal);
            if facing <= 0.0 {
                assert!(!seen, "it looks away");
                continue;
            }
            // Least distance on the line of sight, but for the last part, where the patch itself is near.
            let clear =
                (0..400).map(|k| shape.signed_distance(origin + *w * (f64::from(k) / 440.0))).fold(f64::INFINITY, f64::min);
            if facing > 0.4 && clear > 2.0 * size {
                assert!(seen, "nothing is before {}", patch.point);
                right += 1;
            }
            if clear < -2.0 * size {
                assert!(!seen, "{} is behind the body", patch.point);
                hidden += 1;
            }
        }
        assert!(right > 100 && hidden > 50, "{right} {hidden}");
    }
}

//! A straightened image shows what the lens saw.

use super::*;

/// Coefficients of an Azure Kinect's depth camera, as published with its calibration.
const KINECT: Lens = Lens::Rational([3.130577, 2.324939, 0.000081, -0.000051, 0.130416, 3.458652, 3.350115, 0.662942]);

#[test]
fn a_slanted_plane_through_the_lens_is_straight_again() {
    // A plane z = 1 + 0.3 x: at a ray (a, b) its depth is 1 / (1 − 0.3 a).
    let plane = |ray: [f64; 2]| 1.0 / (1.0 - 0.3 * ray[0]);
    let size = [160, 144];
    let optics = Optics { focal: [126.0, 126.0], center: [83.0, 81.0], lens: KINECT };
    let seen: Vec<f32> = (0..size[0] * size[1])
        .map(|i| optics.ray((i % size[0]) as f64, (i / size[0]) as f64).map_or(0.0, |r| plane(r) as f32))
        .collect();
    let straight = Straightened::new(&optics, size);
    let depth = straight.depth(|i| seen[i]);
    let plain = Optics { lens: Lens::Brown([0.0; 5]), ..optics };
    let mut checked = 0;
    for v in 2..size[1] - 2 {
        for u in 2..size[0] - 2 {
            let z = depth[u + v * size[0]];
            let ray = plain.ray(u as f64, v as f64).unwrap();
            let [a, b] = optics.pixel(ray).unwrap();
            if z > 0.0 && a > 0.0 && b > 0.0 && a < size[0] as f64 - 1.0 && b < size[1] as f64 - 1.0 {
                // Bilinear between rays: an eighth of the second derivative, 2 · 0.3² z³ = 0.3, times the square of their distance, which at the rim of this
                // lens is up to 2.6/126; and f32's digits.
                assert!((f64::from(z) - plane(ray)).abs() < 2e-5, "{u} {v} {z} {}", plane(ray));
                checked += 1;
            }
        }
    }
    // The rim of this lens sees farther out than a pinhole image of its size and focal length: a quarter of its pixels.
    assert!(checked > 15_000 && (0.2..0.3).contains(&straight.lost), "{checked} {}", straight.lost);
}

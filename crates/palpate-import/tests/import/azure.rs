//! A folder of an Azure Kinect with the device's calibration: the lens is rational, and is kept.

use super::truth::*;
use palpate_import::Options;

/// Focal length and centre in shares of the binned sensor of 512 pixels, and k1 … k6, p2, p1 of a device.
const PARAMETERS: [f64; 14] = [
    0.5122697949409485,
    0.49451231956481934,
    0.4921168386936188,
    0.4921667277812958,
    3.1305770874023438,
    2.324939012527466,
    0.1304156482219696,
    3.458651542663574,
    3.350114583969116,
    0.6629416346549988,
    0.0,
    0.0,
    -0.0000511557373101823,
    0.00008132171933539212,
];

/// Ray of a pixel of the 320 × 288 image: the polynomial inverted by bisection along the radius would miss the tangential part, so that the ray is found
/// by a coarse-to-fine search that knows nothing of the importer's method.
fn ray_of(u: f64, v: f64) -> [f64; 2] {
    let p = PARAMETERS;
    let target = [(u - (p[0] * 512.0 - 0.5 - 96.0)) / (p[2] * 512.0), (v - (p[1] * 512.0 - 0.5 - 90.0)) / (p[3] * 512.0)];
    let distort = |x: f64, y: f64| {
        let r2 = x * x + y * y;
        let f = (1.0 + r2 * (p[4] + r2 * (p[5] + r2 * p[6]))) / (1.0 + r2 * (p[7] + r2 * (p[8] + r2 * p[9])));
        let (p1, p2) = (p[13], p[12]);
        [x * f + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x), y * f + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y]
    };
    let miss = |q: [f64; 2]| {
        let d = distort(q[0], q[1]);
        (d[0] - target[0]).hypot(d[1] - target[1])
    };
    let (mut best, mut step) = (target, 0.05);
    while step > 1e-10 {
        let around = (-1..=1).flat_map(|i| (-1..=1).map(move |j| (i, j)));
        let next = around
            .map(|(i, j)| [best[0] + step * f64::from(i), best[1] + step * f64::from(j)])
            .min_by(|a, b| miss(*a).total_cmp(&miss(*b)));
        let next = next.unwrap();
        if miss(next) < miss(best) { best = next } else { step *= 0.5 }
    }
    best
}

#[test]
fn a_rational_lens_is_kept() {
    let bench = Bench::new();
    let (w, h) = (320, 288);
    let rays: Vec<[f64; 2]> = (0..w * h).map(|i| ray_of((i % w) as f64, (i / w) as f64)).collect();
    for k in 0..4 {
        let counts: Vec<u16> = rays.iter().map(|r| (1000.0 * depth(*r, time(2 * k))).round() as u16).collect();
        png(&bench.path(&format!("k/depth/{:05}.png", 2 * k)), &counts, [w, h]);
    }
    let p: Vec<String> = PARAMETERS.iter().map(f64::to_string).collect();
    let json = format!(
        r#"{{"CalibrationInformation": {{"Cameras": [{{"Location": "CALIBRATION_CameraLocationD0",
        "Intrinsics": {{"ModelParameterCount": 14, "ModelParameters": [{}], "ModelType": "CALIBRATION_LensDistortionModelBrownConrady"}}}}]}}}}"#,
        p.join(", ")
    );
    bench.write("k/calibration.json", &json);
    let (imported, r, _) = bench.good("k", &Options { far: Some(0.9), ..Options::default() });
    assert_eq!((imported.format, imported.images), ("azure-kinect", 4));
    assert!((r.frames[1].time - time(2)).abs() < 1e-12, "frames 0, 2, 4 are a frame apart from each other");
    let (mut off, mut n) = (Vec::new(), 0);
    for f in &r.frames {
        let camera = &r.cameras[f.camera];
        for (u, v, c) in f.readings() {
            let q = camera.point(u as f64, v as f64, camera.depth(c)).unwrap();
            off.push((q.distance(center(f.time)) - RADIUS).abs());
            n += 1;
        }
    }
    off.sort_by(f64::total_cmp);
    // Half a count of a millimetre along the ray; rays are good to 1e-10. Where the ball falls off at its rim, the distance from it is less than that.
    assert!(n > 1000 && off[n - 1] < 5.2e-4, "{n} {} {}", off[n / 2], off[n - 1]);
    assert!(!imported.losses.iter().any(|l| l.contains("straightened")), "{:?}", imported.losses);
    let kept = r.cameras[0].distortion;
    assert_eq!((kept[0], kept[2], kept[7]), (PARAMETERS[4], PARAMETERS[13], PARAMETERS[9]));

    let bench = Bench::new();
    png(&bench.path("k/depth/0.png"), &[500; 64], [8, 8]);
    bench.write("k/calibration.json", json);
    let e = bench.bad("k", &Options::default());
    assert!(e.contains("8 × 8") && e.contains("no depth mode"), "{e}");
}

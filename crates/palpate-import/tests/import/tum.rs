//! The layout of the TUM RGB-D benchmark, with a camera that moves.

use super::truth::*;
use glam::{DAffine3, DQuat, DVec3};
use palpate_import::Options;
use std::fmt::Write;

/// Camera to world at a time: the truth's camera axes, turned and shifted a little by the way.
fn pose(t: f64) -> DAffine3 {
    let turn = DQuat::from_axis_angle(DVec3::new(0.2, 1.0, -0.1).normalize(), 0.05 * t);
    DAffine3::from_rotation_translation(turn, DVec3::new(0.05 * t, 0.02, -0.01 * t))
}

fn folder(bench: &Bench, name: &str, moving: bool) {
    let (mut list, mut poses) =
        (String::from("# depth maps\n# timestamp filename\n"), String::from("# ground truth trajectory\n"));
    for k in 0..FRAMES {
        let stamp = 1305031102.160407 + time(k);
        writeln!(list, "{stamp:.6} depth/{stamp:.6}.png").unwrap();
        let p = if moving { pose(time(k)) } else { DAffine3::IDENTITY };
        let seen: Vec<u16> = (0..SIZE[0] * SIZE[1])
            .map(|i| {
                // Along the ray of a pixel from where the camera is: by bisection of steps the ball is met or not.
                let r = ray(i);
                let d = p.matrix3 * DVec3::new(r[0], r[1], 1.0);
                let c = center(time(k)) - p.translation;
                let (a, b) = (d.dot(d), d.dot(c));
                let disc = b * b - a * (c.dot(c) - RADIUS * RADIUS);
                if disc < 0.0 { 0 } else { (5000.0 * (b - disc.sqrt()) / a).round() as u16 }
            })
            .collect();
        png(&bench.path(&format!("{name}/depth/{stamp:.6}.png")), &seen, SIZE);
    }
    // Poses of their own rhythm.
    for k in 0..40 {
        let t = -0.02 + f64::from(k) * 0.011;
        let (p, stamp) = (pose(t), 1305031102.160407 + t);
        let (x, q) = (p.translation, DQuat::from_mat3(&p.matrix3));
        writeln!(poses, "{stamp:.6} {} {} {} {} {} {} {}", x.x, x.y, x.z, q.x, q.y, q.z, q.w).unwrap();
    }
    bench.write(&format!("{name}/depth.txt"), list);
    if moving {
        bench.write(&format!("{name}/groundtruth.txt"), poses);
    }
    let k = format!(r#"{{"fx": {FOCAL}, "fy": {FOCAL}, "cx": {}, "cy": {}}}"#, CENTER[0], CENTER[1]);
    bench.write(&format!("{name}/camera.json"), k);
}

#[test]
fn a_moving_camera_is_one_an_image() {
    let bench = Bench::new();
    folder(&bench, "rgbd", true);
    let (imported, r, _) = bench.good("rgbd", &Options::default());
    assert_eq!((imported.format, imported.images, imported.cameras), ("tum", FRAMES, FRAMES));
    let (off, n) = off_ball(&r);
    // Half of a fifth of a millimetre along the ray, and poses interpolated within 11 ms of a nearly even motion.
    assert!(off < 2e-4 && n > 1000, "{off} {n}");
}

#[test]
fn a_standing_camera_is_one() {
    let bench = Bench::new();
    folder(&bench, "rgbd", false);
    let (imported, r, _) = bench.good("rgbd", &Options::default());
    assert_eq!(imported.cameras, 1);
    let (off, _) = off_ball(&r);
    assert!(off < 1.5e-4, "{off}");
    assert!(imported.guesses.iter().any(|g| g.what == "unit" && g.text.contains("5000 a metre")));
}

#[test]
fn what_contradicts_itself_is_refused() {
    let bench = Bench::new();
    folder(&bench, "rgbd", true);
    let list = std::fs::read_to_string(bench.path("rgbd/depth.txt")).unwrap();
    let third = list.lines().nth(4).unwrap().to_string();
    bench.write("rgbd/depth.txt", list.clone() + &third);
    let e = bench.bad("rgbd", &Options::default());
    assert!(e.contains("depth.txt:15") && e.contains("not after"), "{e}");
    bench.write("rgbd/depth.txt", list.replace(".png", ".gone.png"));
    let e = bench.bad("rgbd", &Options::default());
    assert!(e.contains("depth.txt:3") && e.contains("there is no image"), "{e}");
    bench.write("rgbd/depth.txt", list.clone());
    bench.write("rgbd/groundtruth.txt", "1305031102.1 0 0 0 0 0 0 2\n");
    let e = bench.bad("rgbd", &Options::default());
    assert!(e.contains("groundtruth.txt:1") && e.contains("quaternion"), "{e}");
    bench.write("rgbd/groundtruth.txt", "1.0 0 0 0 0 0 0 1\n");
    let e = bench.bad("rgbd", &Options::default());
    assert!(e.contains("no pose at the time of any image"), "{e}");
    // Without intrinsics those of the benchmark are for another size.
    std::fs::remove_file(bench.path("rgbd/camera.json")).unwrap();
    bench.write("rgbd/groundtruth.txt", "");
    let e = bench.bad("rgbd", &Options::default());
    assert!(e.contains("640 × 480"), "{e}");
}

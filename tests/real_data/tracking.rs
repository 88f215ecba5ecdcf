//! Measured shapes are tracked from the straight shape that they were cast in, with no start values.

use palpate::track;
use std::ops::ControlFlow;
use support::data::data_dir;
use support::measured::open;

/// The body is where it was drawn, and nothing says that it is at rest in the frame.
const STRAIGHT: &[(&str, &str)] = &[
    ("\"static-equilibrium\"", "\"rest\""),
    ("duration = 0 ", "duration = 0.1\nstep = 0.01 "),
    ("band      = 4.0", "band = 4.0\npixel_stride = 4"),
];

#[test]
fn hanging_cantilevers_are_found_from_their_straight_shape() {
    let Some(data) = data_dir() else { return };
    // Residuals of the fits of their moduli (bench/real.json), and as much again of a tenth.
    for (name, fitted) in [("cantilever-ecoflex-hanging", 1.98e-3), ("cantilever-two-materials-hanging", 1.19e-3)] {
        let experiment = open(&data, name, STRAIGHT);
        let tracked = track(&experiment, |_| ControlFlow::Continue(())).unwrap_or_else(|e| panic!("{e}"));
        let frame = &tracked.frames[0];
        let farthest = frame.displacement.iter().map(|u| u.length()).fold(0.0, f64::max);
        println!("{name}: {:?}, farthest {farthest}, {} steps, {:?}", frame.met, frame.steps, frame.doubts);
        assert!(frame.doubts.is_empty() && frame.met.share() > 0.9, "{:?} {:?}", frame.met, frame.doubts);
        assert!(frame.met.rms < 1.1 * fitted, "{} m", frame.met.rms);
        // The heads sink by 106 and 76 mm and come nearer to the clamp.
        assert!((0.07..0.14).contains(&farthest), "{farthest}");
    }
}

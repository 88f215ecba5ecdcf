//! Lenses lead there and back.

use super::*;

/// Coefficients of an Azure Kinect's depth camera, as published with its calibration.
const KINECT: Lens = Lens::Rational([3.130577, 2.324939, 0.000081, -0.000051, 0.130416, 3.458652, 3.350115, 0.662942]);

fn all() -> [Lens; 5] {
    [
        Lens::Brown([0.1, -0.2, 0.001, -0.002, 0.05]),
        KINECT,
        Lens::Modified([0.15, -0.5, -0.0006, -0.0001, 0.4]),
        Lens::Inverse([0.13, 0.1, 0.004, 0.003, -0.05]),
        Lens::Angle([-0.01, 0.02, -0.01, 0.003]),
    ]
}

#[test]
fn every_lens_leads_there_and_back() {
    for lens in all() {
        for p in [[0.0, 0.0], [0.3, -0.2], [-0.5, 0.4], [0.6, 0.5]] {
            let there = lens.distort(p).unwrap();
            let back = lens.undistort(there).unwrap();
            // Newton stops at 1e-12; the slope of these lenses is near one.
            assert!((back[0] - p[0]).hypot(back[1] - p[1]) < 1e-9, "{lens:?} {p:?} {back:?}");
        }
    }
}

#[test]
fn a_rational_lens_without_a_denominator_is_browns() {
    let k = [0.1, -0.2, 0.001, -0.002, 0.05];
    let lens = Lens::Rational([k[0], k[1], k[2], k[3], k[4], 0.0, 0.0, 0.0]);
    assert_eq!(Lens::recorded(lens.as_recorded().unwrap()), Lens::Brown(k));
    let (a, b) = (lens.distort([0.3, 0.2]).unwrap(), Lens::Brown(k).distort([0.3, 0.2]).unwrap());
    assert!((a[0] - b[0]).abs() < 1e-15 && (a[1] - b[1]).abs() < 1e-15);
    assert_eq!(Lens::recorded(KINECT.as_recorded().unwrap()), KINECT);
    assert_eq!(all().map(|l| l.as_recorded().is_some()), [true, true, false, false, false]);
}

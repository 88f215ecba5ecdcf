//! Every measured recording is fitted from its scene file, bounded to stay cheap, and what is found agrees with what was measured
//! without a simulation. Where the model misses, docs/real-data.md says by how much; the ranges here hold those misses in view.

use palpate::{Experiment, Fitted};
use std::path::Path;
use studies::real::swing::Swing;
use studies::real::tracks::rms;
use studies::real::{found, height_at_rest};
use support::data::data_dir;
use support::measured::{fit, open, swings, track};

/// The first three periods instead of all seven.
const SHORT: [&[(&str, &str)]; 2] = [
    &[("duration = 1.0", "duration = 0.45"), ("to = 1.06", "to = 0.52")],
    &[("duration = 1.6", "duration = 0.8"), ("to = 1.7", "to = 0.95")],
];
/// Every third row and column and few iterations: E moves by less than 2 %.
const SPARSE: &[(&str, &str)] = &[("band      = 4.0", "band = 4.0\npixel_stride = 3"), ("iterations = 60", "iterations = 8")];

fn stiffness(fitted: &Fitted) -> f64 {
    found(fitted, "material.youngs_modulus")
}

/// Measured and simulated swing of a marker after a fit, printed beside E and what is left of this marker.
fn compare(name: &str, experiment: &Experiment, fitted: &Fitted, marker: &str, guess: f64) -> (Swing, Swing) {
    let theta = &fitted.result.theta[0];
    let (seen, simulated) = swings(experiment, theta, marker, guess);
    let left = 1e3 * rms(&track(experiment, theta, marker));
    println!(
        "{name}, {marker}: {:.3} / {:.3} Hz, damping {:.4} / {:.4}, centre {:.2} / {:.2} mm simulated / measured, rms {left:.2} mm",
        simulated.frequency,
        seen.frequency,
        simulated.damping_ratio(),
        seen.damping_ratio(),
        1e3 * simulated.centre,
        1e3 * seen.centre
    );
    (seen, simulated)
}

#[test]
fn swinging_beams_and_what_one_tells_of_the_other() {
    let Some(data) = data_dir() else { return };
    let own = open(&data, "beam-gravity", SHORT[0]);
    let fitted = fit(&own);
    let e = stiffness(&fitted);
    // The source's own fits lie between 264 and 294 kPa.
    assert!((255e3..310e3).contains(&e), "E = {e}");
    let (seen, simulated) = compare("own weight", &own, &fitted, "tip1", 7.5);
    // Frequency follows from E, which the sag wants a little smaller (docs/real-data.md).
    assert!((simulated.frequency / seen.frequency - 1.0).abs() < 0.01, "{seen:?} {simulated:?}");
    // The aim: sag within 3 %, the difference of rest height and centre; of the sag after three seconds 6 % are missing (docs/real-data.md).
    let rest = height_at_rest(&own, "tip1");
    assert!(((rest - simulated.centre) / (rest - seen.centre) - 1.0).abs() < 0.03, "{rest} {seen:?} {simulated:?}");
    // Decay of three periods is less certain than their frequency.
    assert!((simulated.damping_ratio() / seen.damping_ratio() - 1.0).abs() < 0.15, "{seen:?} {simulated:?}");
    for marker in ["tip1", "tip2", "tip3"] {
        // The markers' places at rest are known to 0.8 mm.
        let left = rms(&track(&own, &fitted.result.theta[0], marker));
        assert!(left < 0.8e-3, "{marker}: {left}");
    }

    // The same beam with its load, E taken from above.
    let known = format!("youngs_modulus    = {e}");
    let free = "[[fit.parameter]]\npath   = \"material.youngs_modulus\"\nstart  = 2.0e5\nbounds = [1.0e4, 1.0e7]\n";
    let given = [("youngs_modulus    = 2.5e5", known.as_str()), (free, "")];
    let loaded = open(&data, "beam-load52", &[SHORT[1], &given].concat());
    let (seen, simulated) = compare("with 52 g, E of the own weight", &loaded, &fit(&loaded), "tip1", 4.3);
    // Aim of the project for what one beam says of the other.
    assert!((simulated.frequency / seen.frequency - 1.0).abs() < 0.03, "{seen:?} {simulated:?}");
    // The hold's shape is straight to about 1 mm and the markers fit the frame to 0.8 mm: together 1.3 mm of the sag of 17 mm.
    assert!((simulated.centre - seen.centre).abs() < 1.3e-3, "{seen:?} {simulated:?}");

    // And back: E of the loaded beam says how far the unloaded one sags (aim: 5 %), and its frequency but for the known miss of 3.6 %.
    let e = stiffness(&fit(&open(&data, "beam-load52", SHORT[1])));
    let known = format!("youngs_modulus    = {e}");
    let given = [("youngs_modulus    = 2.5e5", known.as_str()), (free, "")];
    let own = open(&data, "beam-gravity", &[SHORT[0], &given].concat());
    let (seen, simulated) = compare("own weight, E of the load", &own, &fit(&own), "tip1", 7.5);
    assert!(((rest - simulated.centre) / (rest - seen.centre) - 1.0).abs() < 0.05, "{rest} {seen:?} {simulated:?}");
    assert!((simulated.frequency / seen.frequency - 1.0).abs() < 0.045, "{seen:?} {simulated:?}");
}

#[test]
fn loaded_beam() {
    let Some(data) = data_dir() else { return };
    let experiment = open(&data, "beam-load52", SHORT[1]);
    let fitted = fit(&experiment);
    let e = stiffness(&fitted);
    // Between the source's fits (264 to 294 kPa), widened by what 1 mm of unknown rest shape makes of a sag of 17 mm.
    assert!((248e3..311e3).contains(&e), "E = {e}");
    let (seen, simulated) = compare("with 52 g", &experiment, &fitted, "tip1", 4.3);
    // What was measured, as the recording's description has it.
    assert!((seen.frequency / 4.33 - 1.0).abs() < 0.02 && (seen.damping_ratio() / 0.058 - 1.0).abs() < 0.2, "{seen:?}");
    // The known miss (docs/real-data.md): 5 % low.
    assert!((simulated.frequency / seen.frequency - 1.0).abs() < 0.06, "{seen:?} {simulated:?}");
    for marker in ["tip1", "tip2", "tip3"] {
        // Rest shape (1 mm) and markers' places (0.8 mm).
        let left = rms(&track(&experiment, &fitted.result.theta[0], marker));
        assert!(left < 1.6e-3, "{marker}: {left}");
    }
}

#[test]
fn swinging_cantilever() {
    let Some(data) = data_dir() else { return };
    let experiment = open(&data, "cantilever-moldstar-oscillating", &[]);
    let fitted = fit(&experiment);
    let e = stiffness(&fitted);
    // The source's fits begin at 220 kPa, the data sheet's secant modulus is 379 kPa.
    assert!((220e3..379e3).contains(&e), "E = {e}");
    let (seen, simulated) = compare("MoldStar", &experiment, &fitted, "head_outer_top", 2.6);
    // Stated: 2.64 to 2.67 Hz. The known miss: 8 % low, as sag decides E.
    assert!((simulated.frequency / 2.65 - 1.0).abs() < 0.1, "{simulated:?}");
    // Stated: damping ratio 0.035 to 0.05; a period and a half of 15 frames leaves a third of it open.
    assert!((0.023..0.067).contains(&simulated.damping_ratio()), "{simulated:?}");
    // The points have a common offset of 1 to 2 mm, and scale 1 to 2 % of an amplitude of 37 mm.
    assert!((simulated.centre - seen.centre).abs() < 2.0e-3, "{seen:?} {simulated:?}");
    let left = fitted.residual().0;
    assert!(left < 3.0e-3, "{left}");
}

/// Fits a hanging cantilever: E [Pa], rms residual [m], points without a match, points, reasons of the verdict.
fn hanging(data: &Path, name: &str) -> (f64, f64, usize, usize, Vec<String>) {
    let fitted = fit(&open(data, name, SPARSE));
    let unmatched = fitted.after.iter().map(|r| r.unmatched).sum();
    let (rms, _, points) = fitted.residual();
    println!("{name}: {:.1} kPa, rms {:.2} mm, {unmatched} unmatched, {points} matched", 1e-3 * stiffness(&fitted), 1e3 * rms);
    (stiffness(&fitted), rms, unmatched, points, fitted.verdict.reasons.clone())
}

#[test]
fn hanging_cantilever_and_the_bias_of_its_sensor() {
    let Some(data) = data_dir() else { return };
    let (e, rms, ..) = hanging(&data, "cantilever-ecoflex-hanging");
    // An inextensible beam clamped at x = 70 mm whose head sinks by the observed 106 mm has 126 kPa, one clamped where the block
    // begins to guide the bar, at 57 mm, has 84 kPa (large deflections, EI θ' integrated).
    assert!((84e3..126e3).contains(&e), "E = {e}");
    // The surface scatters by 1.8 mm about a smooth face in this frame.
    assert!(rms < 2.3e-3, "{rms}");

    let (_, raw_rms, unmatched, points, reasons) = hanging(&data, "cantilever-ecoflex-hanging-raw");
    // Points 23 mm too deep lie behind a bar of 30 mm, but are known to show its front.
    assert!(raw_rms > 5.0 * rms && unmatched * 10 < points, "{raw_rms} {unmatched} of {points}");
    assert!(reasons.iter().any(|w| w.contains("something in the model is missing or wrong")), "{reasons:?}");
}

#[test]
fn hanging_cantilever_of_two_materials() {
    let Some(data) = data_dir() else { return };
    let (e, rms, unmatched, points, _) = hanging(&data, "cantilever-two-materials-hanging");
    // The source's fits of its two halves: 79 ± 11 and 162 ± 28 kPa. One modulus for both lies between.
    assert!((68e3..190e3).contains(&e), "E = {e}");
    // Stated about the fitted bent shape: 0.67 mm in the median, nine tenths below 1.6 mm.
    assert!(rms < 1.6e-3 && unmatched * 20 < points, "{rms} {unmatched} of {points}");

    let (_, raw_rms, ..) = hanging(&data, "cantilever-two-materials-hanging-raw");
    // Half of the body is read 23 mm too deep.
    assert!(raw_rms > 5.0 * rms, "{raw_rms} {rms}");
}

#[test]
fn a_beam_at_rest_under_three_loads_as_one_sequence() {
    let Some(data) = data_dir() else { return };
    let cost = "cost      = \"markers\"\n";
    let only = |from: &str, to: &str| format!("cost = \"markers\"\nframes = {{ from = {from}, to = {to} }}\n");
    // Fits of one state each, by the recording's own page: 253 and 259, 246 and 248, 253 and 261 kPa. A13 of the method: within a tenth.
    for (name, change, single) in [
        ("all states", cost.to_string(), [246e3, 261e3]),
        ("own weight", only("-0.5", "1.5"), [253e3, 259e3]),
        ("52 g", only("1.5", "3.5"), [246e3, 248e3]),
        ("102 g", only("3.5", "5.5"), [253e3, 261e3]),
    ] {
        let fitted = fit(&open(&data, "beam-quasi-static", &[(cost, &change)]));
        let (e, rms) = (stiffness(&fitted), fitted.residual().0);
        println!("{name}: E = {:.1} kPa, {:.2} mm left", 1e-3 * e, 1e3 * rms);
        assert!((0.9 * single[0]..1.1 * single[1]).contains(&e), "{name}: E = {e}");
        // Single states leave 0.1 to 1.4 mm, and the one that was hung off centre 2.4 mm.
        assert!(rms < 2.4e-3, "{name}: {rms}");
    }
    // The first run of each load tells where the second one ends.
    let half = ("iterations = 20\n", "iterations = 20\nframes = { train = { every = 2 } }\n");
    let fitted = fit(&open(&data, "beam-quasi-static", &[half]));
    let held = fitted.held_out.expect("frames are kept from it");
    println!("{}", held.sentence());
    assert_eq!((held.train.frames, held.test.frames), (3, 3));
    assert!(held.test.rms < 0.5 * held.test.unmoved.unwrap() && held.test.unmoved < held.test.rest, "{held:?}");
}

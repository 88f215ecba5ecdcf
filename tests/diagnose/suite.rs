//! A small part of the suite, on a ball of a few cells: a contact, a load and a measurement effect are named, nothing hidden is
//! adequate, and a magnet is seen where it pulls.

use std::time::Duration;
use studies::suite::score::Row;
use studies::suite::{answered, small};

/// Hides something in the small ball, to be as strong as the strong cases are, and scores the answer.
fn outcome(hidden: Option<&str>, seed: u64) -> Row {
    let folder = tempfile::tempdir().unwrap();
    let case = small(hidden, seed, folder.path()).unwrap();
    answered(&case, folder.path(), Duration::from_secs(600)).unwrap()
}

/// The hidden effect is named first, with its number within 15 % as the suite asks for, and the gap closes on data that no fit saw.
fn named(name: &str) {
    let o = outcome(Some(name), 11);
    // Weaker than the strength that the suite aims at would be another case.
    assert!(o.strength > 8.0, "{o:?}");
    assert_eq!((o.verdict.as_str(), o.score), ("missing-effect", 1.0), "{o:?}");
    assert!(o.size_error.is_none_or(|e| e < 0.15), "{o:?}");
    assert!(o.gap_closed.is_some_and(|g| g > 0.9), "{o:?}");
}

#[test]
fn a_contact_effect_is_named() {
    named("coulomb-friction");
}

#[test]
// In the quick tier `diagnose::a_sideways_force_is_named_with_its_size_and_its_twin` names a load.
#[ignore = "slow: cargo xtask test --full"]
fn a_load_is_named() {
    named("air-drag");
}

#[test]
fn a_wall_is_named() {
    let o = outcome(Some("second-plane"), 11);
    assert_eq!((o.verdict.as_str(), o.score), ("missing-effect", 1.0), "{o:?}");
    assert!(o.gap_closed.is_some_and(|g| g > 0.9), "{o:?}");
}

#[test]
// In the quick tier `diagnose::a_sensor_that_reads_too_far_is_not_sold_as_physics` names an effect on the measurement.
#[ignore = "slow: cargo xtask test --full"]
fn a_measurement_effect_is_named() {
    let o = outcome(Some("depth-bias"), 11);
    // One camera sees this ball from about one distance, where a bias and a scale of depth read the same: named first, or as just as good.
    assert_eq!(o.verdict, "missing-effect", "{o:?}");
    assert!(o.score >= 0.5 && o.named[0].starts_with("depth-"), "{o:?}");
    assert!(o.gap_closed.is_some_and(|g| g > 0.9), "{o:?}");
}

#[test]
// In the quick tier `diagnose::nothing_is_found_where_nothing_is_missing` has nothing to find.
#[ignore = "slow: cargo xtask test --full"]
fn nothing_hidden_is_adequate() {
    let o = outcome(None, 12);
    assert_eq!(o.verdict, "adequate", "{o:?}");
}

#[test]
// In the quick tier the study's own tests compute the magnet's pull; docs/suite.md counts what is said of magnets.
#[ignore = "slow: cargo xtask test --full"]
fn a_magnet_is_seen_where_it_pulls() {
    let o = outcome(Some("magnet"), 13);
    // On this small ball a patchwork of known effects follows it to within noise and grid; docs/suite.md says how often magnets are called
    // unexplained.
    assert!(["unexplained", "missing-effect"].contains(&o.verdict.as_str()), "{o:?}");
    assert!(o.f1.is_some_and(|f| f > 0.8), "{o:?}");
    // Half a right angle: closer to it than to anything beside it.
    assert!(o.verdict != "unexplained" || o.points_at.is_some_and(|s| s > 0.7), "{o:?}");
}

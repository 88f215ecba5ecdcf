//! Numbers that no body, camera or scene has: each is named in a warning, before it becomes an error about something else.

use super::Experiment;
use crate::fitting::held_whole;
use palpate_engine::number;
use palpate_io::recording::Recording;
use palpate_io::scene::states;
use palpate_model::params::ParamKey;
use palpate_model::scene::ObservationSpec;
use std::f64::consts::{FRAC_PI_4, PI, TAU};
use std::path::Path;

/// Depth readings up to which all are used: a hundred million bytes of points, and a cost of about a second a time step.
const MOST_READINGS: usize = 3_000_000;
/// Speeds beyond this [m/s] are faster than anything that depth cameras see.
const FAST: f64 = 300.0;
/// Steps beyond this take hours.
const MANY_STEPS: usize = 200_000;
/// Angle between a plane's normal and where its fit starts [rad] from which on the angle may count about another axis than was meant.
const TURNED: f64 = FRAC_PI_4;
/// Views narrower or wider than this [°] are of no depth camera.
const VIEW: [f64; 2] = [0.05, 179.0];

/// Takes every n-th pixel of depth images that hold more readings than are of use, unless the scene says which; returns a warning then.
pub(super) fn thin(read: &Recording, spec: &mut ObservationSpec, path: &Path, text: &str) -> Option<String> {
    if spec.pixel_stride > 1 || read.frames.is_empty() {
        return None;
    }
    let used = read.frames.iter().filter(|f| (spec.from..=spec.to).contains(&f.time));
    let readings = used.map(|f| f.readings().count()).sum::<usize>() / spec.every.max(1);
    if readings <= MOST_READINGS || states(text, "observation.pixel_stride") {
        return None;
    }
    spec.pixel_stride = (readings as f64 / MOST_READINGS as f64).sqrt().ceil() as usize;
    let (n, stride) = (number(readings as f64), spec.pixel_stride);
    Some(format!(
        "{}: observation.pixel_stride = {stride} is taken, since the images hold {n} readings; state it to take another, or 1 for all",
        path.display()
    ))
}

/// What deserves a word about the numbers of a scene and its recording.
pub(super) fn doubts(e: &Experiment) -> Vec<String> {
    let name = e.scene().path.display();
    let mut out = Vec::new();
    let speed = e.scene().initial.velocity.length();
    if speed > FAST {
        out.push(format!("{name}: initial.velocity: {} m/s is unusual; is it in m/s?", number(speed)));
    }
    let steps = e.plan().clock.steps;
    if steps > MANY_STEPS {
        out.push(format!("{name}: time: {steps} steps of {} s take long; is the step in seconds?", number(e.scene().time.step)));
    }
    // States of a sequence may lie far apart.
    if e.plan().clock.moves() {
        let leaps = e.plan().jumps(e.scene().time.start, f64::INFINITY);
        out.extend(
            leaps
                .iter()
                .map(|leap| format!("{name}: {leap}; is its motion in metres and seconds, and relative to the rest place?")),
        );
    }
    out.extend(angles(e).into_iter().map(|text| format!("{name}: {text}")));
    if held_whole(e) {
        out.push(format!("{name}: clamp: clamps hold the whole surface; nothing of the body can move by itself"));
    }
    if let Some(r) = e.recording() {
        out.extend(cameras(e, r));
    }
    out
}

/// Angles of planes whose fit starts far from the scene's own normal.
fn angles(e: &Experiment) -> Vec<String> {
    let plan = e.plan();
    let (keys, fit) = (plan.layout.keys.iter().zip(&plan.theta), e.scene().fit.as_ref());
    let of_planes = keys.filter(|(key, _)| matches!(key, ParamKey::PlaneTheta(_) | ParamKey::PlanePhi(_)));
    let far = of_planes.filter_map(|(key, own)| {
        let path = key.spec().path;
        // Who states a direction means it.
        if e.text().contains(&path.replace(".theta", ".normal").replace(".phi", ".normal")) {
            return None;
        }
        let (from, to) = fit?.parameters.iter().find(|p| p.path == path)?.start;
        let away = |x: f64| ((x - own + PI).rem_euclid(TAU) - PI).abs();
        let least = if (from..=to).contains(own) { 0.0 } else { away(from).min(away(to)) };
        (least > TURNED).then(|| {
            format!(
                "{path} starts {:.0}° from the scene's own normal, of which it is {own:.3} rad; an angle counts about z, or another axis where \
                 the normal is near z: plane.N.normal takes a direction",
                least.to_degrees()
            )
        })
    });
    far.collect()
}

fn cameras(e: &Experiment, r: &Recording) -> Vec<String> {
    let path = r.path.display();
    let mut out = Vec::new();
    for (i, c) in r.cameras.iter().enumerate() {
        for (key, size, focal) in [("fx", c.width, c.focal[0]), ("fy", c.height, c.focal[1])] {
            let view = 2.0 * (0.5 * size as f64 / focal).atan().to_degrees();
            if !(VIEW[0]..=VIEW[1]).contains(&view) {
                out.push(format!(
                    "{path}: camera.{i}.{key}: {} pixels give camera \"{}\" a view of {} degrees",
                    number(focal),
                    c.name,
                    number(view)
                ));
            }
        }
        let depth = -e.shape().signed_distance(c.position());
        if depth > 0.0 {
            out.push(format!(
                "{path}: camera.{i}.world_from_camera: camera \"{}\" stands {} m inside the body at rest",
                c.name,
                number(depth)
            ));
        }
    }
    out
}

//! A first scene for a recording: it can be fitted as it is, and says what of it nobody measured.

use crate::capture::{Equilibria, Guess};
use crate::options::{Floor, Options};
use crate::stages::body::Body;
use crate::stages::plane::Plane;
use crate::stages::release::{GRAVITY, Motion};
use crate::stages::settle::Said;
use crate::stages::thin::Thinned;
use glam::{DAffine3, DVec3};
use std::fmt::Write;

/// Longer motions than this are not fitted at first [s]: what a soft body does, it does in the beginning.
const LONGEST: f64 = 2.0;

/// What a scene is made of.
pub struct Parts<'a> {
    /// Title of the recording.
    pub title: &'a str,
    /// The body at rest.
    pub body: &'a Body,
    /// Upward direction.
    pub up: DVec3,
    /// What the recording does.
    pub motion: Motion,
    /// Start and end of what is simulated [s].
    pub window: (f64, f64),
    /// Last time of the recording [s].
    pub last: f64,
    /// Lowest place along the upward direction at which anything is ever seen [m].
    pub lowest: f64,
    /// The plane that was taken out of the images.
    pub plane: Option<Plane>,
    /// Box around markers that never move.
    pub held: Option<[DVec3; 2]>,
    /// Name of the cost.
    pub cost: &'a str,
    /// What of the recording is used.
    pub thinned: Thinned,
    /// Where it is a sequence of equilibria, what is known of them.
    pub equilibria: Option<&'a Equilibria>,
    /// Number of tracked points.
    pub tracks: usize,
}

/// The time that a scene covers: start and end [s].
pub fn window(motion: Motion, last: f64, o: &Options, said: &mut Said) -> (f64, f64) {
    let Motion::Moving { from, .. } = motion else { return (f64::NEG_INFINITY, f64::INFINITY) };
    if let Some(d) = o.duration {
        return (from, from + d);
    }
    if last - from > LONGEST {
        let text = format!("{LONGEST} s of the {:.2} s after the release", last - from);
        said.guesses.push(Guess::scene("duration", "time.duration", text, "--duration"));
        return (from, from + LONGEST);
    }
    (from, last)
}

fn vector(v: DVec3) -> String {
    // Adding zero turns −0 into 0.
    let [x, y, z] = (v + DVec3::ZERO).to_array();
    format!("[{x:?}, {y:?}, {z:?}]")
}

fn matrix(a: &DAffine3) -> String {
    let m = a.matrix3;
    let row = |i: usize| format!("  [{:?}, {:?}, {:?}, {:?}],\n", m.col(0)[i], m.col(1)[i], m.col(2)[i], a.translation[i]);
    format!("[\n{}{}{}  [0, 0, 0, 1],\n]", row(0), row(1), row(2))
}

/// Stiffness of a spring over that of the body between two points.
const STIFFER: f64 = 300.0;

/// A number with as many digits as a guess deserves.
fn short(x: f64) -> f64 {
    (x * 1e5).round() / 1e5
}

fn rounded(v: DVec3) -> DVec3 {
    DVec3::new(short(v.x), short(v.y), short(v.z))
}

/// What holds the body, and what lies under it.
struct Supports {
    clamp: Option<[DVec3; 2]>,
    /// Point and normal.
    floor: Option<(DVec3, DVec3)>,
}

fn supports(p: &Parts, o: &Options, said: &mut Said) -> Supports {
    let [low, high] = p.body.bounds;
    let mut clamp = o.clamp;
    if clamp.is_none()
        && let Some([a, b]) = p.held
    {
        let room = DVec3::splat(0.1 * (high - low).length());
        clamp = Some([a - room, b + room]);
        let text = "around the markers that never move; the body is held there";
        said.guesses.push(Guess::scene("clamp", "clamp", text, "--clamp"));
    }
    let wants_floor = matches!(o.floor, Some(Floor::At(_)));
    let attached = p.equilibria.is_some_and(|e| !e.fixed.is_empty());
    let at_rest = matches!(p.motion, Motion::Still | Motion::Sequence { .. });
    if clamp.is_none() && at_rest && !attached && !wants_floor {
        // What hangs at rest is held somewhere: at its top, where nothing says otherwise.
        let height = |v: DVec3| v.dot(p.up);
        let (bottom, top) = (
            height(DVec3::select(p.up.cmpge(DVec3::ZERO), low, high)),
            height(DVec3::select(p.up.cmpge(DVec3::ZERO), high, low)),
        );
        let axis = (0..3).max_by(|a, b| p.up[*a].abs().total_cmp(&p.up[*b].abs())).unwrap_or(2);
        let (mut a, mut b) = (low - 0.05 * (high - low), high + 0.05 * (high - low));
        let tenth = 0.1 * (top - bottom) / p.up[axis].abs();
        if p.up[axis] > 0.0 {
            a[axis] = high[axis] - tenth
        } else {
            b[axis] = low[axis] + tenth
        }
        clamp = Some([a, b]);
        let text = "the top tenth of the body, since what is at rest is held somewhere";
        said.guesses.push(Guess::scene("clamp", "clamp", text, "--clamp"));
    }
    let floor = match (o.floor, p.plane) {
        (Some(Floor::None), _) => None,
        (Some(Floor::At(h)), _) => Some((p.up * h, p.up)),
        (None, Some(plane)) if plane.normal.dot(p.up) > 0.9 => {
            said.guesses.push(Guess::scene("floor", "plane", "the plane that was taken out of the images", "--floor"));
            Some((plane.normal * plane.offset, plane.normal))
        }
        (None, _) if clamp.is_none() && !attached => {
            let under = p.lowest.min(corner(p.body.bounds, p.up));
            let text =
                format!("{under:.4} m along the upward direction, the lowest that is ever seen; nothing else holds the body");
            said.guesses.push(Guess::scene("floor", "plane", text, "--floor (a height, or none) and --clamp"));
            Some((p.up * short(under), p.up))
        }
        _ => None,
    };
    Supports { clamp, floor }
}

/// Height of the lowest corner of a box.
fn corner([low, high]: [DVec3; 2], up: DVec3) -> f64 {
    DVec3::select(up.cmpge(DVec3::ZERO), low, high).dot(up)
}

/// Springs that draw what was fixed to where it was seen. They must hardly give way beside the body.
fn attach(t: &mut String, e: &Equilibria, p: &Parts, shear: f64, said: &mut Said) {
    let [low, high] = p.body.bounds;
    let size = high - low;
    let spacing = (size.x * size.y * size.z / p.tracks.max(1) as f64).cbrt();
    let stiffness: f64 = format!("{:.0e}", STIFFER * shear * spacing).parse().unwrap_or(1e4);
    let _ = write!(t, "\n[[attach]]\ntrack = \"recording\"\npoints = {:?}\nstiffness = {stiffness:?}\n", e.fixed);
    let text = format!(
        "{stiffness} N/m a point, {STIFFER} times what the body between two points has; larger ones hold tighter and need more iterations"
    );
    said.guesses.push(Guess::scene("attachment", "attach.0.stiffness", text, "the number in [[attach]]"));
}

/// The text of the scene, without its marks.
pub fn text(p: &Parts, o: &Options, said: &mut Said) -> String {
    let mut t = String::new();
    let held = supports(p, o, said);
    let title = toml_edit::Value::from(p.title).to_string();
    let mut material = |key: &str, flag: &str, given: Option<f64>, usual: f64, why: &str| {
        if given.is_none() {
            said.guesses.push(Guess::scene("material", format!("material.{key}"), why, flag));
        }
        given.unwrap_or(usual)
    };
    let density = material("density", "--density", o.density, 1000.0, "1000 kg/m³, that of water and nearly of silicone");
    let young =
        material("youngs_modulus", "--youngs", o.youngs_modulus, 1e5, "1e5 Pa, where the fit begins; soft silicone is near");
    let poisson = material("poisson_ratio", "--poisson", o.poisson_ratio, 0.45, "0.45, that of rubbery bodies is 0.45 to 0.499");
    // Writing to a string cannot fail.
    let _ = write!(t, "format = \"scene/1\"\ntitle = {title}\n\n[object]\n");
    match &p.body.mesh {
        Some(_) => {
            let _ = write!(t, "mesh = \"object.obj\"\npose = {}\n", matrix(&p.body.pose));
        }
        None => {
            let [a, b] = p.body.bounds.map(rounded);
            let _ = writeln!(t, "shape = {{ box = {{ min = {}, max = {} }} }}", vector(a), vector(b));
        }
    }
    let _ = write!(
        t,
        "\n[material]\nmodel = \"corotated-linear\"\ndensity = {density:?}\nyoungs_modulus = {young:?}\npoisson_ratio = {poisson:?}\n"
    );
    let still = p.motion == Motion::Still;
    let sequence = matches!(p.motion, Motion::Sequence { .. });
    if !still && !sequence {
        let _ = writeln!(t, "stiffness_damping = 0.001");
        let text = "0.001 s, a little; free it beside the modulus where the motion is seen to die away";
        said.guesses.push(Guess::scene("material", "material.stiffness_damping", text, "a [[fit.parameter]] of scene.toml"));
    }
    let _ = write!(t, "\n[world]\ngravity = {}\n", vector(-GRAVITY * p.up));
    if let Some([a, b]) = held.clamp {
        let _ = write!(t, "\n[[clamp]]\nbox = {{ min = {}, max = {} }}\n", vector(rounded(a)), vector(rounded(b)));
    }
    if let Some((point, normal)) = held.floor {
        let _ = write!(t, "\n[[plane]]\npoint = {}\nnormal = {}\n", vector(point), vector(normal));
    }
    if let Some(e) = p.equilibria.filter(|e| !e.fixed.is_empty()) {
        attach(&mut t, e, p, young / (2.0 * (1.0 + poisson)), said);
    }
    if !sequence {
        let _ = write!(t, "\n[initial]\nstate = \"{}\"\n", if still { "static-equilibrium" } else { "rest" });
    }
    t += "\n[time]\n";
    match p.motion {
        Motion::Still => {
            let _ = writeln!(t, "duration = 0");
        }
        Motion::Sequence { .. } => t += "mode = \"quasi-static\"\n",
        Motion::Moving { from, .. } => {
            let to = p.window.1;
            let duration = f64::max(to - from, 1e-3);
            let _ = write!(t, "start = {from:?}\nduration = {:?}\n", (duration * 1e9).round() / 1e9);
        }
    }
    let _ = write!(t, "\n[observation]\nrecording = \".\"\ncost = \"{}\"\n", p.cost);
    if p.thinned.stride > 1 {
        let _ = writeln!(t, "pixel_stride = {}", p.thinned.stride);
    }
    let every = if p.thinned.every > 1 { format!(", every = {}", p.thinned.every) } else { String::new() };
    match p.motion {
        Motion::Moving { from, .. } => {
            let to = p.window.1;
            let _ = writeln!(t, "frames = {{ from = {from:?}, to = {:?}{every} }}", to.min(p.last));
        }
        _ if p.thinned.every > 1 => {
            let _ = writeln!(t, "frames = {{ every = {} }}", p.thinned.every);
        }
        _ => {}
    }
    t += "\n[fit]\niterations = 30\n";
    if let Some(e) = p.equilibria.filter(|e| !e.train.is_empty()) {
        let _ = writeln!(t, "frames = {{ train = {{ numbers = {:?} }} }}", e.train);
    }
    t += "\n[[fit.parameter]]\npath = \"material.youngs_modulus\"\nbounds = [1.0e2, 1.0e8]\n";
    if sequence {
        return t;
    }
    let _ = write!(
        t,
        "\n\
         # More that may be free, once the shape, the pose and what holds the body are right:\n\
         # [[fit.parameter]]\n# path = \"material.stiffness_damping\"\n#\n# [[fit.parameter]]\n# path = \"time.start\"\n"
    );
    t
}

//! `plane.N.normal` among what is fitted: both angles of a plane's normal, said as a direction instead of in their chart.

use crate::document::Table;
use crate::error::InputError;
use crate::scene::fit::Target;
use palpate_model::plan::PlaneSite;
use palpate_model::scene::Scene;

/// Sine of the least angle [rad] between a start and the axis that angles turn about: nearer to it the second one says nothing.
const CLOSE: f64 = 0.1;

/// The plane that a path names the normal of.
fn plane_of(path: &str) -> Option<usize> {
    path.strip_prefix("plane.")?.strip_suffix(".normal")?.parse().ok()
}

/// The two angles of a normal with the value that `start` gives them and bounds `within` an angle of it; `None` where the path names no
/// plane's normal.
pub(super) fn targets(t: &Table, path: &str, scene: &Scene, known: &[Target]) -> Result<Option<Vec<Target>>, InputError> {
    let Some(plane) = plane_of(path).and_then(|i| Some((i, scene.planes.get(i)?))) else { return Ok(None) };
    let (i, normal) = (plane.0, plane.1.normal);
    for key in ["bounds", "known"] {
        if t.has(key) {
            let text =
                format!("{path} is a direction: say within (rad) how far it may turn; plane.{i}.theta and .phi take {key}");
            return Err(t.error(key, text));
        }
    }
    // The chart follows from the scene's own normal, as for the angles by themselves.
    let site = PlaneSite { polar_axis: PlaneSite::polar_axis_for(normal), stiffness: None };
    let start = match t.optional_vec3("start")? {
        None => normal,
        Some(v) => v
            .try_normalize()
            .ok_or_else(|| t.error("start", "has no length; give a direction out of the forbidden half-space"))?,
    };
    let (theta, phi) = site.angles(start);
    if theta.sin() < CLOSE {
        let axis = ["x", "y", "z"][site.polar_axis];
        let text =
            format!("is nearly along {axis}, far from the plane's normal; state it as [[plane]] normal, and leave out start");
        return Err(t.error("start", text));
    }
    let within = t.f64_where("within", |x| x > 0.0 && x <= std::f64::consts::PI, "must be in (0, π] (rad)")?;
    // On the sphere a step of φ is sin θ as long as one of θ.
    let far = within.map_or([f64::INFINITY; 2], |w| [w, w / theta.sin()]);
    let angles = [("theta", theta, far[0]), ("phi", phi, far[1])];
    let target = |(name, value, far): (&str, f64, f64)| {
        let path = format!("plane.{i}.{name}");
        let own = known.iter().find(|k| k.path == path)?;
        Some(Target { path, value: (value, value), lower: own.lower.max(value - far), upper: own.upper.min(value + far), ..*own })
    };
    Ok(Some(angles.into_iter().filter_map(target).collect()))
}

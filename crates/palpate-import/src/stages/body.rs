//! The body at rest: the mesh that the user has, put where the object is seen, or a box around what is seen.

use super::settle::Said;
use crate::capture::Guess;
use crate::error::{ImportError, refuse_option};
use crate::options::{Options, Unit};
use glam::{DAffine3, DVec3};
use palpate_io::mesh::read_mesh_in;
use palpate_model::shape::{MeshShape, TriMesh};

/// A body in the world.
#[derive(Clone, Debug)]
pub struct Body {
    /// The mesh in its own axes [m]; `None` = a box.
    pub mesh: Option<TriMesh>,
    /// From there to the world.
    pub pose: DAffine3,
    /// Lowest and highest corner in the world [m].
    pub bounds: [DVec3; 2],
    /// What reading the mesh had to say.
    pub warnings: Vec<String>,
}

/// What the body was seen of before it moved.
pub struct Seen<'a> {
    /// World points [m].
    pub points: &'a [DVec3],
    /// Lowest and highest corner of them.
    pub bounds: [DVec3; 2],
    /// Direction in which a camera looks, where one does: it sees the near side alone.
    pub sight: Option<DVec3>,
    /// True where the points lie on the surface itself, and not on stalks over it.
    pub on_surface: bool,
}

/// Points that decide about the pose.
const POINTS: usize = 400;

/// Makes the body.
pub fn make(o: &Options, seen: &Seen, said: &mut Said) -> Result<Body, ImportError> {
    let [low, high] = seen.bounds;
    let Some(path) = &o.mesh else {
        if o.pose.is_some() {
            return refuse_option("pose", "", "places a mesh, and --mesh names none");
        }
        return Ok(around(seen, said));
    };
    let extent = (high - low).max_element();
    let mut chosen = Unit::Metre;
    let read = read_mesh_in(path, |longest| {
        chosen = o.mesh_unit.unwrap_or_else(|| unit_of(longest, extent));
        chosen.metres()
    })?;
    let (mesh, warnings) = (read.value, read.warnings);
    let size = mesh.bounds();
    let size = (size.1 - size.0).max_element();
    if o.mesh_unit.is_none() && chosen != Unit::Metre {
        let text = format!("the mesh is in {chosen}: its longest side is then {size:.4} m, what is seen spans {extent:.4} m");
        said.guesses.push(Guess::scene("unit", "object.mesh", text, "--mesh-unit"));
    }
    let pose = match o.pose {
        Some(p) => p,
        None => placed(&mesh, seen, said),
    };
    let (a, b) = mesh.transformed(&pose).bounds();
    Ok(Body { mesh: Some(mesh), pose, bounds: [a, b], warnings })
}

/// The unit that makes a mesh about as large as what is seen of it; metres where they do.
fn unit_of(longest: f64, extent: f64) -> Unit {
    let off = |u: Unit| (longest * u.metres() / extent.max(1e-6)).ln().abs();
    // A camera sees a part, markers sit on a part: eight times as large is still the same unit.
    if off(Unit::Metre) < 8f64.ln() {
        return Unit::Metre;
    }
    *Unit::ALL.iter().min_by(|a, b| off(**a).total_cmp(&off(**b))).expect("there are units")
}

/// Where the mesh lies: where it is, if what is seen lies there; else shifted so that both have one middle, then onto the points.
fn placed(mesh: &TriMesh, seen: &Seen, said: &mut Said) -> DAffine3 {
    let (a, b) = mesh.bounds();
    let (middle, half) = (0.5 * (a + b), 0.5 * (b - a));
    let every = seen.points.len().div_ceil(POINTS).max(1);
    let points: Vec<DVec3> = seen.points.iter().step_by(every).copied().collect();
    let grown = 0.25 * half.length();
    let inside = points.iter().filter(|p| (**p - middle).abs().cmple(half + DVec3::splat(grown)).all()).count();
    if 2 * inside > points.len() {
        let text = "the mesh lies where the object is seen; it is taken to be placed already".to_string();
        said.guesses.push(Guess::scene("pose", "object.pose", text, "--pose"));
        return DAffine3::IDENTITY;
    }
    let [low, high] = seen.bounds;
    let mut shift = 0.5 * (low + high) - middle;
    if let Some(d) = seen.sight {
        // The nearest corner of the box behind the nearest of what is seen.
        let near = points.iter().map(|p| p.dot(d)).fold(f64::INFINITY, f64::min);
        let front = (middle + shift).dot(d) - half.dot(d.abs());
        shift += d * (near - front);
    }
    if seen.on_surface {
        let shape = MeshShape::new(mesh.clone());
        // Mean of the ways to the nearest points: closer with every round, and still long before this many.
        for _ in 0..60 {
            let ways = points.iter().filter_map(|p| Some(*p - shift - shape.closest(*p - shift)?.0));
            let (sum, n) = ways.fold((DVec3::ZERO, 0.0), |(s, n), w| (s + w, n + 1.0));
            shift += sum / f64::max(n, 1.0);
        }
    }
    let text = format!(
        "the mesh is shifted by ({:.4}, {:.4}, {:.4}) m to where the object is seen, and not turned",
        shift.x, shift.y, shift.z
    );
    said.guesses.push(Guess::scene("pose", "object.pose", text, "--pose"));
    DAffine3::from_translation(shift)
}

/// A box around what is seen, as deep as it is wide where one side alone is seen.
fn around(seen: &Seen, said: &mut Said) -> Body {
    let [mut low, mut high] = seen.bounds;
    let size = high - low;
    let longest = size.max_element().max(1e-3);
    if let Some(d) = seen.sight {
        let axis = (0..3).max_by(|a, b| d[*a].abs().total_cmp(&d[*b].abs())).unwrap_or(2);
        let others = (0..3).filter(|a| *a != axis).map(|a| size[a]);
        let deep = others.fold(f64::INFINITY, f64::min).max(0.1 * longest);
        if size[axis] < deep {
            if d[axis] > 0.0 { high[axis] = low[axis] + deep } else { low[axis] = high[axis] - deep }
        }
    }
    for a in 0..3 {
        // Nothing is thinner than a tenth of its length, as far as a guess goes.
        let lacking = 0.1 * longest - (high[a] - low[a]);
        if lacking > 0.0 {
            (low[a], high[a]) = (low[a] - 0.5 * lacking, high[a] + 0.5 * lacking);
        }
    }
    let text = format!(
        "a box of {:.4} × {:.4} × {:.4} m around what is seen, since there is no mesh",
        high.x - low.x,
        high.y - low.y,
        high.z - low.z
    );
    said.guesses.push(Guess::scene("shape", "object.shape", text, "--mesh"));
    Body { mesh: None, pose: DAffine3::IDENTITY, bounds: [low, high], warnings: Vec::new() }
}

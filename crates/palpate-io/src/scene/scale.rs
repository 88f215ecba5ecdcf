//! Is the object in metres, as everything else in the scene?

use super::object::extent;
use crate::document::Source;
use crate::error::InputError;
use crate::mesh::bounds;
use glam::DVec3;
use palpate_model::scene::{BodySource, ClampRegion, Inertia, Plane, Scene};
use palpate_model::shape::LARGE;
use palpate_model::shape::{Shape, shape_of};

/// What is smaller than this part of the object's width is in another unit than the object: millimetres read as metres make everything
/// else a thousandth of it, and nobody holds a body by a hundredth of its width.
pub(crate) const FAR_SMALLER: f64 = 0.01;

/// Warns of an object of some metres with its size and mass, and refuses one beside clamps or planes that are far smaller.
pub(super) fn check(source: &Source, scene: &Scene, warnings: &mut Vec<String>) -> Result<(), InputError> {
    let (key, own) = match &scene.object.source {
        BodySource::Mesh { mesh, .. } => {
            let (min, max) = bounds(&mesh.vertices);
            ("object.mesh", max - min)
        }
        BodySource::Tetrahedra { surface, .. } => {
            let (min, max) = bounds(&surface.vertices);
            ("object.volume_mesh", max - min)
        }
        BodySource::Cloud(cloud) => {
            let (min, max) = bounds(&cloud.points);
            ("object.points", max - min)
        }
        BodySource::Analytic(shape) => ("object.shape", extent(shape)),
    };
    let longest = own.max_element();
    if longest < LARGE {
        return Ok(());
    }
    let shape = shape_of(&scene.object);
    // Chords of a fiftieth of the length lose per cents of a volume, which is enough for a word.
    let volume = shape.surface(0.02 * longest).volume();
    let mass = match scene.material.inertia {
        Inertia::Density(d) => d * volume,
        Inertia::Mass(m) => m,
    };
    let object = format!("the object's longest side is {longest:.4} m");
    let advice = "is the object in millimetres? convert it to metres (scale by 0.001)";
    let width = (volume / longest).sqrt();
    for (i, c) in scene.clamps.iter().enumerate() {
        // A group lies on the body, in its unit.
        let ClampRegion::Box { min, max, .. } = c.region else { continue };
        let size = (max - min).length();
        if size < FAR_SMALLER * width {
            return Err(source.fault(&format!("clamp.{i}.box"), format!("its diagonal is {size:.4} m, {object}; {advice}")));
        }
    }
    for (i, p) in scene.planes.iter().enumerate() {
        if cuts(p, shape.as_ref(), width) {
            let height = p.normal.dot(p.point);
            let text = format!("it cuts the object {height:.4} m from the origin, {object}; {advice}");
            return Err(source.fault(&format!("plane.{i}.point"), text));
        }
    }
    let mass = if mass < 1e4 { format!("{mass:.2}") } else { format!("{mass:.2e}") };
    let text = format!("its longest side is {longest:.4} m and its mass {mass} kg; in millimetres? lengths are in metres");
    warnings.push(source.fault(key, text).to_string());
    Ok(())
}

/// True for a plane that has more than a tenth of the body on its forbidden side and stands, measured by the body, next to the origin,
/// though not through it: a plane that was put under or beside a body a thousand times smaller.
fn cuts(plane: &Plane, shape: &dyn Shape, width: f64) -> bool {
    let (min, max) = shape.bounds();
    let corner = |i: u32| DVec3::from_array(std::array::from_fn(|a| if i >> a & 1 == 1 { max[a] } else { min[a] }));
    let heights = (0..8).map(|i| plane.normal.dot(corner(i) - plane.point));
    let (low, high) = heights.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), x| (l.min(x), h.max(x)));
    let offset = plane.normal.dot(plane.point).abs();
    low < -0.1 * (high - low) && offset > 0.0 && offset < FAR_SMALLER * width
}

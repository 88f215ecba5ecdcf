//! The body that a scene states, cut into tetrahedra, with a change that the scene does not know.

use super::body::Body;
use super::change::Change;
use super::loads::{Loads, Plane};
use super::material::Material;
use super::mesh::Mesh;
use glam::DVec3;
use palpate_model::scene::{Analytic, BodySource, Clamp, Inertia, Scene};

/// Density of the air [kg/m³].
const AIR: f64 = 1.2;
/// Penetration of the ground, over the body's size, at a pressure of a quarter of Young's modulus.
const PENETRATION: f64 = 1e-3;
/// Bricks along the shortest side of a block, of a plate one.
const THIN: usize = 2;
/// Bricks along the side of the cube in a ball: its surface, drawn by quadratic faces, is then in the mean within 3e-4 of its radius.
const ROUND: usize = 4;
/// The second side over the shortest from which on a block is a plate: one quadratic element across bends right.
const PLATE: f64 = 3.0;
/// Longest edge of a brick over the shortest side of the block, along sides that bend.
const LONG: f64 = 0.8;
/// The same of the first brick beside a clamp's edge, where strains change most.
const FIRST: f64 = 0.15;

/// The mesh of a scene's shape, blocks and balls, with edges shorter by `fine`.
///
/// # Errors
/// The shape is another.
pub fn mesh(scene: &Scene, fine: usize) -> Result<Mesh, String> {
    match &scene.object.source {
        BodySource::Analytic(Analytic::Ball { radius, center }) => Ok(Mesh::ball(*center, *radius, ROUND * fine, fine)),
        BodySource::Analytic(Analytic::Box { min, max }) => {
            let size = *max - *min;
            let thin = size.min_element();
            let second = size.x.min(size.y).max(size.x.max(size.y).min(size.z));
            let across = if second > PLATE * thin { 1 } else { THIN };
            let along = |a: usize| {
                let edges = scene.clamps.iter().filter_map(Clamp::corners).flat_map(|(min, max)| [min[a], max[a]]);
                let inside = edges.filter(|e| *e > min[a] + 1e-9 && *e < max[a] - 1e-9);
                planes(min[a], max[a], inside.collect(), thin, across, fine as f64)
            };
            Ok(Mesh::block([0, 1, 2].map(along).each_ref().map(Vec::as_slice)))
        }
        _ => Err(format!("{}: tetrahedra are cut of boxes and balls alone", scene.path.display())),
    }
}

/// Planes across a side, through the edges of clamps; beside one they lie closer together, where strains change most.
fn planes(low: f64, high: f64, mut edges: Vec<f64>, thin: f64, across: usize, fine: f64) -> Vec<f64> {
    edges.sort_by(f64::total_cmp);
    let mut stations = vec![low];
    stations.extend(&edges);
    stations.push(high);
    let mut out = vec![low];
    for pair in stations.windows(2) {
        let length = pair[1] - pair[0];
        let most = if length > 2.5 * thin { LONG * thin / fine } else { 1.001 * thin / (across as f64 * fine) };
        // Bricks grow by half from an edge on until they are as long as allowed.
        let (mut steps, mut sum) = (Vec::new(), 0.0);
        let mut step = if edges.contains(&pair[0]) || edges.contains(&pair[1]) { FIRST * thin / fine } else { most };
        while sum < length - 1e-9 {
            steps.push(step);
            sum += step;
            step = (1.5 * step).min(most);
        }
        if edges.contains(&pair[1]) && !edges.contains(&pair[0]) {
            steps.reverse();
        }
        let mut x = pair[0];
        for s in &steps[..steps.len() - 1] {
            x += s * length / sum;
            out.push(x);
        }
        out.push(pair[1]);
    }
    out
}

/// The true body.
///
/// # Errors
/// The scene's shape is neither a block nor a ball.
pub fn body(scene: &Scene, change: &Change, fine: usize) -> Result<Body, String> {
    let mut mesh = mesh(scene, fine)?;
    let m = &scene.material;
    let boxes: Vec<(DVec3, DVec3)> = scene.clamps.iter().filter_map(Clamp::corners).collect();
    let held = |x: &DVec3| boxes.iter().any(|(min, max)| x.cmpge(*min - 1e-9).all() && x.cmple(*max + 1e-9).all());
    let held = mesh.nodes.iter().map(held).collect();
    // Of the shape that the scene states: it says which part is which, also where the true one is bent.
    let centers: Vec<DVec3> = mesh.tets.iter().map(|t| t.iter().take(4).map(|n| mesh.nodes[*n]).sum::<DVec3>() / 4.0).collect();
    let low = mesh.nodes.iter().copied().fold(DVec3::INFINITY, DVec3::min);
    let high = mesh.nodes.iter().copied().fold(DVec3::NEG_INFINITY, DVec3::max);
    if change.bend != 0.0 {
        let middle = boxes.first().map_or(0.5 * (low.x + high.x), |(min, max)| 0.5 * (min.x.max(low.x) + max.x.min(high.x)));
        let anchor = DVec3::new(middle, 0.5 * (low.y + high.y), 0.5 * (low.z + high.z));
        mesh.nodes.iter_mut().for_each(|x| *x = bent(*x, anchor, change.bend));
    }
    let material = Material::new(m.youngs_modulus, m.poisson_ratio + change.poisson);
    let Inertia::Density(density) = m.inertia else {
        return Err(format!("{}: tetrahedra want the density, not the mass", scene.path.display()));
    };
    let mut body = Body::new(mesh, material, density);
    if let Some(spot) = change.dense {
        for (mass, _) in body.mass.iter_mut().zip(&centers).filter(|(_, c)| c.distance(spot.center) < spot.radius) {
            mass.iter_mut().flatten().for_each(|m| *m *= spot.factor);
        }
    }
    for (place, mass) in &change.masses {
        let (face, _) = body.mesh.nearest(*place);
        let corners = [0, 1, 2].map(|k| body.mesh.nodes[body.mesh.faces[face][k]]);
        body.attach(*mass, |c| c == corners);
    }
    body.mass_damping = m.mass_damping + change.damping[0];
    body.stiffness_damping = m.stiffness_damping + change.damping[1];
    body.held = held;
    for (stiffness, c) in body.stiffness.iter_mut().zip(&centers) {
        if let Some((direction, distance, factor)) = change.soft
            && c.dot(direction) > distance
        {
            *stiffness *= factor;
        }
        if let Some(spot) = change.inclusion.filter(|s| c.distance(s.center) < s.radius) {
            *stiffness *= spot.factor;
        }
    }
    let layer = PENETRATION * (high - low).min_element();
    let plane = scene.planes.first().map(|p| Plane {
        normal: p.normal,
        height: p.point.dot(p.normal) + change.height,
        stiffness: 0.25 * m.youngs_modulus / (layer * layer),
        friction: change.friction,
    });
    body.loads = Loads {
        gravity: scene.gravity + change.gravity,
        force: change.force,
        drag: 0.5 * AIR * change.drag,
        magnet: None,
        plane,
    };
    Ok(body)
}

/// A straight bar along x through `anchor`, bent there to an arc of this curvature towards z.
fn bent(x: DVec3, anchor: DVec3, curvature: f64) -> DVec3 {
    let d = x - anchor;
    let (angle, radius) = (curvature * d.x, 1.0 / curvature - d.z);
    anchor + DVec3::new(radius * angle.sin(), d.y, 1.0 / curvature - radius * angle.cos())
}

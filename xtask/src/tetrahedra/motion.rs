//! The motion of a changed body: its places at the times of frames.

use super::change::Change;
use super::integrator::{Integrator, State};
use super::mesh::Mesh;
use super::outside::Parts;
use super::solid;
use glam::DVec3;
use palpate::Error;
use palpate_model::scene::Scene;

/// Places of the nodes at a time.
#[derive(Clone, Debug)]
pub struct Instant {
    /// Since the start [s].
    pub time: f64,
    /// Where the nodes are [m].
    pub places: Vec<DVec3>,
}

/// A body that was watched.
#[derive(Clone, Debug)]
pub struct Motion {
    /// Its stated shape.
    pub(super) mesh: Mesh,
    /// Where it was.
    pub instants: Vec<Instant>,
}

/// How finely a body is computed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Resolution {
    /// Edges of elements are shorter by this than the usual ones.
    pub fine: usize,
    /// Steps in one of the scene.
    pub substeps: usize,
}

/// Moves the body of a scene with a change and keeps these times (since the start, rising).
///
/// # Errors
/// The shape is neither a block nor a ball, or a step has no solution.
pub fn simulate(scene: &Scene, change: &Change, times: &[f64], of: Resolution) -> Result<Motion, Error> {
    let body = solid::body(scene, change, of.fine).map_err(Error::Input)?;
    let mut parts = Parts::new(&body);
    let pivot = scene.initial.pivot.unwrap_or_else(|| body.mesh.nodes.iter().sum::<DVec3>() / body.mesh.nodes.len() as f64);
    let spin = scene.initial.angular_velocity + change.spin;
    let start = body.mesh.nodes.iter().map(|x| scene.initial.velocity + change.velocity + spin.cross(*x - pivot)).collect();
    let step = scene.time.step / of.substeps as f64;
    let mut motion = Integrator::new(body, start, step).map_err(Error::Failed)?;
    let mut waiting = times.iter().copied().peekable();
    let mut instants = Vec::new();
    let mut now = 0.0;
    for _ in 0..scene.time.steps * of.substeps {
        if waiting.peek().is_none() {
            break;
        }
        let before = motion.state().clone();
        if let Some(outside) = &change.outside {
            outside.act(motion.body_mut(), &mut parts, &before, now + step);
        }
        if let Some((on, anchor, stiffness)) = change.tether {
            let body = motion.body_mut();
            let near = parts.near(body, on);
            let at: DVec3 = near.iter().map(|(k, share)| *share * (body.mesh.nodes[*k] + before.u[*k])).sum();
            body.forces = vec![DVec3::ZERO; before.u.len()];
            near.iter().for_each(|(k, share)| body.forces[*k] = stiffness * *share * (anchor - at));
        }
        motion.advance().map_err(|e| Error::Failed(format!("{e} at {now:.4} s")))?;
        while let Some(time) = waiting.next_if(|t| *t <= now + step + 1e-9) {
            let u = between(&before, motion.state(), step, (time - now) / step);
            instants.push(Instant { time, places: motion.body().mesh.nodes.iter().zip(&u).map(|(x, u)| *x + *u).collect() });
        }
        now += step;
    }
    Ok(Motion { mesh: solid::mesh(scene, of.fine).map_err(Error::Input)?, instants })
}

/// The cubic through two states and their velocities.
fn between(a: &State, b: &State, step: f64, s: f64) -> Vec<DVec3> {
    let (s2, s3) = (s * s, s * s * s);
    let w = [1.0 - 3.0 * s2 + 2.0 * s3, 3.0 * s2 - 2.0 * s3, step * (s - 2.0 * s2 + s3), step * (s3 - s2)];
    (0..a.u.len()).map(|n| w[0] * a.u[n] + w[1] * b.u[n] + w[2] * a.v[n] + w[3] * b.v[n]).collect()
}

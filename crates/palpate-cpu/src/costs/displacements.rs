//! Displacements of simulation nodes that were observed directly: simulated minus measured.

use super::{Along, Cost, Look, Residuals, Sums};
use glam::DVec3;
use palpate_engine::{Misfit, ReadingResidual, ResidualRow, Source};
use palpate_model::observation::{ReadingKind, Sensor};
use std::sync::Arc;

/// The cost.
#[derive(Debug)]
pub struct Displacements;

impl Cost for Displacements {
    fn compare(&self, look: Look, u: &[DVec3], sums: &mut Sums) -> Arc<dyn Residuals> {
        let off: Vec<DVec3> = look.seen().displacements.iter().map(|d| u[d.node as usize] - d.value).collect();
        let noise = look.observation.noise(ReadingKind::Displacement);
        off.iter().for_each(|r| sums.add_vector(*r, noise));
        Arc::new(Offsets { off })
    }
}

/// Residual of every observed node [m].
#[derive(Debug)]
struct Offsets {
    off: Vec<DVec3>,
}

impl Residuals for Offsets {
    fn readings(&self, look: Look) -> Vec<ReadingResidual> {
        let pairs = look.seen().displacements.iter().zip(&self.off);
        pairs
            .map(|(d, r)| ReadingResidual {
                sensor: Sensor::Nodes,
                item: d.node,
                place: look.plan.body.nodes[d.node as usize] + d.value,
                misfit: Some(Misfit::Offset(*r)),
            })
            .collect()
    }

    fn influences(&self, look: Look, scale: f64) -> Vec<f64> {
        let noise = look.observation.noise(ReadingKind::Displacement);
        let factor = scale / (noise * noise);
        self.off.iter().flat_map(|r| (factor * *r).to_array()).collect()
    }

    fn rows(&self, look: Look, _u: &[DVec3], along: Along, visit: &mut dyn FnMut(ResidualRow, &[f64])) {
        let noise = look.observation.noise(ReadingKind::Displacement);
        let mut d = vec![0.0; along.du.len()];
        for (seen, off) in look.seen().displacements.iter().zip(&self.off) {
            let node = seen.node as usize;
            for axis in 0..3u8 {
                let a = usize::from(axis);
                d.iter_mut().zip(along.du).for_each(|(d, du)| *d = du[node][a]);
                let source = Source { sensor: Sensor::Nodes, item: seen.node, axis };
                visit(ResidualRow::coordinate(look.frame, source, off[a], noise, look.plan.body.nodes[node]), &d);
            }
        }
    }

    fn pull(&self, look: Look, _u: &[DVec3], factors: &[f64], out: &mut [DVec3], _theta: &mut [f64]) {
        for (seen, f) in look.seen().displacements.iter().zip(factors.chunks_exact(3)) {
            out[seen.node as usize] += DVec3::from_slice(f);
        }
    }
}

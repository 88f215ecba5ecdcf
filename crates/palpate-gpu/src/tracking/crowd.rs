//! What the host prepares: everything from a common centre, in single precision, and the lattice of cubes.

use super::MOST_ITEMS;
use crate::device::GpuError;
use crate::layout::{Crowd, Eye};
use glam::DVec3;
use palpate_engine::tracking::Sighting;

/// Entries that a workgroup of `sort_blocks` sorts.
pub(super) const BLOCK: u32 = 512;
/// Most cubes along an axis that places lie in; there is one more on either side.
const MOST_CUBES: f64 = 62.0;
/// The most that outliers may weigh: all that do not belong to a place then belong to nothing, and sums stay finite.
const MOST_FLOOR: f64 = 1e30;

/// What is to be found out, with the lengths that matter to it [m].
#[derive(Clone, Copy, Debug)]
pub(super) enum Task {
    /// Shares of a mixture.
    Mix { reach: f64, spread: f64, floor: f64, thin: usize },
    /// Who sees whom.
    See,
    /// Which places have been read.
    Read { reach: f64 },
    /// Which rays pass through.
    Pierce,
}

/// Everything that kernels read.
#[derive(Debug)]
pub(super) struct Prepared {
    pub(super) crowd: Crowd,
    /// Position, area over the mean `[K]`.
    pub(super) places: Vec<[f32; 4]>,
    /// `[K]`.
    pub(super) normals: Vec<[f32; 4]>,
    /// Position, camera `[N]`.
    pub(super) points: Vec<[f32; 4]>,
    /// `[C]`.
    pub(super) eyes: Vec<Eye>,
}

fn four(v: DVec3, w: f64) -> [f32; 4] {
    [v.x as f32, v.y as f32, v.z as f32, w as f32]
}

impl Prepared {
    /// # Errors
    /// More places or points than a kernel can loop over.
    pub(super) fn new(s: &Sighting, task: Task) -> Result<Prepared, GpuError> {
        for (what, count) in [("the surface's places", s.places.len()), ("a frame's depth points", s.points.len())] {
            if count > MOST_ITEMS {
                let (limit, available) = ("loop iterations of one invocation", MOST_ITEMS as u64);
                return Err(GpuError::Limit { limit, available, needed: count as u64, what: format!("tracking with {what}") });
            }
        }
        let (low, high) = s
            .places
            .iter()
            .fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(low, high), p| (low.min(p.position), high.max(p.position)));
        let center = 0.5 * (low + high);
        let area = s.places.iter().map(|p| p.area).sum::<f64>() / s.places.len() as f64;
        let scale = if area > 0.0 { 1.0 / area } else { 1.0 };
        let eyes = s.eyes().into_iter().map(|eye| {
            eye.map_or(Eye::default(), |e| Eye {
                center: four(e.center - center, 1.0),
                axis: four(e.axis, 1.0 / e.pixel),
                right: four(e.right, 0.0),
                down: four(e.down, 0.0),
            })
        });
        Ok(Prepared {
            crowd: crowd(s, task, low - center, high - low),
            // What is seen is told from what is not by a weight, however small.
            places: s.places.iter().map(|p| four(p.position - center, (p.area * scale).max(1e-30))).collect(),
            normals: s.places.iter().map(|p| four(p.normal, 0.0)).collect(),
            points: s.points.iter().map(|p| four(p.position - center, p.camera.into())).collect(),
            eyes: eyes.collect(),
        })
    }
}

/// Sizes, lengths, and the lattice around places whose lowest corner and extent [m] these are.
fn crowd(s: &Sighting, task: Task, low: DVec3, extent: DVec3) -> Crowd {
    let (places, points, cameras) = (s.places.len() as u32, s.points.len() as u32, s.cameras.len() as u32);
    let (slack, near) = match task {
        Task::Mix { reach, .. } | Task::Read { reach } => (s.slack(), reach),
        Task::See => (s.slack(), s.slack()),
        Task::Pierce => (s.depth(), s.depth()),
    };
    // Points farther than a cube from all places have no place near them.
    let edge = near.max(extent.max_element() / MOST_CUBES);
    let cubes = extent.to_array().map(|a| (a / edge).clamp(0.0, MOST_CUBES) as u32 + 3);
    let mut crowd = Crowd {
        places,
        points,
        cameras,
        thin: 1,
        span: places.max(points).next_multiple_of(BLOCK),
        // Places, points, pictures.
        sections: 2 + cameras,
        cells: cubes.iter().product(),
        cubes,
        low: (low - DVec3::splat(edge)).as_vec3().to_array(),
        inverse_edge: (1.0 / edge) as f32,
        reach: (near * near) as f32,
        slack: slack as f32,
        ..Crowd::default()
    };
    match task {
        Task::Mix { spread, floor, thin, .. } => {
            crowd.thin = thin as u32;
            crowd.falloff = (-0.5 / (spread * spread)) as f32;
            crowd.floor = floor.min(MOST_FLOOR) as f32;
        }
        Task::Read { .. } => crowd.sections += cameras,
        Task::See | Task::Pierce => {}
    }
    crowd
}

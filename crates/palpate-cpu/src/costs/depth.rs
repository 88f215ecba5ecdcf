//! Depth points: signed distance φ from the deformed surface, under a robust kernel (sparse surface inversion).

use super::matching::{Match, PointHash, Seen, extend, extend_transposed, match_points};
use super::{Along, Cost, Look, Residuals, Sums};
use crate::linear::vector::Nodes;
use glam::DVec3;
use palpate_engine::{Misfit, ReadingResidual, ResidualRow, Source};
use palpate_model::cutcells::band_lookup::BandLookup;
use palpate_model::observation::{Camera, Observation, ObservedPoint, ReadingKind, kernel};
use palpate_model::plan::Plan;
use std::sync::Arc;

/// Tables of a recording's depth points, made once.
#[derive(Debug)]
pub struct Depth {
    lookup: BandLookup,
    /// Points of every frame as the recording has them.
    hashes: Vec<PointHash>,
}

impl Depth {
    /// Hashes the points of every frame.
    pub fn new(plan: &Plan, observation: &Observation) -> Depth {
        let hash = |points: &[ObservedPoint]| PointHash::new(points, plan.body.length);
        Depth { lookup: BandLookup::of(&plan.body.band), hashes: observation.frames.iter().map(|f| hash(&f.points)).collect() }
    }

    /// Places of a frame's points on the body at displacement `u` `[N]`, by rising point; of those that met it.
    pub fn matches(&self, look: Look, u: &[DVec3]) -> Vec<Match> {
        let (body, obs, points) = (&*look.plan.body, look.observation, &look.seen().points);
        let recorded = (points.as_slice(), obs.cameras.as_slice());
        let reach = (look.plan.band, noise(look));
        if points.is_empty() {
            Vec::new()
        } else if let Some(moved) = look.sensors.points(&obs.cameras, points) {
            let hash = PointHash::new(&moved, body.length);
            let seen = Seen { points: &moved, cameras: &look.sensors.cameras(&obs.cameras), recorded };
            match_points(body, &extend(body, u), &hash, seen, &self.lookup, reach)
        } else {
            let seen = Seen { points, cameras: &obs.cameras, recorded };
            match_points(body, &extend(body, u), &self.hashes[look.frame], seen, &self.lookup, reach)
        }
    }
}

impl Cost for Depth {
    fn compare(&self, look: Look, u: &[DVec3], sums: &mut Sums) -> Arc<dyn Residuals> {
        let (band, points) = (look.plan.band, look.seen().points.len());
        let matches = self.matches(look, u);
        let per_point = 1.0 / (noise(look) * noise(look));
        // A point without a match costs what one at the edge of the band costs.
        sums.cost += (points - matches.len()) as f64 * kernel::unmatched(band) * per_point;
        sums.matched += matches.len();
        for m in &matches {
            sums.cost += kernel::cost(m.place.phi, band) * per_point;
            sums.squares += m.place.phi * m.place.phi;
            sums.signed += m.place.phi;
        }
        Arc::new(Distances { matches })
    }
}

/// Distances of a frame's points.
#[derive(Debug)]
struct Distances {
    /// Points that met the body, in the frame's order.
    matches: Vec<Match>,
}

impl Residuals for Distances {
    fn readings(&self, look: Look) -> Vec<ReadingResidual> {
        let reading = |(item, p): (usize, &ObservedPoint)| ReadingResidual {
            sensor: look.observation.sensor_of_point(p),
            item: item as u32,
            place: p.position,
            misfit: None,
        };
        let mut all: Vec<ReadingResidual> = look.seen().points.iter().enumerate().map(reading).collect();
        self.matches.iter().for_each(|m| all[m.point as usize].misfit = Some(Misfit::Distance(m.place.phi)));
        all
    }

    fn influences(&self, look: Look, scale: f64) -> Vec<f64> {
        let factor = scale / (noise(look) * noise(look));
        let mut all = vec![0.0; look.seen().points.len()];
        for m in &self.matches {
            all[m.point as usize] = factor * kernel::influence(m.place.phi, look.plan.band);
        }
        all
    }

    fn rows(&self, look: Look, _u: &[DVec3], along: Along, visit: &mut dyn FnMut(ResidualRow, &[f64])) {
        let points = &look.seen().points;
        let zero = vec![0.0; along.du.len()];
        let unmatched = |from: usize, to: usize, visit: &mut dyn FnMut(ResidualRow, &[f64])| {
            (from..to).for_each(|n| visit(bare(look, n as u32), &zero));
        };
        let extended: Vec<Nodes> = match self.matches.is_empty() {
            true => Vec::new(),
            false => along.du.iter().map(|d| extend(&look.plan.body, d)).collect(),
        };
        let mut d = vec![0.0; along.du.len()];
        let mut seen = 0;
        for m in &self.matches {
            let point = m.point as usize;
            unmatched(seen, point, visit);
            seen = point + 1;
            let (nodes, weights) = m.stencil(&look.plan.body);
            for (r, d) in d.iter_mut().zip(&extended) {
                *r = -m.place.gradient.dot((0..8).map(|i| weights[i] * d[nodes[i] as usize]).sum());
            }
            let mut direct = Vec::new();
            slopes(look, &points[point], |at| along.moves(at), |at, by| direct.push((at, m.place.gradient.dot(by))));
            along.add_direct(&direct, &mut d);
            visit(row(look, m), &d);
        }
        unmatched(seen, points.len(), visit);
    }

    fn pull(&self, look: Look, _u: &[DVec3], factors: &[f64], out: &mut [DVec3], theta: &mut [f64]) {
        if self.matches.is_empty() {
            return;
        }
        let body = &*look.plan.body;
        let mut extended = vec![DVec3::ZERO; out.len() + body.band.nodes.len()];
        for m in &self.matches {
            let (nodes, weights) = m.stencil(body);
            let g = -factors[m.point as usize] * m.place.gradient;
            for i in 0..8 {
                extended[nodes[i] as usize] += weights[i] * g;
            }
            slopes(look, &look.seen().points[m.point as usize], |_| true, |at, by| theta[at] -= g.dot(by));
        }
        out.iter_mut().zip(extend_transposed(body, &extended)).for_each(|(o, g)| *o += g);
    }
}

fn noise(look: Look) -> f64 {
    look.observation.noise(ReadingKind::Depth)
}

fn camera<'a>(look: Look<'a>, point: &ObservedPoint) -> &'a Camera {
    &look.observation.cameras[point.camera as usize]
}

/// ∂(true point)/∂θ by what measurement effects do, at the places in θ that are wanted.
fn slopes(look: Look, point: &ObservedPoint, wanted: impl Fn(usize) -> bool, add: impl FnMut(usize, DVec3)) {
    look.sensors.point_slopes(camera(look, point), point, wanted, add);
}

/// A point that met nothing.
fn bare(look: Look, point: u32) -> ResidualRow {
    let seen = &look.seen().points[point as usize];
    ResidualRow {
        frame: look.frame,
        source: Source::point(point, look.observation.sensor_of_point(seen)),
        value: None,
        noise: noise(look),
        weight: 0.0,
        rest: seen.position,
        along_sight: 0.0,
        by_place: DVec3::ZERO,
    }
}

fn row(look: Look, m: &Match) -> ResidualRow {
    let band = &look.plan.body.band;
    let seen = &look.seen().points[m.point as usize];
    let (camera, gradient) = (camera(look, seen), m.place.gradient);
    let sight = DVec3::from_array(look.sensors.truth(camera, seen).ray()).normalize_or_zero();
    ResidualRow {
        value: Some(m.place.phi),
        weight: kernel::weight(m.place.phi, look.plan.band),
        rest: band.grid.position(band.cells[m.cell as usize].lattice) + band.grid.h * m.place.xi,
        // Without a line of sight errors may have any direction.
        along_sight: if *camera == Camera::Unknown { gradient.length() } else { gradient.dot(sight) },
        by_place: gradient,
        ..bare(look, m.point)
    }
}

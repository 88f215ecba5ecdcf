//! Comparison of a simulated instant with a frame: cost, gradient, Gauss–Newton terms.
//!
//! Frame times need not be multiples of the step: between two states the displacement is the cubic Hermite curve through both
//! displacements and velocities.

use crate::linear::vector::Nodes;
use crate::passes::markers::Carried;
use crate::passes::matching::{BandLookup, Match, PointHash, extend, extend_transposed, match_points};
use glam::DVec3;
use palpate_engine::{FrameResiduals, ResidualRow, Rows, Source};
use palpate_model::kernel;
use palpate_model::plan::Plan;

/// Place of a frame inside a step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Instant {
    /// Number of the frame.
    pub frame: usize,
    /// Factors of u₀, v₀, u₁, v₁.
    pub value: [f64; 4],
    /// Derivatives of the factors by time [1/s]; zero where the state is held.
    pub rate: [f64; 4],
}

/// Frames that belong to step k of a simulation that starts at `start` on the recording's clock.
pub fn instants(plan: &Plan, start: f64, k: usize) -> Vec<Instant> {
    let frames = &plan.observation.frames;
    let (dt, steps) = (plan.clock.step, plan.clock.steps);
    if steps == 0 {
        let hold = |frame| Instant { frame, value: [1.0, 0.0, 0.0, 0.0], rate: [0.0; 4] };
        return (0..frames.len()).map(hold).collect();
    }
    let place = |time: f64| {
        let x = (time - start) / dt;
        // A frame on a step boundary belongs to the step that ends there, also after rounding.
        let x = if (x - x.round()).abs() < 1e-9 { x.round() } else { x };
        let step = (x.ceil() - 1.0).clamp(0.0, steps as f64 - 1.0);
        (step as usize, x - step)
    };
    let first = frames.partition_point(|f| place(f.time).0 < k);
    let last = frames.partition_point(|f| place(f.time).0 <= k);
    (first..last)
        .map(|frame| {
            let s = place(frames[frame].time).1;
            if s < 0.0 {
                return Instant { frame, value: [1.0, 0.0, 0.0, 0.0], rate: [0.0; 4] };
            }
            if s > 1.0 {
                return Instant { frame, value: [0.0, 0.0, 1.0, 0.0], rate: [0.0; 4] };
            }
            let (s2, s3) = (s * s, s * s * s);
            Instant {
                frame,
                value: [2.0 * s3 - 3.0 * s2 + 1.0, (s3 - 2.0 * s2 + s) * dt, -2.0 * s3 + 3.0 * s2, (s3 - s2) * dt],
                rate: [(6.0 * s2 - 6.0 * s) / dt, 3.0 * s2 - 4.0 * s + 1.0, (-6.0 * s2 + 6.0 * s) / dt, 3.0 * s2 - 2.0 * s],
            }
        })
        .collect()
}

/// Σ factor · vector over u₀, v₀, u₁, v₁.
pub fn blend(factors: &[f64; 4], vectors: [&[DVec3]; 4]) -> Nodes {
    (0..vectors[0].len()).map(|i| (0..4).map(|c| factors[c] * vectors[c][i]).sum()).collect()
}

/// A frame compared with one displacement field.
#[derive(Clone, Debug)]
pub struct Compared {
    /// Matched points.
    pub matches: Vec<Match>,
    /// Σ ρ(r)/σ², not yet divided by the number of residuals.
    pub cost: f64,
    /// Scalar residuals that met something.
    pub matched: usize,
    /// Σ r² of those [m²].
    pub sum_squares: f64,
    /// Σ φ of matched points [m].
    pub sum_signed: f64,
}

/// Compares a frame with displacement `u`.
pub fn compare(plan: &Plan, lookup: &BandLookup, hash: &PointHash, frame: usize, u: &[DVec3]) -> Compared {
    let (body, obs) = (&*plan.body, &*plan.observation);
    let f = &obs.frames[frame];
    let matches = if f.points.is_empty() {
        Vec::new()
    } else {
        match_points(body, &extend(body, u), hash, &f.points, &obs.cameras, lookup, obs.depth_noise)
    };
    let per_point = 1.0 / (obs.depth_noise * obs.depth_noise);
    // A point without a match costs what one at the edge of the band costs.
    let mut cost = (f.points.len() - matches.len()) as f64 * kernel::unmatched(plan.band) * per_point;
    let (mut matched, mut sum_squares, mut sum_signed) = (matches.len(), 0.0, 0.0);
    for m in &matches {
        cost += kernel::cost(m.place.phi, plan.band) * per_point;
        sum_squares += m.place.phi * m.place.phi;
        sum_signed += m.place.phi;
    }
    let mut vectors = |residuals: &mut dyn Iterator<Item = DVec3>, noise: f64| {
        for r in residuals {
            cost += 0.5 * r.length_squared() / (noise * noise);
            sum_squares += r.length_squared();
            matched += 3;
        }
    };
    let marker = |m: &palpate_model::observation::ObservedMarker| {
        Carried::new(body, &obs.markers[m.site as usize], u).position - m.position
    };
    vectors(&mut f.markers.iter().map(marker), obs.marker_noise);
    vectors(&mut f.displacements.iter().zip(u).map(|(d, u)| *u - *d), obs.displacement_noise);
    Compared { matches, cost, matched, sum_squares, sum_signed }
}

/// dJ/du of a compared frame, `[N]`; `scale` is 1/n.
pub fn gradient(plan: &Plan, frame: usize, compared: &Compared, u: &[DVec3], scale: f64) -> Nodes {
    let (body, obs) = (&*plan.body, &*plan.observation);
    let f = &obs.frames[frame];
    let mut out = if compared.matches.is_empty() {
        vec![DVec3::ZERO; u.len()]
    } else {
        let mut extended = vec![DVec3::ZERO; u.len() + body.band.nodes.len()];
        let factor = scale / (obs.depth_noise * obs.depth_noise);
        for m in &compared.matches {
            let (nodes, weights) = m.stencil(body);
            let g = -factor * kernel::influence(m.place.phi, plan.band) * m.place.gradient;
            for i in 0..8 {
                extended[nodes[i] as usize] += weights[i] * g;
            }
        }
        extend_transposed(body, &extended)
    };
    let factor = scale / (obs.marker_noise * obs.marker_noise);
    for m in &f.markers {
        let site = &obs.markers[m.site as usize];
        let carried = Carried::new(body, site, u);
        carried.adjoint(site, factor * (carried.position - m.position), &mut out);
    }
    let factor = scale / (obs.displacement_noise * obs.displacement_noise);
    for (i, d) in f.displacements.iter().enumerate() {
        out[i] += factor * (u[i] - *d);
    }
    out
}

/// Hands every scalar residual of a frame to `visit`, with its derivatives along the displacement derivatives `du[q]` `[Q]`.
/// Matched points come in their order; points that met nothing are left out.
pub fn rows(
    plan: &Plan,
    frame: usize,
    compared: &Compared,
    u: &[DVec3],
    du: &[Nodes],
    mut visit: impl FnMut(ResidualRow, &[f64]),
) {
    let (body, obs) = (&*plan.body, &*plan.observation);
    let f = &obs.frames[frame];
    let mut d = vec![0.0; du.len()];
    if !compared.matches.is_empty() {
        let extended: Vec<Nodes> = du.iter().map(|d| extend(body, d)).collect();
        for m in &compared.matches {
            let (nodes, weights) = m.stencil(body);
            for (r, d) in d.iter_mut().zip(&extended) {
                *r = -m.place.gradient.dot((0..8).map(|i| weights[i] * d[nodes[i] as usize]).sum());
            }
            let seen = &f.points[m.point as usize];
            let sight = (seen.position - obs.cameras[seen.camera as usize].center).normalize_or_zero();
            let row = ResidualRow {
                frame,
                source: Source::Point { point: m.point, camera: seen.camera },
                value: Some(m.place.phi),
                noise: obs.depth_noise,
                weight: kernel::weight(m.place.phi, plan.band),
                rest: body.grid.position(body.band.cells[m.cell as usize].lattice) + body.grid.h * m.place.xi,
                along_sight: m.place.gradient.dot(sight),
            };
            visit(row, &d);
        }
    }
    let mut vector = |noise: f64, rest: DVec3, r: DVec3, source: &dyn Fn(u8) -> Source, change: &dyn Fn(&Nodes) -> DVec3| {
        let changes: Vec<DVec3> = du.iter().map(change).collect();
        for a in 0..3u8 {
            for (d, c) in d.iter_mut().zip(&changes) {
                *d = c[usize::from(a)];
            }
            let value = Some(r[usize::from(a)]);
            visit(ResidualRow { frame, source: source(a), value, noise, weight: 1.0, rest, along_sight: 1.0 }, &d);
        }
    };
    for m in &f.markers {
        let site = &obs.markers[m.site as usize];
        let carried = Carried::new(body, site, u);
        let rest = site.carry(|i| body.nodes[i]).0;
        let source = |axis| Source::Marker { site: m.site, axis };
        vector(obs.marker_noise, rest, carried.position - m.position, &source, &|d| carried.tangent(site, d));
    }
    for (i, d) in f.displacements.iter().enumerate() {
        let source = |axis| Source::Node { node: i as u32, axis };
        vector(obs.displacement_noise, body.nodes[i], u[i] - *d, &source, &|d| d[i]);
    }
}

/// As [`rows`], all together: points that met nothing stand in their place, without value and with derivatives of zero.
pub fn all_rows(plan: &Plan, frame: usize, compared: &Compared, u: &[DVec3], du: &[Nodes]) -> Rows {
    let obs = &*plan.observation;
    let points = &obs.frames[frame].points;
    let mut out = Rows::default();
    let zero = vec![0.0; du.len()];
    let mut seen = 0;
    let unmatched = |n: usize| ResidualRow {
        frame,
        source: Source::Point { point: n as u32, camera: points[n].camera },
        value: None,
        noise: obs.depth_noise,
        weight: 0.0,
        rest: points[n].position,
        along_sight: 0.0,
    };
    let mut add = |row: ResidualRow, d: &[f64]| {
        out.residuals.push(row);
        out.sensitivity.extend_from_slice(d);
    };
    rows(plan, frame, compared, u, du, |row, d| {
        let upto = if let Source::Point { point, .. } = row.source { point as usize } else { points.len() };
        (seen..upto).for_each(|n| add(unmatched(n), &zero));
        seen = if matches!(row.source, Source::Point { .. }) { upto + 1 } else { upto };
        add(row, d);
    });
    (seen..points.len()).for_each(|n| add(unmatched(n), &zero));
    out
}

/// Adds a frame's Gauss–Newton gradient `[Q]` and matrix `[Q, Q]` for the displacement derivatives `du[q]`.
pub fn gauss_newton(
    plan: &Plan,
    frame: usize,
    compared: &Compared,
    u: &[DVec3],
    du: &[Nodes],
    scale: f64,
    gradient: &mut [f64],
    matrix: &mut [f64],
) {
    let q = du.len();
    rows(plan, frame, compared, u, du, |row, d| {
        let weight = scale * row.weight / (row.noise * row.noise);
        let residual = row.value.unwrap_or(0.0);
        for a in 0..q {
            gradient[a] += weight * residual * d[a];
            for b in 0..q {
                matrix[a * q + b] += weight * d[a] * d[b];
            }
        }
    });
}

/// Every residual of a frame, for reports.
pub fn residuals(plan: &Plan, frame: usize, compared: &Compared, u: &[DVec3]) -> FrameResiduals {
    let obs = &*plan.observation;
    let f = &obs.frames[frame];
    let mut points = vec![None; f.points.len()];
    for m in &compared.matches {
        points[m.point as usize] = Some(m.place.phi);
    }
    let markers =
        f.markers.iter().map(|m| Carried::new(&plan.body, &obs.markers[m.site as usize], u).position - m.position).collect();
    FrameResiduals { frame, points, markers }
}

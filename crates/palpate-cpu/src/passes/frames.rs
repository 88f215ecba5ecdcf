//! Comparison of a simulated instant with a frame: cost, gradient, Gauss–Newton terms.
//!
//! Frame times need not be multiples of the step: between two states the displacement is the cubic Hermite curve through both
//! displacements and velocities.

use crate::linear::vector::Nodes;
use crate::passes::markers::Carried;
use crate::passes::matching::{BandLookup, Match, PointHash, Seen, extend, extend_transposed, match_points};
use glam::DVec3;
use palpate_engine::{Direction, FrameResiduals, ResidualRow, Rows, Source};
use palpate_model::effects::sensors::Sensors;
pub use palpate_model::observation::instant::{Instant, instants};
use palpate_model::observation::kernel;
use palpate_model::plan::Plan;

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

/// A frame of the recording as the measurement effects of one member understand it.
#[derive(Clone, Copy, Debug)]
pub struct Look<'a> {
    /// Body and recording.
    pub plan: &'a Plan,
    /// The member's measurement effects.
    pub sensors: &'a Sensors,
    /// Number of the frame.
    pub frame: usize,
}

/// Compares a frame with displacement `u`; `hash` holds its points as the recording has them.
pub fn compare(look: Look, lookup: &BandLookup, hash: &PointHash, u: &[DVec3]) -> Compared {
    let Look { plan, sensors, frame } = look;
    let (body, obs) = (&*plan.body, &*plan.observation);
    let f = &obs.frames[frame];
    let recorded = (f.points.as_slice(), obs.cameras.as_slice());
    let reach = (plan.band, obs.depth_noise);
    let matches = if f.points.is_empty() {
        Vec::new()
    } else if let Some(points) = sensors.points(&obs.cameras, &f.points) {
        let hash = PointHash::new(&points, body.grid.h);
        let seen = Seen { points: &points, cameras: &sensors.cameras(&obs.cameras), recorded };
        match_points(body, &extend(body, u), &hash, seen, lookup, reach)
    } else {
        let seen = Seen { points: &f.points, cameras: &obs.cameras, recorded };
        match_points(body, &extend(body, u), hash, seen, lookup, reach)
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
    let marker =
        |m: &palpate_model::observation::ObservedMarker| Carried::new(body, &sensors.site(obs, m.site), u).position - m.position;
    vectors(&mut f.markers.iter().map(marker), obs.marker_noise);
    vectors(&mut f.displacements.iter().zip(u).map(|(d, u)| *u - *d), obs.displacement_noise);
    Compared { matches, cost, matched, sum_squares, sum_signed }
}

/// dJ/du of a compared frame, `[N]`; `scale` is 1/n. What measurement effects change besides is added to dJ/dθ, `theta` `[P]`.
pub fn gradient(look: Look, compared: &Compared, u: &[DVec3], scale: f64, theta: &mut [f64]) -> Nodes {
    let Look { plan, sensors, frame } = look;
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
            let seen = &f.points[m.point as usize];
            let camera = &obs.cameras[seen.camera as usize];
            sensors.point_slopes(camera, seen, |_| true, |at, d| theta[at] -= g.dot(d));
        }
        extend_transposed(body, &extended)
    };
    let factor = scale / (obs.marker_noise * obs.marker_noise);
    for m in &f.markers {
        let site = sensors.site(obs, m.site);
        let carried = Carried::new(body, &site, u);
        let adj = factor * (carried.position - m.position);
        carried.adjoint(&site, adj, &mut out);
        for at in sensors.marker_places(m.site) {
            (0..3).for_each(|a| theta[at + a] += adj.dot(carried.by_stalk(a)));
        }
    }
    let factor = scale / (obs.displacement_noise * obs.displacement_noise);
    for (i, d) in f.displacements.iter().enumerate() {
        out[i] += factor * (u[i] - *d);
    }
    out
}

/// Tangents at a frame: places in θ and the displacement's derivatives by them.
#[derive(Clone, Copy, Debug)]
pub struct Along<'a> {
    /// Directions in θ `[Q]`.
    pub directions: &'a [Direction],
    /// Derivatives of the displacement `[Q][N]`.
    pub du: &'a [Nodes],
}

/// Hands every scalar residual of a frame to `visit`, with its derivatives `[Q]`.
/// Matched points come in their order; points that met nothing are left out.
pub fn rows(look: Look, compared: &Compared, u: &[DVec3], along: Along, mut visit: impl FnMut(ResidualRow, &[f64])) {
    let Look { plan, sensors, frame } = look;
    let Along { directions, du } = along;
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
            let camera = &obs.cameras[seen.camera as usize];
            sensors.point_slopes(
                camera,
                seen,
                |at| directions.iter().any(|d| d.component(at) != 0.0),
                |at, by| {
                    let change = m.place.gradient.dot(by);
                    d.iter_mut().zip(directions).for_each(|(d, along)| *d += along.component(at) * change);
                },
            );
            let sight = DVec3::from_array(sensors.truth(camera, seen).ray()).normalize_or_zero();
            let row = ResidualRow {
                frame,
                source: Source::Point { point: m.point, camera: seen.camera },
                value: Some(m.place.phi),
                noise: obs.depth_noise,
                weight: kernel::weight(m.place.phi, plan.band),
                rest: body.grid.position(body.band.cells[m.cell as usize].lattice) + body.grid.h * m.place.xi,
                along_sight: m.place.gradient.dot(sight),
                by_place: m.place.gradient,
            };
            visit(row, &d);
        }
    }
    let mut vector = |noise: f64, rest: DVec3, r: DVec3, source: &dyn Fn(u8) -> Source, change: &dyn Fn(usize) -> DVec3| {
        let changes: Vec<DVec3> = (0..du.len()).map(change).collect();
        for a in 0..3u8 {
            for (d, c) in d.iter_mut().zip(&changes) {
                *d = c[usize::from(a)];
            }
            let value = Some(r[usize::from(a)]);
            let by_place = -DVec3::AXES[usize::from(a)];
            visit(ResidualRow { frame, source: source(a), value, noise, weight: 1.0, rest, along_sight: 1.0, by_place }, &d);
        }
    };
    for m in &f.markers {
        let site = sensors.site(obs, m.site);
        let carried = Carried::new(body, &site, u);
        let own = |q: usize| {
            let of = |at: usize| (0..3).map(|a| directions[q].component(at + a) * carried.by_stalk(a)).sum::<DVec3>();
            sensors.marker_places(m.site).map(of).sum::<DVec3>()
        };
        let rest = site.carry(|i| body.nodes[i]).0;
        let source = |axis| Source::Marker { site: m.site, axis };
        vector(obs.marker_noise, rest, carried.position - m.position, &source, &|q| carried.tangent(&site, &du[q]) + own(q));
    }
    for (i, d) in f.displacements.iter().enumerate() {
        let source = |axis| Source::Node { node: i as u32, axis };
        vector(obs.displacement_noise, body.nodes[i], u[i] - *d, &source, &|q| du[q][i]);
    }
}

/// As [`rows`], all together: points that met nothing stand in their place, without value and with derivatives of zero.
pub fn all_rows(look: Look, compared: &Compared, u: &[DVec3], along: Along) -> Rows {
    let (obs, frame) = (&*look.plan.observation, look.frame);
    let points = &obs.frames[frame].points;
    let mut out = Rows::default();
    let zero = vec![0.0; along.du.len()];
    let mut seen = 0;
    let unmatched = |n: usize| ResidualRow {
        frame,
        source: Source::Point { point: n as u32, camera: points[n].camera },
        value: None,
        noise: obs.depth_noise,
        weight: 0.0,
        rest: points[n].position,
        along_sight: 0.0,
        by_place: DVec3::ZERO,
    };
    let mut add = |row: ResidualRow, d: &[f64]| {
        out.residuals.push(row);
        out.sensitivity.extend_from_slice(d);
    };
    rows(look, compared, u, along, |row, d| {
        let upto = if let Source::Point { point, .. } = row.source { point as usize } else { points.len() };
        (seen..upto).for_each(|n| add(unmatched(n), &zero));
        seen = if matches!(row.source, Source::Point { .. }) { upto + 1 } else { upto };
        add(row, d);
    });
    (seen..points.len()).for_each(|n| add(unmatched(n), &zero));
    out
}

/// Adds a frame's Gauss–Newton gradient `[Q]` and matrix `[Q, Q]`.
pub fn gauss_newton(
    look: Look,
    compared: &Compared,
    u: &[DVec3],
    along: Along,
    scale: f64,
    gradient: &mut [f64],
    matrix: &mut [f64],
) {
    let q = along.du.len();
    rows(look, compared, u, along, |row, d| {
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
pub fn residuals(look: Look, compared: &Compared, u: &[DVec3]) -> FrameResiduals {
    let Look { plan, sensors, frame } = look;
    let obs = &*plan.observation;
    let f = &obs.frames[frame];
    let mut points = vec![None; f.points.len()];
    for m in &compared.matches {
        points[m.point as usize] = Some(m.place.phi);
    }
    let markers =
        f.markers.iter().map(|m| Carried::new(&plan.body, &sensors.site(obs, m.site), u).position - m.position).collect();
    FrameResiduals { frame, points, markers }
}

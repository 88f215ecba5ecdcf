//! Where markers and tracked points sit on a body, and whether displacements count its nodes.

use super::{PlanError, error};
use crate::cutcells::extension::{NodeLookup, affine_weights};
use crate::cutcells::places::{beside, in_cell, material_point};
use crate::observation::{MarkerRest, MarkerSite, Observation, ReadingKind, TrackRest};
use crate::shape::Shape;
use crate::space::body::Body;
use crate::space::carrier::Carrier;
use crate::space::stencil::{StencilBuf, Stencils};
use glam::DVec3;
use rayon::prelude::*;

/// Radius of the fit that a marker's rotation is taken from, in cells: the smallest that spans a cut cell's neighbourhood.
const MARKER_RADIUS: f64 = 2.0;
/// How far tracked points may lie from the rest surface where the recording does not say, in cells.
const TRACK_REACH: f64 = 2.0;
/// How far apart nodes of a recording and of a scene may be, in cells: rounding to single precision and the like.
const SAME_NODE: f64 = 1e-3;

/// Where markers sit on a body, for a recording that is to be made.
///
/// # Errors
/// A marker that lies far from the surface.
pub fn marker_sites(rest: &[MarkerRest], body: &Body, shape: &dyn Shape) -> Result<Vec<MarkerSite>, PlanError> {
    let lookup = Lookup::new(body);
    rest.iter().map(|m| marker_site(m, body, &lookup, shape)).collect()
}

/// Finds what carries a place.
enum Lookup<'a> {
    /// Nodes by their place on the lattice.
    Cells(NodeLookup),
    /// Elements or points.
    Elements(Carrier<'a>),
}

impl Lookup<'_> {
    fn new(body: &Body) -> Lookup<'_> {
        match &body.cut {
            Some(_) => Lookup::Cells(NodeLookup::new(body)),
            None => Lookup::Elements(body.carrier()),
        }
    }
}

fn marker_site(m: &MarkerRest, body: &Body, lookup: &Lookup, shape: &dyn Shape) -> Result<MarkerSite, PlanError> {
    let h = body.length;
    let surface = m.surface.unwrap_or_else(|| shape.closest_point(m.position));
    let (min, max) = shape.bounds();
    // Scans and hand-measured points are off by millimetres, not by a large part of the body.
    let allowed = (0.1 * (max - min).length()).max(2.0 * h);
    let (key, point) = if m.surface.is_some() { ("surface", surface) } else { ("position", m.position) };
    let away = shape.signed_distance(point);
    if !(away.is_finite() && m.position.is_finite()) || (m.surface.is_some() && away.abs() > allowed) {
        return Err(error(
            format!("markers.rest \"{}\".{key}", m.name),
            format!("{point} m lies {:.4} m from the body's surface; allowed are {allowed:.4} m", away.abs()),
        ));
    }
    let (stalk, longest) = ((m.position - surface).length(), (max - min).length());
    if stalk > longest {
        return Err(error(
            format!("markers.rest \"{}\".position", m.name),
            format!(
                "{} m lies {stalk:.4} m from where it is attached to the body; a stalk may be as long as the body's diagonal, {longest:.4} m",
                m.position
            ),
        ));
    }
    Ok(MarkerSite {
        name: m.name.clone(),
        kind: ReadingKind::Marker,
        stencil: match lookup {
            Lookup::Cells(nodes) => affine_weights(body, nodes, surface, MARKER_RADIUS * h),
            Lookup::Elements(carrier) => carrier.carry(surface).0,
        },
        stalk: m.position - surface,
    })
}

/// Where tracked points sit. They have no stalk: a point moves with the body where it lies itself.
///
/// # Errors
/// Points farther from the rest surface than allowed: how many, and the farthest.
pub(super) fn track_sites(tracks: &TrackRest, body: &Body, shape: &dyn Shape) -> Result<Vec<MarkerSite>, PlanError> {
    let allowed = tracks.tolerance.unwrap_or(TRACK_REACH * body.length);
    // Points of a cloud lie within the body as well.
    let away = |d: f64| if body.points.stars.is_some() { d.max(0.0) } else { d.abs() };
    let away: Vec<f64> = tracks.places.par_iter().map(|p| away(shape.signed_distance(*p))).collect();
    // What is no number is away as well.
    let far: Vec<usize> = (0..away.len()).filter(|k| away[*k] > allowed || away[*k].is_nan()).collect();
    if let Some(&first) = far.first() {
        let worst = far.iter().copied().fold(first, |a, b| if away[b] > away[a] { b } else { a });
        return Err(error(
            "points.rest",
            format!(
                "{} of {} points lie more than {allowed:.4} m away from the rest surface, point {worst} at {} m by {:.4} m; \
                 check unit, transform and rest, or give a larger points.tolerance",
                far.len(),
                away.len(),
                tracks.places[worst],
                away[worst]
            ),
        ));
    }
    let lookup = Lookup::new(body);
    let site = |(number, place): (usize, &DVec3)| MarkerSite {
        name: format!("points.{number}"),
        kind: ReadingKind::Track,
        stencil: match &lookup {
            Lookup::Cells(nodes) => material_point(body, nodes, *place, MARKER_RADIUS * body.length),
            Lookup::Elements(carrier) => carrier.carry(*place).0,
        },
        stalk: DVec3::ZERO,
    };
    Ok(tracks.places.par_iter().enumerate().map(site).collect())
}

/// How the body deforms at every patch of its surface, where that is `asked`.
pub(super) fn frames(asked: bool, body: &Body) -> Stencils {
    let mut frames = Stencils::default();
    if asked {
        let lookup = Lookup::new(body);
        for p in &body.patches {
            let stencil = match &lookup {
                Lookup::Cells(_) => in_cell(body, p.cell, p.point),
                Lookup::Elements(carrier) => carrier.carry(p.point).0,
            };
            frames.push_with_gradient(&stencil.nodes, &stencil.value, &stencil.gradient);
        }
    }
    frames
}

/// Where a point mass sits: on the body or within one element of it.
pub(super) fn mass_site(key: &str, point: DVec3, body: &Body) -> Result<StencilBuf, PlanError> {
    let (place, away) = match &body.cut {
        Some(_) => beside(body, point),
        None => body.carrier().carry(point),
    };
    if away > body.length {
        let message = format!(
            "{point} m lies {away:.4} m away from the body; a point mass must lie on it or within one {} ({} m)",
            if body.cut.is_some() { "cell" } else { "element" },
            body.length
        );
        return Err(error(key, message));
    }
    Ok(place)
}

/// Compares the nodes that displacements count with those of the body.
///
/// # Errors
/// Another number of nodes, or other places.
pub(super) fn check_nodes(observation: &Observation, body: &Body) -> Result<(), PlanError> {
    let Some(nodes) = &observation.nodes else { return Ok(()) };
    if nodes.count != body.nodes.len() {
        return Err(error(
            "displacements.file",
            format!(
                "holds {} nodes, and the body has {} at cells of {} m; displacements are those of the nodes of this very scene",
                nodes.count,
                body.nodes.len(),
                body.length
            ),
        ));
    }
    let apart = |(a, b): (&DVec3, &DVec3)| a.distance(*b);
    let allowed = SAME_NODE * body.length;
    let off = nodes.places.iter().zip(&body.nodes).map(apart).enumerate().find(|(_, d)| *d > allowed || d.is_nan());
    match off {
        None => Ok(()),
        Some((node, d)) => Err(error(
            "displacements.nodes",
            format!("node {node} lies {d:.6} m from where this scene has it, {} m; is it the same scene?", body.nodes[node]),
        )),
    }
}

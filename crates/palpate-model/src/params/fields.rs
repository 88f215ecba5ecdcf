//! Fields: numbers of a scene that vary over the body, as many as its cells, its nodes or a few regions.
//!
//! A field multiplies the number at its `path` by a factor at every place. The factors come from as many values v_k by a basis B whose rows
//! sum to one: `exp Σ B_k ln v_k` (logarithmic scale) or `Σ B_k v_k` (linear). So a field whose values are all one changes nothing, and
//! one modulus a cell, one a node or blended regions are the same thing with other matrices.

use crate::space::body::Body;
use crate::space::neighbours::Neighbours;
use crate::space::pattern::{BlockRows, Pattern};
use glam::DVec3;

/// What a field varies.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Varied {
    /// `material.youngs_modulus`, cell by cell.
    Modulus,
    /// `material.density`, node by node.
    Density,
    /// `material.stiffness_damping`, cell by cell.
    Damping,
}

impl Varied {
    /// All, by the path of the number that varies.
    pub const ALL: [(&'static str, Varied); 3] = [
        ("material.youngs_modulus", Varied::Modulus),
        ("material.density", Varied::Density),
        ("material.stiffness_damping", Varied::Damping),
    ];

    /// The path.
    pub fn path(self) -> &'static str {
        Varied::ALL.iter().find(|v| v.1 == self).map_or("", |v| v.0)
    }

    /// True of what varies from cell to cell, false of what does from node to node.
    pub fn by_cells(self) -> bool {
        self != Varied::Density
    }

    /// Rest positions of the places where it varies [m].
    pub fn places(self, body: &Body) -> Vec<DVec3> {
        if self.by_cells() { body.middles().collect() } else { body.nodes.clone() }
    }
}

/// How factors follow from values between places.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Scale {
    /// Logarithms are blended: factors stay positive and a tenth is as far as ten times.
    Log,
    /// Values are blended.
    Linear,
}

/// How regions share the places between them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Blend {
    /// Weights solve Laplace's equation on the body, 1 in their own region and 0 in the others.
    Harmonic,
    /// Piecewise linear along the polyline through the regions' centres.
    Axis,
    /// The nearest centre counts alone.
    Nearest,
}

impl Blend {
    /// All, by name; the first where none is given.
    pub const ALL: [(&'static str, Blend); 3] =
        [("harmonic", Blend::Harmonic), ("axis", Blend::Axis), ("nearest", Blend::Nearest)];

    /// Its name.
    pub fn name(self) -> &'static str {
        Blend::ALL.iter().find(|b| b.1 == self).map_or("", |b| b.0)
    }
}

/// A region of a field.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Region {
    /// Centre at rest [m].
    pub center: DVec3,
    /// Radius within which the region has its own value alone [m].
    pub radius: f64,
    /// Factor there.
    pub value: f64,
}

/// What a field's values belong to.
#[derive(Clone, Debug, PartialEq)]
pub enum Basis {
    /// One value a cell.
    Cells,
    /// One value a node.
    Nodes,
    /// One value a point, of bodies of points: point k is node k and element k.
    Points,
    /// One value a region.
    Regions(Vec<Region>, Blend),
}

/// What is expected of a field before the recording is looked at; m is the logarithm of its values.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Prior {
    /// How neighbours go together.
    pub kind: PriorKind,
    /// Length over which m is alike [m]; `None` = the data choose. Not of [`PriorKind::EdgePreserving`].
    pub length: Option<f64>,
    /// Standard deviation of m, or typical height of its steps; `None` = the data choose.
    pub deviation: Option<f64>,
}

/// How neighbouring values go together.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PriorKind {
    /// Smooth: a Gaussian field with the covariance of Matérn.
    Matern,
    /// In parts: smoothed total variation.
    EdgePreserving,
}

impl PriorKind {
    /// All, by name.
    pub const ALL: [(&'static str, PriorKind); 2] =
        [("matern", PriorKind::Matern), ("edge-preserving", PriorKind::EdgePreserving)];

    /// Its name.
    pub fn name(self) -> &'static str {
        PriorKind::ALL.iter().find(|k| k.1 == self).map_or("", |k| k.0)
    }
}

/// A `[[field]]` of a scene.
#[derive(Clone, Debug, PartialEq)]
pub struct FieldSpec {
    /// What it varies.
    pub varied: Varied,
    /// What its values belong to.
    pub basis: Basis,
    /// How they are blended.
    pub scale: Scale,
    /// Values read from a file; `None` = the regions' own, or one everywhere.
    pub values: Option<Vec<f64>>,
    /// What is expected of the values, of cells or nodes.
    pub prior: Option<Prior>,
}

impl FieldSpec {
    /// Number of values on a body.
    pub fn count(&self, body: &Body) -> usize {
        match &self.basis {
            Basis::Cells => body.elements(),
            Basis::Nodes | Basis::Points => body.nodes.len(),
            Basis::Regions(regions, _) => regions.len(),
        }
    }

    /// Which of its values lie beside each other on a body; `None` of regions.
    pub fn neighbours(&self, body: &Body) -> Option<Neighbours> {
        match self.basis {
            Basis::Cells | Basis::Points => Some(Neighbours::of_elements(body)),
            Basis::Nodes => Some(Neighbours::of_nodes(body)),
            Basis::Regions(..) => None,
        }
    }

    /// Its values on a body.
    ///
    /// # Errors
    /// The file has another number of values.
    pub fn start(&self, body: &Body) -> Result<Vec<f64>, String> {
        let count = self.count(body);
        match (&self.values, &self.basis) {
            (Some(values), _) if values.len() != count => {
                Err(format!("has {} values; the body has {count} {}", values.len(), self.basis.noun()))
            }
            (Some(values), _) => Ok(values.clone()),
            (None, Basis::Regions(regions, _)) => Ok(regions.iter().map(|r| r.value).collect()),
            (None, _) => Ok(vec![1.0; count]),
        }
    }
}

impl Basis {
    /// What a value belongs to, in the plural.
    pub fn noun(&self) -> &'static str {
        match self {
            Basis::Cells => "cells",
            Basis::Nodes => "nodes",
            Basis::Points => "points",
            Basis::Regions(..) => "regions",
        }
    }
}

/// A field on its body: from values to factors, and back.
#[derive(Clone, Debug, PartialEq)]
pub struct Field {
    /// What it varies.
    pub varied: Varied,
    /// How values are blended.
    pub scale: Scale,
    /// Start of each place's entries in `columns` and `weights`, `[places + 1]`.
    rows: Vec<u32>,
    columns: Vec<u32>,
    weights: Vec<f64>,
    /// Number of values.
    pub count: usize,
}

impl Field {
    /// A field of a scene on the scene's body.
    ///
    /// # Errors
    /// A region that holds no node.
    pub fn new(spec: &FieldSpec, body: &Body) -> Result<Field, String> {
        let places = spec.varied.places(body);
        let rows: Vec<Vec<(u32, f64)>> = match &spec.basis {
            Basis::Cells if !spec.varied.by_cells() => cells_around_nodes(body),
            Basis::Nodes if spec.varied.by_cells() => {
                let share = |nodes: &[u32]| nodes.iter().map(|n| (*n, 1.0 / nodes.len() as f64)).collect();
                body.element_nodes().map(share).collect()
            }
            Basis::Cells | Basis::Nodes | Basis::Points => (0..places.len() as u32).map(|own| vec![(own, 1.0)]).collect(),
            Basis::Regions(regions, Blend::Nearest) => places.iter().map(|x| vec![(nearest(regions, *x), 1.0)]).collect(),
            Basis::Regions(regions, Blend::Axis) => places.iter().map(|x| along_axis(regions, *x)).collect(),
            Basis::Regions(regions, Blend::Harmonic) => {
                let of_nodes = harmonic(regions, body)?;
                if spec.varied.by_cells() { body.element_nodes().map(|nodes| mean(nodes, &of_nodes)).collect() } else { of_nodes }
            }
        };
        let mut field = Field {
            varied: spec.varied,
            scale: spec.scale,
            rows: vec![0],
            columns: Vec::new(),
            weights: Vec::new(),
            count: spec.count(body),
        };
        for row in rows {
            field.columns.extend(row.iter().map(|r| r.0));
            field.weights.extend(row.iter().map(|r| r.1));
            field.rows.push(field.columns.len() as u32);
        }
        Ok(field)
    }

    /// Number of places that have a factor.
    pub fn places(&self) -> usize {
        self.rows.len() - 1
    }

    /// Entries of a place: value and weight.
    fn row(&self, place: usize) -> impl Iterator<Item = (usize, f64)> + '_ {
        let range = self.rows[place] as usize..self.rows[place + 1] as usize;
        range.map(|k| (self.columns[k] as usize, self.weights[k]))
    }

    /// Factor at every place for values `[count]`.
    pub fn factors(&self, values: &[f64]) -> Vec<f64> {
        let factor = |place: usize| match self.scale {
            Scale::Linear => self.row(place).map(|(k, w)| w * values[k]).sum::<f64>(),
            Scale::Log => self.row(place).map(|(k, w)| w * values[k].ln()).sum::<f64>().exp(),
        };
        (0..self.places()).map(factor).collect()
    }

    /// Change of the logarithm of every factor when the values change by `rates` `[count]`.
    pub fn ln_along(&self, values: &[f64], rates: &[f64]) -> Vec<f64> {
        let factors = if self.scale == Scale::Linear { self.factors(values) } else { Vec::new() };
        let change = |place: usize| match self.scale {
            Scale::Linear => self.row(place).map(|(k, w)| w * rates[k]).sum::<f64>() / factors[place],
            Scale::Log => self.row(place).map(|(k, w)| w * rates[k] / values[k]).sum(),
        };
        (0..self.places()).map(change).collect()
    }

    /// The transpose of [`Field::ln_along`]: adds to `gradient` `[count]` what derivatives by the logarithms of the factors make of it.
    pub fn pull(&self, values: &[f64], by_ln: &[f64], gradient: &mut [f64]) {
        let factors = if self.scale == Scale::Linear { self.factors(values) } else { Vec::new() };
        for (place, g) in by_ln.iter().enumerate() {
            for (k, w) in self.row(place) {
                gradient[k] += match self.scale {
                    Scale::Linear => w * g / factors[place],
                    Scale::Log => w * g / values[k],
                };
            }
        }
    }
}

/// The cells around every node, weighed alike.
fn cells_around_nodes(body: &Body) -> Vec<Vec<(u32, f64)>> {
    let mut rows: Vec<Vec<(u32, f64)>> = vec![Vec::new(); body.nodes.len()];
    for (e, nodes) in body.element_nodes().enumerate() {
        nodes.iter().for_each(|n| rows[*n as usize].push((e as u32, 1.0)));
    }
    for row in &mut rows {
        let share = 1.0 / row.len().max(1) as f64;
        row.iter_mut().for_each(|r| r.1 = share);
    }
    rows
}

fn nearest(regions: &[Region], x: DVec3) -> u32 {
    let gap = |r: &Region| (x - r.center).length() - r.radius;
    let best = regions.iter().enumerate().min_by(|a, b| gap(a.1).total_cmp(&gap(b.1)));
    best.map_or(0, |(k, _)| k as u32)
}

/// Weights of the two regions on either side of a place, measured along the polyline through the centres.
fn along_axis(regions: &[Region], x: DVec3) -> Vec<(u32, f64)> {
    let mut best = (f64::INFINITY, vec![(0, 1.0)]);
    for (k, pair) in regions.windows(2).enumerate() {
        let way = pair[1].center - pair[0].center;
        let t = ((x - pair[0].center).dot(way) / way.length_squared()).clamp(0.0, 1.0);
        let distance = (x - pair[0].center - t * way).length();
        if distance < best.0 {
            best = (distance, vec![(k as u32, 1.0 - t), (k as u32 + 1, t)]);
        }
    }
    best.1
}

/// Mean of the rows of some nodes.
fn mean(nodes: &[u32], rows: &[Vec<(u32, f64)>]) -> Vec<(u32, f64)> {
    let mut sum: Vec<(u32, f64)> = Vec::new();
    for (k, w) in nodes.iter().flat_map(|n| &rows[*n as usize]) {
        let share = w / nodes.len() as f64;
        match sum.iter_mut().find(|s| s.0 == *k) {
            Some(s) => s.1 += share,
            None => sum.push((*k, share)),
        }
    }
    sum
}

/// Weights of the regions at every node: the graph Laplacian of the body's nodes, with natural boundary, by Gauss–Seidel sweeps.
fn harmonic(regions: &[Region], body: &Body) -> Result<Vec<Vec<(u32, f64)>>, String> {
    const SWEEPS: usize = 20_000;
    const SETTLED: f64 = 1e-10;
    let BlockRows { rows, columns, .. } = Pattern::new(body).blocks;
    let owner: Vec<Option<usize>> =
        body.nodes.iter().map(|x| regions.iter().position(|r| (*x - r.center).length() <= r.radius)).collect();
    for (k, r) in regions.iter().enumerate() {
        if !owner.contains(&Some(k)) {
            return Err(format!("region {k} around {} m with radius {} m holds no node; enlarge or move it", r.center, r.radius));
        }
    }
    let mut weights: Vec<Vec<f64>> = vec![vec![0.0; regions.len()]; body.nodes.len()];
    for (w, own) in weights.iter_mut().zip(&owner) {
        match own {
            Some(k) => w[*k] = 1.0,
            None => w.fill(1.0 / regions.len() as f64),
        }
    }
    for _ in 0..SWEEPS {
        let mut moved = 0.0f64;
        for a in (0..body.nodes.len()).filter(|a| owner[*a].is_none()) {
            let around = columns[rows[a]..rows[a + 1]].iter().map(|b| *b as usize).filter(|b| *b != a);
            let count = around.clone().count().max(1) as f64;
            for k in 0..regions.len() {
                let next = around.clone().map(|b| weights[b][k]).sum::<f64>() / count;
                moved = moved.max((next - weights[a][k]).abs());
                weights[a][k] = next;
            }
        }
        if moved < SETTLED {
            break;
        }
    }
    Ok(weights.into_iter().map(|w| (0u32..).zip(w).filter(|w| w.1 != 0.0).collect()).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cutcells::build::SUBDIVISIONS;
    use crate::scene::{Analytic, BodySource, Object, Resolution};
    use crate::shape::shape_of;

    fn bar() -> Body {
        let source = BodySource::Analytic(Analytic::Box { min: DVec3::ZERO, max: DVec3::new(0.2, 0.04, 0.04) });
        let object = Object { source, pose: glam::DAffine3::IDENTITY, resolution: Resolution::CellSize(0.02) };
        Body::build(shape_of(&object).as_ref(), 0.02, 0.02, SUBDIVISIONS).unwrap()
    }

    fn specs() -> Vec<FieldSpec> {
        let region = |x: f64, value: f64| Region { center: DVec3::new(x, 0.02, 0.02), radius: 0.03, value };
        let three = vec![region(0.02, 0.5), region(0.1, 2.0), region(0.18, 4.0)];
        let mut out = Vec::new();
        for (_, varied) in Varied::ALL {
            for scale in [Scale::Log, Scale::Linear] {
                let blends = [Blend::Harmonic, Blend::Axis, Blend::Nearest].map(|b| Basis::Regions(three.clone(), b));
                for basis in [Basis::Cells, Basis::Nodes].into_iter().chain(blends) {
                    out.push(FieldSpec { varied, basis, scale, values: None, prior: None });
                }
            }
        }
        out
    }

    #[test]
    fn equal_values_are_a_factor_everywhere_and_regions_keep_their_own() {
        let body = bar();
        for spec in specs() {
            let field = Field::new(&spec, &body).unwrap();
            let same = field.factors(&vec![3.0; field.count]);
            assert!(same.iter().all(|f| (f - 3.0).abs() < 1e-9), "{spec:?}");
            if let Basis::Regions(regions, _) = &spec.basis {
                let factors = field.factors(&spec.start(&body).unwrap());
                for r in regions {
                    let at = spec.varied.places(&body);
                    let near = (0..at.len()).min_by(|a, b| (at[*a] - r.center).length().total_cmp(&(at[*b] - r.center).length()));
                    let factor = factors[near.unwrap()];
                    // The nearest place may lie half a cell off the centre, an eighth of the way to the next region: that differs by 2 at most,
                    // and by a factor of 4 where values are blended by their logarithms.
                    let near = match spec.scale {
                        Scale::Log => (factor / r.value).ln().abs() < 0.126 * 4.0f64.ln(),
                        _ => (factor - r.value).abs() < 0.126 * 2.0,
                    };
                    assert!(near, "{spec:?}: {factor} for {}", r.value);
                }
            }
        }
    }

    #[test]
    fn rates_are_derivatives_of_the_factors_and_the_pull_is_their_transpose() {
        let body = bar();
        for spec in specs() {
            let field = Field::new(&spec, &body).unwrap();
            let wave = |k: usize, f: f64| (f * k as f64).sin();
            let values: Vec<f64> = (0..field.count).map(|k| 1.5 + wave(k, 1.7)).collect();
            let rates: Vec<f64> = (0..field.count).map(|k| wave(k, 0.9)).collect();
            let at = |t: f64| field.factors(&values.iter().zip(&rates).map(|(v, r)| v + t * r).collect::<Vec<_>>());
            let along = field.ln_along(&values, &rates);
            for ((a, b), exact) in at(1e-6).iter().zip(at(-1e-6)).zip(&along) {
                assert!(((a / b).ln() / 2e-6 - exact).abs() < 1e-7, "{spec:?}");
            }
            let g: Vec<f64> = (0..field.places()).map(|p| wave(p, 2.3)).collect();
            let mut pulled = vec![0.0; field.count];
            field.pull(&values, &g, &mut pulled);
            let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
            assert!((dot(&g, &along) - dot(&pulled, &rates)).abs() < 1e-11 * dot(&g, &g).max(1.0), "{spec:?}");
        }
    }
}

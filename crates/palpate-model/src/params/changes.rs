//! What a member's effects change of the body itself: stiffness, density and stress-free shape, evaluated where backends need them.

use crate::effects::field::{Field, Spot};
use crate::effects::{Law, Site};
use crate::params::Layout;
use crate::params::fields::Varied;
use crate::plan::{Physics, Plan};
use glam::DVec3;

/// Numbers of a clamp's field: factor on its matrices, layer [m], offset [m] and Cayley rotation vector (3 each).
pub const HOLD: usize = 8;

/// Fields that do not change in time; `None` where no effect changes anything.
#[derive(Clone, Debug, Default)]
pub struct Changes {
    /// Factor on Young's modulus per cell.
    pub modulus: Option<Vec<f64>>,
    /// Factor on the density per node.
    pub density: Option<Vec<f64>>,
    /// Factor on the stiffness damping per cell.
    pub damping: Option<Vec<f64>>,
    /// Displacement W of the stress-free shape per node [m].
    pub rest: Option<Vec<DVec3>>,
}

/// An effect: number, law, parameters.
type Numbered<'a> = (usize, &'static Law, &'a [f64]);

fn effects<'a>(layout: &'a Layout, physics: &'a Physics) -> impl Iterator<Item = Numbered<'a>> {
    layout.effects().zip(&physics.effects).enumerate().map(|(i, ((law, _), p))| (i, law, p.as_slice()))
}

impl Spot {
    /// A spot of a plan's body, at its centre and at the start.
    pub fn of(plan: &Plan) -> Spot {
        let body = &plan.body;
        let size = 0.5 * body.size();
        let anchor = plan.clamps.first().map_or(body.center, |c| {
            let middle = |cell: u32| body.cut().middle(&body.cells()[cell as usize]);
            let nodes = c.nodes.iter().map(|n| body.nodes[n.0 as usize]);
            (c.cells.iter().map(|c| middle(c.cell)).chain(nodes)).sum::<DVec3>() / (c.cells.len() + c.nodes.len()) as f64
        });
        Spot { rest: body.center, center: body.center, anchor, size, cell: body.length, elapsed: 0.0 }
    }
}

fn modulus_law(law: &Law) -> Option<&'static dyn Field<1>> {
    if let Site::Modulus(f) = law.site { Some(f) } else { None }
}

fn density_law(law: &Law) -> Option<&'static dyn Field<1>> {
    if let Site::Density(f) = law.site { Some(f) } else { None }
}

fn edge_law(law: &Law) -> Option<&'static dyn Field<1>> {
    if let Site::Edges(f) = law.site { Some(f) } else { None }
}

fn rest_law(law: &Law) -> Option<&'static dyn Field<3>> {
    if let Site::Rest(f) = law.site { Some(f) } else { None }
}

/// Product of the factors of all laws that `pick` finds, at all spots.
fn product(
    plan: &Plan,
    physics: &Physics,
    pick: fn(&Law) -> Option<&'static dyn Field<1>>,
    spots: impl Fn() -> Vec<DVec3>,
) -> Option<Vec<f64>> {
    let mut out: Option<Vec<f64>> = None;
    let spot = Spot::of(plan);
    for (field, p) in effects(&plan.layout, physics).filter_map(|(_, law, p)| Some((pick(law)?, p))) {
        let spots = spots();
        let values = out.get_or_insert_with(|| vec![1.0; spots.len()]);
        for (v, rest) in values.iter_mut().zip(spots) {
            *v *= field.at(&Spot { rest, ..spot }, p)[0];
        }
    }
    out
}

impl Changes {
    /// The fields of one member.
    pub fn new(plan: &Plan, physics: &Physics) -> Changes {
        let mut out = Changes {
            modulus: product(plan, physics, modulus_law, || plan.body.middles().collect()),
            density: product(plan, physics, density_law, || plan.body.nodes.clone()),
            damping: None,
            rest: rest_of_effects(plan, physics),
        };
        for (field, values) in plan.fields.iter().zip(&physics.fields) {
            let factors = field.factors(values);
            match out.varied(field.varied) {
                Some(all) => all.iter_mut().zip(factors).for_each(|(a, f)| *a *= f),
                none => *none = Some(factors),
            }
        }
        out
    }

    /// The factors that a field varies.
    pub fn varied(&mut self, varied: Varied) -> &mut Option<Vec<f64>> {
        match varied {
            Varied::Modulus => &mut self.modulus,
            Varied::Density => &mut self.density,
            Varied::Damping => &mut self.damping,
        }
    }

    /// The same to be read.
    pub fn of(&self, varied: Varied) -> Option<&[f64]> {
        match varied {
            Varied::Modulus => self.modulus.as_deref(),
            Varied::Density => self.density.as_deref(),
            Varied::Damping => self.damping.as_deref(),
        }
    }

    /// Derivative of the modulus factor of every cell by number `slot` of effect `effect`; `None` for other effects.
    pub fn modulus_slope(&self, plan: &Plan, physics: &Physics, effect: usize, slot: usize) -> Option<Vec<f64>> {
        let (_, law, p) = effects(&plan.layout, physics).nth(effect)?;
        slope(plan, modulus_law(law)?, p, slot, self.modulus.as_deref()?, plan.body.middles())
    }

    /// Derivative of the density factor of every node.
    pub fn density_slope(&self, plan: &Plan, physics: &Physics, effect: usize, slot: usize) -> Option<Vec<f64>> {
        let (_, law, p) = effects(&plan.layout, physics).nth(effect)?;
        slope(plan, density_law(law)?, p, slot, self.density.as_deref()?, plan.body.nodes.iter().copied())
    }
}

/// Derivative of a product of factors by a parameter of one of them.
fn slope(
    plan: &Plan,
    field: &dyn Field<1>,
    p: &[f64],
    slot: usize,
    product: &[f64],
    spots: impl Iterator<Item = DVec3>,
) -> Option<Vec<f64>> {
    let spot = Spot::of(plan);
    let at = |(whole, rest): (&f64, DVec3)| {
        let s = Spot { rest, ..spot };
        whole * field.slope(&s, p, slot)[0] / field.at(&s, p)[0]
    };
    Some(product.iter().zip(spots).map(at).collect())
}

/// What effects make of W at every node [m]; `None` where none does.
pub fn rest_of_effects(plan: &Plan, physics: &Physics) -> Option<Vec<DVec3>> {
    let mut rest: Option<Vec<DVec3>> = None;
    let spot = Spot::of(plan);
    for (field, p) in effects(&plan.layout, physics).filter_map(|(_, law, p)| Some((rest_law(law)?, p))) {
        let w = rest.get_or_insert_with(|| vec![DVec3::ZERO; plan.body.nodes.len()]);
        for (w, x) in w.iter_mut().zip(&plan.body.nodes) {
            *w += DVec3::from_array(field.at(&Spot { rest: *x, ..spot }, p));
        }
    }
    rest
}

/// Derivative of W at every node by number `slot` of effect `effect` [m per unit]; `None` for other effects.
pub fn rest_slope(plan: &Plan, physics: &Physics, effect: usize, slot: usize) -> Option<Vec<DVec3>> {
    let (_, law, p) = effects(&plan.layout, physics).nth(effect)?;
    let (field, spot) = (rest_law(law)?, Spot::of(plan));
    let at = |x: &DVec3| DVec3::from_array(field.slope(&Spot { rest: *x, ..spot }, p, slot));
    Some(plan.body.nodes.iter().map(at).collect())
}

/// Factor on the whole body's Young's modulus after `elapsed` seconds.
pub fn aging(plan: &Plan, physics: &Physics, elapsed: f64) -> f64 {
    let aging = |law: &Law, p: &[f64]| match law.site {
        Site::Aging(f) => f.at(&Spot { elapsed, ..Spot::of(plan) }, p)[0],
        _ => 1.0,
    };
    effects(&plan.layout, physics).map(|(_, law, p)| aging(law, p)).product()
}

/// Derivative of [`aging`] by number `slot` of effect `effect`; `None` for other effects.
pub fn aging_slope(plan: &Plan, physics: &Physics, elapsed: f64, effect: usize, slot: usize) -> Option<f64> {
    let (_, law, p) = effects(&plan.layout, physics).nth(effect)?;
    let Site::Aging(field) = law.site else { return None };
    let spot = Spot { elapsed, ..Spot::of(plan) };
    Some(aging(plan, physics, elapsed) * field.slope(&spot, p, slot)[0] / field.at(&spot, p)[0])
}

/// Derivative of [`aging`] when the effects' numbers change by `rates`.
pub fn aging_along(plan: &Plan, physics: &Physics, elapsed: f64, rates: &Physics) -> f64 {
    let numbered = rates.effects.iter().enumerate().flat_map(|(e, r)| r.iter().enumerate().map(move |(slot, r)| (e, slot, *r)));
    let moved = numbered.filter(|n| n.2 != 0.0);
    moved.filter_map(|(e, slot, r)| Some(r * aging_slope(plan, physics, elapsed, e, slot)?)).sum()
}

/// The transpose: adds to the effects' numbers in `gradient` what a derivative by [`aging`] of `by_factor` makes of them.
pub fn pull_aging(plan: &Plan, physics: &Physics, elapsed: f64, by_factor: f64, gradient: &mut Physics) {
    for (effect, numbers) in gradient.effects.iter_mut().enumerate() {
        for (slot, g) in numbers.iter_mut().enumerate() {
            if let Some(slope) = aging_slope(plan, physics, elapsed, effect, slot) {
                *g += by_factor * slope;
            }
        }
    }
}

/// How clamps hold at a spot of the first clamp's middle after `elapsed` seconds: [`HOLD`] numbers, factors multiplied, the others added.
pub fn hold(plan: &Plan, physics: &Physics, spot: &Spot) -> [f64; HOLD] {
    let mut out = [0.0; HOLD];
    out[0] = 1.0;
    for (_, law, p) in effects(&plan.layout, physics) {
        if let Site::Clamps(field) = law.site {
            let own = field.at(spot, p);
            out[0] *= own[0];
            (1..HOLD).for_each(|k| out[k] += own[k]);
        }
    }
    out
}

/// Derivative of [`hold`] by number `slot` of effect `effect`; `None` for other effects.
pub fn hold_slope(plan: &Plan, physics: &Physics, spot: &Spot, effect: usize, slot: usize) -> Option<[f64; HOLD]> {
    let (_, law, p) = effects(&plan.layout, physics).nth(effect)?;
    let Site::Clamps(field) = law.site else { return None };
    let mut out = field.slope(spot, p, slot);
    out[0] *= hold(plan, physics, spot)[0] / field.at(spot, p)[0];
    Some(out)
}

/// How far effects shift the clamps' edges [m]; `None` where no effect does, be it by nothing.
pub fn edge(plan: &Plan, physics: &Physics) -> Option<f64> {
    let spot = Spot::of(plan);
    effects(&plan.layout, physics).filter_map(|(_, law, p)| Some(edge_law(law)?.at(&spot, p)[0])).reduce(|a, b| a + b)
}

/// The furthest [`edge`] within the bounds of the effects' numbers.
pub fn furthest_edge(plan: &Plan) -> Option<f64> {
    let spot = Spot::of(plan);
    let upper = |law: &Law| law.params.iter().map(|p| p.upper).collect::<Vec<f64>>();
    plan.layout.effects().filter_map(|(law, _)| Some(edge_law(law)?.at(&spot, &upper(law))[0])).reduce(|a, b| a + b)
}

/// Derivative of [`edge`] by number `slot` of effect `effect`; `None` for other effects.
pub fn edge_slope(plan: &Plan, physics: &Physics, effect: usize, slot: usize) -> Option<f64> {
    let (_, law, p) = effects(&plan.layout, physics).nth(effect)?;
    Some(edge_law(law)?.slope(&Spot::of(plan), p, slot)[0])
}

//! The terms of the balance of forces, one file each: passes for residual, tangent, and derivatives by the past and by the coefficients.
//!
//! Terms at cells, clamps and patches leave what they have to say where they stand; the node term gathers it ([`nodes`]), and what comes after
//! adds to nodes and blocks by itself. So their order in [`TERMS`] matters.

mod clamps;
mod contact;
mod elastic_cells;
mod elastic_points;
mod held_nodes;
mod jets;
mod nodes;
mod obstacles;
mod point_laws;
mod star_penalty;
mod start;

use crate::device::pipelines::pass;
use crate::device::pipelines::shared::asks;
use crate::device::pipelines::shared::points::{BACK, BY_OLD};
use crate::device::pipelines::shared::pulls::{SEEK_DAMPING, SEEK_MODULUS, SEEK_POISSON, SEEK_REST, SEEK_START, SEEK_VISCOSITY};
use crate::device::recorder::Named;
use crate::passes::{ALL, Passes, Per};
use crate::world::{Rates, SOLVING, Sums, Tally, World};
use palpate_model::effects::Site;
use palpate_model::params::coefficients::Sought;

const TERMS: [&dyn Term; 12] = [
    &contact::Contact,
    &point_laws::SurfaceLaws,
    &obstacles::Obstacles,
    &jets::Jets,
    &clamps::Clamps,
    &elastic_cells::ElasticCells,
    &nodes::Nodes,
    &point_laws::NodeLaws,
    &jets::JetTurns,
    &star_penalty::StarPenalty,
    &elastic_points::ElasticPoints,
    &held_nodes::HeldNodes,
];

/// A term of the balance on its way to the device. What a term has no part in it leaves out.
trait Term: Sync {
    /// What the past leaves for the whole solve.
    fn prepare(&self, _s: &mut Passes) {}
    /// Its forces at a trial of the members of a section.
    fn residual(&self, _s: &mut Passes, _section: u32) {}
    /// Its part of the tangent at the new state, for the members of a section.
    fn tangent(&self, _s: &mut Passes, _section: u32) {}
    /// Subtracts the derivative of its force by a past state times a vector, or the transposed product.
    fn by_past(&self, _s: &mut Passes, _past: &Past) {}
    /// Its change along a direction of the coefficients → `column`.
    fn by_coefficients(&self, _s: &mut Passes, _along: &Along) {}
    /// Subtracts z · ∂(its force)/∂c for all coefficients that are sought, z in `direction`. How many parameters these make does not matter here:
    /// the host pulls the sums back once, at the end.
    fn by_coefficients_transposed(&self, _s: &mut Passes, _pull: &Pull) {}
}

/// A product with the derivative by a past state.
struct Past<'a> {
    way: Way<'a>,
    /// The past state.
    state: &'a wgpu::Buffer,
    /// The vector.
    probe: &'a wgpu::Buffer,
    /// What the product is subtracted from.
    to: &'a wgpu::Buffer,
}

/// Which of the two products.
enum Way<'a> {
    /// For a tangent's right-hand side, which the first of several past states begins.
    Along { first: bool },
    /// The transposed one, for dJ/d(past) of a step that dJ/d(next) came back through.
    Back { adjoint: &'a wgpu::Buffer },
}

impl Past<'_> {
    /// How effects on points are asked.
    fn question(&self) -> u32 {
        match self.way {
            Way::Along { .. } => BY_OLD,
            Way::Back { .. } => BACK,
        }
    }

    /// How elements are asked.
    fn ask(&self) -> u32 {
        match self.way {
            Way::Along { .. } => asks::ALONG,
            Way::Back { .. } => asks::TRANSPOSED,
        }
    }

    fn named(&self) -> [(&'static str, &wgpu::Buffer); 1] {
        [("probe", self.probe)]
    }
}

/// A direction of the coefficients, and which terms change along it.
struct Along<'a> {
    moved: &'a Sought,
    flags: u32,
    named: Vec<(&'static str, &'a wgpu::Buffer)>,
    /// The material or the stress-free shape changes.
    body: bool,
    /// Numbers of effects on clamps.
    grips: bool,
    /// What clamps do, for one of these reasons or because time does.
    clamps: bool,
    /// Laws of cells.
    laws: bool,
    /// Laws of points.
    points: bool,
    /// Obstacles.
    obstacles: bool,
    /// Jets.
    jets: bool,
    /// Something at patches.
    patches: bool,
    /// Something of what the node term gathers.
    gathered: bool,
}

impl<'a> Along<'a> {
    fn new(world: &World, rates: &'a Rates) -> Along<'a> {
        let moved = &rates.moved;
        let effects = &world.geometry.effects;
        let on = |site: fn(&Site) -> bool| seeks_effect(world, moved, site);
        let body = moved.modulus || moved.poisson || moved.rest;
        let grips = on(|s| matches!(s, Site::Clamps(_) | Site::Edges(_)));
        let clamps = body || grips || moved.start;
        let laws = on(|s| matches!(s, Site::Cells(_)));
        let points = point_laws::change(world, moved);
        let obstacles = effects.moving()[0] != 0 && (moved.start || on(|s| matches!(s, Site::Obstacle)));
        let jets = effects.moving()[1] != 0 && (moved.start || on(|s| matches!(s, Site::Jet)));
        let patches = moved.planes || moved.modulus || obstacles || jets || (points && effects.on_patches());
        let gathered = body || moved.damping[1] || moved.viscosity || clamps || patches || laws;
        Along {
            moved,
            flags: rates.flags,
            named: rates.named(),
            body,
            grips,
            clamps,
            laws,
            points,
            obstacles,
            jets,
            patches,
            gathered,
        }
    }
}

/// Coefficients that derivatives are sought by, and where their sums go.
struct Pull<'a> {
    sums: &'a Sums,
    named: Vec<(&'static str, &'a wgpu::Buffer)>,
    /// Something of the material, or the stress-free shape.
    material: bool,
}

impl<'a> Pull<'a> {
    fn new(sums: &'a Sums, named: Vec<(&'static str, &'a wgpu::Buffer)>) -> Pull<'a> {
        let s = &sums.sought;
        Pull { sums, named, material: s.modulus || s.poisson || s.rest }
    }

    fn sought(&self) -> &Sought {
        &self.sums.sought
    }

    /// What kernels are told of it.
    fn asked(&self) -> u32 {
        asked(self.sought())
    }
}

/// The bit where something is sought.
fn bit(sought: bool, bit: u32) -> u32 {
    if sought { bit } else { 0 }
}

/// What terms of the whole body are told of what is sought.
fn asked(s: &Sought) -> u32 {
    bit(s.modulus, SEEK_MODULUS)
        | bit(s.poisson, SEEK_POISSON)
        | bit(s.damping[1], SEEK_DAMPING)
        | bit(s.rest, SEEK_REST)
        | bit(s.start, SEEK_START)
        | bit(s.viscosity, SEEK_VISCOSITY)
}

/// Whether numbers of some effect on such a site are sought.
fn seeks_effect(world: &World, sought: &Sought, on: fn(&Site) -> bool) -> bool {
    world.plan.layout.effects().zip(&sought.effects).any(|((law, _), own)| *own && on(&law.site))
}

impl Passes<'_, '_> {
    /// What the past leaves for the whole solve.
    pub(crate) fn prepare(&mut self) {
        if self.step.is_some() {
            TERMS.iter().for_each(|t| t.prepare(self));
        }
    }

    /// The residual at a trial of the members of a section.
    pub(crate) fn residual(&mut self, section: u32) {
        TERMS.iter().for_each(|t| t.residual(self, section));
    }

    /// Tangent, matrix and preconditioner of the members of a section, at the new state.
    pub(crate) fn assemble(&mut self, section: u32) {
        TERMS.iter().for_each(|t| t.tangent(self, section));
        self.run(pass::INVERT_DIAGONAL, section, Per::Node, 0);
    }

    /// Adds −T du to a tangent's right-hand side `rhs`, with T the derivative by past state `state` and du in `probe`; for the first of several
    /// past states the column as well.
    pub(crate) fn along_past(&mut self, state: &wgpu::Buffer, probe: &wgpu::Buffer, first: bool) {
        let past = Past { way: Way::Along { first }, state, probe, to: &self.world.buffers["rhs"] };
        TERMS.iter().for_each(|t| t.by_past(self, &past));
    }

    /// Adds dJ/d(past state) to `to`, from the solution of the adjoint's system and dJ/d(next).
    pub(crate) fn back(&mut self, state: &wgpu::Buffer, adjoint: &wgpu::Buffer, to: &wgpu::Buffer) {
        let past = Past { way: Way::Back { adjoint }, state, probe: &self.world.buffers[SOLVING], to };
        TERMS.iter().for_each(|t| t.by_past(self, &past));
    }

    /// (∂r/∂c) c' → `column`, whether the direction is one parameter's or any.
    pub(crate) fn push(&mut self, rates: &Rates) {
        let along = Along::new(self.world, rates);
        TERMS.iter().for_each(|t| t.by_coefficients(self, &along));
    }

    /// Adds what this balance says of all that is sought, z in `direction`.
    pub(crate) fn pull(&mut self, tally: &Tally) {
        let Some(sums) = &tally.sums else { return };
        let pull = Pull::new(sums, tally.named());
        TERMS.iter().for_each(|t| t.by_coefficients_transposed(self, &pull));
    }

    /// A pass of the laws of cells, the material that is not linear among them; a plan without any has none of these passes.
    fn laws(&mut self, pass: usize, section: u32, per: Per, extra: u32, more: &Named) {
        if self.world.geometry.effects.on_cells() {
            self.run_with(pass, section, per, extra, more);
        }
    }

    /// The same for all members.
    fn all_laws(&mut self, pass: usize, extra: u32, more: &Named) {
        self.laws(pass, ALL, Per::Cell, extra, more);
    }
}

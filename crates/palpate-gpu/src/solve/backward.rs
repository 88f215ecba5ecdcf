//! Adjoint and tangent of start and step, with the exact tangent at the converged state.

use crate::device::pipelines::pass;
use crate::device::pipelines::shared::asks;
use crate::device::pipelines::shared::points::{BACK, BY_OLD};
use crate::passes::{ALL, Passes, Per};
use crate::world::columns;
use crate::world::{Adjoint, COLUMN_VECTORS, Loan, State, Tally, Tangent, VECTOR, World};
use palpate_model::scene::InitialShape;

/// Adjoint of step k: adds to dJ/d(now) and to dJ/dθ.
pub(crate) fn step_adjoint(world: &World, k: usize, now: &State, next: &State, adj: &Adjoint, adj_now: &Adjoint, tally: &Tally) {
    world.record(|r| {
        let mut s = Passes::new(world, r, Some(k), now, next, tally);
        s.linearise();
        s.run_with(pass::FORM_RHS, ALL, Per::Node, 0, &[("adj", &adj.0.buffer)]);
        s.solve();
        s.run(pass::HOLD_CELLS, ALL, Per::Hold, asks::HOLD_PROBE);
        s.couple_patches(BACK, &[]);
        s.couple_cells(asks::TRANSPOSED, &[]);
        s.run_with(pass::STEP_BACK, ALL, Per::Node, 0, &[("adj", &adj.0.buffer), ("adj_now", &adj_now.0.buffer)]);
        s.press_nodes(ALL, BACK, None, &adj_now.0.buffer, &[]);
        s.pull(tally);
    });
}

/// Adjoint of the start.
pub(crate) fn start_adjoint(world: &World, first: &State, adj: &Adjoint, tally: &Tally) {
    let blank = State(world.lend(3));
    world.record(|r| {
        r.clear(&blank.0.buffer);
        let mut s = Passes::new(world, r, None, &blank, first, tally);
        s.list();
        s.pull_start(tally, &adj.0.buffer);
        if world.plan.initial == InitialShape::StaticEquilibrium {
            s.linearise();
            s.run_with(pass::FORM_RHS, ALL, Per::Node, 0, &[("adj", &adj.0.buffer)]);
            s.solve();
            s.pull(tally);
        }
    });
}

/// Tangent of the start along the tangent's own directions.
pub(crate) fn start_tangent(world: &World, first: &State, tangent: &Tangent, tally: &Tally) {
    let blank = State(world.lend(3));
    let room = ColumnRoom::new(world, tangent.parts.len());
    let half = VECTOR * u64::from(world.geometry.shape.nodes) * world.members() as u64;
    world.record(|r| {
        r.clear(&blank.0.buffer);
        tangent.parts.iter().for_each(|part| r.clear(&part.buffer));
        let mut s = Passes::new(world, r, None, &blank, first, tally);
        room.lend_to(&mut s);
        s.list();
        for (part, rates) in tangent.parts.iter().zip(&*tangent.rates) {
            if rates.flying || rates.moved.rest {
                s.push_start(rates, &part.buffer);
            }
        }
        if world.plan.initial != InitialShape::StaticEquilibrium {
            return;
        }
        s.linearise();
        let moved: Vec<_> = tangent.parts.iter().zip(&*tangent.rates).collect();
        for together in moved.chunks(room.columns) {
            for (q, (_, rates)) in together.iter().enumerate() {
                s.push(rates);
                s.run(pass::SUM_OLD, ALL, Per::Node, 0);
                s.begin_column(q);
            }
            s.solve_columns(together.len());
            for (q, (part, _)) in together.iter().enumerate() {
                s.recorder.copy_part([(room.solved(world), q as u64 * half), (&part.buffer, 0)], half);
            }
        }
    });
}

/// Tangent of step k.
pub(crate) fn step_tangent(world: &World, k: usize, now: &State, next: &State, old: &Tangent, new: &Tangent, tally: &Tally) {
    let room = ColumnRoom::new(world, old.parts.len());
    let flight = &world.buffers["trial"];
    let all: Vec<_> = old.parts.iter().zip(&new.parts).zip(&*old.rates).collect();
    world.record(|r| {
        let mut s = Passes::new(world, r, Some(k), now, next, tally);
        room.lend_to(&mut s);
        s.linearise();
        for together in all.chunks(room.columns) {
            for (q, ((from, _), rates)) in together.iter().enumerate() {
                let from = &from.buffer;
                s.push(rates);
                s.run_with(pass::FLY_TANGENT, ALL, Per::Node, 0, &[("tangent", from), ("flight", flight)]);
                s.run_with(pass::SUM_FLIGHT, ALL, Per::Node, 0, &[("probe", flight)]);
                s.run_with(pass::HOLD_CELLS, ALL, Per::Hold, asks::HOLD_PROBE, &[("probe", from)]);
                s.couple_patches(BY_OLD, &[("probe", from)]);
                s.couple_cells(asks::ALONG, &[("probe", from)]);
                s.run_with(pass::SUM_OLD, ALL, Per::Node, 0, &[("probe", from)]);
                s.press_nodes(ALL, BY_OLD, None, &world.buffers["rhs"], &[("probe", from)]);
                s.begin_column(q);
            }
            s.solve_columns(together.len());
            for (q, ((from, to), _)) in together.iter().enumerate() {
                let ends = [("tangent", &from.buffer), ("tangent_next", &to.buffer)];
                s.run_with(pass::LAND_TANGENT, ALL, Per::Node, q as u32, &ends);
            }
        }
    });
}

/// Vectors of the columns that are solved for at the same time.
struct ColumnRoom {
    /// How many columns there is room for.
    columns: usize,
    /// Those of [`COLUMN_VECTORS`], unless it is a single column.
    loans: Vec<Loan>,
}

impl ColumnRoom {
    fn new(world: &World, wanted: usize) -> ColumnRoom {
        let columns = wanted.clamp(1, columns(world.members() as u64) as usize);
        let count = if columns > 1 { COLUMN_VECTORS.len() } else { 0 };
        ColumnRoom { columns, loans: (0..count).map(|_| world.lend(columns as u64)).collect() }
    }

    fn lend_to<'a>(&'a self, s: &mut Passes<'a, '_>) {
        s.own.extend(COLUMN_VECTORS.iter().zip(&self.loans).map(|(name, loan)| (*name, &loan.buffer)));
    }

    /// Where the solutions lie, one column after another.
    fn solved<'a>(&'a self, world: &'a World) -> &'a wgpu::Buffer {
        self.loans.first().map_or(&world.buffers[COLUMN_VECTORS[0]], |loan| &loan.buffer)
    }
}

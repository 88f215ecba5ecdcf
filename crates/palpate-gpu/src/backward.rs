//! Adjoint and tangent of start and step, with the exact tangent at the converged state.

use crate::effects;
use crate::pipelines::pass;
use crate::solve::{ALL, Per, Solve};
use crate::world::{Adjoint, State, Tally, Tangent, VECTOR, World};
use palpate_model::scene::InitialShape;

/// Adjoint of step k: adds to dJ/d(now) and to dJ/dθ.
pub(crate) fn step_adjoint(world: &World, k: usize, now: &State, next: &State, adj: &Adjoint, adj_now: &Adjoint, tally: &Tally) {
    world.record(|r| {
        let mut s = Solve::new(world, r, Some(k), now, next, tally);
        s.linearise();
        s.run_with(pass::FORM_RHS, ALL, Per::Node, 0, &[("adj", &adj.0.buffer)]);
        s.solve();
        s.run(pass::HOLD_CELLS, ALL, Per::Hold, 5);
        s.couple_patches(effects::BACK, &[]);
        s.couple_cells(1, &[]);
        s.run_with(pass::STEP_BACK, ALL, Per::Node, 0, &[("adj", &adj.0.buffer), ("adj_now", &adj_now.0.buffer)]);
        s.press_nodes(ALL, effects::BACK, None, &adj_now.0.buffer, &[]);
        s.add_columns();
    });
}

/// Adjoint of the start.
pub(crate) fn start_adjoint(world: &World, first: &State, adj: &Adjoint, tally: &Tally) {
    let blank = State(world.lend(3));
    world.record(|r| {
        r.clear(&blank.0.buffer);
        let mut s = Solve::new(world, r, None, &blank, first, tally);
        s.list();
        s.add_start_columns(&adj.0.buffer);
        if world.plan.initial == InitialShape::StaticEquilibrium {
            s.linearise();
            s.run_with(pass::FORM_RHS, ALL, Per::Node, 0, &[("adj", &adj.0.buffer)]);
            s.solve();
            s.add_columns();
        }
    });
}

/// Tangent of the start along the tangent's own directions.
pub(crate) fn start_tangent(world: &World, first: &State, tangent: &Tangent, tally: &Tally) {
    let blank = State(world.lend(3));
    let half = VECTOR * u64::from(world.geometry.shape.nodes) * world.members() as u64;
    let keys = &world.plan.layout.keys;
    world.record(|r| {
        r.clear(&blank.0.buffer);
        let moved = world.plan.initial == InitialShape::StaticEquilibrium;
        if moved {
            Solve::new(world, r, None, &blank, first, tally).linearise();
        }
        for (part, p) in tangent.parts.iter().zip(&tangent.directions) {
            r.clear(&part.buffer);
            let mut s = Solve::new(world, r, None, &blank, first, tally);
            s.list();
            if s.velocity_column(keys[*p]) {
                s.recorder.copy_part(&world.buffers["column"], &part.buffer, half, half);
                if s.shape_column(keys[*p]) {
                    s.recorder.copy_part(&world.buffers["column"], &part.buffer, 0, half);
                }
            } else if let Some(column) = s.column_of(keys[*p]).filter(|_| moved) {
                s.column(Some(column));
                s.run(pass::SUM_OLD, ALL, Per::Node, 0);
                s.solve();
                s.recorder.copy_part(&world.buffers["direction"], &part.buffer, 0, half);
            }
        }
    });
}

/// Tangent of step k.
pub(crate) fn step_tangent(world: &World, k: usize, now: &State, next: &State, old: &Tangent, new: &Tangent, tally: &Tally) {
    let keys = &world.plan.layout.keys;
    world.record(|r| {
        let mut s = Solve::new(world, r, Some(k), now, next, tally);
        s.linearise();
        for ((from, to), p) in old.parts.iter().zip(&new.parts).zip(&old.directions) {
            let from = &from.buffer;
            let column = s.column_of(keys[*p]);
            s.column(column);
            let flight = &world.buffers["trial"];
            s.run_with(pass::FLY_TANGENT, ALL, Per::Node, 0, &[("tangent", from), ("flight", flight)]);
            s.run_with(pass::SUM_FLIGHT, ALL, Per::Node, 0, &[("probe", flight)]);
            s.run_with(pass::HOLD_CELLS, ALL, Per::Hold, 5, &[("probe", from)]);
            s.couple_patches(effects::BY_OLD, &[("probe", from)]);
            s.couple_cells(0, &[("probe", from)]);
            s.run_with(pass::SUM_OLD, ALL, Per::Node, 0, &[("probe", from)]);
            s.press_nodes(ALL, effects::BY_OLD, None, &world.buffers["rhs"], &[("probe", from)]);
            s.solve();
            s.run_with(pass::LAND_TANGENT, ALL, Per::Node, 0, &[("tangent", from), ("tangent_next", &to.buffer)]);
        }
    });
}

//! Adjoint and tangent of start and step, with the exact tangent at the converged state.

use crate::device::pipelines::pass;
use crate::passes::{ALL, Passes, Per};
use crate::solve::forward::rest;
use crate::world::columns;
use crate::world::{Adjoint, Loan, SOLVING, SOLVING_VECTORS, State, Tally, Tangent, VECTOR, World};
use palpate_model::plan::scheme::Stage;
use palpate_model::scene::InitialShape;

/// Adjoint of a stage: adds to dJ/d(past states) and to dJ/dθ.
pub(crate) fn step_adjoint(
    world: &World,
    stage: &Stage,
    past: &[&State],
    next: &State,
    adj: &Adjoint,
    adj_past: &[Adjoint],
    tally: &Tally,
) {
    world.enter(stage);
    let mixed = world.room_to_mix(past);
    let now = mixed.as_ref().unwrap_or(past[0]);
    let share = world.lend(2 * mixed.iter().len() as u64);
    world.record(|r| {
        rest(world, r, stage.step, tally);
        let mut s = Passes::of_stage(world, r, stage, past, now, next, tally);
        s.linearise();
        s.run_with(pass::FORM_RHS, ALL, Per::Node, 0, &[("adj", &adj.0.buffer)]);
        s.solve();
        if s.past.is_empty() {
            s.back(&now.0.buffer, &adj.0.buffer, &adj_past[0].0.buffer);
        }
        // Of several past states each has its own deformation, and the weight of its share in their sum.
        for ((weight, state), to) in s.past.clone().into_iter().zip(adj_past) {
            s.recorder.clear(&share.buffer);
            s.back(state, &adj.0.buffer, &share.buffer);
            s.accumulate(weight, &share.buffer, &to.0.buffer);
        }
        s.pull(tally);
    });
}

impl Passes<'_, '_> {
    /// The weighted sum of the past states' tangents, in `sum` where they are several.
    fn mixed_tangent<'b>(&mut self, parts: &[(f32, &'b wgpu::Buffer)], sum: &'b wgpu::Buffer) -> &'b wgpu::Buffer {
        if let [(_, single)] = parts {
            return single;
        }
        self.add_scaled(parts, sum);
        sum
    }
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

/// Tangent of a stage.
pub(crate) fn step_tangent(
    world: &World,
    stage: &Stage,
    past: &[&State],
    next: &State,
    old: &[&Tangent],
    new: &Tangent,
    tally: &Tally,
) {
    world.enter(stage);
    let mixed = world.room_to_mix(past);
    let now = mixed.as_ref().unwrap_or(past[0]);
    let room = ColumnRoom::new(world, new.parts.len());
    let flight = &world.buffers["trial"];
    let all: Vec<_> = new.parts.iter().zip(&*new.rates).enumerate().collect();
    let [sum, share] = [(); 2].map(|()| world.lend(2 * mixed.iter().len() as u64));
    // Tangents of the past states with their weights, by direction.
    let weighted = |place: usize| -> Vec<(f32, &wgpu::Buffer)> {
        stage.from.iter().zip(old).map(|(f, t)| (f.1 as f32, &t.parts[place].buffer)).collect()
    };
    world.record(|r| {
        rest(world, r, stage.step, tally);
        let mut s = Passes::of_stage(world, r, stage, past, now, next, tally);
        room.lend_to(&mut s);
        s.linearise();
        for together in all.chunks(room.columns) {
            for (q, (place, (_, rates))) in together.iter().enumerate() {
                let parts = weighted(*place);
                let from = s.mixed_tangent(&parts, &sum.buffer);
                s.push(rates);
                s.run_with(pass::FLY_TANGENT, ALL, Per::Node, 0, &[("tangent", from), ("flight", flight)]);
                s.run_with(pass::SUM_FLIGHT, ALL, Per::Node, 0, &[("probe", flight)]);
                if s.past.is_empty() {
                    s.along_past(&now.0.buffer, from, true);
                }
                for (k, (part, (_, state))) in parts.iter().zip(s.past.clone()).enumerate() {
                    s.add_scaled(&[*part], &share.buffer);
                    s.along_past(state, &share.buffer, k == 0);
                }
                s.begin_column(q);
            }
            s.solve_columns(together.len());
            for (q, (place, (to, _))) in together.iter().enumerate() {
                let parts = weighted(*place);
                let ends = [("tangent", s.mixed_tangent(&parts, &sum.buffer)), ("tangent_next", &to.buffer)];
                s.run_with(pass::LAND_TANGENT, ALL, Per::Node, q as u32, &ends);
            }
        }
    });
}

/// Vectors of the columns that are solved for at the same time.
struct ColumnRoom {
    /// How many columns there is room for.
    columns: usize,
    /// Theirs, unless it is a single column.
    loan: Option<Loan>,
}

impl ColumnRoom {
    fn new(world: &World, wanted: usize) -> ColumnRoom {
        let columns = wanted.clamp(1, columns(world.members() as u64) as usize);
        ColumnRoom { columns, loan: (columns > 1).then(|| world.lend(SOLVING_VECTORS * columns as u64)) }
    }

    fn lend_to<'a>(&'a self, s: &mut Passes<'a, '_>) {
        s.own.extend(self.loan.iter().map(|loan| (SOLVING, &loan.buffer)));
    }

    /// Where the solutions lie, one column after another.
    fn solved<'a>(&'a self, world: &'a World) -> &'a wgpu::Buffer {
        self.loan.as_ref().map_or(&world.buffers[SOLVING], |loan| &loan.buffer)
    }
}

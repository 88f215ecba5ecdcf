//! Start and step: what one call of the backend puts on the device's list.

use crate::device::pipelines::pass;
use crate::device::recorder::{Args, Recorder, Size};
use crate::passes::{ALL, Passes, Per};
use crate::world::{State, Tally, World};
use palpate_model::plan::STATIC_ITERATIONS;
use palpate_model::plan::scheme::Stage;
use palpate_model::scene::InitialShape;

/// Newton iterations of a static problem: half of what the CPU allows. Every round that is allowed is recorded, whether a member takes it or
/// not, in every evaluation.
const ITERATIONS: usize = STATIC_ITERATIONS / 2;

/// The initial state.
pub(crate) fn start(world: &mut World, first: &mut State, tally: &mut Tally) {
    let iterations = world.plan.solver.newton_iterations.max(ITERATIONS);
    world.set_iterations(iterations);
    let world = &*world;
    // A static problem's old state is at rest.
    let blank = State(world.lend(3));
    world.record(|r| {
        r.clear(&first.0.buffer);
        r.clear(&blank.0.buffer);
        let steps = world.plan.initial == InitialShape::StaticEquilibrium;
        let mut s = Passes::new(world, r, None, &blank, first, tally);
        s.recorder.run(
            pass::CHECK_MEMBERS,
            &s.own.clone(),
            Size::All { members: 1, groups: world.members().div_ceil(64) },
            Args { extra: u32::from(steps), ..Args::default() },
        );
        if steps {
            s.newton(iterations);
        } else {
            s.list();
            s.run(pass::FINISH_STEP, ALL, Per::Node, 0);
        }
    });
    world_steps(world);
}

/// From here on steps are taken: the kernels may use the plan's own number of Newton iterations.
fn world_steps(world: &World) {
    let mut shape = world.geometry.shape;
    shape.iterations = world.plan.solver.newton_iterations as u32;
    if let Some(buffer) = world.buffers.get("shape") {
        world.gpu.queue.write_buffer(buffer, 0, bytemuck::bytes_of(&shape));
    }
}

/// Lets only those members take part in step k, and in what comes of it, whose recordings take it.
pub(crate) fn rest(world: &World, r: &mut Recorder, k: usize, tally: &Tally) {
    if world.batch.views.iter().all(|v| v.recording.steps >= world.plan.clock.steps) {
        return;
    }
    let groups = world.members().div_ceil(64);
    let args = Args { step: k as u32, ..Args::default() };
    r.run(pass::REST_MEMBERS, &[("health", tally.get("health"))], Size::All { members: 1, groups }, args);
}

/// One stage.
pub(crate) fn step(world: &World, stage: &Stage, past: &[&State], next: &mut State, tally: &mut Tally) {
    world.enter(stage);
    let mixed = world.room_to_mix(past);
    let now = mixed.as_ref().unwrap_or(past[0]);
    world.record(|r| {
        rest(world, r, stage.step, tally);
        Passes::of_stage(world, r, stage, past, now, next, tally).newton(world.plan.solver.newton_iterations);
    });
}

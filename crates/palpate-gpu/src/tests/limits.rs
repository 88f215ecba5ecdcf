//! What is too large, lost or out of memory is an error with a name, a size and a way out.

use super::scenes::{ball, device, held, own_device, plan, spread};
use crate::costs::MOST_DIRECTIONS;
use crate::device::GpuError;
use crate::device::Maker as _;
use crate::device::pipelines::shared::asks;
use crate::device::pipelines::shared::structs;
use crate::device::pipelines::{PASSES, PassSource, Pipelines, compile, constant, pass};
use crate::device::recorder::{Args, Recorder, Size};
use crate::device::{Lanes, STORAGE_BUFFERS, WIDTH, WORKGROUP_BYTES, fits, no_room, refusal};
use crate::layout::{Health, Newton, Shape};
use crate::passes::{ALL, MATRIX, Passes, Per, SOLVE, TRIAL};
use crate::solve;
use crate::world::MOST_SYSTEMS;
use crate::world::Tuning;
use crate::world::{KINDS, SECTIONS};
use crate::{GpuBackend, device::Gpu};
use palpate_engine::{Backend, Evaluate, FailureKind, ParamBatch, Request, Rollout, Wanted};
use std::collections::HashMap;
use std::sync::Arc;

#[test]
fn a_batch_beyond_a_buffer_names_limit_and_size() {
    let Some(gpu) = own_device() else { return };
    let plan = plan(&ball(0.05));
    let available = gpu.device.limits().max_storage_buffer_binding_size;
    // A matrix has at least one number for each node: this many members need more than one binding.
    let members = (available / (36 * plan.body.nodes.len() as u64) + 1) as usize;
    match solve::world(gpu.clone(), &plan, members, Tuning::default()) {
        Err(GpuError::Limit { needed, available, .. }) => assert!(needed > available),
        other => panic!("{:?}", other.map(|w| w.bytes())),
    }
    let error = GpuBackend::on(gpu).build(&plan, members).map(|_| ()).unwrap_err();
    assert!(error.hint.contains("smaller batch") && error.hint.contains("--backend cpu"), "{error}");
}

#[test]
fn a_body_beyond_a_binding_names_limit_and_size() {
    let Some(mut gpu) = own_device() else { return };
    let Some(own) = Arc::get_mut(&mut gpu) else { panic!("the device is not alone") };
    own.largest = 20_000;
    let e = solve::world(gpu, &plan(&ball(0.02)), 1, Tuning::default()).map(|w| w.bytes()).unwrap_err();
    let GpuError::Limit { limit, available, needed, what } = &e else { panic!("{e}") };
    assert_eq!((*limit, *available), ("max_storage_buffer_binding_size", 20_000));
    assert!(*needed > 20_000 && what.contains('`'), "{e}");
}

#[test]
fn more_members_than_built_for_fail_as_evaluations() {
    let Some(gpu) = own_device() else { return };
    let plan = plan(&ball(0.05));
    let backend = GpuBackend::on(gpu);
    let mut world = backend.build(&plan, 1).unwrap_or_else(|e| panic!("{e}"));
    backend.set_params(&mut world, &ParamBatch::from_rows(&spread(&plan, 3)));
    let tally = backend.new_tally(&world, &Request::default());
    let all = backend.read(&world, &tally);
    assert!(all.len() == 3 && all.iter().all(|e| e.failure.as_ref().is_some_and(|f| f.kind == FailureKind::Device)));
}

fn evaluate(rollout: &mut Rollout<GpuBackend>, theta: &[f64]) -> palpate_engine::Evaluation {
    let request = Request { gradient: Wanted::All, sensitivities: vec![0] };
    rollout.evaluate(&ParamBatch::from_rows(&[theta.to_vec()]), &request).remove(0)
}

#[test]
fn memory_that_runs_out_and_a_lost_device_are_errors_with_a_way_out() {
    let Some(gpu) = own_device() else { return };
    let mut scene = ball(0.05);
    scene.time.steps = 2;
    let plan = plan(&scene);
    let mut rollout = Rollout::new(GpuBackend::on(gpu.clone()), &plan, 1).unwrap_or_else(|e| panic!("{e}"));
    let well = evaluate(&mut rollout, &plan.theta);
    assert_eq!(well.failure, None);
    // What wgpu reports of a buffer that no driver could make comes from here.
    let source: Box<dyn std::error::Error + Send + Sync> = "a buffer of a tape".into();
    gpu.keep(crate::device::translate(wgpu::Error::OutOfMemory { source }));
    let failed = evaluate(&mut rollout, &plan.theta);
    let failure = failed.failure.unwrap_or_else(|| panic!("nothing failed"));
    assert_eq!(failure.kind, FailureKind::Device);
    assert!(failure.detail.contains("out of memory") && failure.hint.contains("smaller batch"), "{failure}");
    // Memory may be there again: the next evaluation is none the worse.
    assert_eq!(evaluate(&mut rollout, &plan.theta), well);

    // A lost device stays lost.
    gpu.device.destroy();
    for _ in 0..2 {
        let failed = evaluate(&mut rollout, &plan.theta);
        let failure = failed.failure.unwrap_or_else(|| panic!("a lost device gave cost {}", failed.cost));
        assert_eq!(failure.kind, FailureKind::Device);
        assert!(failed.cost.is_infinite() && failure.hint.contains("--backend cpu"), "{failure}");
    }
    assert!(GpuBackend::on(gpu).build(&plan, 1).is_err());
}

/// What `list_members` makes of as many members of this shape that all want a trial: the roster, and the sizes of dispatches.
fn listed(gpu: &Gpu, shape: Shape) -> [Vec<u32>; 2] {
    let fail = |e: GpuError| -> wgpu::Buffer { panic!("{e}") };
    let members = shape.members as usize;
    let newton = vec![Newton { stage: structs::WANTS_TRIAL, ..Newton::default() }; members];
    let size = 4 * (SECTIONS * (members + 1)) as u64;
    let buffers = [
        ("shape", gpu.upload("shape", &[shape]).unwrap_or_else(fail)),
        ("roster", gpu.buffer("roster", size).unwrap_or_else(fail)),
        ("arguments", gpu.buffer("arguments", (12 * SECTIONS * KINDS) as u64).unwrap_or_else(fail)),
        ("gate", gpu.buffer("gate", 12).unwrap_or_else(fail)),
        ("newton", gpu.upload("newton", &newton).unwrap_or_else(fail)),
        ("health", gpu.upload("health", &vec![Health::default(); members]).unwrap_or_else(fail)),
    ];
    let world: HashMap<&'static str, wgpu::Buffer> = buffers.into_iter().collect();
    let (mut groups, mut times) = (HashMap::new(), HashMap::new());
    let mut r = Recorder::new(gpu, &world, &mut groups, false);
    r.run(pass::LIST_MEMBERS, &[], Size::All { members: 1, groups: 1 }, Args { extra: 1, ..Args::default() });
    r.submit(&mut times);
    [("roster", SECTIONS * (members + 1)), ("arguments", 3 * SECTIONS * KINDS)]
        .map(|(name, count)| gpu.download(&world[name], count).unwrap_or_else(|e| panic!("{e}")))
}

#[test]
fn a_kernel_at_the_bound_of_its_loops_ends_them_all() {
    let Some(gpu) = device(None) else { return };
    // A lane goes through every 64th member: the most that a build accepts.
    let most = MOST_SYSTEMS;
    let shape = Shape { members: most as u32, nodes: 1, cells: 1, blocks: 1, ..Shape::default() };
    let [roster, _] = listed(&gpu, shape);
    assert_eq!(u64::from(roster[TRIAL as usize * (most as usize + 1)]), most);
}

#[test]
fn listings_give_every_kind_of_items_the_workgroups_that_its_passes_work_through() {
    let Some(gpu) = device(None) else { return };
    let shape = Shape {
        members: 3,
        nodes: 1000,
        cells: 333,
        blocks: 9001,
        patches: 777,
        holds: 55,
        elastic: 4321,
        groups: 17,
        slices: 23,
        crew: 5,
        ..Shape::default()
    };
    let [_, sizes] = listed(&gpu, shape);
    // A pass of each kind, how many of its lanes share an item, and the items.
    let kinds = [
        (Per::Member, pass::JUDGE_TRIAL, PASSES[pass::JUDGE_TRIAL].width, 1),
        (Per::Node, pass::PLACE_NEXT, 1, shape.nodes),
        (Per::Cell, pass::PRESS_CELLS, 8, shape.cells),
        (Per::Block, pass::GATHER_MATRIX, 1, shape.blocks),
        (Per::Patch, pass::TOUCH_PATCHES, 1, shape.patches),
        (Per::Hold, pass::HOLD_CELLS, 8, shape.holds),
        (Per::Slice, pass::MULTIPLY_ROWS, PASSES[pass::MULTIPLY_ROWS].width, shape.slices),
        (Per::Elastic, pass::PRESS_ELASTIC, 1, shape.elastic),
        (Per::Group, pass::ADVANCE_CG, PASSES[pass::ADVANCE_CG].width, shape.groups),
        (Per::Crew, pass::PERSIST_CG, PASSES[pass::PERSIST_CG].width, shape.crew),
    ];
    assert_eq!(kinds.len(), KINDS);
    for (per, pass, lanes, items) in kinds {
        let groups = items.div_ceil(PASSES[pass].width / lanes);
        for (section, members) in [(ALL, shape.members), (MATRIX, 0), (SOLVE, 0), (TRIAL, shape.members)] {
            let found = &sizes[3 * (section as usize * KINDS + per as usize)..][..3];
            assert_eq!(found, [groups * members, groups.min(1) * u32::from(members > 0), 1], "{per:?} {}", PASSES[pass].name);
        }
    }
}

#[test]
fn no_kernel_binds_more_buffers_than_adapters_are_asked_for() {
    let widest = PASSES.iter().map(|p| p.bindings.iter().filter(|b| !b.3).count()).max();
    assert_eq!(widest, Some(STORAGE_BUFFERS as usize));
    assert_eq!(PASSES.iter().map(|p| p.width).max(), Some(WIDTH));
    assert!(PASSES.iter().all(|p| p.memory <= WORKGROUP_BYTES));
}

#[test]
fn an_adapter_that_is_too_small_is_refused_by_the_limit_that_is() {
    let enough = wgpu::Limits {
        max_storage_buffers_per_shader_stage: STORAGE_BUFFERS,
        max_compute_invocations_per_workgroup: WIDTH,
        max_compute_workgroup_storage_size: WORKGROUP_BYTES,
        ..wgpu::Limits::default()
    };
    let features = wgpu::Features::IMMEDIATES;
    assert_eq!(refusal("a", features, &enough), None);
    type Fault = (&'static str, u32, fn(&mut wgpu::Limits));
    let faults: [Fault; 3] = [
        ("max_storage_buffers_per_shader_stage", STORAGE_BUFFERS, |l| l.max_storage_buffers_per_shader_stage -= 1),
        ("max_compute_invocations_per_workgroup", WIDTH, |l| l.max_compute_invocations_per_workgroup -= 1),
        ("max_compute_workgroup_storage_size", WORKGROUP_BYTES, |l| l.max_compute_workgroup_storage_size -= 1),
    ];
    for (limit, needed, fault) in faults {
        let mut limits = enough.clone();
        fault(&mut limits);
        let e = refusal("Small 3000", features, &limits).unwrap_or_else(|| panic!("{limit} is not missed"));
        let text = e.to_string();
        for word in ["Small 3000", limit, &needed.to_string(), &(needed - 1).to_string()] {
            assert!(text.contains(word), "{text}");
        }
        assert!(e.hint().contains("--backend cpu") && e.hint().contains("another adapter"), "{}", e.hint());
    }
    let e = refusal("Small 3000", wgpu::Features::empty(), &enough).unwrap_or_else(|| panic!("no feature is missed"));
    assert!(e.to_string().contains("immediates"), "{e}");
}

#[test]
fn a_buffer_beyond_a_limit_names_it_and_memory_that_runs_out_the_buffer() {
    assert_eq!(fits("values", 1000, 1000, 2000), Ok(()));
    for (binding, buffer, limit) in [
        (999, 2000, "max_storage_buffer_binding_size"),
        (2000, 999, "max_buffer_size"),
        (999, 999, "max_storage_buffer_binding_size"),
    ] {
        let e = fits("values", 1000, binding, buffer).err().unwrap_or_else(|| panic!("{limit} is not missed"));
        let text = e.to_string();
        assert!(["`values`", "1000", limit, "999"].iter().all(|w| text.contains(w)), "{text}");
        assert!(["coarser cells", "smaller batch", "--backend cpu"].iter().all(|w| e.hint().contains(w)), "{}", e.hint());
    }
    let source: Box<dyn std::error::Error + Send + Sync> = "not enough memory left".into();
    let e = no_room("tangents", 123_456, wgpu::Error::OutOfMemory { source });
    let text = e.to_string();
    assert!(["out of memory", "`tangents`", "123456 bytes", "not enough memory left"].iter().all(|w| text.contains(w)), "{text}");
    assert!(e.hint().contains("smaller batch"), "{}", e.hint());
}

#[test]
fn a_kernel_that_does_not_compile_is_named() {
    let Some(gpu) = own_device() else { return };
    // What no build lets pass: bad text, and bad types.
    for text in
        ["@compute @workgroup_size(1) fn broken() { let x = ; }", "@compute @workgroup_size(1) fn broken() { let x: u32 = 1.5; }"]
    {
        let source = PassSource {
            name: "broken",
            sources: [text; 2],
            lanes: false,
            coherent: false,
            width: 1,
            memory: 0,
            bindings: &[],
            overrides: &[],
        };
        let e = compile(&gpu, &source, &Pipelines::new(Lanes::Memory)).err().unwrap_or_else(|| panic!("{text} compiles"));
        assert!(matches!(&e, GpuError::Shader { pass, message } if pass == "broken" && !message.is_empty()), "{e}");
        assert!(e.to_string().contains("the kernel broken does not compile") && e.hint().contains("--backend cpu"), "{e}");
        // The device is none the worse.
        assert_eq!(gpu.take_trouble(), None);
    }
}

#[test]
fn an_evaluation_that_needs_a_kernel_that_does_not_compile_names_it_and_the_way_out() {
    let Some(mut gpu) = own_device() else { return };
    // Nobody says how stiff springs are, which derivatives alone ask.
    let missing = "held_stiffness";
    let Some(own) = Arc::get_mut(&mut gpu) else { panic!("the device is not alone") };
    own.pipelines.constant = |name| constant(name).filter(|_| name != "held_stiffness");
    let mut scene = ball(0.05);
    scene.time.steps = 1;
    let plan = plan(&scene);
    let mut rollout = Rollout::new(GpuBackend::on(gpu), &plan, 1).unwrap_or_else(|e| panic!("{e}"));
    // It does not compile the second time either.
    for _ in 0..2 {
        let found = evaluate(&mut rollout, &plan.theta);
        let failure = found.failure.unwrap_or_else(|| panic!("no kernel is missed, and the cost is {}", found.cost));
        assert!(failure.kind == FailureKind::Device && found.cost.is_infinite(), "{failure}");
        assert!(names_a_kernel(&failure.detail, missing) && failure.hint.contains("--backend cpu"), "{failure}");
    }
}

/// Whether words say of one of the kernels that need a constant that it does not compile.
fn names_a_kernel(words: &str, missing: &str) -> bool {
    let needs = |p: &&PassSource| p.overrides.contains(&missing);
    PASSES.iter().filter(needs).any(|p| words.contains(&format!("the kernel {} does not compile", p.name)))
}

#[test]
fn a_kernel_of_every_step_that_does_not_compile_is_named_where_the_plan_is_made_ready() {
    let Some(mut gpu) = own_device() else { return };
    // Nobody says where the barrier begins.
    let Some(own) = Arc::get_mut(&mut gpu) else { panic!("the device is not alone") };
    own.pipelines.constant = |name| constant(name).filter(|_| name != "guard_start");
    let e = GpuBackend::on(gpu).build(&plan(&ball(0.05)), 1).map(|_| ()).unwrap_err();
    assert!(names_a_kernel(&e.message, "guard_start") && e.hint.contains("--backend cpu"), "{e}");
}

#[test]
fn more_derivatives_than_an_invocation_may_look_through_are_refused() {
    let Some(gpu) = own_device() else { return };
    let mut scene = ball(0.05);
    scene.time.steps = 1;
    let plan = plan(&scene);
    let mut rollout = Rollout::new(GpuBackend::on(gpu), &plan, 1).unwrap_or_else(|e| panic!("{e}"));
    let mut with = |count: u64| {
        let request = Request { gradient: Wanted::Nothing, sensitivities: vec![0; count as usize] };
        rollout.evaluate(&ParamBatch::from_rows(std::slice::from_ref(&plan.theta)), &request).remove(0).failure
    };
    let failure = with(MOST_DIRECTIONS + 1).unwrap_or_else(|| panic!("{} derivatives", MOST_DIRECTIONS + 1));
    for words in ["by 257 parameters", "at most 256"] {
        assert!(failure.to_string().contains(words), "{failure}");
    }
    assert_eq!(with(2), None);
}

#[test]
fn conjugate_gradients_at_the_bound_of_their_loops_run_all_iterations() {
    let Some(gpu) = device(None) else { return };
    // Held, without inertia and by block-Jacobi alone: more iterations to convergence than a dispatch may have.
    let plan = plan(&held(0.014));
    let backend = GpuBackend::on(gpu.clone());
    let mut world = backend.build(&plan, 1).unwrap_or_else(|e| panic!("{e}"));
    backend.set_params(&mut world, &ParamBatch::from_rows(std::slice::from_ref(&plan.theta)));
    world.set_iterations(1);
    let tally = backend.new_tally(&world, &Request::default());
    let (now, next) = (backend.new_state(&world), backend.new_state(&world));
    let wave: Vec<[f32; 4]> = (0..plan.body.nodes.len()).map(|i| [(i as f32).sin(), (2.0 * i as f32).cos(), 1.0, 0.0]).collect();
    gpu.queue.write_buffer(&world.buffers["rhs"], 0, bytemuck::cast_slice(&wave));
    let none = vec![0u8; world.buffers["coarse"].size() as usize];
    gpu.queue.write_buffer(&world.buffers["coarse"], 0, &none);
    let world = &world;
    let run = |work: fn(&mut Passes)| world.record(|r| work(&mut Passes::new(world, r, None, &now, &next, &tally)));
    let newton = || gpu.download::<Newton>(&world.buffers["newton"], 1).unwrap_or_else(|e| panic!("{e}"))[0];
    run(|s| {
        s.linearise();
        s.begin_column(0);
    });
    // An accuracy that cannot be reached: the dispatch ends at its bound, which the loops set and not the longest chunk.
    let start = Newton { goal: 0.0, forcing: -1.0, ..newton() };
    gpu.queue.write_buffer(&world.buffers["newton"], 0, bytemuck::bytes_of(&start));
    run(|s| {
        s.list();
        s.begin_cg(asks::FOR_DERIVATIVE);
        s.iterate_chunk(asks::FOR_DERIVATIVE);
    });
    let (end, chunk) = (newton(), world.geometry.shape.chunk);
    println!("{} nodes, {chunk} iterations, {:.1e} of the residual left", plan.body.nodes.len(), (end.rz / start.rz).sqrt());
    assert!((20..512).contains(&chunk));
    assert_eq!((end.cg, end.stage), (chunk, 2), "{end:?}");
    // Sums cut short by an adapter would make directions that do not descend.
    assert!(end.rz < 1e-4 * start.rz, "{end:?}");
}

#[test]
fn more_members_than_an_invocation_may_visit_are_refused() {
    let Some(gpu) = own_device() else { return };
    let e = solve::world(gpu, &plan(&ball(0.05)), MOST_SYSTEMS as usize + 1, Tuning::default()).map(|w| w.bytes()).unwrap_err();
    let GpuError::Limit { limit, available, needed, what } = &e else { panic!("{e}") };
    assert!(limit.contains("loop iterations") && needed > available && what.contains("list_members"), "{e}");
}

//! The second level of the preconditioner: what it computes, what it knows, how groups turn, and what it is good for.

use super::elastic::bar;
use super::passes::Exact;
use super::products::crowded;
use super::scenes::{ball, device, plan, solving_part, spread};
use crate::device::pipelines::shared::asks;
use crate::device::pipelines::shared::solving::{REST, SCALED};
use crate::layout::Newton;
use crate::passes::{ALL, Passes};
use crate::world::carried;
use crate::world::{State, Tally, World};
use crate::{GpuBackend, Tuning};
use glam::{DQuat, DVec3};
use palpate_engine::{Backend, Direction, ParamBatch, Request};
use palpate_model::mechanics::motion::RigidMotion;
use palpate_model::params::ParamKey;
use palpate_model::plan::Plan;
use palpate_model::scene::{Analytic, BodySource, Clamp, Resolution, Scene, Tetrahedron};

fn backend(gpu: std::sync::Arc<crate::Gpu>, many: bool) -> GpuBackend {
    GpuBackend::on(gpu).tuned(Tuning {
        many_from: if many { 0 } else { usize::MAX },
        product: Some(crate::Product::Matrix),
        crew: 0,
    })
}

fn vector(v: [f32; 4]) -> DVec3 {
    DVec3::new(v[0].into(), v[1].into(), v[2].into())
}

/// A world after its first step.
fn stepped(backend: &GpuBackend, plan: &Plan, theta: &[Vec<f64>]) -> (World, [State; 2], Tally) {
    let mut world = backend.build(plan, theta.len()).unwrap_or_else(|e| panic!("{e}"));
    backend.set_params(&mut world, &ParamBatch::from_rows(theta));
    let mut tally = backend.new_tally(&world, &Request::default());
    let [mut now, mut next] = [0; 2].map(|_| backend.new_state(&world));
    backend.start(&mut world, &mut now, &mut tally);
    backend.step(&mut world, &plan.clock.stages()[0], &[&now], &mut next, &mut tally);
    (world, [now, next], tally)
}

/// Q of a node, times shift and turn of its group: rows of three.
fn rows(arm: DVec3) -> [[f64; 6]; 3] {
    let column = |k: usize| {
        let mut unit = [0.0; 6];
        unit[k] = 1.0;
        DVec3::from_slice(&unit[..3]) + DVec3::from_slice(&unit[3..]).cross(arm)
    };
    let columns: Vec<DVec3> = (0..6).map(column).collect();
    [0, 1, 2].map(|r| std::array::from_fn(|k| columns[k][r]))
}

/// z = D⁻¹ r + Q C Qᵀ r in f64, of one member, from what the device holds.
fn right(world: &World, member: usize, r: &[DVec3]) -> Vec<DVec3> {
    let n = world.plan.body.nodes.len();
    let get = |name: &str, items: usize| -> Vec<[f32; 4]> {
        world.gpu.download(&world.buffers[name], items).unwrap_or_else(|e| panic!("{e}"))
    };
    let groups = &world.geometry.groups;
    let inverses = get("inverses", (2 * n + groups.len()) * world.members());
    let turns = &inverses[2 * n * world.members()..];
    let turn = |node: usize| {
        let q = turns[member * groups.len() + groups.of_node[node] as usize].map(f64::from);
        DQuat::from_xyzw(q[0], q[1], q[2], q[3]).normalize()
    };
    let arms = groups.arms(&world.plan.body, &vec![DVec3::ZERO; n]);
    let mut coarse = world.coarse.clone();
    let kind = coarse.kind(&world.plan.clock.stages()[0]) as usize;
    let [number, factor] = coarse.choices(&world.batch.physics)[kind * world.members() + member];
    let c = coarse.dense(number as usize);
    let mut loads = vec![0.0; 6 * groups.len()];
    let carried = carried(&world.plan);
    for i in (0..n).filter(|i| carried[*i]) {
        let own = turn(i).inverse() * r[i];
        for (row, value) in rows(arms[i]).iter().zip(own.to_array()) {
            (0..6).for_each(|k| loads[6 * groups.of_node[i] as usize + k] += row[k] * value);
        }
    }
    let motions: Vec<f64> = c.iter().map(|row| row.iter().zip(&loads).map(|(c, l)| c * l * f64::from(factor)).sum()).collect();
    (0..n)
        .map(|i| {
            let [a, b] = [0, 1].map(|k| inverses[2 * (member * n + i) + k].map(f64::from));
            let own = glam::DMat3::from_cols_array(&[a[0], a[1], a[2], a[1], a[3], b[0], a[2], b[0], b[1]]);
            let motion = &motions[6 * groups.of_node[i] as usize..][..6];
            let moved = rows(arms[i]).map(|row| row.iter().zip(motion).map(|(q, m)| q * m).sum::<f64>());
            own * r[i] + if carried[i] { turn(i) * DVec3::from_array(moved) } else { DVec3::ZERO }
        })
        .collect()
}

/// A short bar of tetrahedra that a clamp holds and turns at one end. Each of its two groups is a plate that hinges on two nodes that are held.
fn hinged() -> Scene {
    let mut scene = ball(0.03);
    scene.solver.tetrahedron = Tetrahedron::Linear;
    scene.object.source = bar(DVec3::new(0.0, -0.017, -0.0165), 0.0334, [3, 1, 1]);
    scene.object.resolution = Resolution::Own;
    scene.material.youngs_modulus = 2e5;
    scene.planes.clear();
    scene.masses.clear();
    let motion = RigidMotion {
        times: vec![0.0, 0.1],
        translations: vec![DVec3::ZERO, DVec3::new(0.003, 0.001, -0.002)],
        rotations: vec![DQuat::IDENTITY, DQuat::from_rotation_y(0.1)],
    };
    scene.clamps = vec![Clamp::still(DVec3::splat(-1.0), DVec3::new(0.021, 1.0, 1.0)).moved(Some(motion))];
    scene
}

/// Both ways to apply it, on a body that has turned, for members of different stiffness; and on one that has nodes which take no part.
#[test]
fn many_and_one_workgroup_apply_what_the_formula_says() {
    let Some(gpu) = device(None) else { return };
    let mut scene = crowded();
    scene.initial.state = palpate_model::scene::InitialShape::Rest;
    scene.initial.angular_velocity = DVec3::new(9.0, 4.0, -7.0);
    scene.clamps.clear();
    for (scene, many) in [(&scene, true), (&scene, false), (&hinged(), true), (&hinged(), false)] {
        let plan = plan(scene);
        let theta = spread(&plan, 3);
        let backend = backend(gpu.clone(), many);
        let (mut world, [now, next], tally) = stepped(&backend, &plan, &theta);
        assert!(world.geometry.groups.len() > 1);
        // No iteration follows the preconditioner.
        world.geometry.shape.chunk = 0;
        world.enter(&plan.clock.stages()[0]);
        let n = plan.body.nodes.len();
        let wave: Vec<[f32; 4]> =
            (0..3 * n).map(|i| [(i as f32).sin(), (2.0 * i as f32).cos(), (0.01 * i as f32).sin(), 0.0]).collect();
        world.gpu.queue.write_buffer(&world.buffers["rhs"], 0, bytemuck::cast_slice(&wave));
        world.record(|r| {
            let mut s = Passes::new(&world, r, Some(0), &now, &next, &tally);
            s.linearise();
            s.begin_column(0);
            s.list();
            s.begin_cg(asks::FOR_DERIVATIVE);
            if many { s.precondition() } else { s.iterate_chunk(asks::FOR_DERIVATIVE) }
        });
        let [rest, z] = [REST, SCALED].map(|part| solving_part(&world, part).into_iter().map(vector).collect::<Vec<_>>());
        let mut differ = false;
        for member in 0..3 {
            let own = member * n..(member + 1) * n;
            let expected = right(&world, member, &rest[own.clone()]);
            let size = expected.iter().fold(0.0f64, |m, v| m.max(v.length()));
            let off = expected.iter().zip(&z[own.clone()]).map(|(a, b)| (*a - *b).length()).fold(0.0, f64::max);
            println!("many {many}, member {member}: {:.1e}", off / size);
            // Sums of some hundred products of both signs, with 24 bits each.
            assert!(off < 1e-5 * size, "{off:e} of {size:e}");
            differ |= rest[own.clone()] != rest[..n] && z[own] != z[..n];
        }
        assert!(differ, "all members are alike");
    }
}

/// At rest, and where τ is a power of two, C is the inverse of the CPU's matrix for the groups' motions.
#[test]
fn what_the_host_knows_is_the_inverse_of_the_groups_matrix() {
    let Some(gpu) = device(None) else { return };
    let mut scene = crowded();
    // As far from planes as it starts: the CPU's matrix below is that of the body at rest.
    scene.planes.clear();
    scene.masses.clear();
    let time = (scene.time.step, scene.time.theta);
    let share = time.1 + scene.material.stiffness_damping / time.0;
    scene.material.youngs_modulus = 1000.0 / (time.1 * time.0 * time.0) / share * 0.5;
    scene.clamps.iter_mut().for_each(|c| c.motion = None);
    let plan = plan(&scene);
    let backend = backend(gpu, true);
    let mut world = backend.build(&plan, 1).unwrap_or_else(|e| panic!("{e}"));
    backend.set_params(&mut world, &ParamBatch::from_rows(std::slice::from_ref(&plan.theta)));
    let exact = Exact::new(&plan, |_| [DVec3::ZERO; 3]);
    let groups = &world.geometry.groups;
    let arms = groups.arms(&plan.body, &vec![DVec3::ZERO; plan.body.nodes.len()]);
    let n = 6 * groups.len();
    let mut coarse = world.coarse.clone();
    let kind = coarse.kind(&plan.clock.stages()[0]) as usize;
    let [number, factor] = coarse.choices(&world.batch.physics)[kind];
    let c = coarse.dense(number as usize);
    let mut worst = 0.0f64;
    for k in 0..n {
        let along: Vec<DVec3> = (0..arms.len())
            .map(|i| {
                if groups.of_node[i] as usize == k / 6 { DVec3::from_array(rows(arms[i]).map(|r| r[k % 6])) } else { DVec3::ZERO }
            })
            .collect();
        let image = exact.product(&along);
        let mut column = vec![0.0; n];
        for i in 0..arms.len() {
            for (row, value) in rows(arms[i]).iter().zip(image[i].to_array()) {
                (0..6).for_each(|p| column[6 * groups.of_node[i] as usize + p] += row[p] * value);
            }
        }
        for (j, row) in c.iter().enumerate() {
            let entry: f64 = row.iter().zip(&column).map(|(c, a)| c * a * f64::from(factor)).sum();
            worst = worst.max((entry - f64::from(u8::from(j == k))).abs());
        }
    }
    println!("{n} motions: C A differs from 1 by {worst:.1e}");
    // Rounding of C and of the device's matrix, times the condition of some thousand.
    assert!(worst < 1e-5, "{worst}");
}

#[test]
fn groups_turn_as_the_body_does() {
    let Some(gpu) = device(None) else { return };
    let plan = plan(&ball(0.02));
    let backend = backend(gpu, true);
    let (world, [now, next], tally) = stepped(&backend, &plan, std::slice::from_ref(&plan.theta));
    let n = plan.body.nodes.len();
    for (axis, angle) in [(DVec3::new(1.0, -2.0, 0.5), 0.4), (DVec3::new(-0.2, 0.1, 1.0), 2.9), (DVec3::X, 0.0)] {
        let turn = DQuat::from_axis_angle(axis.normalize(), angle);
        let state: Vec<[f32; 4]> = (0..3 * n)
            .map(|i| {
                let x = plan.body.nodes[i % n];
                let u = if i < n { turn * x - x + DVec3::new(0.3, 0.0, -0.1) } else { DVec3::ZERO };
                [u.x as f32, u.y as f32, u.z as f32, 0.0]
            })
            .collect();
        world.gpu.queue.write_buffer(&next.0.buffer, 0, bytemuck::cast_slice(&state));
        world.record(|r| {
            let mut s = Passes::new(&world, r, Some(0), &now, &next, &tally);
            s.list();
            s.turn_groups(ALL, &next.0.buffer);
        });
        let inverses: Vec<[f32; 4]> =
            world.gpu.download(&world.buffers["inverses"], 2 * n + world.geometry.groups.len()).unwrap_or_else(|e| panic!("{e}"));
        for q in &inverses[2 * n..] {
            let q = q.map(f64::from);
            let off = DQuat::from_xyzw(q[0], q[1], q[2], q[3]).angle_between(turn);
            // Displacements of a third of a metre in units of 1e-8 m, over groups of some centimetres.
            assert!(off < 1e-5, "{off} at {angle}");
        }
    }
}

/// A slender beam, clamped at one end.
fn beam() -> Scene {
    let mut scene = ball(0.01);
    scene.object.source = BodySource::Analytic(Analytic::Box { min: DVec3::ZERO, max: DVec3::new(0.4, 0.03, 0.03) });
    scene.planes.clear();
    scene.masses.clear();
    scene.material.youngs_modulus = 2e5;
    scene.initial.velocity = DVec3::ZERO;
    scene.initial.angular_velocity = DVec3::ZERO;
    scene.clamps = vec![Clamp::still(DVec3::splat(-1.0), DVec3::new(0.011, 1.0, 1.0))];
    scene
}

/// Iterations of the first steps, with the second level and without.
#[test]
fn a_beam_takes_less_than_half_of_the_iterations() {
    let Some(gpu) = device(None) else { return };
    let plan = plan(&beam());
    for many in [true, false] {
        let backend = backend(gpu.clone(), many);
        let count = |with: bool| {
            let mut world = backend.build(&plan, 1).unwrap_or_else(|e| panic!("{e}"));
            backend.set_params(&mut world, &ParamBatch::from_rows(std::slice::from_ref(&plan.theta)));
            if !with {
                let none = vec![0u8; world.buffers["coarse"].size() as usize];
                world.gpu.queue.write_buffer(&world.buffers["coarse"], 0, &none);
            }
            let mut tally = backend.new_tally(&world, &Request::default());
            let [mut now, mut next] = [0; 2].map(|_| backend.new_state(&world));
            backend.start(&mut world, &mut now, &mut tally);
            let mut all = 0;
            for stage in plan.clock.stages() {
                backend.step(&mut world, &stage, &[&now], &mut next, &mut tally);
                let n = world.gpu.download::<Newton>(&world.buffers["newton"], 1).unwrap_or_else(|e| panic!("{e}"))[0];
                all += n.total;
                std::mem::swap(&mut now, &mut next);
            }
            assert!(backend.read(&world, &tally)[0].failure.is_none());
            all
        };
        let [with, without] = [true, false].map(count);
        println!("many {many}: {with} iterations, {without} with block-Jacobi alone");
        assert!(2 * with < without, "{with} against {without}");
    }
}

/// Spoils C, of so many groups.
type Spoil = fn(&mut [[f32; 4]], usize);

/// What nobody must be left with: a solve that ended far from its solution, and no failure. C is made wrong before a step, or before its derivatives.
#[test]
fn a_second_level_that_is_none_does_no_harm_or_fails() {
    let Some(gpu) = device(None) else { return };
    let plan = plan(&hinged());
    // C is no longer symmetric, and iterations stand still. Of the derivative by a spin, nearly all of whose load a clamp's springs bear, what is
    // left then is little beside that load, and a tenth of the derivative.
    let skew: Spoil = |c, groups| {
        for (row, c) in c.chunks_mut(groups).enumerate() {
            c.iter_mut().flatten().enumerate().for_each(|(k, x)| *x *= 1.0 + 0.45 * ((7 * row + 3 * k) as f32).sin());
        }
    };
    let negative: Spoil = |c, _| c.iter_mut().flatten().for_each(|x| *x *= -9.0);
    for many in [true, false] {
        let backend = backend(gpu.clone(), many);
        let (right, failure) = derived(&backend, &plan, [None, None]);
        assert_eq!(failure, None);
        for (name, spoil) in [("skew", skew), ("negative", negative)] {
            for [first, second] in [[Some(spoil), None], [None, Some(spoil)]] {
                let (found, failure) = derived(&backend, &plan, [first, second]);
                let off = right.iter().zip(&found).map(|(a, b)| apart(a, b)).fold(0.0, f64::max);
                println!("many {many}, {name}, before the step: {}: off by {off:.1e}, {failure:?}", first.is_some());
                // Derivatives are promised to a thousandth.
                assert!(failure.is_some() || off < 1e-3, "{name}: {off:.1e} and no failure");
                assert!(second.is_none() || failure.is_some_and(|f| f.contains("conjugate gradient iterations left")), "{name}");
            }
        }
    }
}

/// Difference of two vectors over the size of the first.
fn apart(a: &[f64], b: &[f64]) -> f64 {
    let norm = |v: &mut dyn Iterator<Item = f64>| v.map(|x| x * x).sum::<f64>().sqrt();
    norm(&mut a.iter().zip(b).map(|(x, y)| x - y)) / norm(&mut a.iter().copied()).max(1e-30)
}

/// State after a step, its derivatives by the modulus and by the first spin, and the derivative of a wave of it by the old state; and what failed. C is
/// spoilt before the step, and before its derivatives.
fn derived(backend: &GpuBackend, plan: &Plan, spoils: [Option<Spoil>; 2]) -> (Vec<Vec<f64>>, Option<String>) {
    let mut world = backend.build(plan, 1).unwrap_or_else(|e| panic!("{e}"));
    backend.set_params(&mut world, &ParamBatch::from_rows(std::slice::from_ref(&plan.theta)));
    let coarse = world.buffers["coarse"].clone();
    let right: Vec<[f32; 4]> = world.gpu.download(&coarse, coarse.size() as usize / 16).unwrap_or_else(|e| panic!("{e}"));
    let spoil = |world: &World, how: Option<Spoil>| {
        let mut c = right.clone();
        how.into_iter().for_each(|how| how(&mut c, world.geometry.groups.len()));
        world.gpu.queue.write_buffer(&coarse, 0, bytemuck::cast_slice(&c));
    };
    let asked = |p: &usize| matches!(plan.layout.keys[*p], ParamKey::YoungsModulus | ParamKey::AngularVelocity(0));
    let directions: Vec<usize> = (0..plan.theta.len()).filter(asked).collect();
    let mut tally = backend.new_tally(&world, &Request::default());
    let [mut now, mut next] = [0; 2].map(|_| backend.new_state(&world));
    let [mut old, mut new] = [0; 2].map(|_| backend.new_tangent(&world, &Direction::parameters(&directions)));
    let (adj, mut adj_past) = (backend.new_adjoint(&world), [backend.new_adjoint(&world)]);
    let stage = &plan.clock.stages()[0];
    backend.start(&mut world, &mut now, &mut tally);
    backend.start_tangent(&mut world, &now, &mut old, &mut tally);
    spoil(&world, spoils[0]);
    backend.step(&mut world, stage, &[&now], &mut next, &mut tally);
    spoil(&world, spoils[1]);
    backend.step_tangent(&mut world, stage, &[&now], &next, &[&old], &mut new, &mut tally);
    let n = plan.body.nodes.len();
    let wave: Vec<[f32; 4]> = (0..2 * n).map(|i| [(i as f32).sin(), (2.0 * i as f32).cos(), 0.1, 0.0]).collect();
    world.gpu.queue.write_buffer(&adj.0.buffer, 0, bytemuck::cast_slice(&wave));
    backend.step_adjoint(&mut world, stage, &[&now], &next, &adj, &mut adj_past, &mut tally);
    let of = |buffer: &wgpu::Buffer, vectors: usize| -> Vec<f64> {
        let all: Vec<[f32; 4]> = world.gpu.download(buffer, vectors).unwrap_or_else(|e| panic!("{e}"));
        all.iter().flat_map(|v| [v[0], v[1], v[2]]).map(f64::from).collect()
    };
    let tangents = new.parts.iter().map(|part| of(&part.buffer, 2 * n));
    let ends = [of(&next.0.buffer, 2 * n), of(&adj_past[0].0.buffer, 2 * n)];
    let found = tangents.chain(ends).collect();
    (found, backend.read(&world, &tally)[0].failure.as_ref().map(|f| f.message()))
}

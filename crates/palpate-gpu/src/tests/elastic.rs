//! Bodies of tetrahedra against the CPU: passes one by one, states by every material and scheme, derivatives; one percent must show.

use super::derivative_passes;
use super::derivatives;
use super::effects::compare_within;
use super::faults::{BALANCE, Fault, busy, check_states};
use super::forward::CLOSE;
use super::passes::{Exact, apart, found, given};
use super::scenes::{ball, device, held, own_device, plan};
use super::schemes;
use crate::{GpuBackend, Product, Tuning};
use glam::DVec3;
use palpate_cpu::CpuBackend;
use palpate_engine::{Request, Rollout, Wanted};
use palpate_model::effects::{self, Effect};
use palpate_model::materials;
use palpate_model::materials::viscosity::Viscosity;
use palpate_model::observation::{Channel, Frame, MarkerRest, Observation, ObservedDisplacement, ObservedMarker, ReadingKind};
use palpate_model::params::ParamKey;
use palpate_model::plan::Plan;
use palpate_model::plan::build::build_plan;
use palpate_model::scene::{BodySource, Resolution, Scene, Tetrahedron};
use palpate_model::space::points::TetMesh;
use std::ops::ControlFlow;

use Tetrahedron::{Linear, Quadratic};

/// A box of cubes of six tetrahedra each, so many along its edges.
pub(super) fn bar(low: DVec3, edge: f64, count: [usize; 3]) -> BodySource {
    let [a, b, c] = count.map(|n| n + 1);
    let at = |i: usize, j: usize, k: usize| (i + a * (j + b * k)) as u32;
    let mut mesh = TetMesh::default();
    for m in 0..a * b * c {
        mesh.nodes.push(low + edge * DVec3::new((m % a) as f64, (m / a % b) as f64, (m / (a * b)) as f64));
    }
    for m in 0..count.iter().product() {
        let (i, j, k) = (m % count[0], m / count[0] % count[1], m / (count[0] * count[1]));
        let c = |bits: usize| at(i + (bits & 1), j + (bits >> 1 & 1), k + (bits >> 2));
        for way in [[1, 3], [1, 5], [2, 3], [2, 6], [4, 5], [4, 6]] {
            mesh.tets.push([c(0), c(way[0]), c(way[1]), c(7)]);
        }
    }
    let mesh = mesh.checked().unwrap_or_else(|e| panic!("{e}"));
    BodySource::Tetrahedra { path: "in-code.msh".into(), surface: mesh.surface(), mesh }
}

/// The box of the ball, so many cubes along every edge.
fn tetrahedra(count: usize) -> BodySource {
    bar(DVec3::new(-0.047, -0.049, 0.001), 0.1 / count as f64, [count; 3])
}

/// A scene with tetrahedra in place of its ball.
pub(super) fn of_tets(mut scene: Scene, kind: Tetrahedron, count: usize) -> Scene {
    scene.solver.tetrahedron = kind;
    scene.object.source = tetrahedra(count);
    scene.object.resolution = Resolution::Own;
    scene
}

/// One of quadratic elements that falls onto the ground, and one of linear ones that hangs in a clamp that moves.
fn both() -> [Scene; 2] {
    let mut falling = busy(of_tets(ball(0.03), Quadratic, 2));
    falling.initial.velocity.z = -1.0;
    let mut hanging = busy(of_tets(held(0.03), Linear, 3));
    hanging.material.mass_damping = 50.0;
    [falling, hanging]
}

/// Everything acts that can: both dampings, the viscosity of a material that is not linear, contact, a point mass, effects on nodes, patches, stiffness and density.
fn crowded(model: &'static materials::Model) -> Scene {
    let mut s = of_tets(busy(ball(0.03)), Quadratic, 1);
    s.material.model = model;
    s.material.stiffness_damping = 0.006;
    s.material.viscosity = (!model.is_linear).then_some(Viscosity { coefficient: 60.0, exponent: 0.8 });
    for (kind, value) in
        [("coulomb-friction", 0.5), ("uniform-force", 5000.0), ("stiffness-gradient", 5.0), ("density-gradient", 6.0)]
    {
        let mut effect = Effect::absent(effects::find(kind).unwrap_or_else(|| panic!("{kind}")));
        effect.values[0] = Some(value);
        s.effects.push(effect);
    }
    s
}

/// Faults of the balance (other materials than the first two have their own tests): of the first material all that such bodies have, of others the one that tells materials apart.
fn faults(model: &'static materials::Model) -> impl Iterator<Item = Fault> {
    let all = BALANCE.into_iter().filter(|f| f.0 != "ghost penalty");
    all.filter(move |f| model.is_linear || f.0 == "Poisson's ratio")
}

#[test]
fn passes_of_a_step_agree_with_the_cpu_and_one_percent_shows() {
    let Some(gpu) = device(None) else { return };
    let backend = GpuBackend::on(gpu);
    for model in &materials::ALL[..2] {
        let plan = plan(&crowded(model));
        let right = Exact::new(&plan, given);
        print!("{}: ", model.name);
        assert_eq!(apart(&found(&backend, &plan, &right), &right), [""; 0], "{}", model.name);
        for (name, fault) in faults(model) {
            let mut wrong = plan.clone();
            fault(&mut wrong);
            print!("{name}: ");
            let seen = apart(&found(&backend, &wrong, &right), &right);
            assert!(!seen.is_empty(), "{}: 1 % of {name} is not seen", model.name);
            if name == "Poisson's ratio" {
                assert!(["gather_residual", "gather_matrix"].iter().all(|p| seen.contains(p)), "{}: {seen:?}", model.name);
            }
        }
    }
}

#[test]
fn passes_of_derivatives_agree_with_the_cpu_and_one_percent_shows() {
    let Some(gpu) = device(None) else { return };
    let backend = GpuBackend::on(gpu).tuned(Tuning { many_from: 0, product: Some(Product::Matrix), crew: 0 });
    for model in &materials::ALL[..2] {
        let plan = plan(&crowded(model));
        let (right, sizes) = derivative_passes::exact(&plan);
        let seen = |plan: &Plan| derivative_passes::apart(&derivative_passes::found(&backend, plan, &sizes), &right);
        print!("{}: ", model.name);
        assert_eq!(seen(&plan), [""; 0], "{}", model.name);
        for (name, fault) in faults(model) {
            let mut wrong = plan.clone();
            fault(&mut wrong);
            print!("{name}: ");
            let seen = seen(&wrong);
            assert!(seen.iter().any(|s| s == "pull") || name == "point mass", "1 % of {name} is seen in {seen:?} alone");
        }
    }
}

#[test]
// Every material has kernels of its own to compile; passes of a step say the same of two of them.
#[ignore = "slow: cargo xtask test --full"]
fn states_by_every_material_agree_with_the_cpu_and_one_percent_shows() {
    let Some(gpu) = device(None) else { return };
    for model in materials::ALL.iter().filter(|m| m.has_twin()) {
        for (mut scene, touches) in both().into_iter().zip([true, false]) {
            scene.material.model = model;
            scene.time.steps = 4;
            println!("{}", model.name);
            let faults: Vec<Fault> = faults(model).filter(|f| touches || f.0 != "contact stiffness").collect();
            check_states(&gpu, &scene, &[plan(&scene).theta], CLOSE, &faults);
        }
    }
}

#[test]
// Cells run through every scheme in any case.
#[ignore = "slow: cargo xtask test --full"]
fn states_of_every_scheme_agree_with_the_cpu() {
    let Some(gpu) = device(None) else { return };
    for scheme in schemes::schemes() {
        for mut scene in both() {
            scene.time.scheme = scheme;
            scene.time.steps = 3;
            let plan = plan(&scene);
            let states = |theta: &[f64]| schemes::moments(GpuBackend::on(gpu.clone()), &plan, theta);
            let right = schemes::moments(CpuBackend, &plan, &plan.theta);
            let own = schemes::apart(&plan, &states(&plan.theta), &right);
            println!("{}: {own:?}", scheme.name);
            // As bodies of cells.
            assert!(own.iter().all(|d| *d < 1e-6), "{}: {own:?}", scheme.name);
            let mut wrong = plan.theta.clone();
            wrong[plan.layout.index(ParamKey::StiffnessDamping)] *= 1.01;
            let seen = schemes::apart(&plan, &states(&wrong), &right);
            assert!(seen.iter().any(|d| *d > 1e-6), "{}: 1 % of damping is not seen: {seen:?}", scheme.name);
        }
    }
}

#[test]
fn every_parameter_of_a_falling_and_of_a_held_body() {
    let Some(gpu) = device(None) else { return };
    for (model, mut scene) in [&materials::ALL[0], &materials::ALL[1]]
        .into_iter()
        .zip([of_tets(ball(0.03), Linear, 2), of_tets(held(0.03), Quadratic, 2)])
    {
        scene.material.model = model;
        scene.time.steps = 4;
        derivatives::check(&GpuBackend::on(gpu.clone()), &plan(&scene), 2);
    }
}

#[test]
fn a_clamped_node_is_where_its_clamp_wants_it() {
    let Some(gpu) = device(None) else { return };
    let plan = plan(&both()[1]);
    let (found, _) = super::forward::states(&GpuBackend::on(gpu), &plan, std::slice::from_ref(&plan.theta));
    let clamp = &plan.clamps[0];
    let start = plan.theta[plan.layout.index(ParamKey::TimeStart)];
    assert!(!clamp.nodes.is_empty() && clamp.nodes.len() < plan.body.nodes.len());
    for (k, moment) in found.iter().enumerate() {
        let (a, b) = palpate_model::plan::clamp_pose(clamp.motion.as_ref(), start + k as f64 * plan.clock.step);
        for (n, _) in &clamp.nodes {
            let x = plan.body.nodes[*n as usize];
            let off = (moment[0].0[*n as usize] - (a * x + b - x)).length();
            // Single precision of some centimetres.
            assert!(off < 1e-8, "step {k}, node {n}: {off:.1e} m");
        }
    }
}

/// The plan of a scene whose markers, one on a stalk, and last displacements were seen a little after its states, a little off.
pub(super) fn seen(scene: &Scene) -> Plan {
    let marker = |name: &str, surface: DVec3, stalk: DVec3| MarkerRest {
        name: name.into(),
        position: surface + stalk,
        surface: Some(surface),
    };
    let rest = [
        marker("a", DVec3::new(0.053, 0.01, 0.06), 0.02 * DVec3::X),
        marker("b", DVec3::new(0.01, -0.049, 0.03), DVec3::ZERO),
        marker("c", DVec3::new(-0.02, 0.02, 0.101), DVec3::ZERO),
    ];
    let bare = build_plan(scene, Observation::default(), &rest).unwrap_or_else(|e| panic!("{e}"));
    let off = |k: usize, i: usize| 2e-4 * DVec3::new((k + 2 * i) as f64, (3 * k + i) as f64, (k * i) as f64 + 0.7).map(f64::sin);
    let mut frames = Vec::new();
    let mut cpu = Rollout::new(CpuBackend, &bare, 1).unwrap_or_else(|e| panic!("{e}"));
    let visited = cpu.visit(&bare.theta, |k, s, _| {
        let sites = bare.observation.markers.iter().zip(&rest).enumerate();
        let carried = |(i, (site, m)): (usize, (&palpate_model::observation::MarkerSite, &MarkerRest))| ObservedMarker {
            site: i as u32,
            position: m.position + site.stencil.get().at(&s.displacement) + off(k, i),
        };
        let mut frame = Frame { time: scene.time.start + s.time + 0.2 * scene.time.step, ..Frame::default() };
        if k == bare.clock.steps {
            frame.displacements = ObservedDisplacement::of_all(s.displacement.iter().enumerate().map(|(i, u)| *u + off(k, i)));
        } else {
            frame.markers = sites.map(carried).collect();
        }
        frames.push(frame);
        ControlFlow::Continue(())
    });
    visited.unwrap_or_else(|e| panic!("{e}"));
    let channels = vec![Channel::new(ReadingKind::Marker, 1e-3), Channel::new(ReadingKind::Displacement, 1e-3)];
    let observation = Observation { frames, channels, ..Observation::default() };
    build_plan(scene, observation, &rest).unwrap_or_else(|e| panic!("{e}"))
}

#[test]
fn evaluations_with_markers_and_displacements_agree_with_the_cpu() {
    for mut scene in both() {
        scene.time.steps = 3;
        // As of bodies of cells.
        compare_within(&seen(&scene), 3e-4);
    }
}

#[test]
fn memory_of_a_body_of_tetrahedra_is_foreseen() {
    let Some(gpu) = own_device() else { return };
    let mut scene = of_tets(held(0.03), Quadratic, 2);
    for (kind, key, value) in [("strain-stiffening", "coefficient", 5.0), ("compliant-clamp", "layer", 0.004)] {
        super::effects::with(&mut scene, kind, &[(key, &[value])]);
    }
    let plan = plan(&scene);
    super::memory::check(&gpu, &plan, 2, &Request { gradient: Wanted::All, sensitivities: vec![0] });
}

//! Tangents whose dissipation has no negative curvature, against those of the CPU.

use super::elastic::of_tets;
use super::passes::{Exact, apart, found, given, lawful};
use super::scenes::{ball, device, plan};
use crate::GpuBackend;
use crate::layout::Newton;
use crate::world::World;
use palpate_cpu::terms::Curvature;
use palpate_model::materials::viscosity::Viscosity;
use palpate_model::scene::{Scene, Tetrahedron};

/// Asks for tangents of a curvature.
pub(super) fn ask(world: &World, curvature: Curvature) {
    let newton = &world.buffers["newton"];
    let mut n = world.gpu.download::<Newton>(newton, 1).unwrap_or_else(|e| panic!("{e}"))[0];
    n.majorised = u32::from(curvature == Curvature::Majorised);
    world.gpu.queue.write_buffer(newton, 0, bytemuck::bytes_of(&n));
}

/// Dissipation of cells, of tetrahedra and of points inside them: effects and the material's.
fn dissipating() -> [Scene; 3] {
    let flow = |mut s: Scene| {
        s.material.viscosity = Some(Viscosity { coefficient: 60.0, exponent: 0.6 });
        s
    };
    let mut tets = of_tets(ball(0.03), Tetrahedron::Linear, 2);
    tets.effects =
        lawful().effects.into_iter().filter(|e| ["power-law-viscosity", "structural-damping"].contains(&e.law().kind)).collect();
    [flow(lawful()), tets, flow(of_tets(ball(0.03), Tetrahedron::Quadratic, 1))]
}

#[test]
fn majorised_tangents_agree_with_the_cpu_and_are_not_the_exact_ones() {
    let Some(gpu) = device(None) else { return };
    let backend = GpuBackend::on(gpu);
    for scene in dissipating() {
        let plan = plan(&scene);
        let [exact, above] = [Curvature::Exact, Curvature::Majorised].map(|c| Exact::curved(&plan, given, c));
        let passes = ["gather_matrix", "invert_diagonal"];
        let off = |right: &Exact, other: &Exact| {
            apart(&found(&backend, &plan, right), other).into_iter().filter(|p| passes.contains(p)).count()
        };
        assert_eq!((off(&above, &above), off(&above, &exact)), (0, 2));
    }
}

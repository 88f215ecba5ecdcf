//! What laws of cells are asked, on cells and on tetrahedra: their input, and which of them the plan has. Twin of
//! palpate-model/src/effects/cell.rs. Laws are the files of `effects/`; the build script links them with `cell_law`, which calls the one of a
//! number, and with the sizes of the input.
// use shared/hyper
// use shared/effect_site

// The two functions of a law: ψ of (a, ε), and φ of (d, a₀).
const ENERGY_PART = 0u;
const LOSS_PART = 1u;
// The host lets no more into a plan.
const MOST_LAWS = 16u;

var<body> cell_effects: array<EffectSite>;

// The input, and 1/Δt.
var<private> input: array<vec4<f32>, CELL_INPUTS>;
var<private> step_rate: f32;

fn density() -> Dual {
    return input[0];
}

fn old_density() -> Dual {
    return input[1];
}

// Mean strain: xx, yy, zz, yz, zx, xy.
fn strain(i: u32) -> Dual {
    return input[1u + i];
}

fn param(i: u32) -> Dual {
    return input[SCALARS + i];
}

// Laws of cells that the plan has.
fn law_count() -> u32 {
    return (shape.fields >> LAWS_AT) & MOST_COUNT;
}

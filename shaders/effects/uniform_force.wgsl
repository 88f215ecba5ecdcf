//! Twin of palpate-model/src/effects/uniform_force.rs. The way stands for x: what differs does not depend on x.

fn uniform_force() -> Dual {
    return -mul(dot3(vector(0u), way()), measure);
}

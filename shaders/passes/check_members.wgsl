//! Refuses members whose parameters make no sense, before anything is computed. call.extra: 1 = a static start, which needs a clamp.
// use shared/structs
// use shared/finite

var<uniform> shape: Shape;
var<batch> members: array<Member>;
var<storage, read_write> health: array<Health>;

@compute @workgroup_size(64)
fn check_members(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x >= shape.members {
        return;
    }
    let m = members[id.x];
    var broken = WELL;
    if m.young <= 0.0 || m.density <= 0.0 || !is_finite(m.young) || !is_finite(m.density) {
        broken = BAD_PARAMETER;
    } else if call.extra == 1u && shape.clamps == 0u {
        broken = NO_CLAMP;
    }
    if broken != WELL {
        health[id.x] = Health(broken, 0u, vec2(m.young, m.density));
    }
}

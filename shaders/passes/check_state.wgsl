//! Looks at every member's new state once per step: all numbers, still in the world, solve finished? call.extra: 1 = it was given less than it is allowed.
// use shared/grid
// use shared/sum_nodes
// use shared/largest

var<storage, read> newton: array<Newton>;
var<storage, read_write> health: array<Health>;

@compute @workgroup_size(256)
fn check_state(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
               @builtin(local_invocation_index) local: u32) {
    let p = find_place(group, groups, 0u, 1u, 1u);
    if !p.runs {
        return;
    }
    let bad = sum_nodes(local, p.member, 0u).x;
    var far = 0.0;
    for (var i = local; i < node_shares(); i += 256u) {
        far = max(far, node_parts[node_parts_at(p.member) + 2u * i + 1u].x);
    }
    far = largest(local, far);
    if local != 0u {
        return;
    }
    let n = newton[p.member];
    var broken = 0u;
    if n.stage != IDLE {
        broken = STALLED;
    }
    if far > shape.world {
        broken = FELL_OUT;
    }
    if bad > 0.0 {
        broken = NOT_FINITE;
    }
    if n.stage != IDLE && call.extra != 0u {
        broken = HURRIED;
    }
    if broken != 0u {
        health[p.member] = Health(broken, call.step + call.mode, vec2(select(n.norm / n.scale, far, broken == FELL_OUT), f32(n.iteration)));
    }
}

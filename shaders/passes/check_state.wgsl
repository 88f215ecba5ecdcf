//! Looks at every member's new state once per step: all numbers, still in the world, solve finished? call.extra: 1 = it was given less than it is allowed.
// use shared/grid
// use shared/team_256
// use shared/totals
// use shared/finite

var<storage, read> next: array<vec4<f32>>;
var<storage, read> newton: array<Newton>;
var<storage, read_write> health: array<Health>;

var<workgroup> farthest: array<f32, 256>;

@compute @workgroup_size(256)
fn check_state(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
               @builtin(local_invocation_index) local: u32) {
    let p = find_place(group, groups, 0u, 1u, 1u);
    if !p.runs {
        return;
    }
    var bad = vec4(0.0);
    var far = 0.0;
    for (var i = local; i < shape.nodes; i += 256u) {
        let a = at_node(p.member, i);
        let u = next[a].xyz + next[part(1u) + a].xyz;
        let v = next[part(2u) + a].xyz;
        if !(is_finite(dot(u, u)) && is_finite(dot(v, v))) {
            bad.x += 1.0;
        } else {
            far = max(far, length(u));
        }
    }
    farthest[local] = far;
    let count = total(local, bad).x;
    if local != 0u {
        return;
    }
    for (var k = 1u; k < 256u; k++) {
        far = max(far, farthest[k]);
    }
    let n = newton[p.member];
    var broken = 0u;
    if n.stage != IDLE {
        broken = STALLED;
    }
    if far > shape.world {
        broken = FELL_OUT;
    }
    if count > 0.0 {
        broken = NOT_FINITE;
    }
    if n.stage != IDLE && call.extra != 0u {
        broken = HURRIED;
    }
    if broken != 0u {
        health[p.member] = Health(broken, call.step + call.mode, vec2(select(n.norm / n.scale, far, broken == FELL_OUT), f32(n.iteration)));
    }
}

//! The new velocity, v₁ = v₀ + Δt g + w/(θΔt) with w the increment beyond free flight; at the start (call.mode 0) the initial
//! one, of a body that is put into its stress-free shape where it starts at rest. And what
//! check_state looks at, in parts: how many nodes have no numbers, and how far the farthest is.
// use shared/mix
// use shared/unstrained
// use shared/finite
// use shared/team_64
// use shared/totals
// use shared/largest
// use shared/node_parts

var<body> rest: array<vec4<f32>>;
var<storage, read> now: array<vec4<f32>>;
var<storage, read_write> next: array<vec4<f32>>;
// The last one, which was taken.
var<storage, read> trial: array<vec4<f32>>;

fn finish(p: Place) {
    let m = members[p.member];
    let a = at_node(p.member, p.item);
    if call.mode == 0u {
        var arm = rest[p.item].xyz - shape.pivot;
        if starts_unstrained() {
            let w = rests[a].xyz;
            let steps = round(w / shape.quantum);
            next[a] = vec4(steps * shape.quantum, 0.0);
            next[part(1u) + a] = vec4(w - steps * shape.quantum, 0.0);
            arm += w;
        }
        let v = m.velocity.xyz + cross(m.spin.xyz, arm);
        next[part(2u) + a] = vec4(v, 0.0);
    } else {
        let w = trial[a].xyz;
        next[part(2u) + a] = vec4(now[part(2u) + a].xyz + (shape.dt * m.gravity.xyz + w / (shape.theta * shape.dt)), 0.0);
    }
}

@compute @workgroup_size(64)
fn finish_step(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
               @builtin(local_invocation_index) local: u32) {
    let share = find_share(group, groups, shape.nodes, 64u);
    if !share.runs {
        return;
    }
    let p = place_in(share, local, shape.nodes);
    var bad = vec4(0.0);
    var far = 0.0;
    if p.live {
        finish(p);
        let a = at_node(p.member, p.item);
        let u = next[a].xyz + next[part(1u) + a].xyz;
        let v = next[part(2u) + a].xyz;
        if is_finite(dot(u, u)) && is_finite(dot(v, v)) {
            far = length(u);
        } else {
            bad.x = 1.0;
        }
    }
    keep_part(local, share, 0u, total(local, bad));
    keep_part(local, share, 1u, vec4(largest(local, far), 0.0, 0.0, 0.0));
}

//! The new velocity, v₁ = v₀ + Δt g + w/(θΔt) with w the increment beyond free flight; at the start (call.mode 0) the initial
//! one, of a body that is put into its stress-free shape where it starts at rest.
// use shared/mix
// use shared/unstrained

var<body> rest: array<vec4<f32>>;
var<storage, read> now: array<vec4<f32>>;
var<storage, read_write> next: array<vec4<f32>>;
var<storage, read> increment: array<vec4<f32>>;

@compute @workgroup_size(64)
fn finish_step(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
               @builtin(local_invocation_index) local: u32) {
    let p = find_place(group, groups, local, shape.nodes, 64u);
    if !p.live {
        return;
    }
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
        let w = increment[a].xyz;
        next[part(2u) + a] = vec4(now[part(2u) + a].xyz + (shape.dt * m.gravity.xyz + w / (shape.theta * shape.dt)), 0.0);
    }
}

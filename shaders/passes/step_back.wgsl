//! dJ/d(old state) from the adjoint solution z (`probe`). With A = S + M/(θΔt²), A z = dJ/du + dJ/dv/(θΔt) and T the derivative
//! by the old displacement without inertia, the large inertia terms cancel by hand:
//! dJ/du₀ += dJ/du − S z − Tᵀz,  dJ/dv₀ += dJ/dv + Δt (dJ/du − S z).
// use shared/old_row

var<storage, read> adj: array<vec4<f32>>;
var<storage, read_write> adj_now: array<vec4<f32>>;

@compute @workgroup_size(64)
fn step_back(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
             @builtin(local_invocation_index) local: u32) {
    let p = find_place(group, groups, local, shape.nodes, 64u);
    if !p.live {
        return;
    }
    let m = members[p.member];
    let mix = mix_of(m);
    let a = at_node(p.member, p.item);
    let kept = adj[a].xyz - stiffness_row(p.member, p.item);
    adj_now[a] += vec4(kept - old_row(p.member, p.item, m, mix), 0.0);
    adj_now[part(1u) + a] += vec4(adj[part(1u) + a].xyz + shape.dt * kept, 0.0);
}

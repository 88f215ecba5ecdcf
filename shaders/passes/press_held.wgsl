//! Adds the springs of nodes whose clamps give way, with their energy, to a residual.
// use shared/wanted

var<storage, read> next: array<vec4<f32>>;
// As gather_residual has it.
var<storage, read_write> residual: array<vec4<f32>>;

@compute @workgroup_size(64)
fn press_held(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
              @builtin(local_invocation_index) local: u32) {
    let p = find_place(group, groups, local, shape.nodes, 64u);
    if !p.live || !gives_way(p.member) {
        return;
    }
    let a = at_node(p.member, p.item);
    let firm = firm_of(members[p.member], p.member);
    var sum = vec4(0.0);
    for (var k = held_rows[p.item]; k < held_rows[p.item + 1u]; k++) {
        let away = (next[a].xyz - wanted_by(p.member, holders[k].by, p.item)) + next[part(1u) + a].xyz;
        let stiffness = spring_at(firm, layer_of(p.member), holders[k]).stiffness;
        sum += stiffness * vec4(away, 0.5 * dot(away, away));
    }
    residual[a] += sum;
    residual[part(1u) + a].w += sum.w;
}

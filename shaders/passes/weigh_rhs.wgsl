//! The right-hand side of a derivative, for column call.extra of every member; and what begin_exact decides by, in parts.
// use shared/grid
// use shared/team_64
// use shared/totals
// use shared/precondition
// use shared/solving
// use shared/node_parts
// use shared/held

var<storage, read> rhs: array<vec4<f32>>;
var<storage, read_write> solving: array<vec4<f32>>;

@compute @workgroup_size(64)
fn weigh_rhs(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
             @builtin(local_invocation_index) local: u32) {
    let share = find_share(group, groups, shape.nodes, 64u);
    if !share.runs {
        return;
    }
    let p = place_in(share, local, shape.nodes);
    var state = vec4(0.0);
    if p.live {
        let a = at_node(p.member, p.item);
        let r = rhs[a].xyz;
        let own = at_node(call.extra * shape.members + p.member, p.item);
        solving[solving_part(RIGHT) + own] = vec4(r, 0.0);
        // Of a load that is nothing this stays the solution.
        solving[own] = vec4(0.0);
        let size = dot(r, scaled(a, r));
        state = vec4(size, inverses[2u * a + 1u].w, 0.0, 0.0);
        if shape.held != 0u {
            state += size * select(vec4(0.0, 0.0, 1.0, 0.0), vec4(0.0, 0.0, 0.0, 1.0), is_held(p.member, p.item));
        }
    }
    keep_part(local, share, 0u, total(local, state));
}

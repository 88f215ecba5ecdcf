//! How far each group of the second level has turned since rest, as a unit quaternion: the rotation nearest to how its nodes lie around their
//! centre, by Müller, Bender, Chentanez & Macklin (MIG 2016), which any shape of a group serves, flat ones too.
// use shared/grid
// use shared/finite
// use shared/team_64
// use shared/totals
// use shared/coarse

// The state: [3][B][N], of which the first two make the displacement.
var<storage, read> turning: array<vec4<f32>>;
// After the inverse blocks, as shared/precondition says.
var<storage, read_write> inverses: array<vec4<f32>>;

// Turns of the iteration: as many as bring a half turn to its end.
const TURNS = 30u;

@compute @workgroup_size(64)
fn turn_groups(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
               @builtin(local_invocation_index) local: u32) {
    let share = find_share(group, groups, shape.groups, 1u);
    if !share.runs {
        return;
    }
    // Σ u ⊗ arm, by columns. Arms sum to zero, so that no centre has to be taken off.
    var by_x = vec4(0.0);
    var by_y = vec4(0.0);
    var by_z = vec4(0.0);
    for (var k = group_rows[share.first] + local; k < group_rows[share.first + 1u]; k += 64u) {
        let node = group_nodes[k];
        let a = at_node(share.member, node);
        let arm = arms[node].xyz;
        let u = turning[a].xyz + turning[part(1u) + a].xyz;
        // In units of the arms.
        let x = arm + u / shape.group_size;
        by_x += vec4(x * arm.x, 0.0);
        by_y += vec4(x * arm.y, 0.0);
        by_z += vec4(x * arm.z, 0.0);
    }
    let cx = total(local, by_x).xyz;
    let cy = total(local, by_y).xyz;
    let cz = total(local, by_z).xyz;
    if local != 0u {
        return;
    }
    var q = vec4(0.0, 0.0, 0.0, 1.0);
    for (var i = 0u; i < TURNS; i++) {
        let rx = turned(q, vec3(1.0, 0.0, 0.0));
        let ry = turned(q, vec3(0.0, 1.0, 0.0));
        let rz = turned(q, vec3(0.0, 0.0, 1.0));
        let along = abs(dot(rx, cx) + dot(ry, cy) + dot(rz, cz));
        let by = (cross(rx, cx) + cross(ry, cy) + cross(rz, cz)) / max(along, 1e-30);
        // Half of the turn, as quaternions have it.
        let half = 0.5 * length(by);
        let step = vec4(by * (0.5 * select(sin(half) / half, 1.0, half < 1e-4)), cos(half));
        q = normalize(vec4(step.w * q.xyz + q.w * step.xyz + cross(step.xyz, q.xyz), step.w * q.w - dot(step.xyz, q.xyz)));
    }
    // Of a state that is lost any rotation serves.
    if !(all_finite(q.xyz) && is_finite(q.w)) {
        q = vec4(0.0, 0.0, 0.0, 1.0);
    }
    inverses[2u * shape.members * shape.nodes + share.member * shape.groups + share.first] = q;
}

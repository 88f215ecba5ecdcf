//! dJ/du of a look at the nodes of the body: band nodes folded back onto it (transpose of the extension), markers and observed nodes
//! added. Mode 1: the round has depth points.
// use costs/markers
// use costs/displacements
// use shared/found

// [slots][N + M]: by extended nodes, and then by those of the body.
var<storage, read_write> pulls: array<vec4<f32>>;
// Band nodes that a simulation node is extended to, and the weights.
var<body> fold_rows: array<u32>;
var<body> fold_columns: array<u32>;
var<body> fold_values: array<f32>;
// Recording by recording: entries of the sites' lists at every node, and the sites that they belong to.
var<body> node_site_rows: array<u32>;
var<body> node_site_list: array<vec2<u32>>;
// Markers of a frame by site: [F][most sites + 1].
var<body> mark_rows: array<u32>;

@compute @workgroup_size(64)
fn join_pulls(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
              @builtin(local_invocation_index) local: u32) {
    let s = find_seat(group, groups, 64u);
    let node = s.first + local;
    if !s.runs || node >= sight.nodes {
        return;
    }
    let shot = shots[s.look.shot];
    let base = s.slot * sight.extended;
    var g = vec3(0.0);
    if call.mode == 1u && shot.point_count != 0u {
        g = pulls[base + node].xyz;
        for (var k = fold_rows[node]; k < fold_rows[node + 1u]; k++) {
            g += fold_values[k] * pulls[base + fold_columns[k]].xyz;
        }
    }
    if shot.marker_count != 0u {
        let row = shot.node_rows + node;
        for (var k = node_site_rows[row]; k < node_site_rows[row + 1u]; k++) {
            let entry = node_site_list[k];
            let of_site = shot.mark_start + entry.x;
            let w = stencil_entries[entry.y].weight;
            let slope = stencil_gradients[entry.y].xyz;
            for (var m = mark_rows[of_site]; m < mark_rows[of_site + 1u]; m++) {
                let at = s.slot * sight.markers + m;
                g += w * carried[at].pull.xyz + carried[at].turn * cross(carried[at].spin.xyz, slope);
            }
        }
    }
    if node < shot.node_count {
        g += displacement_pull(s.slot, shot, node);
    }
    pulls[base + node] = vec4(g, 0.0);
}

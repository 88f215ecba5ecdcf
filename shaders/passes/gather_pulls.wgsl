//! Gradient of the depth cost by the extended nodes: the corners' shares, cell by cell.
// use shared/look

var<storage, read> corner_pulls: array<vec4<f32>>;
// Corners (8 · cell + corner) at every extended node.
var<body> band_node_rows: array<u32>;
var<body> band_node_list: array<u32>;
// [slots][N + M]
var<storage, read_write> pulls: array<vec4<f32>>;

@compute @workgroup_size(64)
fn gather_pulls(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
                @builtin(local_invocation_index) local: u32) {
    let s = find_seat(group, groups, 64u);
    let index = s.first + local;
    if !s.runs || index >= sight.extended {
        return;
    }
    var sum = vec4(0.0);
    for (var k = band_node_rows[index]; k < band_node_rows[index + 1u]; k++) {
        for (var stripe = 0u; stripe < sight.stripes; stripe++) {
            sum += corner_pulls[(s.slot * sight.stripes + stripe) * sight.cells * 8u + band_node_list[k]];
        }
    }
    pulls[s.slot * sight.extended + index] = sum;
}

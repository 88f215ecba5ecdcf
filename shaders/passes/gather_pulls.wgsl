//! Gradient of the depth cost by the extended nodes: the corners' shares, cell by cell.
// use shared/look

var<storage, read> corner_pulls: array<vec4<f32>>;
// Corners (8 · cell + corner) at every extended node.
var<storage, read> band_node_rows: array<u32>;
var<storage, read> band_node_list: array<u32>;
// [slots][N + M]
var<storage, read_write> pulls: array<vec4<f32>>;

@compute @workgroup_size(64)
fn gather_pulls(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
                @builtin(local_invocation_index) local: u32) {
    let s = find_seat(group, groups, local, 64u);
    if !s.runs || s.item >= sight.extended {
        return;
    }
    var sum = vec4(0.0);
    for (var k = band_node_rows[s.item]; k < band_node_rows[s.item + 1u]; k++) {
        for (var stripe = 0u; stripe < sight.stripes; stripe++) {
            sum += corner_pulls[(s.slot * sight.stripes + stripe) * sight.cells * 8u + band_node_list[k]];
        }
    }
    pulls[s.slot * sight.extended + s.item] = sum;
}

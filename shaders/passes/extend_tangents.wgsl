//! Continues the derivatives of the displacement, along `mode` directions, to the band's nodes.
// use shared/look

var<body> band_rows: array<u32>;
var<body> band_columns: array<u32>;
var<body> band_values: array<f32>;
var<storage, read_write> changes: array<vec4<f32>>;

@compute @workgroup_size(64)
fn extend_tangents(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
                   @builtin(local_invocation_index) local: u32) {
    let s = find_seat(group, groups, 64u);
    let index = s.first + local;
    let band = max(sight.extended - sight.nodes, 1u);
    let q = index / band;
    let row = index % band;
    if !s.runs || q >= call.mode || sight.extended == sight.nodes {
        return;
    }
    let base = (s.slot * call.mode + q) * sight.extended;
    var sum = vec4(0.0);
    for (var k = band_rows[row]; k < band_rows[row + 1u]; k++) {
        sum += band_values[k] * changes[base + band_columns[k]];
    }
    changes[base + sight.nodes + row] = sum;
}

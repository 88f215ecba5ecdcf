//! Continues displacements to the band's nodes. Weights of a row sum to one, so differences to the row's first node are enough.
// use shared/seen

var<body> band_rows: array<u32>;
var<body> band_columns: array<u32>;
var<body> band_values: array<f32>;

@compute @workgroup_size(64)
fn extend_band(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
               @builtin(local_invocation_index) local: u32) {
    let s = find_seat(group, groups, 64u);
    let index = s.first + local;
    if !s.runs || index >= sight.extended - sight.nodes {
        return;
    }
    let first = band_rows[index];
    let origin = seen_at(s.slot, band_columns[first]);
    var sum = vec3(0.0);
    for (var k = first; k < band_rows[index + 1u]; k++) {
        sum += band_values[k] * between(origin, seen_at(s.slot, band_columns[k]));
    }
    let at = seen_at(s.slot, sight.nodes + index);
    seen[at] = seen[origin];
    seen[rest_part() + at] = seen[rest_part() + origin] + vec4(sum, 0.0);
}

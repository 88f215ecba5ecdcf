//! Continues displacements to the band's nodes. Weights of a row sum to one, so differences to the row's first node are enough.
// use shared/seen

var<storage, read> band_rows: array<u32>;
var<storage, read> band_columns: array<u32>;
var<storage, read> band_values: array<f32>;

@compute @workgroup_size(64)
fn extend_band(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
               @builtin(local_invocation_index) local: u32) {
    let s = find_seat(group, groups, local, 64u);
    if !s.runs || s.item >= sight.extended - sight.nodes {
        return;
    }
    let first = band_rows[s.item];
    let origin = seen_at(s.slot, band_columns[first]);
    var sum = vec3(0.0);
    for (var k = first; k < band_rows[s.item + 1u]; k++) {
        sum += band_values[k] * between(origin, seen_at(s.slot, band_columns[k]));
    }
    let at = seen_at(s.slot, sight.nodes + s.item);
    seen[at] = seen[origin];
    seen[rest_part() + at] = seen[rest_part() + origin] + vec4(sum, 0.0);
}

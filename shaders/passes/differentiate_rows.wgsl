//! Derivatives of every residual along `mode` directions. Items are points, then markers, then observed nodes.
// use shared/hexahedron
// use costs/markers
// use shared/found
// use shared/directions

var<storage, read> changes: array<vec4<f32>>;
// [points][readings]: derivatives of the true points.
var<shots> reading_slopes: array<vec4<f32>>;
// [slots][Q][most rows]
var<storage, read_write> slopes: array<f32>;

fn marker_change(base: u32, member: u32, column: u32, first_site: u32, mark: Mark, carrier: Carried) -> vec3<f32> {
    var c = carrier;
    var moved = vec3(0.0);
    var df = mat3x3(vec3(0.0), vec3(0.0), vec3(0.0));
    let number = first_site + mark.site;
    for (var k = stencil_rows[number]; k < stencil_rows[number + 1u]; k++) {
        let d = changes[base + stencil_entries[k].node].xyz;
        moved += stencil_entries[k].weight * d;
        df += outer(d, stencil_gradients[k].xyz);
    }
    let spin = c.pair * axial(transpose(c.turn) * df);
    moved += c.turn * cross(spin, stalk_of(member, first_site, mark.site));
    if sight.offsets > 0u {
        for (var axis = 0u; axis < 3u; axis++) {
            moved += offset_along(column, mark.site, axis) * c.turn[axis];
        }
    }
    return moved;
}

@compute @workgroup_size(64)
fn differentiate_rows(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
                      @builtin(local_invocation_index) local: u32) {
    let s = find_seat(group, groups, 64u);
    let index = s.first + local;
    let shot = shots[s.look.shot];
    let items = shot.point_count + shot.marker_count + shot.node_count;
    let q = index / max(items, 1u);
    let item = index % max(items, 1u);
    if !s.runs || items == 0u || q >= call.mode {
        return;
    }
    let column = s.look.member * call.mode + q;
    let base = (s.slot * call.mode + q) * sight.extended;
    let out = (s.slot * call.mode + q) * sight.rows;
    if item < shot.point_count {
        let f = found[s.slot * sight.points + item];
        var d = 0.0;
        if f.cell != NONE {
            var change = vec3(0.0);
            for (var i = 0u; i < 8u; i++) {
                change += shape_at(f.xi, i) * changes[base + band_cells[f.cell].nodes[i]].xyz;
            }
            for (var k = 0u; k < sight.readings; k++) {
                change -= reading_along(column, k) * reading_slopes[(shot.point_start + item) * sight.readings + k].xyz;
            }
            d = -dot(f.gradient, change);
        }
        slopes[out + item] = d;
        return;
    }
    var change = vec3(0.0);
    let vector = item - shot.point_count;
    if vector < shot.marker_count {
        let mark = marks[shot.marker_start + vector];
        change = marker_change(base, s.look.member, column, shot.first_site, mark, carried[s.slot * sight.markers + vector]);
    } else {
        change = changes[base + vector - shot.marker_count].xyz;
    }
    let row = out + shot.point_count + 3u * vector;
    slopes[row] = change.x;
    slopes[row + 1u] = change.y;
    slopes[row + 2u] = change.z;
}

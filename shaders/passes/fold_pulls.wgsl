//! dJ/du of a look: band nodes folded back onto the body (transpose of the extension), markers and observed nodes added; handed to
//! both ends of the step, and to the time that the curve is read at. Mode 1: the round has depth points.
// use costs/markers
// use costs/displacements
// use shared/found
// use shared/reduce

var<storage, read> now: array<vec4<f32>>;
var<storage, read> next: array<vec4<f32>>;
var<storage, read> pulls: array<vec4<f32>>;
// Band nodes that a simulation node is extended to, and the weights.
var<storage, read> fold_rows: array<u32>;
var<storage, read> fold_columns: array<u32>;
var<storage, read> fold_values: array<f32>;
// Entries of the sites' lists at every node, and the sites that they belong to.
var<storage, read> node_site_rows: array<u32>;
var<storage, read> node_site_list: array<vec2<u32>>;
// Markers of a frame by site: [F][sites + 1].
var<storage, read> mark_rows: array<u32>;
// [2][B][N]: by u and by v.
var<storage, read_write> adj_now: array<vec4<f32>>;
var<storage, read_write> adj_next: array<vec4<f32>>;

fn pull_of(s: Seat, shot: Shot, node: u32) -> vec3<f32> {
    var g = vec3(0.0);
    if call.mode == 1u && shot.point_count != 0u {
        let base = s.slot * sight.extended;
        g = pulls[base + node].xyz;
        for (var k = fold_rows[node]; k < fold_rows[node + 1u]; k++) {
            g += fold_values[k] * pulls[base + fold_columns[k]].xyz;
        }
    }
    if shot.marker_count != 0u {
        for (var k = node_site_rows[node]; k < node_site_rows[node + 1u]; k++) {
            let entry = node_site_list[k];
            let of_site = s.look.frame * (sight.sites + 1u) + entry.x;
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
    return g;
}

@compute @workgroup_size(64)
fn fold_pulls(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
              @builtin(local_invocation_index) local: u32) {
    let s = find_seat(group, groups, local, 64u);
    if !s.runs {
        return;
    }
    let shot = shots[s.look.shot];
    let plane = sight.members * sight.nodes;
    let f = s.look.value;
    let rate = s.look.rate;
    var later = 0.0;
    for (var node = s.item; node < sight.nodes; node += 64u * call.roster) {
        let g = pull_of(s, shot, node);
        let a = s.look.member * sight.nodes + node;
        adj_now[a] += vec4(f.x * g, 0.0);
        adj_now[plane + a] += vec4(f.y * g, 0.0);
        adj_next[a] += vec4(f.z * g, 0.0);
        adj_next[plane + a] += vec4(f.w * g, 0.0);
        // The rates of u₀ and u₁ sum to zero.
        let moved = (next[a].xyz - now[a].xyz) + (next[plane + a].xyz - now[plane + a].xyz);
        let speed = rate.z * moved + (rate.y * now[2u * plane + a].xyz + rate.w * next[2u * plane + a].xyz);
        // A later start means an earlier place on the curve.
        later -= dot(g, speed);
    }
    let total = tree(local, vec4(later, 0.0, 0.0, 0.0));
    if local == 0u {
        partials[s.slot * PARTS + s.group] = total;
    }
}

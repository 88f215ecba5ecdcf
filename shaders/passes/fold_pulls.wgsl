//! Hands dJ/du of a look to both ends of the step, and to the time that the curve is read at.
// use shared/look
// use shared/reduce

var<storage, read> now: array<vec4<f32>>;
var<storage, read> next: array<vec4<f32>>;
var<storage, read> pulls: array<vec4<f32>>;
// [2][B][N]: by u and by v.
var<storage, read_write> adj_now: array<vec4<f32>>;
var<storage, read_write> adj_next: array<vec4<f32>>;

@compute @workgroup_size(64)
fn fold_pulls(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
              @builtin(local_invocation_index) local: u32) {
    let s = find_seat(group, groups, 64u);
    let index = s.first + local;
    if !s.runs {
        return;
    }
    let plane = sight.members * sight.nodes;
    let f = s.look.value;
    let rate = s.look.rate;
    var later = 0.0;
    for (var node = index; node < sight.nodes; node += 64u * call.roster) {
        let g = pulls[s.slot * sight.extended + node].xyz;
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

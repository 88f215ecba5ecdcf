//! Derivative of the looks' displacements along one of Q directions (`mode` = Q + DIRECTION · direction): the Hermite curve of the
//! tangents, and the curve's own speed for directions that shift the clock.
// use shared/look
// use shared/directions

var<storage, read> now: array<vec4<f32>>;
var<storage, read> next: array<vec4<f32>>;
// [2][B][N]: du, dv of this direction.
var<storage, read> tangent_now: array<vec4<f32>>;
var<storage, read> tangent_next: array<vec4<f32>>;
// [slots][Q][N + M]
var<storage, read_write> changes: array<vec4<f32>>;

@compute @workgroup_size(64)
fn see_tangents(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
                @builtin(local_invocation_index) local: u32) {
    let s = find_seat(group, groups, 64u);
    let index = s.first + local;
    let node = index;
    if !s.runs || node >= sight.nodes {
        return;
    }
    let count = call.mode % DIRECTION;
    let q = call.mode / DIRECTION;
    let a = s.look.member * sight.nodes + node;
    let plane = sight.members * sight.nodes;
    let f = s.look.value;
    var d = f.x * tangent_now[a].xyz + f.y * tangent_now[plane + a].xyz
        + (f.z * tangent_next[a].xyz + f.w * tangent_next[plane + a].xyz);
    let later = later_start(s.look.member * count + q);
    if later != 0.0 {
        let rate = s.look.rate;
        let moved = (next[a].xyz - now[a].xyz) + (next[plane + a].xyz - now[plane + a].xyz);
        d -= later * (rate.z * moved + (rate.y * now[2u * plane + a].xyz + rate.w * next[2u * plane + a].xyz));
    }
    changes[(s.slot * count + q) * sight.extended + node] = vec4(d, 0.0);
}

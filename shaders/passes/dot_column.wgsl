//! dJ/dp −= z · ∂r/∂p for the parameter call.extra (modulo OF_VELOCITY); with OF_VELOCITY on top dJ/dp += dJ/dv · ∂v/∂p of the start, `probe`
//! then being an adjoint, and with OF_SHAPE dJ/dp += dJ/du · ∂u/∂p. One workgroup per member, fixed order.
// use shared/grid
// use shared/totals
// use shared/asks

var<storage, read> probe: array<vec4<f32>>;
var<storage, read> column: array<vec4<f32>>;
var<storage, read_write> gradient: array<f32>;

@compute @workgroup_size(256)
fn dot_column(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
              @builtin(local_invocation_index) local: u32) {
    let p = find_place(group, groups, 0u, 1u, 1u);
    if !p.runs {
        return;
    }
    let start = call.extra >= OF_VELOCITY;
    let of_velocity = start && call.extra < OF_SHAPE;
    var sum = vec4(0.0);
    for (var i = local; i < shape.nodes; i += 256u) {
        let a = at_node(p.member, i);
        sum.x += dot(probe[select(0u, part(1u), of_velocity) + a].xyz, column[a].xyz);
    }
    let s = total(local, sum).x;
    if local == 0u {
        gradient[p.member * shape.parameters + call.extra % OF_VELOCITY] += select(-s, s, start);
    }
}

//! dJ/dp −= z · ∂r/∂p for the parameter call.extra (mod 2¹⁶); with 2¹⁶ on top dJ/dp += dJ/dv · ∂v/∂p of the start, `probe`
//! then being an adjoint, and with 2¹⁷ dJ/dp += dJ/du · ∂u/∂p. One workgroup per member, fixed order.
// use shared/grid
// use shared/totals

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
    let start = call.extra >= 65536u;
    let of_velocity = start && call.extra < 131072u;
    var sum = vec4(0.0);
    for (var i = local; i < shape.nodes; i += 256u) {
        let a = at_node(p.member, i);
        sum.x += dot(probe[select(0u, part(1u), of_velocity) + a].xyz, column[a].xyz);
    }
    let s = total(local, sum).x;
    if local == 0u {
        gradient[p.member * shape.parameters + call.extra % 65536u] += select(-s, s, start);
    }
}

//! Sums (i, i², 1) over groups of eight invocations, and fetches the next lane's i: see probe.rs.
// use shared/structs
// use shared/lanes

var<storage, read_write> sums: array<vec4<f32>>;

@compute @workgroup_size(64)
fn probe_lanes(@builtin(global_invocation_id) id: vec3<u32>, @builtin(local_invocation_index) local: u32) {
    lanes_start(local);
    let i = f32(id.x);
    let s = sum8(vec3(i, i * i, 1.0));
    publish(vec3(i, f32(call.extra), 0.0));
    sums[id.x] = vec4(s, published((local + 1u) % 8u).x);
}

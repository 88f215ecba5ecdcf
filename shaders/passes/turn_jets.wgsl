//! What the turning of patches under jets says of the old state, node by node: adds what press_jets left for F to dJ/d(old state).
// use shared/grid

// Patches whose deformation a node has a part in: patch and entry.
var<body> framed_rows: array<u32>;
var<body> framed_list: array<vec2<u32>>;
var<body> frame_gradients: array<vec4<f32>>;
var<storage, read> jet_turns: array<vec4<f32>>;
var<storage, read_write> forces: array<vec4<f32>>;

@compute @workgroup_size(64)
fn turn_jets(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
             @builtin(local_invocation_index) local: u32) {
    let p = find_place(group, groups, local, shape.nodes, 64u);
    if !p.live {
        return;
    }
    var sum = vec3(0.0);
    for (var k = framed_rows[p.item]; k < framed_rows[p.item + 1u]; k++) {
        let at = 3u * (p.member * shape.patches + framed_list[k].x);
        let g = frame_gradients[framed_list[k].y].xyz;
        sum += jet_turns[at].xyz * g.x + jet_turns[at + 1u].xyz * g.y + jet_turns[at + 2u].xyz * g.z;
    }
    forces[at_node(p.member, p.item)] += vec4(sum, 0.0);
}

//! Where places that follow the body go: their displacement, and its gradient there column by column. call.step: number of places; call.roster:
//! the first of them.
// use shared/structs
// use shared/stencil

// [N]: displacement of the nodes beyond what all have in common.
var<storage, read> displacements: array<vec4<f32>>;
// [places][4]
var<storage, read_write> carried_places: array<vec4<f32>>;

@compute @workgroup_size(64)
fn carry_places(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
                @builtin(local_invocation_index) local: u32) {
    let number = 64u * (group.x + group.y * groups.x) + local;
    if number >= call.step {
        return;
    }
    let place = call.roster + number;
    let start = stencil_rows[place];
    var moved = vec3(0.0);
    var a = vec3(0.0);
    var b = vec3(0.0);
    var c = vec3(0.0);
    if stencil_rows[place + 1u] > start {
        // Told from the first node: weights of a gradient are large where elements are small.
        let first = displacements[stencil_entries[start].node].xyz;
        for (var k = start; k < stencil_rows[place + 1u]; k++) {
            let d = displacements[stencil_entries[k].node].xyz - first;
            let g = stencil_gradients[k].xyz;
            moved += stencil_entries[k].weight * d;
            a += d * g.x;
            b += d * g.y;
            c += d * g.z;
        }
        moved += first;
    }
    carried_places[4u * number] = vec4(moved, 0.0);
    carried_places[4u * number + 1u] = vec4(a, 0.0);
    carried_places[4u * number + 2u] = vec4(b, 0.0);
    carried_places[4u * number + 3u] = vec4(c, 0.0);
}

//! Lets members rest whose recordings take none of the steps from the next one on, `call.step`, and wakes them on the way back.
// use shared/structs

var<uniform> shape: Shape;
// Steps that the recording of each member takes.
var<batch> lasting: array<u32>;
var<storage, read_write> health: array<Health>;

@compute @workgroup_size(64)
fn rest_members(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x >= shape.members {
        return;
    }
    let over = call.step >= lasting[id.x];
    let code = health[id.x].code;
    if over && code == WELL {
        health[id.x].code = RESTING;
    }
    if !over && code == RESTING {
        health[id.x].code = WELL;
    }
}

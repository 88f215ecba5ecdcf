//! After a solve for call.extra columns of every member: the first column that failed is the member's failure, and so is one
//! that was given too few iterations to come to an end.
// use shared/structs
// use shared/efforts

var<uniform> shape: Shape;
var<storage, read> newton: array<Newton>;
var<storage, read> column_health: array<Health>;
var<storage, read_write> health: array<Health>;

@compute @workgroup_size(64)
fn end_exact(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x >= shape.members || health[id.x].code != WELL {
        return;
    }
    for (var q = 0u; q < call.extra; q++) {
        var found = column_health[q * shape.members + id.x];
        if call.mode != 0u {
            log_effort(call.step, DERIVATIVE_AT, newton[q * shape.members + id.x].cg);
        }
        if newton[q * shape.members + id.x].stage == WANTS_SOLVE {
            found.code = HURRIED;
        }
        if found.code != WELL {
            health[id.x] = found;
            return;
        }
    }
}

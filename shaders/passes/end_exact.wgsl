//! After a solve for call.extra columns of every member: the first column that failed is the member's failure.
// use shared/structs

var<uniform> shape: Shape;
var<storage, read> column_health: array<Health>;
var<storage, read_write> health: array<Health>;

@compute @workgroup_size(64)
fn end_exact(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x >= shape.members || health[id.x].code != WELL {
        return;
    }
    for (var q = 0u; q < call.extra; q++) {
        let found = column_health[q * shape.members + id.x];
        if found.code != WELL {
            health[id.x] = found;
            return;
        }
    }
}

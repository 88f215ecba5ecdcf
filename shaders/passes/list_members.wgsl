//! Lists who takes part in what comes next (section 0: all that are well; 1, 2, 3: those that want a matrix, a solve, a trial)
//! and writes the sizes of the dispatches for each list, so that work that nobody wants shrinks to nothing. `gate` is the size of
//! later listings: nothing once nobody wants anything. call.extra: columns of each member that are solved for at the same time; those
//! of a member follow each other, so that they find its matrix in the caches.
// use shared/structs
// use shared/roster

var<uniform> shape: Shape;
var<storage, read_write> roster: array<u32>;
var<storage, read_write> arguments: array<u32>;
var<storage, read_write> gate: array<u32>;
var<storage, read> newton: array<Newton>;
var<storage, read> health: array<Health>;

// Workgroups of one member, by what the items are.
fn groups_of(kind: u32) -> u32 {
    switch kind {
        case PER_NODE: { return (shape.nodes + 63u) / 64u; }
        case PER_CELL: { return (shape.cells + 7u) / 8u; }
        case PER_BLOCK: { return (shape.blocks + 63u) / 64u; }
        case PER_PATCH: { return (shape.patches + 63u) / 64u; }
        case PER_HOLD: { return (shape.holds + 7u) / 8u; }
        case PER_WIDE: { return (shape.nodes + WIDE - 1u) / WIDE; }
        case PER_ROW: { return (shape.nodes + NARROW - 1u) / NARROW; }
        case PER_ELASTIC: { return (shape.elastic + 63u) / 64u; }
        default: { return 1u; }
    }
}

@compute @workgroup_size(SECTIONS)
fn list_members(@builtin(local_invocation_index) section: u32) {
    let start = section * (call.extra * shape.members + 1u);
    var count = 0u;
    var busy = 0u;
    for (var k = 0u; k < call.extra * shape.members; k++) {
        let b = k / call.extra;
        let system = (k % call.extra) * shape.members + b;
        if health[b].code == WELL && (section == IDLE || newton[system].stage == section) {
            count += 1u;
            roster[start + count] = system;
            busy |= newton[system].stage;
        }
    }
    roster[start] = count;
    if section == IDLE {
        gate[0] = select(0u, 1u, busy != 0u);
        gate[1] = 1u;
        gate[2] = 1u;
    }
    for (var kind = 0u; kind < KINDS; kind++) {
        let total = count * groups_of(kind);
        let at = (section * KINDS + kind) * 3u;
        arguments[at] = min(total, WIDEST);
        arguments[at + 1u] = (total + WIDEST - 1u) / WIDEST;
        arguments[at + 2u] = 1u;
    }
}

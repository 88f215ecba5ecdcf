//! Lists who takes part in what comes next (section 0: all that are well; 1, 2, 3: those that want a matrix, a solve, a trial)
//! and writes the sizes of the dispatches for each list, so that work that nobody wants shrinks to nothing. `gate` is the size of
//! later listings: nothing once nobody wants anything. call.extra: columns of each member that are solved for at the same time; those
//! of a member follow each other, so that they find its matrix in the caches. Each section has 64 lanes, which look at as many systems at a time.
// use shared/structs
// use shared/roster

var<uniform> shape: Shape;
var<storage, read_write> roster: array<u32>;
var<storage, read_write> arguments: array<u32>;
var<storage, read_write> gate: array<u32>;
var<storage, read> newton: array<Newton>;
var<storage, read> health: array<Health>;

// How many of the lanes up to this one list a system; whether a lane has seen one that wants something.
var<workgroup> listed: array<u32, 256>;
var<workgroup> wanting: array<u32, 256>;

// Workgroups of one member, by what the items are.
fn groups_of(kind: u32) -> u32 {
    switch kind {
        case PER_NODE: { return (shape.nodes + 63u) / 64u; }
        case PER_CELL: { return (shape.cells + 7u) / 8u; }
        case PER_BLOCK: { return (shape.blocks + 63u) / 64u; }
        case PER_PATCH: { return (shape.patches + 63u) / 64u; }
        case PER_HOLD: { return (shape.holds + 7u) / 8u; }
        case PER_SLICE: { return shape.slices; }
        case PER_ELASTIC: { return (shape.elastic + 63u) / 64u; }
        case PER_GROUP: { return shape.groups; }
        case PER_CREW: { return shape.crew; }
        default: { return 1u; }
    }
}

@compute @workgroup_size(256)
fn list_members(@builtin(local_invocation_index) local: u32) {
    let section = local / 64u;
    let lane = local % 64u;
    let start = section * (call.extra * shape.members + 1u);
    var count = 0u;
    var busy = 0u;
    for (var first = 0u; first < call.extra * shape.members; first += 64u) {
        let k = first + lane;
        var system = 0u;
        var own = 0u;
        if k < call.extra * shape.members {
            let b = k / call.extra;
            system = (k % call.extra) * shape.members + b;
            let stage = newton[system].stage;
            if health[b].code == WELL && (section == IDLE || stage == section) {
                own = 1u;
                busy |= stage;
            }
        }
        // Sums over the lanes up to each, doubling how far they reach.
        listed[local] = own;
        workgroupBarrier();
        for (var s = 0u; s < 6u; s++) {
            var before = 0u;
            if lane >= (1u << s) {
                before = listed[local - (1u << s)];
            }
            workgroupBarrier();
            listed[local] += before;
            workgroupBarrier();
        }
        if own != 0u {
            roster[start + count + listed[local]] = system;
        }
        count += listed[section * 64u + 63u];
        workgroupBarrier();
    }
    wanting[local] = busy;
    workgroupBarrier();
    if lane == 0u {
        roster[start] = count;
    }
    if local == 0u {
        var any = 0u;
        for (var i = 0u; i < 64u; i++) {
            any |= wanting[i];
        }
        gate[0] = select(0u, 1u, any != 0u);
        gate[1] = 1u;
        gate[2] = 1u;
    }
    if lane < KINDS {
        let total = count * groups_of(lane);
        let at = (section * KINDS + lane) * 3u;
        arguments[at] = min(total, WIDEST);
        arguments[at + 1u] = (total + WIDEST - 1u) / WIDEST;
        arguments[at + 2u] = 1u;
    }
}

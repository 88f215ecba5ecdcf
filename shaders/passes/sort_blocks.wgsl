//! Sorts the hash in blocks of 512 entries, by merging runs of 1, 2, 4, … of them in the workgroup's memory. Every invocation looks for the entries
//! of two ranks, so that nothing is written twice.
// use shared/crowd
// use shared/order

var<storage, read_write> entries: array<vec2<u32>>;

const BLOCK = 512u;
// Two blocks: what is merged, and what comes of it.
var<workgroup> runs: array<vec2<u32>, 1024>;

// Where the entry of a rank lies in two sorted runs of `width` entries, one behind the other (Odeh et al. 2012, "merge path").
fn ranked(first: u32, width: u32, rank: u32) -> u32 {
    var low = max(rank, width) - width;
    var high = min(rank, width);
    for (var k = 0u; k < 10u; k++) {
        if low >= high {
            break;
        }
        let middle = (low + high) / 2u;
        if before(runs[first + width + rank - 1u - middle], runs[first + middle]) {
            high = middle;
        } else {
            low = middle + 1u;
        }
    }
    let a = first + low;
    let b = first + width + rank - low;
    if low < width && (rank - low >= width || !before(runs[b], runs[a])) {
        return a;
    }
    return b;
}

@compute @workgroup_size(256)
fn sort_blocks(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
               @builtin(local_invocation_index) local: u32) {
    let first = (group.x + group.y * groups.x) * BLOCK;
    let live = first < crowd.span * crowd.sections;
    if live {
        runs[local] = entries[first + local];
        runs[local + 256u] = entries[first + local + 256u];
    }
    for (var round = 0u; round < 9u; round++) {
        workgroupBarrier();
        let width = 1u << round;
        let source = (round & 1u) * BLOCK;
        for (var k = 0u; k < 2u; k++) {
            let i = local + 256u * k;
            let within = i & (2u * width - 1u);
            runs[BLOCK - source + i] = runs[ranked(source + i - within, width, within)];
        }
    }
    workgroupBarrier();
    if live {
        // An odd number of rounds ends in the second block.
        entries[first + local] = runs[BLOCK + local];
        entries[first + local + 256u] = runs[BLOCK + local + 256u];
    }
}

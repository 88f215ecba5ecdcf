//! Merges sorted runs of call.extra entries two by two, section by section. Every invocation looks for the entry of its own rank.
// use shared/crowd
// use shared/order

var<storage, read> runs: array<vec2<u32>>;
var<storage, read_write> merged: array<vec2<u32>>;

@compute @workgroup_size(64)
fn merge_runs(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
              @builtin(local_invocation_index) local: u32) {
    let flat = flat_id(group, groups, local, 64u);
    if flat >= crowd.span * crowd.sections {
        return;
    }
    let width = call.extra;
    let within = flat % crowd.span;
    let pair = within - within % (2u * width);
    let first = flat - within + pair;
    let rank = within - pair;
    // The last runs of a section may be short.
    let ahead = min(width, crowd.span - pair);
    let behind = min(2u * width, crowd.span - pair) - ahead;
    var low = max(rank, behind) - behind;
    var high = min(rank, ahead);
    for (var k = 0u; k < 32u; k++) {
        if low >= high {
            break;
        }
        let middle = (low + high) / 2u;
        if before(runs[first + ahead + rank - 1u - middle], runs[first + middle]) {
            high = middle;
        } else {
            low = middle + 1u;
        }
    }
    let a = first + low;
    let b = first + ahead + rank - low;
    let own = low < ahead && (rank - low >= behind || !before(runs[b], runs[a]));
    merged[flat] = runs[select(b, a, own)];
}

//! Where each cube's places and points start in the sorted hash, by bisection.
// use shared/hash

var<storage, read_write> cell_starts: array<u32>;

@compute @workgroup_size(64)
fn find_cells(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
              @builtin(local_invocation_index) local: u32) {
    let flat = flat_id(group, groups, local, 64u);
    let section = flat / (crowd.cells + 1u);
    let key = flat % (crowd.cells + 1u);
    if section > POINTS {
        return;
    }
    cell_starts[flat] = first_of(section, key);
}

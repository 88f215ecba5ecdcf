//! Which places each camera sees: those that face it and do not lie far behind the nearest one in their pixel. Those count by their area.
// use shared/picture

// [C][K]
var<storage, read_write> areas: array<f32>;

@compute @workgroup_size(64)
fn see_places(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
              @builtin(local_invocation_index) local: u32) {
    let flat = flat_id(group, groups, local, 64u);
    if flat >= crowd.cameras * crowd.places {
        return;
    }
    let place = flat % crowd.places;
    areas[flat] = select(0.0, crowd_places[place].w, sees(flat / crowd.places, place));
}

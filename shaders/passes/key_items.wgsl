//! The hash before it is sorted: an entry for every place and point in every section, with the key of its cube or pixel.
// use shared/crowd

var<storage, read_write> entries: array<vec2<u32>>;

@compute @workgroup_size(64)
fn key_items(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
             @builtin(local_invocation_index) local: u32) {
    let flat = flat_id(group, groups, local, 64u);
    let section = flat / crowd.span;
    let item = flat % crowd.span;
    if section >= crowd.sections {
        return;
    }
    var entry = vec2(NOWHERE, item);
    let kept = item % crowd.thin == 0u;
    if section == PLACES {
        if item < crowd.places && kept {
            entry.x = cube_key(crowd_places[item].xyz);
        }
    } else if section == POINTS {
        if item < crowd.points && kept {
            entry.x = cube_key(crowd_points[item].xyz);
        }
    } else {
        let camera = (section - PICTURES) % crowd.cameras;
        let eye = eyes[camera];
        if section < PICTURES + crowd.cameras {
            if item < crowd.places && faces(eye, item) {
                let pixel = pixel_of(eye, crowd_places[item].xyz);
                entry = vec2(pixel.key, bitcast<u32>(pixel.depth));
            }
        } else if item < crowd.points && u32(crowd_points[item].w) == camera {
            entry.x = pixel_of(eye, crowd_points[item].xyz).key;
        }
    }
    entries[flat] = entry;
}

//! Which places each camera has read: one of its points lies in the place's pixel, and it sees the place. Without lines of sight: one lies near.
//! Eight lanes a place and camera.
// use shared/picture
// use shared/octet

// [C][K]
var<storage, read_write> reads: array<u32>;

@compute @workgroup_size(64)
fn read_places(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
               @builtin(local_invocation_index) local: u32) {
    let item = flat_id(group, groups, local, 64u) >> 3u;
    let lane = local & 7u;
    let live = item < crowd.cameras * crowd.places;
    var read = false;
    var least = 1.0e30;
    if live {
        let camera = item / crowd.places;
        let place = item % crowd.places;
        let at = crowd_places[place].xyz;
        let eye = eyes[camera];
        if eye.center.w > 0.0 {
            let key = pixel_of(eye, at).key;
            let section = PICTURES + crowd.cameras + camera;
            read = key != NOWHERE && holds(section, first_of(section, key), key) && sees(camera, place);
        } else {
            for (var row = 0u; row < 9u; row++) {
                let run = row_near(POINTS, at, row);
                for (var i = run.x + lane; i < run.y; i += 8u) {
                    let point = crowd_points[entries[i].y];
                    let away = point.xyz - at;
                    least = min(least, select(1.0e30, dot(away, away), u32(point.w) == camera));
                }
            }
        }
    }
    let all = least_of_eight(local, least);
    if live && lane == 0u {
        reads[item] = u32(read || all <= crowd.reach);
    }
}

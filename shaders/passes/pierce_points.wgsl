//! Free space: whether a point's ray meets the body, and whether it passes through. It does where the point lies behind the nearest place in its
//! pixel and far from every place. Eight lanes a point.
// use shared/picture
// use shared/octet

const MISSED = 0u;
const MET = 1u;
const THROUGH = 2u;
// [N]
var<storage, read_write> fates: array<u32>;

@compute @workgroup_size(64)
fn pierce_points(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
                 @builtin(local_invocation_index) local: u32) {
    let n = flat_id(group, groups, local, 64u) >> 3u;
    let lane = local & 7u;
    var met = false;
    var beyond = false;
    var least = 1.0e30;
    if n < crowd.points {
        let point = crowd_points[n];
        let camera = u32(point.w);
        let pixel = pixel_of(eyes[camera], point.xyz);
        let nearest = nearest_in(camera, pixel.key);
        met = nearest >= 0.0;
        beyond = met && pixel.depth > nearest + crowd.slack;
        if beyond {
            for (var row = 0u; row < 9u; row++) {
                let run = row_near(PLACES, point.xyz, row);
                for (var i = run.x + lane; i < run.y; i += 8u) {
                    let away = crowd_places[entries[i].y].xyz - point.xyz;
                    least = min(least, dot(away, away));
                }
            }
        }
    }
    let all = least_of_eight(local, least);
    if n < crowd.points && lane == 0u {
        fates[n] = select(select(MISSED, MET, met), THROUGH, beyond && all > crowd.reach);
    }
}

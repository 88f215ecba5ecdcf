//! First half of the E-step: what the likelihoods of a point sum to over the places near it, outliers included; its inverse. Eight lanes a point.
// use shared/mixture
// use shared/octet

// [C]
var<storage, read> floors: array<f32>;
// [N]: 0 where nothing, not even an outlier, explains the point.
var<storage, read_write> inverses: array<f32>;

@compute @workgroup_size(64)
fn share_points(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
                @builtin(local_invocation_index) local: u32) {
    let n = (flat_id(group, groups, local, 64u) >> 3u) * crowd.thin;
    let lane = local & 7u;
    var sum = 0.0;
    var camera = 0u;
    if n < crowd.points {
        let point = crowd_points[n];
        camera = u32(point.w);
        for (var row = 0u; row < 9u; row++) {
            let run = row_near(PLACES, point.xyz, row);
            for (var i = run.x + lane; i < run.y; i += 8u) {
                let k = entries[i].y;
                sum += likelihood(k, camera, point.xyz - crowd_places[k].xyz);
            }
        }
    }
    let whole = sum_of_eight(local, vec4(sum, 0.0, 0.0, 0.0)).x + floors[camera];
    if n < crowd.points && lane == 0u {
        inverses[n] = select(0.0, 1.0 / whole, whole > 0.0);
    }
}

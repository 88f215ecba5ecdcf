//! Second half of the E-step: a place's share of all points near it, P, and what these draw it by, Σ p (c − s). Eight lanes a place.
// use shared/mixture
// use shared/octet

// [N]
var<storage, read> inverses: array<f32>;
// [K/thin]: Σ p (c − s) [m], P.
var<storage, read_write> shares: array<vec4<f32>>;

@compute @workgroup_size(64)
fn share_places(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
                @builtin(local_invocation_index) local: u32) {
    let item = flat_id(group, groups, local, 64u) >> 3u;
    let place = item * crowd.thin;
    let lane = local & 7u;
    var sum = vec4(0.0);
    if place < crowd.places {
        let at = crowd_places[place].xyz;
        for (var row = 0u; row < 9u; row++) {
            let run = row_near(POINTS, at, row);
            for (var i = run.x + lane; i < run.y; i += 8u) {
                let n = entries[i].y;
                let point = crowd_points[n];
                let away = point.xyz - at;
                let own = likelihood(place, u32(point.w), away);
                if own > 0.0 {
                    sum += own * inverses[n] * vec4(away, 1.0);
                }
            }
        }
    }
    let whole = sum_of_eight(local, sum);
    if place < crowd.places && lane == 0u {
        shares[item] = whole;
    }
}

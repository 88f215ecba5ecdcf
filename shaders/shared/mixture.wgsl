//! A Gaussian mixture whose components are places, weighted by the area that a camera sees (Wang et al. 2015, eq. 4), over its peak.
// use shared/hash

// [C][K]: area of a place over the mean of all where the camera sees it, else 0.
var<storage, read> weights: array<f32>;

// Of a place in a point: 0 beyond the reach.
fn likelihood(place: u32, camera: u32, away: vec3<f32>) -> f32 {
    let d = dot(away, away);
    // More than half of those in cubes nearby are beyond it: nothing is read for them.
    if d >= crowd.reach {
        return 0.0;
    }
    return weights[camera * crowd.places + place] * exp(crowd.falloff * d);
}

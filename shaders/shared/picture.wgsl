//! The picture that a camera has of the places that face it. Its section of the hash is sorted by pixel and depth, so the first entry of a pixel is
//! the nearest.
// use shared/hash

// Depth of the nearest place in a pixel [m]; negative without any.
fn nearest_in(camera: u32, key: u32) -> f32 {
    let at = first_of(PICTURES + camera, key);
    if key == NOWHERE || !holds(PICTURES + camera, at, key) {
        return -1.0;
    }
    return bitcast<f32>(entries[at].y);
}

// Whether a camera sees a place; one without lines of sight sees all.
fn sees(camera: u32, place: u32) -> bool {
    let eye = eyes[camera];
    if eye.center.w == 0.0 {
        return true;
    }
    let pixel = pixel_of(eye, crowd_places[place].xyz);
    if pixel.depth <= 0.0 || !faces(eye, place) {
        return false;
    }
    let nearest = nearest_in(camera, pixel.key);
    return nearest < 0.0 || pixel.depth <= nearest + crowd.slack;
}

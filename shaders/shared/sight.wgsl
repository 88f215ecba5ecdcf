//! The picture that a nozzle has of the patches: each is drawn as a square, and a pixel keeps the nearest. Twin of palpate-cpu/src/terms/seen.rs, with
//! which it shares how large pixels are.

// Radii of the jet out to which it blows; most pixels along a side; least cosine by which a patch's slope is reckoned.
override jet_reach: f32;
override jet_side: f32;
override jet_steepest: f32;

// [jets][B]: lowest place in the picture, edge of a pixel, pixels along a side.
struct Picture {
    low: vec2<f32>,
    pixel: f32,
    side: u32,
}

fn pixel_of(picture: Picture, place: vec2<f32>) -> vec2<u32> {
    return min(vec2<u32>(max((place - picture.low) / picture.pixel, vec2(0.0))), vec2(picture.side - 1u));
}

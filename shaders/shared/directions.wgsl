//! Directions of tangents, as the passes of observations are told of them.
// use shared/look

// In a call's `mode`: number of directions, plus DIRECTION times which of them.
const DIRECTION = 65536u;

// [B][Q][entries]: components of the directions by what the measurement depends on beside the states: the start on the recording's clock;
// where offsets of markers are parameters, 3 · marker + axis of them; numbers that move readings.
var<storage, read> own_directions: array<f32>;

fn of_offsets() -> u32 {
    return select(0u, 3u * sight.sites, sight.offsets > 0u);
}

// `column`: directions times the member, plus which of them.
fn own_entry(column: u32, entry: u32) -> f32 {
    return own_directions[column * (1u + of_offsets() + sight.readings) + entry];
}

fn later_start(column: u32) -> f32 {
    return own_entry(column, 0u);
}

fn offset_along(column: u32, site: u32, axis: u32) -> f32 {
    return own_entry(column, 1u + 3u * site + axis);
}

fn reading_along(column: u32, number: u32) -> f32 {
    return own_entry(column, 1u + of_offsets() + number);
}

//! Directions of tangents, as the passes of observations are told of them.

// In a call's `mode`: number of directions, plus DIRECTION times which of them.
const DIRECTION = 65536u;
// Codes of directions that change the measurement: 1 + 3 · marker + axis of an offset, READING + number of what moves readings, else 0.
const READING = 0x80000000u;

//! What call.extra asks of passes.

// Of touch_patches: force, energy and stiffness; derivatives by Young's modulus and, plus PLANE_ASKS times the plane, by its height
// and angles; nothing; by the old state along `probe`.
const TOUCH_FORCE = 0u;
const TOUCH_YOUNG = 1u;
const PLANE_HEIGHT = 2u;
const PLANE_THETA = 3u;
const PLANE_PHI = 4u;
const NO_TOUCH = 5u;
const TOUCH_OLD = 6u;
const PLANE_ASKS = 8u;

// Of hold_cells: force of the new state, weighted with θ, and of the old one, weighted with 1 − θ; derivative of both by Young's
// modulus, Poisson's ratio and time; the old state's matrix times `probe`; nothing; derivatives by effects: by a stiffness that
// varies over the body or in time, by the stress-free shape, by how clamps are held.
const HOLD_NEW = 0u;
const HOLD_OLD = 1u;
const HOLD_YOUNG = 2u;
const HOLD_POISSON = 3u;
const HOLD_TIME = 4u;
const HOLD_PROBE = 5u;
const NO_HOLD = 6u;
const HOLD_SLOPE = 7u;
const HOLD_AGING = 8u;
const HOLD_REST = 9u;
const HOLD_GRIP = 10u;
// The last four are told HOLD_ROW times the row of their slopes, and the last HOLD_MATRIX times one more than the row of its matrices'.
const HOLD_ROW = 256u;
const HOLD_MATRIX = 65536u;

// Of the passes that couple a step with the old state: the derivative times `probe`, or its transpose.
const ALONG = 0u;
const TRANSPOSED = 1u;

// Bits that the passes of an iteration of conjugate gradients by many workgroups are told: its number is odd; products were made in groups
// of WIDE nodes (else NARROW).
const ODD = 1u;
const WIDE_PARTS = 2u;

// What a solve by conjugate gradients is for: a direction of Newton's method, which a negative curvature cuts short, or a derivative, of which it
// is an error.
const FOR_DIRECTION = 0u;
const FOR_DERIVATIVE = 1u;

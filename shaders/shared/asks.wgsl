//! What call.extra asks of passes.

// Of touch_patches: force, energy and stiffness; nothing; derivative by the old state along `probe`.
const TOUCH_FORCE = 0u;
const NO_TOUCH = 1u;
const TOUCH_OLD = 2u;
// Of passes of things that move besides: the transpose of that; change along a direction of the coefficients; stiffness.
const TOUCH_BACK = 3u;
const TOUCH_ALONG = 4u;
const TOUCH_STIFFNESS = 5u;

// Of hold_cells: force of the new state, weighted with θ, and of the old one, weighted with 1 − θ; the old state's matrix times `probe`; nothing.
const HOLD_NEW = 0u;
const HOLD_OLD = 1u;
const HOLD_PROBE = 2u;
const NO_HOLD = 3u;

// Of the passes that couple a step with the old state: the derivative times `probe`, or its transpose.
const ALONG = 0u;
const TRANSPOSED = 1u;
// A bit besides, of elastic points: the same by the stress-free shape, as far as the past sees it, along `probe`, a change of it, or transposed, before
// it goes to nodes.
const OF_SHAPE = 2u;

// Bits that the passes of an iteration of conjugate gradients by many workgroups are told: its number is odd; a product is with the solution;
// the first preconditioned residual is made, of the residual as it is.
const ODD = 1u;
const OF_SOLUTION = 2u;
const BEGINS = 4u;

// What a solve by conjugate gradients is for: a direction of Newton's method, which a negative curvature cuts short, or a derivative, of which it
// is an error.
const FOR_DIRECTION = 0u;
const FOR_DERIVATIVE = 1u;
// So often a derivative's solve goes on after a residual that was only said to be small; then the true one is what rounding leaves.
const MOST_CLAIMS = 2u;

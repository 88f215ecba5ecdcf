//! What solves for derivatives are asked for.

// Relative accuracy that a solve in single precision can reach with any certainty.
const FINEST = 2e-7;

//! What call.extra asks of brace_stars.

// Which displacements A is multiplied with: of the new state, of the old one, or the vector `probe`.
const BRACE_NEW = 0u;
const BRACE_OLD = 1u;
const BRACE_PROBE = 2u;
const BRACE_OF = 3u;
// Bits: subtract; add to a residual, with energies and sizes.
const BRACE_MINUS = 4u;
const BRACE_RESIDUAL = 8u;

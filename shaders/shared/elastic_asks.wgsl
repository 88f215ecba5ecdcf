//! What call.extra asks of the passes of elastic points.

// Of press_elastic: the force of the new state with damping, and its energy; or the old state's force alone.
const STRESS_NEW = 0u;
const STRESS_OLD = 1u;

// Bits for shape_elastic: what the tangent makes of it, instead of the stress; transposed.
const SHAPE_TANGENT = 1u;
const SHAPE_PULLS = 2u;

// Bits for spread_elastic: subtract; add to a residual, with energies and sizes; patches take part.
const SPREAD_MINUS = 1u;
const SPREAD_RESIDUAL = 2u;
const SPREAD_PATCHES = 4u;

// Numbers of a point's tangent, by columns.
const TANGENT_NUMBERS = 81u;

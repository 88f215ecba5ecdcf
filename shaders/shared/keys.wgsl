//! Kinds of parameters, and how the passes of a derivative by one are told of it: its kind, plus KEYS times an index.

const YOUNGS_MODULUS = 0u;
const POISSON_RATIO = 1u;
const DENSITY = 2u;
const MASS_DAMPING = 3u;
const STIFFNESS_DAMPING = 4u;
const GRAVITY = 5u;
const VELOCITY = 6u;
const ANGULAR_VELOCITY = 7u;
const TIME_START = 8u;
const PLANE = 9u;
const POINT_MASS = 10u;
const EFFECT = 11u;
// Place in an index beside SLOTS times the law.
const SLOTS = 16u;
const MODULUS_SLOPE = 12u;
const DENSITY_SLOPE = 13u;
const AGING_SLOPE = 14u;
// A kind that no kernel knows: the column is zero.
const NOTHING = 15u;
const REST_SLOPE = 16u;
// Of the start in another stress-free shape: of its displacement, and of the velocity that a spin gives it.
const START_SHAPE = 17u;
const START_SPIN = 18u;

const KEYS = 32u;
// Added for gather_column: cells take part.
const OF_CELLS = 65536u;

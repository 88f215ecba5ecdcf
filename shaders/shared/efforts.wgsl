//! What solves of a stage took, the most of all members: the host records as much the next time.

// Rounds of Newton's method; iterations of a derivative's solve; iterations of the solve of every round.
const ROUNDS_AT = 0u;
const DERIVATIVE_AT = 1u;
const SOLVES_AT = 2u;
const MOST_ROUNDS = 30u;
const LOGGED = 32u;

var<storage, read_write> efforts: array<atomic<u32>>;

fn log_effort(stage: u32, what: u32, count: u32) {
    atomicMax(&efforts[stage * LOGGED + what], count);
}

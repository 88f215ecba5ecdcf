//! How a search spends its time: who is fitted, in what order, and when one is dropped. Nothing here decides what is true; the same candidates, fitted
//! to their ends, are judged by [`crate::judgement`] alone. `cargo xtask suite --ablate` says what each number is worth.

/// Numbers of the search.
#[derive(Clone, Debug, PartialEq)]
pub struct Policy {
    /// Most effects added, one a round.
    pub rounds: usize,
    /// Candidates that race in a round, those that promise most; half as many again for second starts, twice as many where there are few
    /// instants, because fits are cheap and linear estimates poor there.
    pub fits: usize,
    /// Iterations of each lap of a race; the last brings what is left to its optimum.
    pub laps: [usize; 4],
    /// Relative decrease of the cost by an iteration at which a fit has arrived: of the first laps, and of the last ones.
    pub tolerance: [f64; 2],
    /// Share of those on the way, with no more numbers, that go on after a lap, the ones whose curvature promises the lowest cost, and how many do
    /// at least.
    pub kept: (f64, usize),
    /// Share of what the leader gains by which that promise may lag behind what the leader has reached.
    pub lag: f64,
    /// Shares of the linear estimate that a fit may start from: the first at which the cost is lower than without.
    pub starts: [f64; 3],
    /// Starts of an effect at an unknown place that are scored first; the others follow where one of these promises a share of the best's gain.
    pub places: (usize, f64),
    /// Walls, and other effects that are scored by what they do at a typical size: how many race, and the share of the sum of squares that
    /// they must take away as they stand.
    pub walls: (usize, f64),
    /// Further starts of candidates at unknown places where nothing explains: in all, and of each.
    pub elsewhere: (usize, usize),
    /// Change of a fitted number, relative to its size, from which on it may lie in another valley; and from which on what shows there shows
    /// nothing of the body, so that candidates start where the fit began first.
    pub strayed: (f64, f64),
    /// Multiples of its typical size that an effect at an unknown place is tried at there, where small amounts of it tell nothing.
    pub sizes: [f64; 2],
    /// Most numbers of a plain effect, and of a freer one beside a plain one.
    pub plain: (usize, usize),
    /// Share of the sum of squares that a pair must promise to take away, and how much of it beyond its better half.
    pub promise: (f64, f64),
    /// Pairs that are fitted of each number of numbers: plain ones, with a freer effect; and fitted effects that partners are looked for.
    pub pairs: (usize, usize, usize),
    /// Effects of a family that are tried in the place of others.
    pub kin: usize,
    /// Candidates of a race that are measured beside errors of grid and step of their own.
    pub rivals: usize,
}

impl Default for Policy {
    fn default() -> Policy {
        Policy {
            rounds: 3,
            fits: 12,
            laps: [2, 3, 8, 25],
            tolerance: [2e-4, 2e-5],
            kept: (0.5, 4),
            lag: 0.1,
            starts: [1.0, 0.3, 0.1],
            places: (8, 0.25),
            walls: (3, 0.3),
            elsewhere: (10, 3),
            strayed: (0.3, 10.0),
            sizes: [1.0, 3.0],
            plain: (3, 9),
            promise: (0.8, 0.05),
            pairs: (2, 8, 3),
            kin: 4,
            rivals: 4,
        }
    }
}

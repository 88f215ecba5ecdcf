//! How many dispatches a solve is given. The device decides who takes part in each, and one that nobody wants shrinks to nothing, but
//! a graphics processor still takes a microsecond or two for it. So a rollout is recorded with few of them first. A member that needs
//! more says so, and the rollout is computed again with more, as are all later ones of that world. How many there are changes no bit
//! of what a member arrives at: a solve that is cut off goes on where it was.

use std::cell::Cell;

/// What a solve is given.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Effort {
    /// Rounds of Newton's method.
    pub(crate) rounds: usize,
    /// Iterations of conjugate gradients in each of them.
    pub(crate) iterations: u32,
    /// The same for a derivative.
    pub(crate) derivative: u32,
}

/// Everything that is allowed.
pub(crate) const FULL: Effort = Effort { rounds: usize::MAX, iterations: u32::MAX, derivative: u32::MAX };

/// From little to everything. A step of a soft body takes three to five rounds, and its solves go on from one round to the next.
const LEVELS: &[Effort] = &[
    Effort { rounds: 6, iterations: 32, derivative: 128 },
    Effort { rounds: 10, iterations: 96, derivative: 512 },
    Effort { rounds: 16, iterations: 256, derivative: 2048 },
    FULL,
];

/// The level at which a world is, and whether that was too low.
#[derive(Debug)]
pub(crate) struct Level {
    levels: &'static [Effort],
    level: usize,
    watched: bool,
    short: Cell<bool>,
}

impl Level {
    /// `sparing`: a dispatch that nobody wants costs something. On a software adapter it hardly does, and computing again would.
    pub(crate) fn new(sparing: bool) -> Level {
        Level::of(if sparing { LEVELS } else { &[FULL] })
    }

    /// The first of these levels, of which the last gives everything.
    pub(crate) fn of(levels: &'static [Effort]) -> Level {
        Level { levels, level: 0, watched: true, short: Cell::new(false) }
    }

    /// What a solve is given now.
    pub(crate) fn effort(&self) -> Effort {
        if self.watched { FULL } else { self.levels[self.level] }
    }

    /// Whether rollouts are looked at on the way, so that none can be computed again; so it is until somebody says otherwise.
    pub(crate) fn watch(&mut self, watched: bool) {
        self.watched = watched;
    }

    /// Notes that a member was cut off.
    pub(crate) fn fell_short(&self) {
        self.short.set(true);
    }

    /// True if a member was cut off since the last call; from then on there is more.
    pub(crate) fn rise(&mut self) -> bool {
        let short = self.short.take();
        self.level = (self.level + usize::from(short)).min(self.levels.len() - 1);
        short
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_level_gives_more_and_the_last_one_everything() {
        assert!(
            LEVELS
                .windows(2)
                .all(|w| { w[0].rounds < w[1].rounds && w[0].iterations < w[1].iterations && w[0].derivative < w[1].derivative })
        );
        let mut level = Level::new(true);
        assert_eq!(level.effort(), FULL);
        level.watch(false);
        assert_eq!(level.effort(), LEVELS[0]);
        assert!(!level.rise());
        for effort in &LEVELS[1..] {
            level.fell_short();
            assert!(level.rise());
            assert_eq!(level.effort(), *effort);
        }
        assert_eq!(level.effort(), FULL);
        level = Level::new(false);
        level.watch(false);
        assert_eq!(level.effort(), FULL);
    }
}

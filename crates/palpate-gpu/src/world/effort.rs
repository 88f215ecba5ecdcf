//! How many dispatches a solve is given. The device decides who takes part in each, and one that nobody wants shrinks to nothing, but
//! a graphics processor still takes a microsecond or two for it, and the host two to record it. So every stage is given what it took in the
//! rollout before, and a little more: rollouts of a fit resemble each other. The first rollout is recorded with few. A member that needs
//! more says so, and the rollout is computed again with more. How many there are changes no bit of what a member arrives at: a solve that is
//! cut off goes on where it was.

use crate::device::pipelines::shared::efforts::{DERIVATIVE_AT, LOGGED, MOST_ROUNDS, ROUNDS_AT, SOLVES_AT};
use std::cell::{Cell, RefCell};

/// What a solve is given.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Effort {
    /// Rounds of Newton's method.
    pub(crate) rounds: usize,
    /// Iterations of conjugate gradients in each of them; those beyond have as many as the last.
    pub(crate) iterations: Vec<u32>,
    /// The same for a derivative.
    pub(crate) derivative: u32,
}

impl Effort {
    fn even(rounds: usize, iterations: u32, derivative: u32) -> Effort {
        Effort { rounds, iterations: vec![iterations], derivative }
    }

    /// Everything that is allowed.
    pub(crate) fn full() -> Effort {
        Effort::even(usize::MAX, u32::MAX, u32::MAX)
    }

    /// Iterations of a round.
    pub(crate) fn of_round(&self, round: usize) -> u32 {
        self.iterations.get(round).or(self.iterations.last()).copied().unwrap_or(u32::MAX)
    }

    /// What a stage took (`shared/efforts.wgsl`), with a margin.
    fn like(log: &[u32], margin: f64) -> Effort {
        let more = |n: u32| (f64::from(n) * (1.0 + margin)).ceil() as u32 + SPARE;
        let rounds = log[ROUNDS_AT as usize] as usize;
        let solves = &log[SOLVES_AT as usize..];
        let mut iterations: Vec<u32> = solves.iter().take(rounds).map(|n| more(*n)).collect();
        // What is left over of a solve goes on in rounds that come on top, with the mean of the others.
        let all: u32 = solves.iter().take(rounds).sum();
        iterations.push(more(all.div_ceil(rounds.max(1) as u32)));
        let spare = 1 + (rounds as f64 * margin) as usize;
        Effort { rounds: rounds + spare, iterations, derivative: more(log[DERIVATIVE_AT as usize]) }
    }
}

/// Given beyond what a solve took, and in parts of it: where a dispatch that nobody wants costs as much as computing again now and then, and where
/// it costs next to nothing.
const SPARE: u32 = 4;
const MARGIN: f64 = 0.15;
const AMPLE: f64 = 1.0;
/// Beyond this margin everything is given.
const WIDEST: f64 = 1.0;

/// What the first rollout is given: (rounds, iterations, iterations of a derivative), from little to much. A step of a soft body takes three to
/// five rounds, and its solves go on from one round to the next. After the last comes everything.
pub(crate) const LEVELS: &[(usize, u32, u32)] = &[(6, 32, 128), (10, 96, 512), (16, 256, 2048)];

/// What a world gives its solves, and whether that was too little.
#[derive(Debug)]
pub(crate) struct Level {
    levels: &'static [(usize, u32, u32)],
    level: usize,
    /// What every stage took in the rollout before, with the margin that it is given; where nothing may be left out, never.
    known: RefCell<Option<Vec<u32>>>,
    margin: Cell<f64>,
    usual: f64,
    watched: bool,
    short: Cell<bool>,
}

impl Level {
    /// `sparing`: a dispatch that nobody wants costs something. On a software adapter it hardly does, and computing again would.
    pub(crate) fn new(sparing: bool) -> Level {
        if sparing { Level::of(LEVELS) } else { Level { usual: AMPLE, margin: Cell::new(AMPLE), ..Level::of(&[]) } }
    }

    /// The first rollout with the first of these levels, after which comes everything.
    pub(crate) fn of(levels: &'static [(usize, u32, u32)]) -> Level {
        Level {
            levels,
            level: 0,
            known: RefCell::new(None),
            margin: Cell::new(MARGIN),
            usual: MARGIN,
            watched: true,
            short: Cell::new(false),
        }
    }

    /// What a stage is given now.
    pub(crate) fn effort(&self, stage: usize) -> Effort {
        if self.watched {
            return Effort::full();
        }
        let log = self.known.borrow();
        let own = log.as_ref().and_then(|log| log.chunks(LOGGED as usize).nth(stage));
        match own.filter(|log| log[ROUNDS_AT as usize] > 0) {
            Some(log) if self.margin.get() <= WIDEST && log[ROUNDS_AT as usize] <= MOST_ROUNDS => {
                Effort::like(log, self.margin.get())
            }
            // Nor is it known what a stage of more rounds took than are kept.
            Some(_) => Effort::full(),
            None => self.levels.get(self.level).map_or_else(Effort::full, |(r, i, d)| Effort::even(*r, *i, *d)),
        }
    }

    /// Whether rollouts are looked at on the way, so that none can be computed again; so it is until somebody says otherwise.
    pub(crate) fn watch(&mut self, watched: bool) {
        self.watched = watched;
    }

    /// Takes what the stages of a rollout took.
    pub(crate) fn learn(&self, log: &[u32]) {
        if self.watched || self.short.get() {
            return;
        }
        let mut known = self.known.borrow_mut();
        let mut log = log.to_vec();
        // A rollout without derivatives says nothing of them.
        if let Some(before) = known.as_ref().filter(|k| k.len() == log.len()) {
            for (now, old) in log.chunks_mut(LOGGED as usize).zip(before.chunks(LOGGED as usize)) {
                let place = DERIVATIVE_AT as usize;
                now[place] = if now[place] == 0 { old[place] } else { now[place] };
            }
        }
        *known = Some(log);
        self.margin.set(self.usual);
    }

    /// Notes that a member was cut off.
    pub(crate) fn fell_short(&self) {
        self.short.set(true);
    }

    /// True if a member was cut off since the last call; from then on there is more.
    pub(crate) fn rise(&mut self) -> bool {
        let short = self.short.take();
        if short && self.known.borrow().is_some() {
            self.margin.set(4.0 * self.margin.get());
        } else {
            self.level += usize::from(short);
        }
        short
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_level_gives_more_and_after_the_last_comes_everything() {
        assert!(LEVELS.windows(2).all(|w| w[0].0 < w[1].0 && w[0].1 < w[1].1 && w[0].2 < w[1].2));
        let mut level = Level::new(true);
        assert_eq!(level.effort(0), Effort::full());
        level.watch(false);
        let given = |(r, i, d): (usize, u32, u32)| Effort::even(r, i, d);
        assert_eq!(level.effort(0), given(LEVELS[0]));
        assert!(!level.rise());
        for effort in &LEVELS[1..] {
            level.fell_short();
            assert!(level.rise());
            assert_eq!(level.effort(0), given(*effort));
        }
        level.fell_short();
        assert!(level.rise());
        assert_eq!(level.effort(0), Effort::full());
        level = Level::new(false);
        level.watch(false);
        assert_eq!(level.effort(0), Effort::full());
        level.learn(&log());
        assert_eq!(level.effort(0), Effort { rounds: 5, iterations: vec![44, 84, 64], derivative: 204 });
        level.fell_short();
        assert!(level.rise());
        assert_eq!(level.effort(0), Effort::full());
    }

    /// A log of two stages, the first of two rounds, the second of one.
    fn log() -> Vec<u32> {
        let mut log = vec![0; 2 * LOGGED as usize];
        let [rounds, derivative, solves] = [ROUNDS_AT, DERIVATIVE_AT, SOLVES_AT].map(|p| p as usize);
        (log[rounds], log[derivative], log[solves], log[solves + 1]) = (2, 100, 20, 40);
        (log[LOGGED as usize + rounds], log[LOGGED as usize + solves]) = (1, 7);
        log
    }

    #[test]
    fn a_stage_is_given_what_it_took_and_a_little_more() {
        let mut level = Level::new(true);
        level.watch(false);
        level.learn(&log());
        assert_eq!(level.effort(0), Effort { rounds: 3, iterations: vec![27, 50, 39], derivative: 119 });
        assert_eq!(level.effort(1).iterations, [13, 13]);
        assert_eq!([0, 1, 2, 9].map(|r| level.effort(0).of_round(r)), [27, 50, 39, 39]);
        // Too little twice: then everything, until it is known better.
        for expected in [68, u32::MAX] {
            level.fell_short();
            assert!(level.rise());
            assert_eq!(level.effort(0).of_round(1), expected);
        }
        let mut without = log();
        without[DERIVATIVE_AT as usize] = 0;
        level.learn(&without);
        assert_eq!(level.effort(0).derivative, 119);
        // What a rollout took that was cut off is not known.
        level.fell_short();
        level.learn(&vec![1; 2 * LOGGED as usize]);
        assert!(level.rise());
        assert_eq!(level.effort(0).rounds, 4);
    }

    #[test]
    fn a_stage_of_more_rounds_than_are_kept_is_given_all() {
        let mut level = Level::new(true);
        level.watch(false);
        let mut log = log();
        log[ROUNDS_AT as usize] = MOST_ROUNDS + 1;
        level.learn(&log);
        assert_eq!(level.effort(0), Effort::full());
    }
}

//! The tracker on a point on a spring, whose frames are known.

use super::course::track;
use super::*;
use crate::failure::Failure;
use std::ops::ControlFlow;

/// A point on a spring: readings draw it from its place, and the mixture reaches farther than the surface.
struct Point {
    readings: Vec<Option<f64>>,
    asked: Vec<(usize, Pull)>,
    pierced: Vec<f64>,
}

const STIFFNESS: f64 = 1.0;
const REACH: f64 = 0.3;

impl Follow for Point {
    fn start(&mut self) -> Result<Pose, Failure> {
        Ok(Pose { displacement: vec![DVec3::ZERO], velocity: vec![DVec3::ZERO] })
    }

    fn approach(&mut self, problem: &Problem, pull: Pull, u: &mut Vec<DVec3>) -> Result<f64, Failure> {
        self.asked.push((problem.frame, pull));
        let from = match problem.prior {
            Prior::Step(pose, _) | Prior::Held(pose, _) => pose.displacement[0].x,
            Prior::Equilibrium => 0.0,
        };
        let near = |goal: f64| match pull {
            Pull::Mixture { .. } => true,
            Pull::Surface { band } => (goal - u[0].x).abs() < band.min(REACH),
        };
        let goal = self.readings[problem.frame].filter(|g| near(*g));
        let weight = problem.temperature * 1e4;
        let best = goal.map_or(from, |g| (STIFFNESS * from + weight * g) / (STIFFNESS + weight));
        let fall = 0.5 * (best - u[0].x).powi(2) * 1e4;
        u[0].x = best;
        Ok(fall)
    }

    fn look(&mut self, frame: usize, u: &[DVec3], band: f64) -> Met {
        let Some(goal) = self.readings[frame] else { return Met::default() };
        let away = (goal - u[0].x).abs();
        let matched = usize::from(away < band.min(REACH));
        Met { readings: 1, matched, rms: away * matched as f64, cost: 0.5e4 * away.min(band).powi(2) }
    }

    fn certainty(&mut self, p: &Problem, _: f64, _: &[DVec3], _: &[Vec<DVec3>]) -> Result<Certainty, Failure> {
        let prior = vec![vec![DVec3::splat((p.temperature / STIFFNESS).sqrt())]];
        Ok(Certainty { posterior: prior.clone(), prior, determined: 1.0, excess: 0.5 * p.temperature, energy: 0.0 })
    }

    fn pierced(&mut self, frame: usize, _: &[DVec3]) -> Result<f64, Failure> {
        let cold = self.asked.iter().any(|(f, pull)| *f == frame && matches!(pull, Pull::Mixture { .. }));
        Ok(if cold { 0.0 } else { self.pierced[frame] })
    }

    fn seen(&mut self, frame: usize, _: &[DVec3]) -> Result<Vec<bool>, Failure> {
        Ok(vec![self.readings[frame].is_some()])
    }
}

fn followed(mut body: Point) -> (Vec<Tracked>, Vec<(usize, Pull)>) {
    let settings = Settings {
        dynamic: true,
        temperature: None,
        outliers: 0.0,
        spread: None,
        widest: 0.1,
        spacing: 0.01,
        noise: 0.01,
        size: 1.0,
    };
    let frames: Vec<(usize, f64)> = (0..body.readings.len()).map(|k| (k, 0.1 * k as f64)).collect();
    let mut all = Vec::new();
    let visit = |t: Tracked| {
        all.push(t);
        ControlFlow::Continue(())
    };
    track(&mut body, &settings, &frames, 0.0, &[vec![DVec3::ONE]], visit).unwrap();
    (all, body.asked)
}

fn mixtures(asked: &[(usize, Pull)], frame: usize) -> usize {
    asked.iter().filter(|(f, pull)| *f == frame && matches!(pull, Pull::Mixture { .. })).count()
}

#[test]
fn near_frames_need_no_mixture_and_far_ones_do() {
    let readings = vec![Some(0.0), Some(0.02), Some(0.8)];
    let (all, asked) = followed(Point { pierced: vec![0.0; 3], readings, asked: Vec::new() });
    assert_eq!([0, 1, 2].map(|f| mixtures(&asked, f) > 0), [false, false, true]);
    assert_eq!(all.iter().map(|t| t.cold).collect::<Vec<_>>(), [false, false, true]);
    // What draws has the weight 1e4 of a noise of 1 cm.
    assert!((all[1].pose.displacement[0].x - 0.02).abs() < 0.011, "{:?}", all[1].pose);
    assert!(
        (all[1].pose.velocity[0].x - all[1].pose.displacement[0].x / 0.1 + all[0].pose.displacement[0].x / 0.1).abs() < 1e-12
    );
}

#[test]
fn a_frame_without_readings_is_the_priors_and_the_next_goes_on_from_the_one_before() {
    let readings = vec![Some(0.0), None, Some(0.02)];
    let (all, _) = followed(Point { pierced: vec![0.0; 3], readings, asked: Vec::new() });
    assert_eq!(all[1].doubts, [Doubt::Unseen]);
    // Two intervals passed since the last frame that was met.
    let moved = all[2].pose.displacement[0].x - all[0].pose.displacement[0].x;
    assert!((all[2].pose.velocity[0].x - moved / 0.2).abs() < 1e-12);
}

#[test]
fn a_lost_frame_is_looked_for_afresh() {
    let readings = vec![Some(0.0), Some(0.02)];
    let (all, asked) = followed(Point { pierced: vec![0.0, 0.5], readings, asked: Vec::new() });
    assert!(mixtures(&asked, 1) > 0 && all[1].cold && all[1].doubts.is_empty(), "{:?}", all[1].doubts);
}

#[test]
fn what_stays_lost_moves_nothing() {
    let readings = vec![Some(0.0), Some(0.02), Some(0.0)];
    struct Hopeless(Point);
    impl Follow for Hopeless {
        fn start(&mut self) -> Result<Pose, Failure> {
            self.0.start()
        }
        fn approach(&mut self, problem: &Problem, pull: Pull, u: &mut Vec<DVec3>) -> Result<f64, Failure> {
            self.0.approach(problem, pull, u)
        }
        fn look(&mut self, frame: usize, u: &[DVec3], band: f64) -> Met {
            self.0.look(frame, u, band)
        }
        fn certainty(&mut self, p: &Problem, band: f64, u: &[DVec3], d: &[Vec<DVec3>]) -> Result<Certainty, Failure> {
            self.0.certainty(p, band, u, d)
        }
        fn pierced(&mut self, frame: usize, _: &[DVec3]) -> Result<f64, Failure> {
            Ok(if frame == 1 { 0.4 } else { 0.0 })
        }
        fn seen(&mut self, frame: usize, u: &[DVec3]) -> Result<Vec<bool>, Failure> {
            self.0.seen(frame, u)
        }
    }
    let mut body = Hopeless(Point { pierced: vec![0.0; 3], readings, asked: Vec::new() });
    let settings = Settings {
        dynamic: true,
        temperature: Some(1.0),
        outliers: 0.0,
        spread: Some(0.2),
        widest: 0.1,
        spacing: 0.01,
        noise: 0.01,
        size: 1.0,
    };
    let mut all = Vec::new();
    let visit = |t: Tracked| {
        all.push(t);
        ControlFlow::Continue(())
    };
    track(&mut body, &settings, &[(0, 0.0), (1, 0.1), (2, 0.2)], 0.0, &[vec![DVec3::ONE]], visit).unwrap();
    assert_eq!(all[1].doubts, [Doubt::Pierced(0.4)]);
    let moved = all[2].pose.displacement[0].x - all[0].pose.displacement[0].x;
    assert!((all[2].pose.velocity[0].x - moved / 0.2).abs() < 1e-12, "{:?}", all[2].pose);
}

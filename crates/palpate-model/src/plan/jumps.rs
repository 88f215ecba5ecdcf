//! Clamps that move by leaps: further within a step than a body can follow.

use super::{ClampSite, Plan, clamp_pose};
use crate::space::body::Body;
use glam::{DMat3, DVec3};
use std::fmt;

/// Part of the body's diagonal that is a leap however fast the clamp moves otherwise.
const FAR: f64 = 0.25;
/// A step is one as well where it leads this many times as far as half of the others, and further than a cell.
const SUDDEN: f64 = 10.0;

/// A step within which a clamp moves by a leap.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Jump {
    /// Number of the clamp.
    pub clamp: usize,
    /// Beginning of the step on the recording's clock [s].
    pub from: f64,
    /// Its end [s]; the beginning again where the clamp is elsewhere from the start.
    pub to: f64,
    /// How far the clamp carries what it holds [m].
    pub distance: f64,
}

impl fmt::Display for Jump {
    /// In words, without a full stop.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Jump { clamp, from, to, distance } = self;
        match from < to {
            true => write!(
                f,
                "clamp.{clamp} jumps by {} m within a step, from {} s to {} s",
                digits(*distance),
                digits(*from),
                digits(*to)
            ),
            false => {
                write!(f, "clamp.{clamp} is {} m away from its rest place at the start, {} s", digits(*distance), digits(*from))
            }
        }
    }
}

/// At most six digits.
fn digits(x: f64) -> f64 {
    format!("{x:.5e}").parse().unwrap_or(x)
}

impl Plan {
    /// The longest leap of every clamp that makes one, where the motion starts at `start` on the recording's clock and ends `duration` later
    /// [s]. Where a clamp's motion begins away from the rest place counts as a leap.
    pub fn jumps(&self, start: f64, duration: f64) -> Vec<Jump> {
        let times: Vec<f64> = match self.times.is_empty() {
            true => (0..=self.clock.steps).map(|k| k as f64 * self.clock.step).collect(),
            false => self.times.iter().map(|t| t - self.times[0]).collect(),
        };
        // Half a step more, for the end of the last may be rounded.
        let times: Vec<f64> = times.into_iter().filter(|t| *t <= duration + 0.5 * self.clock.step).map(|t| start + t).collect();
        let leap = |(i, clamp): (usize, &ClampSite)| {
            let (motion, corners) = (clamp.motion.as_ref()?, corners(&self.body, clamp)?);
            let rest = (DMat3::IDENTITY, DVec3::ZERO);
            let poses = times.iter().map(|t| clamp_pose(Some(motion), *t));
            let from = std::iter::once(rest).chain(poses.clone());
            let ways: Vec<f64> = from.zip(poses).map(|(a, b)| way(&corners, a, b)).collect();
            let longest = (0..ways.len()).max_by(|a, b| ways[*a].total_cmp(&ways[*b]))?;
            let mut sorted = ways.clone();
            sorted.sort_by(f64::total_cmp);
            let usual = sorted[sorted.len() / 2];
            let (low, high) = self.body.corners;
            let distance = ways[longest];
            let sudden = distance > self.body.length.max(SUDDEN * usual);
            (distance > FAR * (high - low).length() || sudden).then(|| Jump {
                clamp: i,
                from: times[longest.saturating_sub(1)],
                to: times[longest],
                distance,
            })
        };
        self.clamps.iter().enumerate().filter_map(leap).collect()
    }
}

/// Furthest way of these points between two poses [m].
fn way(points: &[DVec3], a: (DMat3, DVec3), b: (DMat3, DVec3)) -> f64 {
    points.iter().map(|x| (b.0 * *x + b.1 - a.0 * *x - a.1).length()).fold(0.0, f64::max)
}

/// Corners of the box around what a clamp holds [m]; none where it holds nothing.
fn corners(body: &Body, clamp: &ClampSite) -> Option<Vec<DVec3>> {
    let of_cells = clamp.cells.iter().flat_map(|c| body.cells()[c.cell as usize].nodes);
    let held = of_cells.chain(clamp.nodes.iter().map(|n| n.0)).map(|n| body.nodes[n as usize]);
    let (low, high) =
        held.fold(None, |ends: Option<(DVec3, DVec3)>, x| Some(ends.map_or((x, x), |(a, b)| (a.min(x), b.max(x)))))?;
    let pick = |k: usize, axis: usize| if k >> axis & 1 == 0 { low[axis] } else { high[axis] };
    Some((0..8).map(|k| DVec3::new(pick(k, 0), pick(k, 1), pick(k, 2))).collect())
}

//! Which measurement should be made next to tell what is named from what explains the data as well.

use crate::quantity::millimetres;
use glam::{DAffine3, DQuat, DVec3};

/// How a measurement differs from the one that was made; by default in nothing.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Way {
    /// Where cameras stand that stand elsewhere: number, and pose, world from camera.
    pub cameras: Vec<(u32, DAffine3)>,
    /// Added to the velocity at the start [m/s].
    pub push: DVec3,
    /// Added to the angular velocity at the start [rad/s].
    pub spin: DVec3,
    /// Turns gravity.
    pub turn: DQuat,
}

/// One measurement that could be made next.
#[derive(Clone, Debug, PartialEq)]
pub struct Separation {
    /// What would be done, in words.
    pub measurement: String,
    /// The same for a simulation.
    pub way: Way,
    /// How far every rival, fitted to both recordings, would lie from the readings of the model that is named, root mean square [m], and the
    /// noise of a single such reading [m].
    pub differences: Vec<(f64, f64)>,
}

/// The measurement that tells what is named from most of its rivals.
#[derive(Clone, Debug, PartialEq)]
pub struct Separated {
    /// What would be done, in words.
    pub measurement: String,
    /// The same for a simulation.
    pub way: Way,
    /// Names of the rivals whose readings would differ by at least the noise of a single one; empty when none of the measurements tried tells
    /// any of them.
    pub from: Vec<String>,
    /// Names of the others.
    pub not_from: Vec<String>,
    /// Smallest difference over the rivals that it tells, or largest where it tells none [m].
    pub difference: f64,
    /// Noise of a single reading there [m].
    pub noise: f64,
}

impl Separated {
    /// The best of several measurements: that which tells most of the rivals, `names` in their order, and of those the one whose smallest
    /// difference is the largest, in units of noise. Of equal ones the first counts; `None` without any.
    pub fn best(ways: &[Separation], names: &[String]) -> Option<Separated> {
        let ratio = |d: &(f64, f64)| d.0 / d.1.max(1e-300);
        let judged = ways.iter().filter(|w| w.differences.len() == names.len()).filter_map(|w| {
            let told = |d: &&(f64, f64)| ratio(d) >= 1.0;
            let least = w.differences.iter().filter(told).min_by(|a, b| ratio(a).total_cmp(&ratio(b)));
            let most = w.differences.iter().max_by(|a, b| ratio(a).total_cmp(&ratio(b)));
            let (difference, noise) = *least.or(most)?;
            let with = |yes: bool| {
                let chosen = names.iter().zip(&w.differences).filter(|(_, d)| told(d) == yes);
                chosen.map(|(n, _)| n.clone()).collect::<Vec<String>>()
            };
            let (measurement, way) = (w.measurement.clone(), w.way.clone());
            Some(Separated { measurement, way, from: with(true), not_from: with(false), difference, noise })
        });
        let rank = |s: &Separated| (s.from.len(), s.difference / s.noise.max(1e-300));
        judged.reduce(|a, b| if rank(&b).partial_cmp(&rank(&a)) == Some(std::cmp::Ordering::Greater) { b } else { a })
    }

    /// For reports.
    pub fn sentence(&self) -> String {
        let (by, noise) = (millimetres(self.difference), millimetres(self.noise));
        if self.from.is_empty() {
            return format!(
                "None of the measurements tried would tell them apart: {by} at most, where a reading has a noise of {noise}."
            );
        }
        let rest = if self.not_from.is_empty() { String::new() } else { format!("; not from {}", self.not_from.join(", ")) };
        format!(
            "Next: {} would tell it from {}, by {by} where a reading has a noise of {noise}{rest}.",
            self.measurement,
            self.from.join(", ")
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn way(measurement: &str, differences: &[f64]) -> Separation {
        let differences = differences.iter().map(|d| (*d, 1e-3)).collect();
        // Told apart by their pushes below.
        let way = Way { push: DVec3::X * measurement.len() as f64, ..Way::default() };
        Separation { measurement: measurement.into(), way, differences }
    }

    #[test]
    fn the_measurement_that_tells_most_rivals_by_the_largest_smallest_difference_is_proposed() {
        let names = ["a".to_string(), "b".to_string()];
        let ways = [way("spin", &[9e-3, 0.5e-3]), way("view", &[2e-3, 4e-3]), way("drop", &[3e-3, 1.5e-3])];
        let best = Separated::best(&ways, &names).unwrap();
        assert_eq!((best.measurement.as_str(), best.difference, best.not_from.len()), ("view", 2e-3, 0));
        assert_eq!(best.way, ways[1].way);
        assert_eq!(best.sentence(), "Next: view would tell it from a, b, by 2.000 mm where a reading has a noise of 1.000 mm.");
        // Where no measurement tells both, the one that tells one.
        let best = Separated::best(&ways[..1], &names).unwrap();
        assert_eq!((best.from.as_slice(), best.not_from.as_slice()), (&names[..1], &names[1..]));
        assert!(best.sentence().ends_with("; not from b."), "{}", best.sentence());
    }

    #[test]
    fn less_than_the_noise_of_a_reading_is_no_proposal() {
        let best = Separated::best(&[way("spin", &[0.007e-3]), way("push", &[0.9e-3])], &["a".to_string()]).unwrap();
        assert!(best.from.is_empty());
        assert!(
            best.sentence().starts_with("None of the measurements tried would tell them apart: 0.900 mm"),
            "{}",
            best.sentence()
        );
        assert_eq!(Separated::best(&[], &["a".to_string()]), None);
    }
}

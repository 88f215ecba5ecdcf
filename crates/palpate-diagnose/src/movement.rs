//! What a candidate does to the answer, in words: by how much it moves the free number that it moves most.

use crate::laboratory::{Model, Number};
use crate::quantity::stated;
use palpate_model::params::unit_behind;

/// Factor, or its inverse, from which on a positive number is said to become so many times as large; below, by so many per cent.
const TIMES: f64 = 1.5;
/// A linear estimate says no more of a positive number than that it becomes so many times as large, or as small.
const LINEAR: f64 = 2.0;

/// A free number that a candidate moves.
#[derive(Clone, Debug, PartialEq)]
pub struct Movement {
    /// What moves it.
    pub candidate: String,
    /// Its path in the scene file.
    pub path: String,
    /// Its unit.
    pub unit: String,
    /// Its value in the baseline.
    pub before: f64,
    /// Its value beside the candidate.
    pub after: f64,
    /// Standard error of whichever of the two is known worse.
    pub error: Option<f64>,
    /// False where sensitivities say so, and no fit.
    pub fitted: bool,
    /// True where it has a size that factors make sense of.
    positive: bool,
}

/// The movement that matters most of a baseline's numbers towards these values with these errors; `None` without a free number.
pub(crate) fn largest(
    candidate: &str,
    baseline: &Model,
    values: &[f64],
    errors: &[Option<f64>],
    fitted: bool,
) -> Option<Movement> {
    let of = |(k, (n, after)): (usize, (&Number, &f64))| {
        let (before, after) = (baseline.values[k], *after);
        let known = [baseline.errors[k], errors.get(k).copied().flatten()];
        let error = known.into_iter().flatten().filter(|e| e.is_finite() && *e > 0.0).reduce(f64::max);
        let positive = n.bounds.0 >= 0.0 && before > 0.0 && after > 0.0;
        let (path, unit) = (n.path.clone(), n.unit.clone());
        let m = Movement { candidate: candidate.into(), path, unit, before, after, error, fitted, positive };
        // How far it goes in sizes that matter; what stays within its error counts behind all that does not.
        let size = if positive { (after / before).ln().abs() } else { (after - before).abs() / n.scale.max(f64::MIN_POSITIVE) };
        (m.is_beyond_error(), size, m)
    };
    let all = baseline.numbers.iter().zip(values).enumerate().map(of).filter(|(_, size, _)| size.is_finite());
    all.max_by(|a, b| (a.0, a.1).partial_cmp(&(b.0, b.1)).unwrap_or(std::cmp::Ordering::Equal)).map(|(.., m)| m)
}

impl Movement {
    /// Value beside the candidate over that before, where that makes sense.
    pub fn factor(&self) -> Option<f64> {
        self.positive.then(|| self.after / self.before)
    }

    /// By how many standard errors it moves, where one is known.
    pub fn standard_errors(&self) -> Option<f64> {
        self.error.map(|e| (self.after - self.before).abs() / e)
    }

    /// True where it moves by more than it is uncertain anyway.
    pub fn is_beyond_error(&self) -> bool {
        self.standard_errors().is_none_or(|n| n > 1.0) && self.after != self.before
    }

    /// How large the movement is beside others of the same number or of other ones, for an order.
    pub(crate) fn size(&self) -> f64 {
        self.factor().map_or_else(|| self.standard_errors().unwrap_or(0.0), |f| f.ln().abs())
    }

    /// By how much it moves: a factor, per cent, or standard errors.
    fn by(&self) -> String {
        let errors = self.standard_errors().map(|n| format!("{} standard errors", count(n)));
        match self.factor() {
            Some(f) if !self.fitted && f > LINEAR => "more than twice as large".into(),
            Some(f) if !self.fitted && f < 1.0 / LINEAR => "less than half as large".into(),
            Some(f) if f >= TIMES || f <= 1.0 / TIMES => format!("{} times", two(f)),
            Some(f) => format!("{}{} %", if f < 1.0 { "−" } else { "+" }, two(100.0 * (f - 1.0).abs())),
            None => {
                errors.map_or_else(|| format!("by {}", self.with_unit((self.after - self.before).abs())), |e| format!("by {e}"))
            }
        }
    }

    fn with_unit(&self, value: f64) -> String {
        format!("{}{}", stated(value, None), unit_behind(&self.unit))
    }

    /// What it does, in a sentence.
    pub fn sentence(&self) -> String {
        let Movement { candidate, path, .. } = self;
        if self.fitted && !self.is_beyond_error() {
            return format!("With {candidate} no free number moves by more than its standard error.");
        }
        if self.fitted {
            let (after, before) = (self.with_unit(self.after), self.with_unit(self.before));
            return format!("With {candidate} {path} is {after} instead of {before} ({}).", self.by());
        }
        match self.factor() {
            _ if !self.is_beyond_error() => format!("{candidate} would move no free number by more than its standard error."),
            Some(f) if !(1.0 / LINEAR..=LINEAR).contains(&f) => format!("{candidate} would make {path} {}.", self.by()),
            Some(f) if f >= TIMES || f <= 1.0 / TIMES => format!("{candidate} would make {path} about {} as large.", self.by()),
            Some(_) => format!("{candidate} would move {path} by about {}.", self.by()),
            None => format!("{candidate} would move {path} {}.", self.by().replacen("by ", "by about ", 1)),
        }
    }
}

/// A number with its first two digits, whole where it has more.
fn two(x: f64) -> String {
    match x.abs() {
        a if a >= 10.0 => format!("{x:.0}"),
        a if a >= 1.0 => format!("{x:.1}"),
        _ => format!("{}", format!("{x:.1e}").parse::<f64>().unwrap_or(x)),
    }
}

/// How many of something, with a digit behind the point where there are few.
fn count(n: f64) -> String {
    if n < 10.0 { format!("{n:.1}") } else { format!("{n:.0}") }
}

#[cfg(test)]
mod tests {
    use super::*;
    use palpate_model::params::Transform;

    fn model(numbers: &[(&str, &str, f64, Option<f64>)]) -> Model {
        let number = |(path, unit, value, _): &(&str, &str, f64, Option<f64>)| Number {
            path: (*path).into(),
            unit: (*unit).into(),
            start: *value,
            bounds: if path.starts_with("material") { (0.0, 1e9) } else { (f64::NEG_INFINITY, f64::INFINITY) },
            scale: value.abs().max(0.1),
            transform: Transform::Linear,
            known: None,
        };
        Model {
            changes: Vec::new(),
            numbers: numbers.iter().map(number).collect(),
            values: numbers.iter().map(|n| n.2).collect(),
            errors: numbers.iter().map(|n| n.3).collect(),
        }
    }

    #[test]
    fn the_number_that_moves_most_is_named_with_a_factor_per_cent_or_standard_errors() {
        let base = model(&[("material.youngs_modulus", "Pa", 458.0, Some(3.0)), ("initial.velocity.x", "m/s", -0.5, Some(0.01))]);
        let said =
            |values: &[f64], fitted| largest("coulomb-friction", &base, values, &[Some(2.0), None], fitted).unwrap().sentence();
        let with = "With coulomb-friction";
        let cases = [
            ([1958.0, -0.51], format!("{with} material.youngs_modulus is 1958 Pa instead of 458.0 Pa (4.3 times).")),
            ([200.0, -0.51], format!("{with} material.youngs_modulus is 200.0 Pa instead of 458.0 Pa (0.44 times).")),
            ([480.0, -0.5], format!("{with} material.youngs_modulus is 480.0 Pa instead of 458.0 Pa (+4.8 %).")),
            ([420.0, -0.5], format!("{with} material.youngs_modulus is 420.0 Pa instead of 458.0 Pa (−8.3 %).")),
            ([459.0, -0.25], format!("{with} initial.velocity.x is -0.2500 m/s instead of -0.5000 m/s (by 25 standard errors).")),
            ([459.0, -0.505], format!("{with} no free number moves by more than its standard error.")),
        ];
        for (values, sentence) in cases {
            assert_eq!(said(&values, true), sentence);
        }
        let guesses = [
            ([480.0, -0.5], "coulomb-friction would move material.youngs_modulus by about +4.8 %."),
            ([800.0, -0.5], "coulomb-friction would make material.youngs_modulus about 1.7 times as large."),
            // Linear estimates do not reach so far.
            ([4000.0, -0.5], "coulomb-friction would make material.youngs_modulus more than twice as large."),
            ([458.0, -0.46], "coulomb-friction would move initial.velocity.x by about 4.0 standard errors."),
            ([458.0, -0.505], "coulomb-friction would move no free number by more than its standard error."),
        ];
        for (values, sentence) in guesses {
            assert_eq!(said(&values, false), sentence);
        }
        // A number that is not determined moves far within its error: another that moves beyond it counts.
        let open = model(&[("material.mass_damping", "1/s", 0.1, Some(5.0)), ("material.density", "kg/m³", 1000.0, Some(1.0))]);
        assert_eq!(largest("creep", &open, &[4.0, 1010.0], &[], true).unwrap().path, "material.density");
        assert_eq!(largest("creep", &model(&[]), &[], &[], true), None);
    }
}

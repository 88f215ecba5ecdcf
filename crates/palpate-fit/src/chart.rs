//! Charts: an unconstrained coordinate z of order one for every physical value.
//!
//! | transform | z | value | dvalue/dz |
//! |---|---|---|---|
//! | `Log` | ln(v / typical) | typical · exp z | v |
//! | `Logit` | ln((v − a)/(b − v)) | a + (b − a)/(1 + exp(−z)) | (v − a)(b − v)/(b − a) |
//! | `Linear` | v / typical | z · typical | typical |
//! | `Relative` | ln(1 + v) | exp z − 1 | 1 + v |
//!
//! Bounds of `Log`, `Linear` and `Relative` become a box in z that optimisers project on. `Logit` cannot leave its bounds; its box only
//! keeps z from running away when the data push the value into a bound.

use palpate_model::params::Transform;
use serde::{Deserialize, Serialize};

/// End of the box of a logit: a value within 8e-7 of the range from its bound, where dvalue/dz has lost six digits.
const LOGIT_END: f64 = 14.0;

/// A share of the range so close to a bound that a fitted value there was held by the bound.
const LOGIT_AT_BOUND: f64 = 2e-4;

/// The map between one value and its coordinate.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Chart {
    transform: Transform,
    typical: f64,
    lower: f64,
    upper: f64,
}

/// Which bound holds a value.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum AtBound {
    /// The smallest allowed value.
    Lower,
    /// The largest allowed value.
    Upper,
}

impl AtBound {
    /// As sentences name it.
    pub fn name(self) -> &'static str {
        match self {
            AtBound::Lower => "lower",
            AtBound::Upper => "upper",
        }
    }
}

impl Chart {
    /// A chart for values in `[lower, upper]`; the error says what is wrong and what is allowed.
    pub fn new(transform: Transform, typical: f64, lower: f64, upper: f64) -> Result<Chart, String> {
        if lower.is_nan() || upper.is_nan() || lower >= upper {
            return Err(format!("bounds [{lower}, {upper}] are empty; the first must be smaller than the second"));
        }
        if !(typical.is_finite() && typical > 0.0) {
            return Err(format!("typical size {typical} must be positive"));
        }
        match transform {
            Transform::Log if lower <= 0.0 => {
                return Err(format!("lower bound {lower} must be positive, because the parameter is fitted as its logarithm"));
            }
            Transform::Relative if lower <= -1.0 => {
                return Err(format!(
                    "lower bound {lower} must be above -1, because the logarithm of 1 + the parameter is fitted"
                ));
            }
            Transform::Logit if !(lower.is_finite() && upper.is_finite()) => {
                return Err(format!("bounds [{lower}, {upper}] must be finite, because the parameter is fitted as a logit"));
            }
            _ => {}
        }
        Ok(Chart { transform, typical, lower, upper })
    }

    /// Value at z, within the bounds.
    pub fn value(&self, z: f64) -> f64 {
        let v = match self.transform {
            Transform::Log => self.typical * z.exp(),
            Transform::Linear => self.typical * z,
            Transform::Relative => z.exp_m1(),
            Transform::Logit => {
                // Measured from the nearer bound, so that no digits are lost there.
                let range = self.upper - self.lower;
                if z < 0.0 { self.lower + range * (z.exp() / (1.0 + z.exp())) } else { self.upper - range / (1.0 + z.exp()) }
            }
        };
        v.clamp(self.lower, self.upper)
    }

    /// Coordinate of a value; values outside the bounds are moved to them.
    pub fn coordinate(&self, value: f64) -> f64 {
        let v = value.clamp(self.lower, self.upper);
        match self.transform {
            Transform::Log => (v / self.typical).ln(),
            Transform::Linear => v / self.typical,
            Transform::Relative => v.ln_1p(),
            Transform::Logit => ((v - self.lower) / (self.upper - v)).ln().clamp(-LOGIT_END, LOGIT_END),
        }
    }

    /// dvalue/dz at z.
    pub fn slope(&self, z: f64) -> f64 {
        match self.transform {
            Transform::Log => self.typical * z.exp(),
            Transform::Linear => self.typical,
            Transform::Relative => z.exp(),
            Transform::Logit => {
                let e = (-z.abs()).exp();
                (self.upper - self.lower) * e / ((1.0 + e) * (1.0 + e))
            }
        }
    }

    /// The allowed range of z; ends may be infinite.
    pub fn range(&self) -> (f64, f64) {
        match self.transform {
            Transform::Logit => (-LOGIT_END, LOGIT_END),
            _ => (self.coordinate(self.lower), self.coordinate(self.upper)),
        }
    }

    /// The bound that a value lies on, if it does.
    pub fn at_bound(&self, value: f64) -> Option<AtBound> {
        let z = self.coordinate(value);
        let near = |bound: f64, z_bound: f64| match self.transform {
            Transform::Logit => (value - bound).abs() < LOGIT_AT_BOUND * (self.upper - self.lower),
            // Projection puts values on the bound up to the rounding of the chart.
            _ => z_bound.is_finite() && (z - z_bound).abs() < 1e-9 * z_bound.abs().max(1.0),
        };
        let (low, high) = self.range();
        if near(self.lower, low) {
            Some(AtBound::Lower)
        } else if near(self.upper, high) {
            Some(AtBound::Upper)
        } else {
            None
        }
    }

    /// The value at a share of the way from one to another: evenly by ratios of what is fitted as a logarithm.
    pub fn between(&self, (a, b): (f64, f64), share: f64) -> f64 {
        match self.transform {
            Transform::Log => (a.ln() + share * (b.ln() - a.ln())).exp().clamp(a, b),
            Transform::Relative => (a.ln_1p() + share * (b.ln_1p() - a.ln_1p())).exp_m1().clamp(a, b),
            Transform::Logit | Transform::Linear => a + share * (b - a),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn charts() -> Vec<(Chart, Vec<f64>)> {
        let new = |t, typical, a, b| Chart::new(t, typical, a, b).expect("the bounds are valid");
        vec![
            (new(Transform::Log, 1e5, 1e-3, 1e13), vec![1e-3, 0.7, 1e5, 3.3e5, 1e13]),
            (new(Transform::Logit, 0.1, -0.5, 0.4999), vec![-0.499, -0.1, 0.0, 0.3, 0.45, 0.499]),
            (new(Transform::Linear, 9.81, -20.0, f64::INFINITY), vec![-20.0, -9.81, 0.0, 5.0]),
            (new(Transform::Relative, 0.5, -0.999, 1e3), vec![-0.999, -0.3, 0.0, 2e-9, 0.5, 1e3]),
        ]
    }

    #[test]
    fn round_trip() {
        for (chart, values) in charts() {
            for v in values {
                let back = chart.value(chart.coordinate(v));
                // The logarithm of 1e8 costs about 20 ulp; a logit near its bound loses digits of v − a.
                assert!((back - v).abs() <= 1e-13 * v.abs().max(1e-3), "{chart:?}: {v} became {back}");
            }
        }
    }

    #[test]
    fn slope_matches_central_differences() {
        for (chart, _) in charts() {
            for z in [-1.7, -0.3, 0.0, 0.4, 1.9] {
                let d = 1e-5;
                let difference = (chart.value(z + d) - chart.value(z - d)) / (2.0 * d);
                // Truncation d²/6 of the third derivative, and rounding eps/d.
                assert!((difference / chart.slope(z) - 1.0).abs() < 1e-9, "{chart:?} at {z}");
            }
        }
    }

    #[test]
    fn values_stay_within_bounds() {
        for (chart, _) in charts() {
            for z in [-1e3, -30.0, 30.0, 1e3] {
                let v = chart.value(z);
                assert!(v >= chart.lower && v <= chart.upper);
            }
            let (low, _) = chart.range();
            assert_eq!(chart.at_bound(chart.value(low)), Some(AtBound::Lower));
            assert_eq!(chart.at_bound(chart.value(0.3)), None);
        }
    }

    #[test]
    fn senseless_bounds_are_refused() {
        let refused = |t, a, b| Chart::new(t, 1.0, a, b).is_err();
        assert!(refused(Transform::Linear, 2.0, 1.0));
        assert!(refused(Transform::Linear, f64::NAN, 1.0));
        assert!(refused(Transform::Log, 0.0, 1.0));
        assert!(refused(Transform::Relative, -1.0, 1.0));
        assert!(refused(Transform::Logit, 0.0, f64::INFINITY));
    }
}

//! Why a member of a batch stopped.

use palpate_model::params::{Layout, unit_behind};
use palpate_model::plan::{Physics, Plan};
use std::borrow::Cow;
use std::fmt;

/// A member that stopped: what happened, when, and what may help.
#[derive(Clone, Debug, PartialEq)]
pub struct Failure {
    /// What happened.
    pub kind: FailureKind,
    /// Simulation time [s] since the initial state at which it happened.
    pub time: f64,
    /// Details with numbers.
    pub detail: String,
    /// What a user can try: that of the kind, unless whoever met the failure knows better.
    pub hint: Cow<'static, str>,
}

/// Kinds of failure.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FailureKind {
    /// A state or a gradient is not a number.
    NotFinite,
    /// Newton's method did not converge.
    NewtonStalled,
    /// The linear solver did not converge or the matrix is not positive definite.
    LinearSolve,
    /// The body left the world (moved more than a thousand times its size).
    FellOut,
    /// There is no equilibrium to be found (nothing holds the body).
    NoEquilibrium,
    /// A state of a quasi-static sequence is in equilibrium and would not stay there.
    Unstable,
    /// A parameter lies outside the range the model is defined for.
    BadParameter,
    /// The backend cannot compute what was asked for.
    Unsupported,
    /// The device that the backend runs on broke.
    Device,
    /// Somebody asked to stop: nothing is wrong with the member.
    Stopped,
}

impl Failure {
    /// With the hint of its kind.
    pub fn new(kind: FailureKind, time: f64, detail: impl Into<String>) -> Failure {
        Failure { kind, time, detail: detail.into(), hint: kind.hint().into() }
    }

    /// A device that broke, with the way out that its error knows.
    pub fn of_device(detail: impl Into<String>, hint: impl Into<String>) -> Failure {
        Failure { hint: Cow::Owned(hint.into()), ..Failure::new(FailureKind::Device, 0.0, detail) }
    }

    /// What happened and when, without the hint.
    pub fn message(&self) -> String {
        let what = self.kind.what();
        if self.kind == FailureKind::Device {
            // It has no place in the simulation.
            return format!("{what}: {}", self.detail);
        }
        format!("{what} at t = {} s: {}", number(self.time), self.detail)
    }

    /// With what is behind it, as far as the plan tells: a clamp that leaps until then, else the values θ `[P]`, one of which is to blame.
    pub fn in_plan(self, plan: &Plan, theta: &[f64]) -> Failure {
        let about_motion = matches!(
            self.kind,
            FailureKind::NotFinite
                | FailureKind::NewtonStalled
                | FailureKind::LinearSolve
                | FailureKind::FellOut
                | FailureKind::NoEquilibrium
                | FailureKind::Unstable
        );
        let start = Physics::new(&plan.layout, theta).start;
        let leaps = if about_motion { plan.jumps(start, self.time) } else { Vec::new() };
        let Some(leap) = leaps.into_iter().max_by(|a, b| a.distance.total_cmp(&b.distance)) else {
            return self.with_values(&plan.layout, theta);
        };
        Failure {
            detail: leap.to_string(),
            hint: "check the rows of the clamp's motion file (metres, seconds, relative to the rest place), or use a smaller [time] step".into(),
            ..self
        }
    }

    /// Adds the values θ `[P]` of the parameters that are not zero to the details.
    fn with_values(mut self, layout: &Layout, theta: &[f64]) -> Failure {
        let stated = layout.keys.iter().zip(theta).filter(|(_, v)| **v != 0.0).map(|(k, v)| {
            let spec = k.spec();
            format!("{} = {}{}", spec.path, number(*v), unit_behind(spec.unit))
        });
        self.detail = format!("{}, with {}", self.detail, stated.collect::<Vec<_>>().join(", "));
        self
    }
}

/// A number for messages: six digits, with an exponent where it is very large or small.
pub fn number(x: f64) -> String {
    if x == 0.0 || !x.is_finite() {
        return x.to_string();
    }
    // Rounded first, so that 999999.9 counts as a million.
    let (digits, exponent) = match format!("{x:.5e}").split_once('e') {
        Some((d, e)) => (d.to_string(), e.parse::<i32>().unwrap_or(0)),
        None => return x.to_string(),
    };
    let trimmed =
        |s: &str| if s.contains('.') { s.trim_end_matches('0').trim_end_matches('.').to_string() } else { s.to_string() };
    if (-4..9).contains(&exponent) {
        let decimals = usize::try_from(5 - exponent).unwrap_or(0);
        trimmed(&format!("{x:.decimals$}"))
    } else {
        format!("{}e{exponent}", trimmed(&digits))
    }
}

impl FailureKind {
    fn what(self) -> &'static str {
        match self {
            FailureKind::NotFinite => "a number became infinite or undefined",
            FailureKind::NewtonStalled => "the nonlinear solve of a step did not converge",
            FailureKind::LinearSolve => "the linear solve of a step failed",
            FailureKind::FellOut => "the body left the world",
            FailureKind::Unstable => "an equilibrium is unstable",
            FailureKind::NoEquilibrium => "no static equilibrium was found",
            FailureKind::BadParameter => "a parameter is out of range",
            FailureKind::Unsupported => "the backend cannot do this",
            FailureKind::Stopped => "stopped on request",
            FailureKind::Device => "the device failed",
        }
    }

    /// What a user can try.
    fn hint(self) -> &'static str {
        match self {
            FailureKind::NotFinite => "use a smaller [time] step, or narrower bounds for the parameters named",
            FailureKind::NewtonStalled => "use a smaller [time] step, or allow more solver.newton_iterations",
            FailureKind::LinearSolve => {
                "set solver.linear = \"cholesky\" where conjugate gradients stopped; else use a smaller [time] step, or poisson_ratio \
                 further below 0.5"
            }
            FailureKind::FellOut => "check gravity, planes and initial velocity, or shorten [time] duration",
            FailureKind::NoEquilibrium => {
                "hold the body with a [[clamp]] (a larger one, or one more), make it stiffer, or start from initial.state = \"rest\""
            }
            FailureKind::Unstable => {
                "the body buckles or snaps through here: hold more of it, take smaller loads or states closer together, or simulate the motion"
            }
            FailureKind::BadParameter => "set bounds for the parameter in [[fit.parameter]]",
            FailureKind::Unsupported => "use --backend cpu",
            FailureKind::Stopped => "run again",
            FailureKind::Device => "run again, with a smaller batch, or with --backend cpu; results so far are kept",
        }
    }
}

impl fmt::Display for Failure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} (hint: {})", self.message(), self.hint)
    }
}

impl std::error::Error for Failure {}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_short_at_any_size() {
        for (x, text) in [
            (0.0, "0"),
            (0.4, "0.4"),
            (-9.81, "-9.81"),
            (2e5, "200000"),
            (123456.789, "123457"),
            (1e-3, "0.001"),
            (1.0 / 3.0, "0.333333"),
            (999_999_999.9, "1e9"),
            (1e200, "1e200"),
            (-2.5e-9, "-2.5e-9"),
            (f64::INFINITY, "inf"),
        ] {
            assert_eq!(number(x), text);
        }
    }

    #[test]
    fn details_name_values_with_units_that_are_units() {
        let layout = Layout::new(0, 0, &[], &[]);
        let theta: Vec<f64> = layout.keys.iter().map(|k| if k.spec().path.contains("velocity") { 0.0 } else { 0.4 }).collect();
        let f = Failure::new(FailureKind::NotFinite, 0.1 + 0.2, "a node").with_values(&layout, &theta);
        let text = f.to_string();
        assert!(text.starts_with("a number became infinite or undefined at t = 0.3 s: a node, with "), "{text}");
        assert!(text.contains("material.youngs_modulus = 0.4 Pa, material.poisson_ratio = 0.4, "), "{text}");
        assert!(!text.contains("velocity") && text.ends_with("for the parameters named)"), "{text}");
    }
}

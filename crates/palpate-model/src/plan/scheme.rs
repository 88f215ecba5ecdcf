//! Time integration schemes: tables over past states.
//!
//! Every scheme here is built of one implicit solve, the θ-step of length ℓ from a state (ũ, ṽ) that is a weighted sum of past ones:
//! `M [(u₁ − ũ)/(θℓ²) − ṽ/(θℓ)] + θ f(u₁) + (1 − θ) f(ũ) = 0` and `v₁ = (u₁ − ũ)/(θℓ) − (1 − θ)/θ ṽ`, f the forces' left side.
//! - The θ-scheme is one such step of length Δt from the present state.
//! - BDF2, `v₁ = (3u₁ − 4u₀ + u₋)/(2Δt)`, is one with θ = 1 and ℓ = 2Δt/3 from (4·now − before)/3. Its first step has no state before and is
//!   one of TR-BDF2, so that the order stays two (Hahn et al. 2019 copy the start backwards instead, which leaves half a step of delay).
//! - TR-BDF2 (Bank et al., *IEEE Trans. Electron Devices* 32, 1985; Hosea & Shampine, *Appl. Numer. Math.* 20, 1996) is a trapezoidal step
//!   of γΔt, γ = 2 − √2, and one of BDF2 over both parts: of second order, L-stable, and with one length in both solves.
//!
//! A solve from more than one past state has θ = 1, so only forces that depend on a rate see the past states.

use crate::mechanics::contact::acts_along;

/// A past state that a solve starts from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Past {
    /// The state at the beginning of the step.
    Now,
    /// The state at the beginning of the step before.
    Before,
    /// The state that solve `n` of the same step gave.
    Solved(usize),
}

/// One row of a table: one implicit solve.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Solve {
    /// Past states and their weights, which sum to one.
    pub from: &'static [(Past, f64)],
    /// ℓ over Δt.
    pub length: f64,
    /// θ; `None` = the one that the scene states.
    pub theta: Option<f64>,
    /// Where in the step the new state lies, over Δt.
    pub end: f64,
}

/// A scheme.
#[derive(Debug, PartialEq)]
pub struct Scheme {
    /// Name in scene files, `[time] scheme = "…"`.
    pub name: &'static str,
    /// One sentence for `--help` and reports.
    pub doc: &'static str,
    /// The solves of a step.
    pub solves: &'static [Solve],
    /// The solves of the first step, where there is no state before.
    pub first: &'static [Solve],
    /// Every state is an equilibrium: there is no inertia, and nothing depends on a rate or on the past.
    pub still: bool,
}

const SQRT_2: f64 = std::f64::consts::SQRT_2;
/// Part of a step that TR-BDF2's first solve takes.
const GAMMA: f64 = 2.0 - SQRT_2;

const THETA_STEP: &[Solve] = &[Solve { from: &[(Past::Now, 1.0)], length: 1.0, theta: None, end: 1.0 }];

const STILL_STEP: &[Solve] = &[Solve { from: &[(Past::Now, 1.0)], length: 1.0, theta: Some(1.0), end: 1.0 }];

const BDF2_STEP: &[Solve] =
    &[Solve { from: &[(Past::Now, 4.0 / 3.0), (Past::Before, -1.0 / 3.0)], length: 2.0 / 3.0, theta: Some(1.0), end: 1.0 }];

// 1/(γ(2 − γ)) = (1 + √2)/2 with the weight of the first part's end, 1 − that with the step's beginning.
const TR_BDF2_STEP: &[Solve] = &[
    Solve { from: &[(Past::Now, 1.0)], length: GAMMA, theta: Some(0.5), end: GAMMA },
    Solve {
        from: &[(Past::Solved(0), 0.5 + 0.5 * SQRT_2), (Past::Now, 0.5 - 0.5 * SQRT_2)],
        length: 0.5 * GAMMA,
        theta: Some(1.0),
        end: 1.0,
    },
];

/// All schemes; the first is the default.
///
/// A default has to be of second order, or a fit takes for the material's what the scheme damps. It also has to damp what the step does not
/// resolve: vibrations that landings leave behind pile up at θ = ½, until Newton's method finds no way through them. An undamped block
/// of 5 or 100 kPa and 10 cm, thrown onto the ground in steps of 4 or 10 ms, stalls so within 3 s, on a soft contact layer and a stiff one;
/// both other schemes simulate it. Of these BDF2 takes too much: 1.3 % of a free spin's energy in ten turns of 100 steps, against 0.09 %.
pub static ALL: &[Scheme] = &[
    Scheme {
        name: "tr-bdf2",
        doc: "a trapezoidal and a backward part, two solves a step: the most accurate of those that damp what the step does not resolve",
        solves: TR_BDF2_STEP,
        first: TR_BDF2_STEP,
        still: false,
    },
    Scheme {
        name: "bdf2",
        doc: "second-order backward differences: damps what the step does not resolve",
        solves: BDF2_STEP,
        first: TR_BDF2_STEP,
        still: false,
    },
    Scheme {
        name: "theta",
        doc: "one step from the present state; `theta` weighs the new state's forces: ½ conserves energy, more damps numerically",
        solves: THETA_STEP,
        first: THETA_STEP,
        still: false,
    },
];

/// A sequence of equilibria: `[time] mode = "quasi-static"`. A state is where Newton's method starts for the next one, and nothing more.
pub static QUASI_STATIC: Scheme = Scheme {
    name: "quasi-static",
    doc: "every state is an equilibrium under the loads of its time",
    solves: STILL_STEP,
    first: STILL_STEP,
    still: true,
};

/// The θ-scheme.
pub fn theta() -> &'static Scheme {
    &ALL[2]
}

/// The scheme of this name.
pub fn find(name: &str) -> Option<&'static Scheme> {
    ALL.iter().find(|s| s.name == name)
}

/// One solve of a rollout. States are numbered from the start, 0; stage s gives state s + 1.
#[derive(Clone, Debug, PartialEq)]
pub struct Stage {
    /// Number of the stage.
    pub number: usize,
    /// Number of the step that it belongs to.
    pub step: usize,
    /// Numbers of the past states that it starts from, the newest first, and their weights.
    pub from: Vec<(usize, f64)>,
    /// ℓ [s].
    pub length: f64,
    /// θ.
    pub theta: f64,
    /// Time of the new state since the start [s].
    pub time: f64,
    /// Number of the state at the beginning of the step, where the step ends with this stage.
    pub completes: Option<usize>,
    /// The new state is an equilibrium ([`Scheme::still`]).
    pub still: bool,
}

impl Scheme {
    /// All solves of `steps` steps of `step` seconds, with θ where the table leaves it open.
    pub fn stages(&self, step: f64, steps: usize, theta: f64) -> Vec<Stage> {
        let mut stages: Vec<Stage> = Vec::new();
        let (mut now, mut before) = (0, 0);
        for k in 0..steps {
            let table = if k == 0 { self.first } else { self.solves };
            let first = stages.len();
            for (i, solve) in table.iter().enumerate() {
                let number = |past: Past| match past {
                    Past::Now => now,
                    Past::Before => before,
                    Past::Solved(n) => first + n + 1,
                };
                stages.push(Stage {
                    number: stages.len(),
                    step: k,
                    from: solve.from.iter().map(|(past, weight)| (number(*past), *weight)).collect(),
                    length: solve.length * step,
                    theta: solve.theta.unwrap_or(theta),
                    time: if solve.end == 1.0 { (k + 1) as f64 * step } else { (k as f64 + solve.end) * step },
                    completes: (i + 1 == table.len()).then_some(now),
                    still: self.still,
                });
            }
            (before, now) = (now, stages.len());
        }
        stages
    }

    /// True where a step with this weight of the new state, where the table leaves it open, is of second order.
    pub fn is_of_second_order(&self, theta: f64) -> bool {
        // Of the θ-scheme as far as contact acts along the way: its error is of first order times θ − ½.
        !self.leaves_theta_open() || acts_along(theta)
    }

    /// True where the scene states the weight of the new state.
    pub fn leaves_theta_open(&self) -> bool {
        self.solves.iter().any(|s| s.theta.is_none())
    }

    /// (x, ẋ) of ẍ = −x after `steps` steps of `step` from (1, 0).
    fn oscillate(&self, step: f64, steps: usize, theta: f64) -> [f64; 2] {
        let mut states = vec![[1.0, 0.0]];
        for s in self.stages(step, steps, theta) {
            let [u, v] = [0, 1].map(|c| s.from.iter().map(|(n, w)| w * states[*n][c]).sum::<f64>());
            let (l, t) = (s.length, s.theta);
            let u1 = (u / (t * l * l) + v / (t * l) - (1.0 - t) * u) / (1.0 / (t * l * l) + t);
            states.push([u1, (u1 - u) / (t * l) - (1.0 - t) / t * v]);
        }
        states[states.len() - 1]
    }

    /// What the scheme by itself takes from a vibration of `frequency` [Hz] in steps of `step` seconds, as a damping ratio: that which a
    /// body without it would need to lose as much of its amplitude in as many steps.
    pub fn numerical_damping(&self, step: f64, theta: f64, frequency: f64) -> f64 {
        // Long enough that how the first step differs does not count, and short enough that something is left.
        const STEPS: usize = 50;
        let angle = std::f64::consts::TAU * frequency * step;
        let [x, v] = self.oscillate(angle, STEPS, theta);
        -x.hypot(v).ln() / (angle * STEPS as f64)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Time;

    /// Error of an oscillation at t = 3, with θ = ½ where it is open.
    fn error(scheme: &Scheme, steps: usize) -> f64 {
        let [u, v] = scheme.oscillate(3.0 / steps as f64, steps, 0.5);
        (u - 3f64.cos()).hypot(v + 3f64.sin())
    }

    #[test]
    fn the_scheme_that_leaves_theta_open_is_found_as_such() {
        assert_eq!(theta(), find("theta").unwrap());
        for scheme in ALL {
            assert_eq!(scheme.leaves_theta_open(), scheme == theta(), "{}", scheme.name);
            assert!(scheme.is_of_second_order(0.5));
            assert_eq!(scheme.is_of_second_order(0.6), scheme != theta(), "{}", scheme.name);
        }
        assert!(ALL[0].is_of_second_order(Time::default().theta));
    }

    #[test]
    fn numerical_damping_is_what_the_amplification_of_a_step_says() {
        let of =
            |name: &str, theta: f64, angle: f64| find(name).unwrap().numerical_damping(1.0, theta, angle / std::f64::consts::TAU);
        let angle = 0.1;
        assert!(of("theta", 0.5, angle).abs() < 1e-14, "{}", of("theta", 0.5, angle));
        // ζ = (θ − ½) ω Δt, and ¼ (ω Δt)³ of BDF2 (|z|² = 1 − ½ (ω Δt)⁴), to first order; the first step is not one of BDF2.
        assert!((of("theta", 0.6, angle) / (0.1 * angle) - 1.0).abs() < 0.01);
        assert!((of("bdf2", 0.5, angle) / (0.25 * angle.powi(3)) - 1.0).abs() < 0.1, "{}", of("bdf2", 0.5, angle));
        let (fine, coarse) = (of("tr-bdf2", 0.5, 0.5 * angle), of("tr-bdf2", 0.5, angle));
        assert!((coarse / fine - 8.0).abs() < 0.2 && coarse < 0.05 * of("bdf2", 0.5, angle), "{fine} {coarse}");
    }

    #[test]
    fn every_scheme_is_of_second_order_from_its_first_step_on() {
        for scheme in ALL {
            let order = (error(scheme, 200) / error(scheme, 400)).log2();
            assert!((order - 2.0).abs() < 0.03, "{}: order {order}", scheme.name);
        }
    }

    #[test]
    fn a_state_that_moves_uniformly_stays_exact_and_numbers_fit() {
        for scheme in ALL {
            let stages = scheme.stages(0.1, 4, 0.6);
            let mut at = vec![0.0];
            for (n, s) in stages.iter().enumerate() {
                assert_eq!(s.number, n);
                assert!((s.from.iter().map(|f| f.1).sum::<f64>() - 1.0).abs() < 1e-15);
                assert!(s.from.len() == 1 || s.theta == 1.0, "{}", scheme.name);
                // u̇ = 1: the combination lies ℓ before the new state.
                let from: f64 = s.from.iter().map(|(i, w)| w * at[*i]).sum();
                assert!((from + s.length - s.time).abs() < 1e-15, "{} {n}", scheme.name);
                at.push(s.time);
            }
            let ends: Vec<usize> = stages.iter().filter_map(|s| s.completes).collect();
            assert_eq!(ends.len(), 4);
            assert!(ends.iter().enumerate().all(|(k, n)| (at[*n] - 0.1 * k as f64).abs() < 1e-15));
        }
    }
}

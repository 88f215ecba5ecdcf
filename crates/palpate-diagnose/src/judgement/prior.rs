//! What is known before any reading: how many explanations there are, what freedom costs, and in which world bodies live.
//!
//! ```text
//! ln p(M) = −Σ_effects [ln J + ln O + ½ n_e ln m] − ½ Σ_numbers z²
//! ```
//!
//! J candidates compete, a scene is right as it is until the data say otherwise (O to one), an effect has n_e numbers that the recording asks
//! for, each at the price of Schwarz (*Ann. Stat.* 6, 1978) for m means of readings; and z is by how many standard deviations a number lies
//! outside the world as it is known: gravity of 14.9 m/s² says that the model is wrong, however well it follows.

/// Odds for a scene as it is, against any one thing that it lacks: one false alarm in so many at the worst.
const ODDS: f64 = 20.0;

/// A number outside the world as it is known.
#[derive(Clone, Debug, PartialEq)]
pub struct Strange {
    /// Path of the number, or of the vector.
    pub path: String,
    /// What is strange about it, with value and unit: one clause.
    pub what: String,
    /// By how many standard deviations it lies outside what is known; 0 where that says nothing, as at a bound of the fit's own.
    pub deviations: f64,
}

impl Strange {
    /// True where it says something against the model.
    pub fn is_evidence(&self) -> bool {
        self.deviations > 0.0
    }
}

/// Prior of models of one recording.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Prior {
    /// Number of candidates J.
    pub candidates: usize,
    /// Number of means of readings m.
    pub readings: usize,
}

impl Prior {
    /// ln O: what a model pays for anything more.
    pub fn odds() -> f64 {
        ODDS.ln()
    }

    /// What a number costs that the recording asks for.
    pub fn number(self) -> f64 {
        0.5 * (self.readings.max(1) as f64).ln()
    }

    /// What a model pays for a discrepancy beside it: for being there, and for one number, its size.
    pub fn discrepancy(self) -> f64 {
        Prior::odds() + self.number()
    }

    /// ln p of a model with effects of so many needed numbers, and with what is strange about it.
    pub fn log(self, needed: &[usize], strange: &[Strange]) -> f64 {
        let effect = |n: &usize| (self.candidates.max(1) as f64).ln() + Prior::odds() + *n as f64 * self.number();
        -needed.iter().map(effect).sum::<f64>() - 0.5 * strange.iter().map(|s| s.deviations.powi(2)).sum::<f64>()
    }
}

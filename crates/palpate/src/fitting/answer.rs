//! The headline of a fit: of each number its value, one ± and the parts of that.

use super::Fitted;

/// Parts of a standard error, in the number's unit; they add as squares.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Parts {
    /// What averages out over readings.
    pub noise: f64,
    /// What cells and step leave open; `None` where that was not looked at.
    pub discretisation: Option<f64>,
    /// What the recording calls systematic.
    pub systematic: f64,
}

impl Parts {
    /// The whole standard error.
    pub fn total(&self) -> f64 {
        self.noise.hypot(self.systematic).hypot(self.discretisation.unwrap_or(0.0))
    }
}

/// What is said of a number.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Headline {
    /// Its value, in the limit of fine cells and steps where it is corrected to that.
    pub value: f64,
    /// Parts of its standard error; `None` at a bound or where the data do not say.
    pub parts: Option<Parts>,
    /// The value on the scene's own cells, where the headline is another.
    pub uncorrected: Option<f64>,
}

impl Fitted {
    /// The headline of a number, by its place in [`Fitted::free`].
    pub fn headline(&self, i: usize) -> Headline {
        let p = &self.result.parameters[i];
        let effect = self.grid.as_ref().and_then(|g| g.numbers.get(i));
        let limit = effect.and_then(|e| e.limit);
        let parts = p.standard_error.map(|all| {
            let noise = p.noise.unwrap_or(all).min(all);
            let systematic = (all * all - noise * noise).max(0.0).sqrt();
            Parts { noise, discretisation: effect.map(|e| e.error), systematic }
        });
        Headline { value: limit.unwrap_or(p.value), parts, uncorrected: limit.map(|_| p.value) }
    }
}

//! Errors of grid and step are those of a model: where its body goes elsewhere, or is ten times softer on one side, they are others than the
//! baseline's. Candidates that may be named are compared beside their own.

use super::{Fitted, Session, State};

/// Iterations of fits that there must be time for to measure one: it takes about as long.
const MEASURED: usize = 10;

impl Session<'_> {
    /// Measures the errors of candidates, the best first, until the best of all and those as good as it have their own. Beside its own errors a model
    /// predicts better than beside another's, so that those count as well who were as good before.
    pub(super) fn measure_rivals(&mut self, before: &State, fitted: &mut [Fitted]) {
        for _ in 0..self.options.search.rivals {
            let score = |k: &usize| fitted[*k].state.judged.score();
            let order = |a: &usize, b: &usize| score(a).total_cmp(&score(b));
            let Some(best) = (0..fitted.len()).max_by(order).filter(|k| score(k) > before.judged.score()) else { return };
            let rival = |k: &usize| {
                let (a, b) = (&fitted[*k], &fitted[best]);
                a.lent.over(&b.lent).is_as_good() || a.state.judged.over(&b.state.judged).is_as_good()
            };
            let open = (0..fitted.len()).filter(|k| !fitted[*k].state.own && rival(k)).max_by(order);
            let Some(next) = open.filter(|_| self.lab.iterations_left() >= MEASURED) else { return };
            self.refine(&mut fitted[next].state);
            fitted[next].gain = self.gain(before, &fitted[next].state);
            fitted[next].nats = fitted[next].state.judged.over(&before.judged).parts();
        }
    }

    /// True if the best of the candidates is an explanation that leaves nothing.
    pub(super) fn explained(&self, fitted: &[Fitted]) -> bool {
        let best = fitted.iter().map(|f| &f.state.judged).max_by(|a, b| a.score().total_cmp(&b.score()));
        best.is_some_and(|j| !j.may_be_missing())
    }
}

//! `[fit]`: what is to be found out, and how.

/// What is to be found out.
#[derive(Clone, Debug, PartialEq)]
pub struct FitSpec {
    /// The optimiser; `None` where the scene leaves the choice.
    pub optimizer: Option<Optimizer>,
    /// Most iterations per start.
    pub iterations: usize,
    /// Number of starts.
    pub starts: usize,
    /// Seed of the starts.
    pub seed: u64,
    /// Threads; 0 = all.
    pub threads: usize,
    /// Where starts come from.
    pub warm_start: WarmStart,
    /// Free parameters.
    pub parameters: Vec<FitParameter>,
    /// Which frames it sees; `None` = all.
    pub frames: Option<TrainFrames>,
}

/// Frames that a fit sees, out of those that the scene's `[observation]` uses. It is tried on the others.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct TrainFrames {
    /// From the first on every n-th.
    pub every: usize,
    /// So many at most.
    pub count: usize,
    /// Instead of both, their numbers in rising order.
    pub numbers: Option<Vec<usize>>,
    /// The other way round: the frames that the fit does not see.
    pub others: bool,
}

impl TrainFrames {
    /// True where frame `number` is one of these.
    pub fn holds(&self, number: usize) -> bool {
        let trains = match &self.numbers {
            Some(all) => all.binary_search(&number).is_ok(),
            None => number.is_multiple_of(self.every) && number / self.every < self.count,
        };
        trains != self.others
    }
}

/// Where a fit's start values come from, beside what the scene says.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum WarmStart {
    /// From nowhere else.
    #[default]
    Stated,
    /// Stiffness and damping from the frequencies at which markers or tracked points vibrate.
    Modal,
    /// The same from tracking the body, and a fit to what was tracked; where the scene's own values are near enough, from these.
    Tracked,
}

impl WarmStart {
    /// All by their names in files.
    pub const ALL: [(&'static str, WarmStart); 3] =
        [("none", WarmStart::Stated), ("modal", WarmStart::Modal), ("tracked", WarmStart::Tracked)];

    /// Its name.
    pub fn name(self) -> &'static str {
        WarmStart::ALL.iter().find(|w| w.1 == self).map_or("", |w| w.0)
    }
}

/// Optimisers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Optimizer {
    /// Resilient propagation: signs of the gradient only (the paper).
    Rprop,
    /// Gradient descent with adaptive (Barzilai–Borwein) steps.
    GradientDescent,
    /// Limited-memory quasi-Newton.
    Lbfgs,
    /// Gauss–Newton with Levenberg–Marquardt damping.
    GaussNewton,
    /// The same without a matrix: products by a tangent and an adjoint, for fields.
    GaussNewtonCg,
    /// Simplex search without gradients.
    NelderMead,
}

impl Optimizer {
    /// All by their names in files and on the command line.
    pub const ALL: [(&'static str, Optimizer); 6] = [
        ("rprop", Optimizer::Rprop),
        ("gradient-descent", Optimizer::GradientDescent),
        ("lbfgs", Optimizer::Lbfgs),
        ("gauss-newton", Optimizer::GaussNewton),
        ("gauss-newton-cg", Optimizer::GaussNewtonCg),
        ("nelder-mead", Optimizer::NelderMead),
    ];

    /// Its name.
    pub fn name(self) -> &'static str {
        Optimizer::ALL.iter().find(|o| o.1 == self).map_or("", |o| o.0)
    }
}

/// One free number.
#[derive(Clone, Debug, PartialEq)]
pub struct FitParameter {
    /// Path in the scene file: a component of a vector and a region of a field have their own entry, a field by cells or nodes has one for
    /// all its values; `material.mass` stays as written.
    pub path: String,
    /// Where starts are drawn from (equal ends: a fixed start).
    pub start: (f64, f64),
    /// Allowed range.
    pub bounds: (f64, f64),
    /// Value and standard deviation that are known beforehand: a Gaussian prior in the number's own unit.
    pub known: Option<(f64, f64)>,
    /// With several scenes: not shared between them.
    pub per_scene: bool,
}

//! What an optimiser sees of physics: parameters in, cost and derivatives out.

use crate::failure::{Failure, FailureKind};
use crate::part::Share;
use palpate_model::observation::View;

/// Parameter vectors of a batch, shape `[B, P]`, SI units, and what each member is compared with.
#[derive(Clone, Debug, PartialEq)]
pub struct ParamBatch {
    /// Number of parameters P.
    pub parameters: usize,
    /// Values, member by member.
    pub values: Vec<f64>,
    /// What each member is compared with `[B]`; empty where all are with the whole of the plan's own recording.
    pub views: Vec<View>,
    /// Places in θ that each member wants sensitivities for, in place of those that are requested and at most as many `[B]`, so that its Q is
    /// their number; empty where all want the latter.
    pub own: Vec<Vec<usize>>,
}

impl ParamBatch {
    /// A batch of rows; all must have the same length.
    pub fn from_rows(rows: &[Vec<f64>]) -> ParamBatch {
        let parameters = rows.first().map_or(0, Vec::len);
        assert!(rows.iter().all(|r| r.len() == parameters), "rows of a batch have the same length");
        ParamBatch { parameters, values: rows.concat(), views: Vec::new(), own: Vec::new() }
    }

    /// A batch of one.
    pub fn of(row: &[f64]) -> ParamBatch {
        ParamBatch { parameters: row.len(), values: row.to_vec(), views: Vec::new(), own: Vec::new() }
    }

    /// The same members, each compared with a view of its own.
    #[must_use]
    pub fn seeing(self, views: Vec<View>) -> ParamBatch {
        assert!(views.len() == self.members(), "every member has a view");
        ParamBatch { views, ..self }
    }

    /// The same members, each with places of its own that it wants sensitivities for.
    #[must_use]
    pub fn along(self, own: Vec<Vec<usize>>) -> ParamBatch {
        assert!(own.len() == self.members(), "every member has places");
        ParamBatch { own, ..self }
    }

    /// Directions of the tangents for which `requested` places ask `[Q]`.
    pub fn directions(&self, requested: &[usize]) -> Vec<Direction> {
        Direction::along(&self.own, requested)
    }

    /// What member b is compared with.
    pub fn view(&self, b: usize) -> View {
        self.views.get(b).cloned().unwrap_or_default()
    }

    /// The batch in parts of at most `most` members.
    pub fn parts(&self, most: usize) -> impl Iterator<Item = ParamBatch> {
        let (all, most) = (self.members(), most.max(1));
        (0..all).step_by(most).map(move |first| {
            let end = all.min(first + most);
            let values = self.values[first * self.parameters..end * self.parameters].to_vec();
            let views = self.views.get(first..end).map_or_else(Vec::new, <[View]>::to_vec);
            let own = self.own.get(first..end).map_or_else(Vec::new, <[Vec<usize>]>::to_vec);
            ParamBatch { parameters: self.parameters, values, views, own }
        })
    }

    /// Number of members B.
    pub fn members(&self) -> usize {
        self.values.len().checked_div(self.parameters).unwrap_or(0)
    }

    /// Parameters of member b.
    pub fn row(&self, b: usize) -> &[f64] {
        &self.values[b * self.parameters..(b + 1) * self.parameters]
    }
}

/// Parameters that a gradient is wanted by; what is not wanted costs nothing.
#[derive(Clone, Debug, Default, PartialEq)]
pub enum Wanted {
    /// No gradient at all.
    #[default]
    Nothing,
    /// All of θ.
    All,
    /// These places in θ; the other entries of the gradient are zero.
    Places(Vec<usize>),
}

impl Wanted {
    /// True where some gradient is wanted.
    pub fn any(&self) -> bool {
        !matches!(self, Wanted::Nothing)
    }

    /// Which of `parameters` numbers are wanted `[P]`.
    pub fn mask(&self, parameters: usize) -> Vec<bool> {
        match self {
            Wanted::Nothing => vec![false; parameters],
            Wanted::All => vec![true; parameters],
            Wanted::Places(places) => {
                let mut mask = vec![false; parameters];
                places.iter().for_each(|p| mask[*p] = true);
                mask
            }
        }
    }
}

/// A direction in the space of parameters.
#[derive(Clone, Debug, PartialEq)]
pub enum Direction {
    /// One parameter alone, by its place in θ.
    Parameter(usize),
    /// Any direction dθ `[P]`.
    Dense(Vec<f64>),
    /// Of every member one parameter alone `[B]`, or nowhere. What is asked of it without a member holds for any of them.
    Each(Vec<Option<usize>>),
}

impl Direction {
    /// The directions of single parameters.
    pub fn parameters(places: &[usize]) -> Vec<Direction> {
        places.iter().map(|p| Direction::Parameter(*p)).collect()
    }

    /// Directions along the `own` places of every member, or those that are requested of all where there are none.
    pub fn along(own: &[Vec<usize>], requested: &[usize]) -> Vec<Direction> {
        if own.is_empty() {
            return Direction::parameters(requested);
        }
        let each = |q: usize| own.iter().map(|places| places.get(q).copied()).collect();
        (0..requested.len()).map(|q| Direction::Each(each(q))).collect()
    }

    /// The direction of member b; nowhere is `Each` of nobody.
    pub fn of(&self, b: usize) -> Direction {
        match self {
            Direction::Each(places) => places[b].map_or(Direction::Each(Vec::new()), Direction::Parameter),
            all => all.clone(),
        }
    }

    /// Component along the parameter at place p.
    pub fn component(&self, p: usize) -> f64 {
        match self {
            Direction::Parameter(own) => f64::from(u8::from(*own == p)),
            Direction::Dense(d) => d[p],
            Direction::Each(places) => f64::from(u8::from(places.contains(&Some(p)))),
        }
    }

    /// Components that are not zero: place in θ and value.
    pub fn entries(&self) -> impl Iterator<Item = (usize, f64)> + '_ {
        let (own, dense): (Vec<usize>, &[f64]) = match self {
            Direction::Parameter(p) => (vec![*p], &[]),
            Direction::Dense(d) => (Vec::new(), d),
            Direction::Each(places) => (places.iter().flatten().copied().collect(), &[]),
        };
        own.into_iter().map(|p| (p, 1.0)).chain(dense.iter().copied().enumerate().filter(|(_, v)| *v != 0.0))
    }

    /// All components `[P]`.
    pub fn dense(&self, parameters: usize) -> Vec<f64> {
        let mut d = vec![0.0; parameters];
        self.entries().for_each(|(p, v)| d[p] = v);
        d
    }
}

/// Most parameters that forward sensitivities are computed for at once: each takes the memory of a state and a linear solve per step.
pub const MOST_SENSITIVITIES: usize = 256;

/// What is wanted besides the cost.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Request {
    /// The adjoint gradient dJ/dθ by these.
    pub gradient: Wanted,
    /// Gauss–Newton curvature (and gradient) by forward sensitivities for these places in θ; empty = none.
    pub sensitivities: Vec<usize>,
}

/// Cost and derivatives of one member.
///
/// The cost is `J = (1/n) Σ ρ(r)/σ²`, over the n scalar residuals r of all frames (a depth point is one, a marker three),
/// with ρ(r) ≈ r²/2 for small r: half the mean squared residual in units of the noise.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Evaluation {
    /// J, dimensionless. Infinite for a member that failed.
    pub cost: f64,
    /// dJ/dθ `[P]`, zero where it is not wanted; empty unless requested.
    pub gradient: Vec<f64>,
    /// Forward sensitivities' result; `None` unless requested.
    pub curvature: Option<Curvature>,
    /// Scalar residuals that met a surface or marker.
    pub matched: usize,
    /// Scalar residuals in all (n above).
    pub residuals: usize,
    /// Sum of squared matched residuals [m²].
    pub sum_squares: f64,
    /// Sum of matched residuals of depth points [m] (a bias shows here).
    pub sum_signed: f64,
    /// Why the member stopped, if it did.
    pub failure: Option<Failure>,
}

impl Evaluation {
    /// An evaluation that failed.
    pub fn failed(failure: Failure) -> Evaluation {
        Evaluation { cost: f64::INFINITY, failure: Some(failure), ..Evaluation::default() }
    }

    /// Root mean square distance of the matched residuals' points [m]: `sqrt(Σ r² / matched)` per scalar residual.
    pub fn rms(&self) -> f64 {
        if self.matched == 0 { f64::NAN } else { (self.sum_squares / self.matched as f64).sqrt() }
    }
}

/// Gauss–Newton model from forward sensitivities of Q requested parameters.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Curvature {
    /// dJ/dθ for the requested parameters `[Q]`.
    pub gradient: Vec<f64>,
    /// Positive semi-definite approximation of d²J/dθ² `[Q, Q]`, row-major: `(1/n) Σ w ∇r ∇rᵀ/σ²`, w the robust weight.
    pub matrix: Vec<f64>,
}

/// Physics as a function; object-safe, so that a fit can be tested on a parabola.
pub trait Evaluate: Send {
    /// Number of parameters P that [`Self::evaluate`] expects.
    fn parameters(&self) -> usize;
    /// Cost and derivatives of every member of a batch; a failed member has infinite cost and says why.
    fn evaluate(&mut self, theta: &ParamBatch, request: &Request) -> Vec<Evaluation>;

    /// True where [`Evaluate::product`] is computed.
    fn has_products(&self) -> bool {
        false
    }

    /// Product `H v` `[P]` with the Gauss–Newton matrix of [`Curvature`] over all parameters of the only member `at`, for a direction `v` `[P]`;
    /// entries that are not `wanted` are zero. What was simulated for the last member is kept, so that further products with its matrix
    /// take a tangent and an adjoint each.
    ///
    /// # Errors
    /// The simulation fails, or there are no products ([`FailureKind::Unsupported`]).
    fn product(&mut self, _at: &ParamBatch, _v: &[f64], _wanted: &Wanted) -> Result<Vec<f64>, Failure> {
        Err(Failure::new(FailureKind::Unsupported, 0.0, "there are no products with the Gauss-Newton matrix"))
    }

    /// What this is part of, where several evaluators are one behind: a batch through any of them may hold members of all.
    fn share(&self) -> Option<Share> {
        None
    }
}

//! Laws of a whole cell: energy and dissipation per volume as functions of a few scalars of its deformation.
//!
//! With q the cell's deformation without rotation (see [`crate::cutcells::corotation`]), K its matrix for E = 1, V its volume:
//! a = ½ qᵀKq/V is the energy density over E, ε the mean strain (symmetric gradient, averaged over the part of the cell that deforms), and
//! d = ½ (q₁−q₀)ᵀK(q₁−q₀)/V measures the strain increment of a step. All are objective. A law adds V·E·ψ(a, ε) to the
//! elastic energy, weighted in time like it, and V·E·φ(d, a₀) to the incremental potential, with what is not conservative
//! taken at the old state a₀, so that all second derivatives stay symmetric.

use super::law::Number;
use num_dual::HyperDual64;

/// Scalars of the energy: a and the six strains.
pub const ENERGY: usize = 7;
/// Scalars of the dissipation: d and a₀.
pub const LOSS: usize = 2;
/// Most parameters of a cell law.
pub const MOST: usize = 8;

/// One state of a cell.
#[derive(Clone, Copy, Debug)]
pub struct Strain<D> {
    /// Energy density of the linear material over E: ½ ε² in uniaxial stress.
    pub density: D,
    /// Mean strain: xx, yy, zz, yz, zx, xy (tensor components, body frame).
    pub mean: [D; 6],
}

/// A step of a cell.
#[derive(Clone, Copy, Debug)]
pub struct Increment<D> {
    /// d: like `Strain::density`, of the strain increment.
    pub density: D,
    /// a₀: energy density of the old state over E.
    pub old: D,
    /// 1/Δt [1/s].
    pub rate: f64,
}

/// A law of cells. Implement one or both of its functions; derivatives follow.
pub trait CellLaw: Sync {
    /// True when the energy depends on the mean strain.
    const STRAINED: bool = false;
    /// True when there is a dissipation.
    const LOSSY: bool = false;

    /// ψ: energy density over E.
    fn energy<D: Number>(&self, _s: &Strain<D>, _p: &[D]) -> D {
        D::from(0.0)
    }

    /// φ: incremental dissipation potential per volume over E; convex in the increment.
    fn loss<D: Number>(&self, _s: &Increment<D>, _p: &[D]) -> D {
        D::from(0.0)
    }
}

/// Which of a law's functions.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Part {
    /// ψ of [`ENERGY`] scalars.
    Energy,
    /// φ of [`LOSS`] scalars, for steps of 1/rate seconds.
    Loss {
        /// 1/Δt [1/s].
        rate: f64,
    },
}

impl Part {
    /// Number of scalars before the parameters.
    pub fn scalars(self) -> usize {
        match self {
            Part::Energy => ENERGY,
            Part::Loss { .. } => LOSS,
        }
    }
}

/// A [`CellLaw`] with its derivatives, without its type. `z`: the part's scalars, then the parameters.
pub trait Cell: Sync {
    /// Number of scalars that the part's value may depend on; the others are not needed.
    fn needs(&self, part: Part) -> usize;
    /// The function's value.
    fn value(&self, part: Part, z: &[f64]) -> f64;
    /// First derivatives by entries i and j and the mixed second one.
    fn slopes(&self, part: Part, z: &[f64], i: usize, j: usize) -> [f64; 3];
}

fn evaluate<L: CellLaw, D: Number>(law: &L, part: Part, z: &[D]) -> D {
    let p = &z[part.scalars()..];
    match part {
        Part::Energy => law.energy(&Strain { density: z[0], mean: std::array::from_fn(|k| z[1 + k]) }, p),
        Part::Loss { rate } => law.loss(&Increment { density: z[0], old: z[1], rate }, p),
    }
}

impl<L: CellLaw> Cell for L {
    fn needs(&self, part: Part) -> usize {
        match part {
            Part::Energy if L::STRAINED => ENERGY,
            Part::Energy => 1,
            Part::Loss { .. } if L::LOSSY => LOSS,
            Part::Loss { .. } => 0,
        }
    }

    fn value(&self, part: Part, z: &[f64]) -> f64 {
        evaluate(self, part, z)
    }

    fn slopes(&self, part: Part, z: &[f64], i: usize, j: usize) -> [f64; 3] {
        let mut lifted = [HyperDual64::from(0.0); ENERGY + MOST];
        for (h, v) in lifted.iter_mut().zip(z) {
            h.re = *v;
        }
        lifted[i].eps1 = 1.0;
        lifted[j].eps2 = 1.0;
        let v = evaluate(self, part, &lifted[..z.len()]);
        [v.eps1, v.eps2, v.eps1eps2]
    }
}

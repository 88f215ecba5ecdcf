//! Products with the tangent stiffness without its matrix, for many states at a time: a term keeps what its points or springs need, a tenth of what
//! their blocks take.

use super::{Curvature, Equation};
use crate::linear::matrix::{Matrix, Operator, Packed};
use glam::DVec3;

/// A term's part of the tangent stiffness at one displacement.
pub trait Part: Send + Sync {
    /// y += A x.
    fn add(&self, x: &[DVec3], y: &mut [DVec3]);
}

/// Whether a term has its tangent without a matrix.
pub enum Parts<'a> {
    /// It has none: the derivative is zero.
    Nothing,
    /// It has.
    Free(Box<dyn Part + 'a>),
    /// The matrix is all there is.
    Matrix,
}

/// Products with a tangent.
pub type Products<'a> = Box<dyn Operator + Send + Sync + 'a>;

/// Vectors of nodes as registers of four numbers.
pub(super) fn padded(x: &[DVec3]) -> Vec<[f64; 4]> {
    x.iter().map(|x| [x.x, x.y, x.z, 0.0]).collect()
}

/// The sum of all terms' parts.
struct Sum<'a> {
    parts: Vec<Box<dyn Part + 'a>>,
}

impl Operator for Sum<'_> {
    fn multiply(&self, x: &[DVec3], y: &mut [DVec3]) {
        y.fill(DVec3::ZERO);
        self.parts.iter().for_each(|p| p.add(x, y));
    }
}

impl<'a> Equation<'a> {
    /// The exact tangent stiffness at `u1` as products, by a packed matrix where some term has no other; the residual has been computed there.
    pub fn products<'b>(&'b self, u1: &[DVec3]) -> Products<'b> {
        let mut free: Vec<Box<dyn Part + 'b>> = Vec::new();
        for term in &self.terms {
            match term.products(u1) {
                Parts::Nothing => {}
                Parts::Free(part) => free.push(part),
                Parts::Matrix => {
                    let mut matrix = Matrix::default();
                    self.tangent(u1, Curvature::Exact, &mut matrix);
                    return Box::new(Packed::new(&self.context.pattern.blocks, &matrix, |v| v));
                }
            }
        }
        Box::new(Sum { parts: free })
    }

    /// True where [`Equation::products`] takes the memory of a matrix.
    pub fn needs_matrix(&self, u1: &[DVec3]) -> bool {
        self.terms.iter().any(|t| matches!(t.products(u1), Parts::Matrix))
    }
}

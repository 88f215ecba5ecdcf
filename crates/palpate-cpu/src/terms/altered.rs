//! What effects make of a member's body beside its coefficients: strained rest cells, clamps, laws of cells.

use super::elastic_cells::laws::{CellActing, cell_laws};
use super::unstrained::Unstrained;
use palpate_model::cutcells::corotation::CellPose;
use palpate_model::cutcells::elements::Elements;
use palpate_model::materials::principal_stretch::PrincipalStretch;
use palpate_model::params::coefficients::Coefficients;
use palpate_model::params::grips::Grip;
use palpate_model::plan::Plan;

/// All empty without such effects.
#[derive(Debug, Default)]
pub struct Altered {
    /// Every cell in the stress-free shape.
    pub rest: Option<Vec<CellPose>>,
    /// Elastic points of a body without cells in that shape.
    pub points: Option<Unstrained>,
    /// Clamps with compliant layers and moved edges.
    pub grips: Option<Vec<Grip>>,
    /// Laws of cells.
    pub laws: Vec<CellActing>,
    /// The material, where its curves are the member's own.
    pub law: Option<PrincipalStretch>,
}

impl Altered {
    /// Of one member.
    pub fn new(plan: &Plan, coefficients: &Coefficients, elements: &Elements) -> Altered {
        let (body, physics) = (&plan.body, &coefficients.physics);
        let shape = coefficients.changes.rest.as_ref();
        let rest = shape.filter(|_| body.cut.is_some()).map(|w| {
            let at = |n: u32| body.nodes[n as usize] + w[n as usize];
            body.cells().iter().map(|c| CellPose::new(&c.nodes.map(at), body.length)).collect()
        });
        let points = shape.filter(|_| body.cut.is_none()).map(|w| Unstrained::new(&body.points, w));
        Altered {
            rest,
            points,
            grips: Grip::all(plan, physics, elements),
            laws: cell_laws(plan, physics),
            law: plan.own_law(physics),
        }
    }
}

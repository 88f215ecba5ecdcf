//! How much memory simulations take, from the sizes of what they keep; found before anything is computed.

use crate::kept::BACK;
use crate::linear::{Need, Purpose};
use crate::terms::elastic_cells::POSED;
use glam::{DMat3, DVec3};
use palpate_engine::{Request, Wanted};
use palpate_model::cutcells::corotation::V24;
use palpate_model::cutcells::domain::BandCell;
use palpate_model::cutcells::elements::Classes;
use palpate_model::observation::ObservedPoint;
use palpate_model::plan::Plan;
use palpate_model::scene::InitialShape;
use palpate_model::space::pattern::Pattern;

/// Vectors over all nodes that a solve keeps at a time: forces, directions, conjugate gradients.
const VECTORS: usize = 16;
/// Bytes of a cell's matrix and its derivative by Poisson's ratio.
const MATRICES: usize = 2 * 576 * size_of::<f64>();

/// Memory of a batch of simulations [B].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Memory {
    /// The body, its band, the matrices of its cells, what was measured: once for all members.
    pub shared: u64,
    /// The matrix of every member, and in a sequence its factor.
    pub matrices: u64,
    /// What the members solved side by side keep meanwhile: poses of cells, a copy or factor of the matrix, vectors.
    pub solves: u64,
    /// States of every member: all steps where a gradient is asked for, two otherwise.
    pub states: u64,
    /// Derivatives of two states of every member along every direction.
    pub tangents: u64,
}

impl Memory {
    /// All of it.
    pub fn total(&self) -> u64 {
        self.shared + self.matrices + self.solves + self.states + self.tangents
    }
}

/// Sizes that the memory of any batch follows from, found once for a plan.
#[derive(Clone, Debug)]
pub struct Sizes<'a> {
    plan: &'a Plan,
    /// Of what all members share, but for the matrices of cells [B].
    tables: usize,
    /// Blocks of the matrix.
    blocks: usize,
    /// Matrices of cells for one Poisson's ratio.
    matrices: usize,
    /// Of linear solves.
    need: Need,
}

impl<'a> Sizes<'a> {
    /// Of a plan.
    pub fn new(plan: &'a Plan) -> Sizes<'a> {
        let (body, band) = (&plan.body, &plan.body.band);
        let pattern = Pattern::of(plan);
        let blocks = pattern.blocks.columns.len();
        let held: usize = plan.clamps.iter().map(|c| c.cells.len()).sum();
        let points_of = |r: usize| plan.recording(r).observation.frames.iter().map(|f| f.points.len()).sum::<usize>();
        let points: usize = (0..plan.recordings()).map(points_of).sum();
        let tables = size_of_val(body.cells())
            + band.cells.len() * size_of::<BandCell>()
            + band.nodes.len() * size_of::<DVec3>()
            + band.columns.len() * (size_of::<u32>() + size_of::<f64>())
            + 4 * band.grid.len()
            + 8 * pattern.cell_list.len()
            + 4 * blocks
            + points * (size_of::<ObservedPoint>() + 8);
        // With many right-hand sides larger bodies are factorised, and still larger ones where nothing moves.
        let purpose = if plan.initial == InitialShape::Rest { Purpose::Step(usize::MAX) } else { Purpose::Static };
        let need = Need::of(plan.solver.linear, body, &pattern, purpose);
        Sizes { plan, tables: tables + need.shared, blocks, matrices: Classes::new(plan).parts.len() + held, need }
    }

    /// Memory that one evaluation of `members` simulations takes on so many threads, an estimate. Matrices of cells are kept for each of
    /// the `ratios` different Poisson's ratios in the batch.
    pub fn memory(&self, members: usize, ratios: usize, threads: usize, request: &Request) -> Memory {
        let Sizes { plan, tables, blocks, matrices, need } = *self;
        let (nodes, cells) = (plan.body.nodes.len(), plan.body.cells().len());
        let vector = nodes * size_of::<DVec3>();
        let [stays, beside] = self.side_by_side();
        let solve = need.solve + beside + cells * (POSED + size_of::<V24>()) + VECTORS * vector;
        let kept = if request.gradient.any() { plan.clock.stages().len() + 3 } else { 3 };
        let bytes = |n: usize| n as u64;
        Memory {
            shared: bytes(tables + ratios * matrices * MATRICES),
            // Beside the stiffness tetrahedra keep a mass of every block.
            matrices: bytes(members * (stays + blocks * (size_of::<DMat3>() + if plan.body.cut.is_none() { 8 } else { 0 }))),
            solves: bytes(members.min(threads.max(1)) * solve),
            states: bytes(members * 2 * kept * vector),
            tangents: bytes(members * 4 * request.sensitivities.len() * vector),
        }
    }

    /// What states of a sequence that are solved for together take: the factor that stays with the member, rounded to half of its size, and meanwhile as
    /// much in matrices, the moduli of points, and vectors.
    fn side_by_side(&self) -> [usize; 2] {
        let (plan, nodes) = (self.plan, self.plan.body.nodes.len());
        let Some(factor) = self.need.factor.filter(|_| !plan.times.is_empty()) else { return [0; 2] };
        let moduli = plan.body.points.len() * size_of::<[[f64; 9]; 9]>();
        let states = BACK.min(plan.times.len());
        [factor / 2, factor / 2 + states * (moduli + VECTORS * nodes * size_of::<DVec3>())]
    }

    /// The same of a product with the Gauss–Newton matrix: one simulation with all its states, and the tangents of all of them.
    pub fn product(&self, threads: usize) -> Memory {
        let back = self.memory(1, 1, threads, &Request { gradient: Wanted::All, ..Request::default() });
        Memory { tangents: back.states, ..back }
    }
}

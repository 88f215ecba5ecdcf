//! Two-level preconditioner: block-Jacobi on the nodes plus a direct solve for the rigid motions of small groups of nodes.
//!
//! What block-Jacobi is slow at is stiffness over long distances: bending and stretching of the whole body. Groups of a few
//! nodes across move almost rigidly in such modes, so six rigid modes per group carry them (aggregation with rigid-body modes,
//! as in Vaněk, Mandel & Brezina 1996, here unsmoothed and additive: one pass, no extra product with the matrix).

use super::cholesky::{Analysis, Factor};
use super::conjugate_gradient::Precondition;
use super::jacobi::BlockJacobi;
use super::matrix::Matrix;
use glam::{DMat3, DVec3};
use palpate_model::space::body::Body;
use palpate_model::space::groups::Groups;
use palpate_model::space::pattern::{BlockRows, Pattern};
use rayon::prelude::*;

/// Groups of nodes and the pattern of their matrix; depends on the geometry only.
#[derive(Debug)]
pub struct Coarsening {
    groups: Groups,
    // Two 3 × 3 block rows per group: translation and rotation.
    blocks: BlockRows,
    analysis: Analysis,
}

impl Coarsening {
    /// Groups the nodes of a body into cubes of `across` nodes.
    pub fn new(body: &Body, pattern: &Pattern, across: i64) -> Result<Coarsening, String> {
        let groups = Groups::new(body, &pattern.blocks, across);
        let mut neighbours = vec![Vec::new(); 2 * groups.len()];
        for i in 0..body.nodes.len() {
            let a = groups.of_node[i];
            for &j in &pattern.blocks.columns[pattern.blocks.rows[i]..pattern.blocks.rows[i + 1]] {
                let b = groups.of_node[j as usize];
                for part in 0..2 {
                    neighbours[(2 * a + part) as usize].extend([2 * b, 2 * b + 1]);
                }
            }
            if i % 64 == 0 {
                // Keep the lists short while they grow.
                for part in 0..2 {
                    let list = &mut neighbours[(2 * a + part) as usize];
                    list.sort_unstable();
                    list.dedup();
                }
            }
        }
        let blocks = BlockRows::new(neighbours);
        let analysis = Analysis::new(&blocks)?;
        Ok(Coarsening { groups, blocks, analysis })
    }

    /// Memory that groups, their pattern and the structure of a factor take [B].
    pub fn bytes(&self) -> usize {
        2 * size_of::<u32>() * self.groups.of_node.len() + size_of::<u32>() * self.blocks.columns.len() + self.analysis.bytes()
    }

    /// Memory that a second level takes while it is made [B].
    pub fn level_bytes(&self) -> usize {
        // Strips, and the matrix that they are joined to.
        let matrices = 2 * size_of::<DMat3>() * self.blocks.columns.len();
        let arms = size_of::<DVec3>() * self.groups.of_node.len();
        matrices + arms + self.analysis.factor_bytes() + self.analysis.work_bytes()
    }

    /// The groups' 6 × 6 blocks QᵀAQ, Q = [I, −[arm]×] per node.
    fn project(&self, rows: &BlockRows, matrix: &Matrix, arms: &[DVec3]) -> Matrix {
        let strips: Vec<Vec<DMat3>> = self
            .groups
            .nodes
            .par_iter()
            .enumerate()
            .map(|(g, nodes)| {
                let start = self.blocks.rows[2 * g];
                let length = self.blocks.rows[2 * g + 1] - start;
                let columns = &self.blocks.columns[start..start + length];
                // Rows of translation, then of rotation.
                let mut strip = vec![DMat3::ZERO; 2 * length];
                for &i in nodes {
                    let left = cross(arms[i as usize]);
                    for k in rows.rows[i as usize]..rows.rows[i as usize + 1] {
                        let j = rows.columns[k];
                        let a = matrix.values[k];
                        let b = a * -cross(arms[j as usize]);
                        let at = columns
                            .binary_search(&(2 * self.groups.of_node[j as usize]))
                            .expect("groups of neighbours are neighbours");
                        strip[at] += a;
                        strip[at + 1] += b;
                        strip[length + at] += left * a;
                        strip[length + at + 1] += left * b;
                    }
                }
                strip
            })
            .collect();
        Matrix { values: strips.concat() }
    }

    /// The second level for a matrix at displacement u.
    pub fn level(&self, body: &Body, rows: &BlockRows, matrix: &Matrix, u: &[DVec3]) -> Result<Level, String> {
        let arms = self.groups.arms(body, u);
        let factor = self.analysis.factor(&self.project(rows, matrix, &arms))?;
        Ok(Level { arms, factor })
    }
}

fn cross(w: DVec3) -> DMat3 {
    palpate_model::mechanics::rotation::cross_matrix(w)
}

/// The factorised stiffness of the groups. It stays a good preconditioner for the neighbouring matrices of one Newton solve.
#[derive(Debug)]
pub struct Level {
    arms: Vec<DVec3>,
    factor: Factor,
}

/// Block-Jacobi plus the coarse solve.
pub struct TwoLevel<'a> {
    /// The groups.
    pub coarsening: &'a Coarsening,
    /// First level.
    pub jacobi: &'a BlockJacobi,
    /// Second level.
    pub level: &'a Level,
}

impl TwoLevel<'_> {
    /// Translation and rotation of every group that the coarse solve answers with.
    fn coarse(&self, r: &[DVec3]) -> Vec<DVec3> {
        let mut out = vec![DVec3::ZERO; 2 * self.coarsening.groups.len()];
        for (g, nodes) in self.coarsening.groups.nodes.iter().enumerate() {
            for &i in nodes {
                out[2 * g] += r[i as usize];
                out[2 * g + 1] += self.level.arms[i as usize].cross(r[i as usize]);
            }
        }
        self.level.factor.solve(&mut [&mut out]);
        out
    }
}

impl Precondition for TwoLevel<'_> {
    fn apply(&self, r: &[DVec3], z: &mut [DVec3]) {
        let c = self.coarsening;
        let ((), coarse) = rayon::join(|| self.jacobi.apply(r, z), || self.coarse(r));
        for (i, z) in z.iter_mut().enumerate() {
            let g = c.groups.of_node[i] as usize;
            *z += coarse[2 * g] + coarse[2 * g + 1].cross(self.level.arms[i]);
        }
    }
}

//! Second level of the preconditioner: groups of nodes and their stiffness, factorised on the host in f64. Twin in purpose of
//! palpate-cpu/src/linear/coarse.rs, which factorises anew in every step; here a factor serves all steps and all members, so that a device only
//! multiplies.
//!
//! At rest Qᵀ A Q = ρ m (M̂ + τ K̂) with the rigid motions Q of the groups, their stiffness K̂ for a modulus of 1 Pa, their mass M̂ for a density of
//! 1 kg/m³, m the weight of inertia, s that of stiffness, and τ = E s / (ρ m). C is the inverse for the power of two nearest to τ, over ρ m: which
//! member asks beside others does not matter to its bits. Of a static problem C = K̂⁻¹ / E. The device turns it with the groups
//! (`shaders/shared/coarse.wgsl`).
//!
//! Nodes that stiff springs hold take no part: Q has no rows there. A group would be held in what moves them, a hundred million times as stiff as the
//! body, and soft in what does not, as a plate is that hinges on two of its nodes. Single precision has no room for such a C: rounding of its soft
//! part is larger than its stiff one, and M⁻¹ no longer positive. Block-Jacobi alone all but solves for these nodes.

use super::geometry::Geometry;
use crate::device::pipelines::shared::roster;
use crate::device::{Arena, GpuError, Maker};
use faer::linalg::solvers::DenseSolveCore as _;
use faer::{Mat, Side};
use glam::DVec3;
use palpate_model::plan::scheme::Stage;
use palpate_model::plan::{Physics, Plan};
use palpate_model::scene::InitialShape;
use palpate_model::space::body::Body;
use palpate_model::space::groups::Groups;
use palpate_model::space::pattern::BlockRows;
use std::collections::HashMap;

/// Edge of a group, in nodes, where there are not too many.
const ACROSS: i64 = 4;
/// Most groups: C is dense, and every iteration reads it.
pub(crate) const MOST_GROUPS: usize = 256;
/// Added to the diagonal, in parts of it, where rounding has left a matrix that is not positive, of the stiffness or of C: the first that will do.
const SHIFTS: [f64; 5] = [0.0, 1e-6, 1e-5, 1e-4, 1e-3];
/// What single precision may take off the diagonal of C, in parts of it, as it is stored and as it is multiplied.
const ROUNDING: f64 = 1e-6;
/// A motion is none of a group's whose nodes it moves so much less than another one does, by squares: turns of nodes in a line, say.
const STILL: f64 = 1e-4;

/// Groups of a body's nodes.
pub(crate) fn groups(body: &Body, blocks: &BlockRows) -> Groups {
    let mut across = ACROSS;
    loop {
        let groups = Groups::new(body, blocks, across);
        if groups.len() <= MOST_GROUPS {
            return groups;
        }
        across += 1;
    }
}

/// Slices of the groups that products are made in, a workgroup each: where each starts among the nodes of all groups, and the first one of
/// each group. Slices of a group are as long as each other, and none reaches into another group.
pub(crate) fn slices(groups: &Groups) -> [Vec<u32>; 2] {
    let (mut starts, mut of_group, mut at) = (vec![0], vec![0], 0);
    for nodes in &groups.nodes {
        let count = nodes.len().div_ceil(roster::NARROW as usize);
        starts.extend((1..=count).map(|k| (at + k * nodes.len() / count) as u32));
        of_group.push(starts.len() as u32 - 1);
        at += nodes.len();
    }
    [starts, of_group]
}

/// Which nodes move with their groups `[N]`: those that no clamp's springs hold.
pub(crate) fn carried(plan: &Plan) -> Vec<bool> {
    let mut carried = vec![true; plan.body.nodes.len()];
    plan.clamps.iter().flat_map(|c| &c.nodes).for_each(|(node, _)| carried[*node as usize] = false);
    carried
}

/// Adds the groups and their slices to the body's arena.
pub(crate) fn put(groups: &Groups, slices: &[Vec<u32>; 2], plan: &Plan, tables: &mut Arena) {
    let mut rows = vec![0u32];
    groups.nodes.iter().for_each(|g| rows.push(rows[rows.len() - 1] + g.len() as u32));
    tables.put("group_rows", &rows);
    tables.put("group_nodes", &groups.nodes.concat());
    tables.put("slice_starts", &slices[0]);
    tables.put("group_slices", &slices[1]);
    let arms = groups.arms(&plan.body, &vec![DVec3::ZERO; plan.body.nodes.len()]);
    // Numbers of groups are below zero, counted from -1 on, at nodes that do not move with theirs.
    let number = |(g, carried): (&u32, bool)| if carried { *g as f32 } else { -1.0 - *g as f32 };
    let numbers = groups.of_node.iter().zip(carried(plan)).map(number);
    let arms: Vec<[f32; 4]> = arms.iter().zip(numbers).map(|(a, g)| [a.x as f32, a.y as f32, a.z as f32, g]).collect();
    tables.put("arms", &arms);
}

/// Vectors of four numbers that C takes for so many groups.
pub(crate) fn vectors(groups: usize) -> usize {
    9 * groups * groups
}

/// Weights of stiffness and inertia in a stage; of the static problem without inertia.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Kind {
    length: f64,
    theta: f64,
}

/// Which C a member takes: the power of two nearest to its τ, or that of the static problem.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
enum Key {
    Static,
    Octave(i32),
}

/// The groups' matrices, and what was made of them.
#[derive(Clone, Debug)]
pub(crate) struct Coarse {
    groups: usize,
    /// Kinds of stages; the static problem comes before them.
    kinds: Vec<Kind>,
    starts_static: bool,
    /// K̂ and M̂; none until the stiffness is known.
    known: Option<[Mat<f64>; 2]>,
    keys: HashMap<Key, usize>,
    /// C of every key, as the device wants it.
    inverses: Vec<[f32; 4]>,
    on_device: Option<usize>,
}

impl Coarse {
    /// Of a plan whose stiffness is not known yet: until it is, block-Jacobi works alone.
    pub(crate) fn new(plan: &Plan, geometry: &Geometry) -> Coarse {
        let mut kinds: Vec<Kind> = Vec::new();
        for stage in plan.clock.stages() {
            let kind = Kind { length: stage.length, theta: stage.theta };
            if !kinds.contains(&kind) {
                kinds.push(kind);
            }
        }
        let starts_static = plan.initial == InitialShape::StaticEquilibrium;
        let groups = geometry.groups.len();
        Coarse { groups, kinds, starts_static, known: None, keys: HashMap::new(), inverses: Vec::new(), on_device: None }
    }

    /// Number of a stage's kind; 0 is the static problem.
    pub(crate) fn kind(&self, stage: &Stage) -> u32 {
        let same = |k: &Kind| k.length == stage.length && k.theta == stage.theta;
        1 + self.kinds.iter().position(same).unwrap_or(0) as u32
    }

    /// Learns the stiffness from a matrix of the device, `[blocks][9]` without inertia, at rest in a stage, for these parameters.
    pub(crate) fn learn(&mut self, plan: &Plan, geometry: &Geometry, stage: &Stage, physics: &Physics, values: &[f32]) {
        let unit = weights(physics, &Kind { length: stage.length, theta: stage.theta })[0];
        let arms = geometry.groups.arms(&plan.body, &vec![DVec3::ZERO; plan.body.nodes.len()]);
        let n = 6 * self.groups;
        let [mut stiffness, mut mass] = [(); 2].map(|()| Mat::<f64>::zeros(n, n));
        let of_node = &geometry.groups.of_node;
        let blocks = &geometry.blocks;
        let carried = carried(plan);
        let mut reach = vec![Mat::<f64>::zeros(6, 6); self.groups];
        for (i, volume) in plan.body.node_volume.iter().enumerate().filter(|(i, _)| carried[*i]) {
            let left = motions(arms[i]);
            add(&mut reach[of_node[i] as usize], [0, 0], &left, &left, |r, c| f64::from(u8::from(r == c)));
            let row = 6 * of_node[i] as usize;
            add(&mut mass, [row, row], &left, &left, |r, c| if r == c { *volume } else { 0.0 });
            for k in blocks.rows[i]..blocks.rows[i + 1] {
                let j = blocks.columns[k] as usize;
                if !carried[j] {
                    continue;
                }
                let at = [row, 6 * of_node[j] as usize];
                add(&mut stiffness, at, &left, &motions(arms[j]), |r, c| f64::from(values[9 * k + 3 * r + c]) / unit);
            }
        }
        [&mut stiffness, &mut mass].into_iter().for_each(|m| hold_still(m, &reach));
        let finite = (0..n).all(|j| (0..n).all(|i| stiffness[(i, j)].is_finite()));
        self.known = finite.then_some([stiffness, mass]);
    }

    /// What each member takes in each kind of stage: number of C, and a factor; `[kinds][B]`.
    pub(crate) fn choices(&mut self, batch: &[Physics]) -> Vec<[f32; 2]> {
        let mut out = Vec::with_capacity((1 + self.kinds.len()) * batch.len());
        for physics in batch {
            let factor = if self.starts_static { 1.0 / physics.youngs_modulus } else { 0.0 };
            out.push(self.choice(Key::Static, factor));
        }
        for kind in self.kinds.clone() {
            for physics in batch {
                let [stiffness, inertia] = weights(physics, &kind);
                let octave = (stiffness / inertia).log2().round();
                let key = Key::Octave(if octave.is_finite() { octave as i32 } else { 0 });
                out.push(self.choice(key, 1.0 / inertia));
            }
        }
        out
    }

    /// One of them. What makes no sense is left to block-Jacobi.
    fn choice(&mut self, key: Key, factor: f64) -> [f32; 2] {
        let sound = factor.is_finite() && factor > 0.0;
        let Some([stiffness, mass]) = self.known.as_ref().filter(|_| sound) else { return [0.0; 2] };
        let next = self.keys.len();
        let number = *self.keys.entry(key).or_insert_with(|| {
            self.inverses.extend(inverse(stiffness, mass, key, self.groups));
            next
        });
        [number as f32, factor as f32]
    }

    /// Brings what the device lacks there.
    ///
    /// # Errors
    /// More than the device has.
    pub(crate) fn upload<M: Maker>(&mut self, gpu: &M, to: &mut HashMap<&'static str, M::Buffer>) -> Result<(), GpuError> {
        if self.on_device != Some(self.keys.len()) {
            let nothing = vec![[0.0; 4]; vectors(self.groups)];
            to.insert("coarse", gpu.upload("coarse", if self.keys.is_empty() { &nothing } else { &self.inverses })?);
            self.on_device = Some(self.keys.len());
        }
        Ok(())
    }

    /// C of a number as rows of a matrix, for tests.
    #[cfg(test)]
    pub(crate) fn dense(&self, number: usize) -> Vec<Vec<f64>> {
        let g = self.groups;
        let start = number * vectors(g);
        let entry = |row: usize, column: usize| {
            let (target, source) = (row / 6, column / 6);
            let at = |which: usize, part: usize| f64::from(self.inverses[start + (9 * source + which) * g + target][part]);
            match (row % 6, column % 6) {
                (r @ 0..4, c) => at(c, r),
                (r, c) => at(6 + c / 2, 2 * (c % 2) + r - 4),
            }
        };
        (0..6 * g).map(|r| (0..6 * g).map(|c| entry(r, c)).collect()).collect()
    }

    /// Kinds of stages beside the static problem.
    pub(crate) fn kinds(&self) -> usize {
        self.kinds.len()
    }

    /// How many C a batch takes whose members are about as stiff as each other.
    pub(crate) fn usual(&self) -> usize {
        self.kinds.len() + usize::from(self.starts_static)
    }
}

/// Weights of stiffness [Pa] and of inertia [kg/m³/s²] in a stage.
fn weights(p: &Physics, kind: &Kind) -> [f64; 2] {
    let stiffness = p.youngs_modulus * (kind.theta + p.stiffness_damping / kind.length);
    [stiffness, p.density / (kind.theta * kind.length * kind.length)]
}

/// Rows of Q of a node: shift and turn of its group make it move so, [I, −[arm]×].
fn motions(arm: DVec3) -> [[f64; 6]; 3] {
    [[1.0, 0.0, 0.0, 0.0, arm.z, -arm.y], [0.0, 1.0, 0.0, -arm.z, 0.0, arm.x], [0.0, 0.0, 1.0, arm.y, -arm.x, 0.0]]
}

/// Adds Qᵢᵀ A Qⱼ of a block A at the place of two groups.
fn add(
    to: &mut Mat<f64>,
    [row, column]: [usize; 2],
    left: &[[f64; 6]; 3],
    right: &[[f64; 6]; 3],
    a: impl Fn(usize, usize) -> f64,
) {
    for r in 0..3 {
        for c in 0..3 {
            let value = a(r, c);
            if value == 0.0 {
                continue;
            }
            for (p, l) in left[r].iter().enumerate() {
                for (q, m) in right[c].iter().enumerate() {
                    to[(row + p, column + q)] += l * value * m;
                }
            }
        }
    }
}

/// Makes a matrix of the groups stiff along motions that move no node: nothing asks for them, and without it had no inverse. `reach`: QᵀQ of each
/// group.
fn hold_still(matrix: &mut Mat<f64>, reach: &[Mat<f64>]) {
    let n = matrix.nrows();
    let mean = (0..n).map(|i| matrix[(i, i)]).sum::<f64>() / n as f64;
    let weight = if mean > 0.0 { mean } else { 1.0 };
    for (g, reach) in reach.iter().enumerate() {
        let Ok(eigen) = reach.self_adjoint_eigen(Side::Lower) else { continue };
        let (values, vectors) = (eigen.S().column_vector(), eigen.U());
        // Ascending.
        for k in (0..6).filter(|k| values[*k] <= STILL * values[5]) {
            for p in 0..6 {
                for q in 0..6 {
                    matrix[(6 * g + p, 6 * g + q)] += weight * vectors[(p, k)] * vectors[(q, k)];
                }
            }
        }
    }
}

/// (A + shift diag A)⁻¹, unless A or what single precision makes of the inverse is not positive.
fn inverted(a: &Mat<f64>, shift: f64) -> Option<Mat<f64>> {
    let n = a.nrows();
    let more = |m: &Mat<f64>, part: f64| Mat::from_fn(n, n, |i, j| if i == j { m[(i, j)] * (1.0 + part) } else { m[(i, j)] });
    let c = more(a, shift).llt(Side::Lower).ok()?.inverse();
    let rounded = Mat::from_fn(n, n, |i, j| f64::from(c[(i, j)] as f32));
    more(&rounded, -ROUNDING).llt(Side::Lower).ok().map(|_| c)
}

/// C for a key, as the device wants it: `[from][9][to]` of `add_motion`; zero where there is none.
fn inverse(stiffness: &Mat<f64>, mass: &Mat<f64>, key: Key, groups: usize) -> Vec<[f32; 4]> {
    let n = stiffness.nrows();
    let entry = |i: usize, j: usize| match key {
        Key::Static => stiffness[(i, j)],
        Key::Octave(power) => mass[(i, j)] + f64::from(power).exp2() * stiffness[(i, j)],
    };
    // What rounding has left apart is put together.
    let a = Mat::from_fn(n, n, |i, j| 0.5 * (entry(i, j) + entry(j, i)));
    let mut out = vec![[0.0; 4]; vectors(groups)];
    let Some(c) = SHIFTS.iter().find_map(|shift| inverted(&a, *shift)) else { return out };
    for from in 0..groups {
        for to in 0..groups {
            let at = |row: usize, column: usize| c[(6 * to + row, 6 * from + column)] as f32;
            for column in 0..6 {
                let place = (9 * from + column) * groups + to;
                out[place] = [at(0, column), at(1, column), at(2, column), at(3, column)];
            }
            for pair in 0..3 {
                let place = (9 * from + 6 + pair) * groups + to;
                let [first, second] = [2 * pair, 2 * pair + 1];
                out[place] = [at(4, first), at(5, first), at(4, second), at(5, second)];
            }
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Rigid motions of two groups that springs hold at some of these nodes, by so much more than neighbours hold each other.
    fn plates(stiff: f64) -> Mat<f64> {
        let mut a = Mat::zeros(12, 12);
        for g in 0..2 {
            for (i, arm) in
                [DVec3::new(-0.4, 0.0, 0.1), DVec3::new(-0.4, 0.0, -0.1), DVec3::new(0.4, 0.1, 0.1)].into_iter().enumerate()
            {
                let own = motions(arm);
                let spring = if i < 2 { stiff } else { 1.0 };
                add(&mut a, [6 * g, 6 * g], &own, &own, |r, c| if r == c { spring } else { 0.0 });
            }
        }
        a
    }

    /// Whether C, as it is stored, is positive by more than single precision takes away.
    fn is_positive(c: &[[f32; 4]], groups: usize) -> bool {
        let coarse = Coarse {
            groups,
            kinds: Vec::new(),
            starts_static: false,
            known: None,
            keys: HashMap::new(),
            inverses: c.to_vec(),
            on_device: None,
        };
        let rows = coarse.dense(0);
        let less = |i: usize, j: usize| rows[i][j] * if i == j { 1.0 - ROUNDING } else { 1.0 };
        Mat::from_fn(6 * groups, 6 * groups, less).llt(Side::Lower).is_ok()
    }

    #[test]
    fn what_single_precision_has_no_room_for_is_made_less_soft() {
        let none = Mat::zeros(12, 12);
        for (stiff, plain) in [(10.0, true), (1e9, false)] {
            let a = plates(stiff);
            assert_eq!(inverted(&a, 0.0).is_some(), plain, "{stiff}");
            assert!(is_positive(&inverse(&a, &none, Key::Static, 2), 2), "{stiff}");
        }
    }

    #[test]
    fn motions_that_move_no_node_are_held() {
        // A group in a line, which does not turn about it, and one of no nodes.
        let line = [-0.3, 0.0, 0.1, 0.2].map(|x| motions(DVec3::new(x, 2.0 * x, -x)));
        let mut reach = [(); 2].map(|()| Mat::zeros(6, 6));
        line.iter().for_each(|own| add(&mut reach[0], [0, 0], own, own, |r, c| f64::from(u8::from(r == c))));
        let mut a = Mat::zeros(12, 12);
        line.iter().for_each(|own| add(&mut a, [0, 0], own, own, |r, c| if r == c { 3e4 } else { 0.0 }));
        let before = a.clone();
        hold_still(&mut a, &reach);
        let c = inverted(&a, 0.0).expect("positive");
        // No C is large, and what the nodes feel is what it was.
        assert!((0..12).all(|i| c[(i, i)] < 1e-2), "{c:?}");
        let felt =
            |a: &Mat<f64>, v: &[f64; 6]| -> f64 { (0..6).map(|p| (0..6).map(|q| v[p] * a[(p, q)] * v[q]).sum::<f64>()).sum() };
        let about = [0.0, 0.0, 0.0, 1.0, 2.0, -1.0];
        assert!(felt(&before, &about).abs() < 1e-6 && felt(&a, &about) > 1e3);
        line.iter().flatten().for_each(|row| assert!((felt(&a, row) / felt(&before, row) - 1.0).abs() < 1e-9));
    }
}

//! Which nodes touch which: the block pattern of the system matrix and the way into it.

use crate::plan::Plan;
use crate::space::body::Body;
use crate::space::stencil::Stencils;
use std::collections::BTreeMap;

/// Block-compressed rows over the simulation nodes (3 × 3 blocks), with the places where cells, ghost lines and point
/// masses add. The pattern is symmetric and every row's columns increase.
#[derive(Debug)]
pub struct Pattern {
    /// The blocks.
    pub blocks: BlockRows,
    /// Start of each node's entries in `cell_list`, shape `[N + 1]`.
    pub cell_rows: Vec<usize>,
    /// (cell, corner) pairs of each node, increasing.
    pub cell_list: Vec<(u32, u8)>,
    /// Start of each node's entries in `point_list`, shape `[N + 1]`.
    pub point_rows: Vec<usize>,
    /// (elastic point, place in its stencil) pairs of each node, increasing.
    pub point_list: Vec<(u32, u8)>,
    /// Row ranges that are assembled side by side; fixed by the size alone, so results do not depend on threads.
    pub parts: Vec<std::ops::Range<usize>>,
}

/// Block-compressed rows alone.
#[derive(Clone, Debug)]
pub struct BlockRows {
    /// Start of each row, shape `[N + 1]`.
    pub rows: Vec<usize>,
    /// Column of each block, increasing in a row.
    pub columns: Vec<u32>,
    /// Place of each diagonal block.
    pub diagonal: Vec<usize>,
}

impl BlockRows {
    /// Rows from lists of neighbours (with repetitions, each holding the row itself).
    pub fn new(mut neighbours: Vec<Vec<u32>>) -> BlockRows {
        for list in &mut neighbours {
            list.sort_unstable();
            list.dedup();
        }
        let mut rows = vec![0];
        let mut columns = Vec::with_capacity(neighbours.iter().map(Vec::len).sum());
        let mut diagonal = Vec::with_capacity(neighbours.len());
        for (a, list) in neighbours.iter().enumerate() {
            let own = list.binary_search(&(a as u32)).expect("every node belongs to a cell");
            diagonal.push(columns.len() + own);
            columns.extend_from_slice(list);
            rows.push(columns.len());
        }
        BlockRows { rows, columns, diagonal }
    }

    /// Number of block rows.
    pub fn len(&self) -> usize {
        self.diagonal.len()
    }

    /// True without rows.
    pub fn is_empty(&self) -> bool {
        self.diagonal.is_empty()
    }

    /// Place of block (a, b).
    pub fn find(&self, a: u32, b: u32) -> usize {
        let row = self.rows[a as usize]..self.rows[a as usize + 1];
        row.start + self.columns[row].binary_search(&b).expect("block is in the pattern")
    }
}

impl Pattern {
    /// The pattern of a body (27 neighbours in the bulk, and the ends of ghost lines).
    pub fn new(body: &Body) -> Pattern {
        Pattern::with(body, &[])
    }

    /// The pattern of a plan. Places of a body of points follow more of them than a star has: its surface, point masses and driven points.
    pub fn of(plan: &Plan) -> Pattern {
        let driven = plan.driven.iter().flatten().map(|d| &d.stencils);
        let beyond: Vec<&Stencils> = match plan.body.points.stars {
            Some(_) => [&plan.body.surface, &plan.masses].into_iter().chain(driven).collect(),
            None => Vec::new(),
        };
        Pattern::with(&plan.body, &beyond)
    }

    /// `beyond`: stencils whose nodes touch each other though no element has them.
    fn with(body: &Body, beyond: &[&Stencils]) -> Pattern {
        let n = body.nodes.len();
        let mut neighbours: Vec<Vec<u32>> = vec![Vec::with_capacity(33); n];
        let mut cells: Vec<Vec<(u32, u8)>> = vec![Vec::with_capacity(8); n];
        for (e, cell) in body.cells().iter().enumerate() {
            for (i, &a) in cell.nodes.iter().enumerate() {
                neighbours[a as usize].extend_from_slice(&cell.nodes);
                cells[a as usize].push((e as u32, i as u8));
            }
        }
        let mut points: Vec<Vec<(u32, u8)>> = vec![Vec::new(); n];
        for (e, nodes) in body.points.stencils.iter().map(|s| s.nodes).enumerate() {
            for (i, &a) in nodes.iter().enumerate() {
                points[a as usize].push((e as u32, i as u8));
            }
        }
        // All points of an element have the same nodes.
        for nodes in body.points.means().chain(beyond.iter().flat_map(|all| all.iter())).map(|s| s.nodes) {
            nodes.iter().for_each(|a| neighbours[*a as usize].extend_from_slice(nodes));
        }
        for ghost in body.ghosts() {
            for a in ghost.nodes {
                neighbours[a as usize].extend_from_slice(&ghost.nodes);
            }
        }
        let blocks = BlockRows::new(neighbours);
        let (cell_rows, cell_list) = joined(cells);
        let (point_rows, point_list) = joined(points);
        // About 300 rows are worth a task of their own; the blocks of cells that two parts share are set aside and added afterwards.
        let count = (n / 300).clamp(1, 16);
        let parts = (0..count).map(|p| p * n / count..(p + 1) * n / count).collect();
        Pattern { blocks, cell_rows, cell_list, point_rows, point_list, parts }
    }

    /// Number of nodes N.
    pub fn nodes(&self) -> usize {
        self.blocks.len()
    }

    /// Number of the part that a row belongs to.
    pub fn part_of(&self, row: usize) -> usize {
        self.parts.partition_point(|p| p.end <= row)
    }

    /// Places of all 64 blocks of a group of eight nodes, row by row.
    pub fn blocks8(&self, nodes: &[u32; 8]) -> [u32; 64] {
        std::array::from_fn(|k| self.blocks.find(nodes[k / 8], nodes[k % 8]) as u32)
    }
}

/// Lists in a row, and where each begins.
fn joined(lists: Vec<Vec<(u32, u8)>>) -> (Vec<usize>, Vec<(u32, u8)>) {
    let mut rows = vec![0];
    let mut all = Vec::with_capacity(lists.iter().map(Vec::len).sum());
    for list in lists {
        all.extend(list);
        rows.push(all.len());
    }
    (rows, all)
}

/// Places where a plan's terms add into the matrix.
#[derive(Debug)]
pub struct Places {
    /// Per cell, the 64 blocks of its nodes.
    pub cells: Vec<[u32; 64]>,
    /// Blocks that ghost lines add to, increasing, and the factor on the identity there: the sum over its lines.
    pub ghosts: Vec<(u32, f64)>,
    /// Blocks of the nodes of every elastic point.
    pub points: Squares,
    /// Blocks of the nodes of every surface patch.
    pub patches: Squares,
    /// Blocks of the nodes of every point mass.
    pub masses: Squares,
    /// Blocks of the nodes of every driven point, effect by effect.
    pub driven: Vec<Squares>,
}

impl Places {
    /// Looks every place up once.
    pub fn new(plan: &Plan, pattern: &Pattern) -> Places {
        Places {
            cells: plan.body.cells().iter().map(|c| pattern.blocks8(&c.nodes)).collect(),
            ghosts: ghosts(&plan.body, pattern),
            points: Squares::new(pattern, &plan.body.points.stencils),
            patches: Squares::new(pattern, &plan.body.surface),
            masses: Squares::new(pattern, &plan.masses),
            driven: plan
                .driven
                .iter()
                .map(|d| d.as_ref().map(|d| Squares::new(pattern, &d.stencils)).unwrap_or_default())
                .collect(),
        }
    }
}

/// Places of the blocks of all pairs of a stencil's nodes, stencil by stencil, row by row.
#[derive(Debug, Default)]
pub struct Squares {
    starts: Vec<u32>,
    places: Vec<u32>,
}

impl Squares {
    fn new(pattern: &Pattern, stencils: &Stencils) -> Squares {
        let mut all = Squares { starts: vec![0], places: Vec::new() };
        for s in stencils.iter() {
            let pairs = s.nodes.iter().flat_map(|a| s.nodes.iter().map(move |b| (*a, *b)));
            all.places.extend(pairs.map(|(a, b)| pattern.blocks.find(a, b) as u32));
            all.starts.push(all.places.len() as u32);
        }
        all
    }

    /// Blocks (a, b) of stencil `s` `[n · n]`.
    pub fn of(&self, s: usize) -> &[u32] {
        &self.places[self.starts[s] as usize..self.starts[s + 1] as usize]
    }
}

/// The ghost penalty's matrix for a unit scale, block by block.
fn ghosts(body: &Body, pattern: &Pattern) -> Vec<(u32, f64)> {
    const STENCIL: [f64; 3] = [1.0, -2.0, 1.0];
    let mut sums: BTreeMap<u32, f64> = BTreeMap::new();
    for line in body.ghosts() {
        for (i, a) in line.nodes.iter().enumerate() {
            for (j, b) in line.nodes.iter().enumerate() {
                *sums.entry(pattern.blocks.find(*a, *b) as u32).or_default() += line.weight * STENCIL[i] * STENCIL[j];
            }
        }
    }
    sums.into_iter().collect()
}

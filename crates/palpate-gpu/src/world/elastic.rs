//! Tables of bodies without cells: which elastic points and patches have a node or make a block, in a fixed order, and which nodes clamps hold.

use crate::device::Arena;
use crate::layout::{Holder, Pair};
use crate::stencils::StencilTable;
use palpate_model::plan::Plan;
use palpate_model::space::pattern::Pattern;

/// Lists in compressed rows.
#[derive(Debug, Default)]
pub(super) struct Lists<T> {
    rows: Vec<u32>,
    all: Vec<T>,
}

impl<T: Copy + bytemuck::NoUninit> Lists<T> {
    pub(super) fn new(lists: &[Vec<T>]) -> Lists<T> {
        let mut rows = vec![0];
        for list in lists {
            rows.push(rows[rows.len() - 1] + list.len() as u32);
        }
        Lists { rows, all: lists.concat() }
    }

    /// Adds rows and lists to an arena, by the names of their tables.
    pub(super) fn put(&self, [rows, all]: [&str; 2], tables: &mut Arena) {
        tables.put(rows, &self.rows);
        tables.put(all, &self.all);
    }

    /// Length of the longest.
    pub(super) fn longest(&self) -> u64 {
        self.rows.windows(2).map(|w| u64::from(w[1] - w[0])).max().unwrap_or(0)
    }
}

/// The tables; empty for a body of cells.
#[derive(Debug)]
pub(super) struct ElasticTables {
    /// Stencil and entry, by node.
    pub(super) of_node: Lists<[u32; 2]>,
    /// By block of the matrix.
    pub(super) of_block: Lists<Pair>,
    /// Clamps that hold a node.
    pub(super) holders: Lists<Holder>,
    volumes: Vec<f32>,
    /// Of stars, entries of γ A of the residual penalty [m], and where each star's begin.
    braces: Vec<f32>,
    brace_rows: Vec<u32>,
    /// Where the points end in each node's list of `of_node`.
    star_ends: Vec<u32>,
}

impl ElasticTables {
    /// Of a plan whose first `count` stencils, elastic points and patches, act on nodes.
    pub(super) fn new(plan: &Plan, pattern: &Pattern, stencils: &StencilTable, count: usize) -> ElasticTables {
        let has_points = !plan.body.points.is_empty();
        let [nodes, blocks] = [pattern.nodes(), pattern.blocks.columns.len()].map(|n| if has_points { n } else { 0 });
        let mut of_node = vec![Vec::new(); nodes];
        let mut of_block = vec![Vec::new(); blocks];
        let mut holders = vec![Vec::new(); nodes];
        for s in if has_points { 0..count } else { 0..0 } {
            let entries = stencils.rows[s]..stencils.rows[s + 1];
            let node = |k: u32| stencils.entries[k as usize].node;
            for row in entries.clone() {
                of_node[node(row) as usize].push([s as u32, row]);
                for column in entries.clone() {
                    let pair = Pair { stencil: s as u32, row, column };
                    of_block[pattern.blocks.find(node(row), node(column))].push(pair);
                }
            }
        }
        for (by, clamp) in (0u32..).zip(&plan.clamps) {
            for ((node, stiffness), area) in clamp.nodes.iter().zip(&clamp.areas) {
                holders[*node as usize].push(Holder { by, stiffness: *stiffness as f32, area: *area as f32 });
            }
        }
        let (mut braces, mut brace_rows) = (Vec::new(), Vec::new());
        if let Some(penalty) = &plan.body.points.stars {
            for star in 0..plan.body.points.len() {
                brace_rows.push(braces.len() as u32);
                braces.extend(penalty.of(star).iter().map(|a| (penalty.factor * a) as f32));
            }
        }
        let of_node = Lists::new(&of_node);
        let mut star_ends = Vec::new();
        if plan.body.points.stars.is_some() {
            let count = plan.body.points.len() as u32;
            let end = |rows: &[u32]| {
                rows[0] + of_node.all[rows[0] as usize..rows[1] as usize].partition_point(|at| at[0] < count) as u32
            };
            star_ends.extend(of_node.rows.windows(2).map(end));
        }
        ElasticTables {
            star_ends,
            braces,
            brace_rows,
            of_node,
            of_block: Lists::new(&of_block),
            holders: Lists::new(&holders),
            volumes: plan.body.points.volume.iter().map(|v| *v as f32).collect(),
        }
    }

    /// Most stars that have a node.
    pub(super) fn most_stars(&self) -> u64 {
        self.star_ends.iter().zip(&self.of_node.rows).map(|(end, first)| u64::from(end - first)).max().unwrap_or(0)
    }

    /// True where clamps hold nodes.
    pub(super) fn holds(&self) -> bool {
        !self.holders.all.is_empty()
    }

    /// Adds them to an arena.
    pub(super) fn put(&self, tables: &mut Arena) {
        tables.put("elastic_volumes", &self.volumes);
        tables.put("braces", &self.braces);
        tables.put("brace_rows", &self.brace_rows);
        tables.put("star_ends", &self.star_ends);
        self.of_node.put(["elastic_rows", "elastic_list"], tables);
        self.of_block.put(["pair_rows", "pairs"], tables);
        self.holders.put(["held_rows", "holders"], tables);
    }
}

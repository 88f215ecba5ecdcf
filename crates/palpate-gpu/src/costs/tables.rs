//! Tables of the band and of the markers' sites, each with its transpose, so that every sum gathers in a fixed order.

use crate::costs::shots::split;
use crate::device::pipelines::shared::structs::NONE;
use crate::layout::{BandCell, Site};
use crate::stencils::StencilTable;
use glam::{DMat3, DVec3};
use palpate_model::observation::{MarkerSite, ReadingKind};
use palpate_model::plan::Plan;

/// Rows of a sparse matrix: where each starts, which column, which value.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Rows<T> {
    pub(crate) starts: Vec<u32>,
    pub(crate) columns: Vec<u32>,
    pub(crate) values: Vec<T>,
}

impl<T: Copy> Rows<T> {
    /// Rows of a list of (row, column, value), in the list's order.
    pub(crate) fn new(count: usize, entries: &[(u32, u32, T)]) -> Rows<T> {
        let mut order: Vec<usize> = (0..entries.len()).collect();
        order.sort_by_key(|&e| entries[e].0);
        let starts = (0..=count).map(|r| order.partition_point(|&e| (entries[e].0 as usize) < r) as u32).collect();
        Rows {
            starts,
            columns: order.iter().map(|&e| entries[e].1).collect(),
            values: order.iter().map(|&e| entries[e].2).collect(),
        }
    }

    /// Length of the longest row.
    pub(crate) fn longest(&self) -> usize {
        self.starts.windows(2).map(|w| (w[1] - w[0]) as usize).max().unwrap_or(0)
    }
}

/// The band.
#[derive(Clone, Debug)]
pub(crate) struct BandTables {
    pub(crate) cells: Vec<BandCell>,
    pub(crate) sdf: Vec<f32>,
    /// Band cells by lattice place; `NONE` = none.
    pub(crate) lookup: Vec<u32>,
    /// Extension: rows are band nodes, columns simulation nodes.
    pub(crate) extend: Rows<f32>,
    /// Its transpose; columns are extended nodes.
    pub(crate) fold: Rows<f32>,
    /// Corners 8 · cell + i of every extended node.
    pub(crate) corners: Rows<()>,
}

impl BandTables {
    pub(crate) fn new(plan: &Plan) -> BandTables {
        let (body, band) = (&*plan.body, &plan.body.band);
        let n = body.nodes.len();
        let mut lookup = vec![NONE; band.grid.len()];
        let mut cells = Vec::with_capacity(band.cells.len());
        let mut corners = Vec::with_capacity(8 * band.cells.len());
        for (c, cell) in band.cells.iter().enumerate() {
            lookup[band.grid.index(cell.lattice)] = c as u32;
            let corner = split(band.grid.position(cell.lattice) - body.center)[0];
            cells.push(BandCell { nodes: cell.nodes, lattice: cell.lattice.map(|x| x as u32), pad: 0, corner });
            corners.extend((0..8).map(|i| (cell.nodes[i], (8 * c + i) as u32, ())));
        }
        let row = |p: usize| band.rows[p] as usize..band.rows[p + 1] as usize;
        let fold: Vec<(u32, u32, f32)> = (0..band.nodes.len())
            .flat_map(|p| row(p).map(move |k| (band.columns[k], (n + p) as u32, band.values[k] as f32)))
            .collect();
        BandTables {
            cells,
            sdf: band.cells.iter().flat_map(|c| c.sdf.map(|d| d as f32)).collect(),
            lookup,
            extend: Rows {
                starts: if band.rows.is_empty() { vec![0] } else { band.rows.clone() },
                columns: band.columns.clone(),
                values: band.values.iter().map(|v| *v as f32).collect(),
            },
            fold: Rows::new(n, &fold),
            corners: Rows::new(n + band.nodes.len(), &corners),
        }
    }
}

/// The sites of the markers of all recordings, one recording's after another's.
#[derive(Clone, Debug, Default)]
pub(crate) struct SiteTables {
    pub(crate) sites: Vec<Site>,
    /// Places and gradients.
    pub(crate) stencils: StencilTable,
    /// Of every recording: rows are nodes, columns its sites; values are entries of `stencils`.
    pub(crate) of_node: Vec<Rows<u32>>,
}

impl SiteTables {
    pub(crate) fn new(plan: &Plan) -> SiteTables {
        let mut tables = SiteTables::default();
        for recording in (0..plan.recordings()).map(|r| plan.recording(r)) {
            let mut transposed = Vec::new();
            for (s, site) in recording.observation.markers.iter().enumerate() {
                tables.sites.push(place(plan, site));
                let first = tables.stencils.entries.len() as u32;
                transposed.extend((first..).zip(&site.stencil.nodes).map(|(k, node)| (*node, s as u32, k)));
                tables.stencils.extend(std::iter::once(site.stencil.get()));
            }
            tables.of_node.push(Rows::new(plan.body.nodes.len(), &transposed));
        }
        tables
    }

    /// Sites at nodes, rows of all recordings one after the other: where each row starts, and pairs of site and entry.
    pub(crate) fn lists(&self) -> (Vec<u32>, Vec<[u32; 2]>) {
        let (mut starts, mut list): (Vec<u32>, Vec<[u32; 2]>) = (Vec::new(), Vec::new());
        for rows in &self.of_node {
            let first = list.len() as u32;
            starts.extend(rows.starts.iter().map(|s| s + first));
            list.extend(rows.columns.iter().zip(&rows.values).map(|(s, k)| [*s, *k]));
        }
        (starts, list)
    }
}

fn place(plan: &Plan, site: &MarkerSite) -> Site {
    let excess = site.carry(|i| plan.body.nodes[i]).1 - DMat3::IDENTITY;
    let column = |c: DVec3| split(c)[0];
    Site {
        stalk: site.stalk.as_vec3().to_array(),
        track: u32::from(site.kind == ReadingKind::Track),
        excess: [column(excess.x_axis), column(excess.y_axis), column(excess.z_axis)],
    }
}

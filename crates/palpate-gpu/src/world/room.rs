//! Work space of the solves: which buffers there are, and how large they are.

use super::limits::columns;
use crate::device::pipelines::shared::{elastic_asks, roster, solving, structs};
use crate::layout::{Health, Newton, Shape};

/// Bytes of a node's vector.
pub(crate) const VECTOR: u64 = 16;

/// One work buffer: name, items per member as a function of the shape, bytes per item.
type Work = (&'static str, fn(&Shape) -> u32, u64);

/// Work space per member.
const WORK: [Work; 27] = [
    ("increment", |s| s.nodes, VECTOR),
    ("solving", |s| SOLVING_VECTORS as u32 * s.nodes, VECTOR),
    ("trial", |s| s.nodes, VECTOR),
    ("residual", |s| 3 * s.nodes, VECTOR),
    ("old_force", |s| s.nodes, VECTOR),
    ("rhs", |s| s.nodes, VECTOR),
    ("column", |s| s.nodes, VECTOR),
    ("node_parts", |s| 2 * s.nodes.div_ceil(64), VECTOR),
    ("inverses", |s| 2 * s.nodes + s.groups, VECTOR),
    ("values", |s| 9 * s.blocks, 4),
    ("tangents", |s| structs::TANGENT_VECTORS * s.cells, VECTOR),
    ("cell_force", |s| 16 * s.cells, VECTOR),
    ("law_modes", |s| s.cells * modes(s.fields), VECTOR),
    ("old_stress", |s| 8 * s.cells, VECTOR),
    ("old_q", |s| if s.fields & structs::FIELD_MIXES == 0 { 0 } else { 8 * s.cells }, VECTOR),
    ("supports", |s| 3 * s.patches + 8 * s.holds, VECTOR),
    ("elastic_stress", |s| 3 * s.elastic, VECTOR),
    ("past_strains", |s| 2 * s.elastic, VECTOR),
    ("past_stretches", |s| if s.elastic == 0 || laws(s.fields) == 0 { 0 } else { 2 * s.elements }, VECTOR),
    ("reactions", |s| if s.held == 0 || s.fields & structs::FIELD_GRIPS == 0 { 0 } else { s.nodes }, VECTOR),
    ("shape_stress", |s| if s.fields & structs::FIELD_REST == 0 { 0 } else { 3 * s.elastic }, VECTOR),
    ("jet_sights", |s| s.jets * s.patches, VECTOR),
    ("jet_pictures", |s| s.jets, VECTOR),
    ("jet_seen", |s| s.jets * s.patches, 4),
    ("jet_forces", |s| s.jets.min(1) * s.patches, VECTOR),
    ("jet_turns", |s| s.jets.min(1) * 3 * s.patches, VECTOR),
    ("elastic_tangents", |s| elastic_asks::TANGENT_NUMBERS * s.elastic, 4),
];

/// The same per column of a member that is solved for at the same time as others.
const OF_COLUMN: [Work; 4] = [
    ("cg_sums", |s| solving::SCALARS + solving::OF_SLICE * s.slices + solving::OF_GROUP * s.groups, VECTOR),
    ("newton", |_| 1, size_of::<Newton>() as u64),
    ("meetings", |_| 3, 4),
    ("column_health", |_| 1, size_of::<Health>() as u64),
];

/// Vectors of a solve (`shared/solving.wgsl`), the solution first. Columns that are solved for together have their own; one alone uses those of
/// the work space.
pub(crate) const SOLVING: &str = "solving";
pub(crate) const SOLVING_VECTORS: u64 = solving::PARTS_OF_SOLVING as u64;

/// Vectors that laws of cells need per cell for the matrix (`shared/modes.wgsl`).
fn modes(fields: u32) -> u32 {
    match (fields >> structs::SCALARS_AT) & structs::MOST_SCALARS {
        0 => 0,
        n => 1 + 8 * (n + 2) + 2 * n,
    }
}

/// Number of laws of cells.
fn laws(fields: u32) -> u32 {
    (fields >> structs::LAWS_AT) & structs::MOST_COUNT
}

/// Sections of the roster, and kinds of items, of `list_members`.
pub(crate) const SECTIONS: usize = roster::SECTIONS as usize;
pub(crate) const KINDS: usize = roster::KINDS as usize;

/// Work buffers of a batch, with their bytes.
pub(crate) fn work(shape: &Shape, members: usize) -> Vec<(&'static str, u64)> {
    let systems = columns(members as u64) * members as u64;
    let each = WORK.iter().map(|w| (w, members as u64)).chain(OF_COLUMN.iter().map(|w| (w, systems)));
    let own = each.map(|((name, items, bytes), count)| (*name, u64::from(items(shape)) * bytes * count));
    let shared: [(&'static str, u64); 6] = [
        ("shape", size_of::<Shape>() as u64),
        ("roster", 4 * SECTIONS as u64 * (systems + 1)),
        ("arguments", 12 * (SECTIONS * KINDS) as u64),
        ("gate", 12),
        // Where listings that may not change `gate` write instead.
        ("no_gate", 12),
        // What passes find that no direction concerns.
        ("rates_tables", 0),
    ];
    own.chain(shared).collect()
}

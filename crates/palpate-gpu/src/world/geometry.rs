//! A plan's constant buffers: cells, lists for gathering, patches, clamps, masses.

use super::coarse;
use super::effects::Effects;
use super::elastic::ElasticTables;
use super::limits::{LOOPS, Most, check_loops};
use super::mass::MassTable;
use crate::device::pipelines::shared::structs::{FIELD_COUPLED, FIELD_MIXES, FIELD_STARS};
use crate::device::{Arena, GpuError, Maker};
use crate::layout::{Cell, Shape};
use crate::stencils::StencilTable;
use palpate_model::cutcells::elements::Classes;
use palpate_model::params::grips::within_reach;
use palpate_model::plan::{Plan, WORLD_SIZE};
use palpate_model::space::groups::Groups;
use palpate_model::space::pattern::{BlockRows, Pattern, Places};
use std::collections::HashMap;

/// Best relative accuracy of a Newton solve in single precision: three roundings of the forces. Where rounding is more, a step that no longer halves
/// the residual ends the solve.
const FINEST: f64 = 2e-7;
/// Most CG iterations of one solve; a solve that needs more is a symptom.
const MOST_ITERATIONS: usize = 2000;
/// Most CG iterations of one dispatch: the rest of a long chunk is lost when a member converges early in it.
const LONGEST_CHUNK: u64 = 512;

/// Host side of a plan's geometry.
#[derive(Debug)]
pub(crate) struct Geometry {
    pub(crate) shape: Shape,
    /// Iterations that workgroups which stay make in one dispatch, an even number.
    pub(crate) stay: u32,
    pub(crate) classes: Classes,
    /// (clamp, cell of the body) of every clamp cell in the device's order: all that a member may hold.
    pub(crate) holds: Vec<(usize, u32)>,
    pub(crate) effects: Effects,
    pub(crate) mass: MassTable,
    /// Groups of nodes of the preconditioner's second level.
    pub(crate) groups: Groups,
    pub(crate) blocks: BlockRows,
}

fn vec4(v: glam::DVec3, w: f64) -> [f32; 4] {
    [v.x as f32, v.y as f32, v.z as f32, w as f32]
}

impl Geometry {
    /// Uploads a plan's constants into `buffers`.
    ///
    /// # Errors
    /// The plan needs something this backend lacks, or more than the device has.
    pub(crate) fn new<M: Maker>(
        gpu: &M,
        plan: &Plan,
        members: usize,
        many: bool,
        buffers: &mut HashMap<&'static str, M::Buffer>,
    ) -> Result<Geometry, GpuError> {
        let effects = Effects::new(plan)?;
        let touched = !plan.planes.is_empty() || effects.on_patches();
        let stages = plan.clock.stages();
        let along = !plan.planes.is_empty() && stages.iter().any(|s| palpate_model::mechanics::contact::acts_along(s.theta));
        let mixes = stages.iter().any(|s| s.from.len() > 1);
        let coupled = along || effects.on_patches();
        let body = &plan.body;
        let n = body.nodes.len();
        let pattern = Pattern::of(plan);
        let places = Places::new(plan, &pattern);
        let classes = Classes::new(plan);
        let blocks = pattern.blocks.columns.len();

        let reach = |(i, s)| within_reach(plan, s).into_iter().map(move |cell| (i, cell));
        let mut holds: Vec<(usize, u32)> = plan.clamps.iter().enumerate().flat_map(reach).collect();
        holds.sort_by_key(|(i, cell)| (*cell, *i));
        let cells: Vec<Cell> = body
            .cells()
            .iter()
            .enumerate()
            .map(|(e, cell)| {
                let number = e as u32;
                Cell {
                    nodes: cell.nodes,
                    kind: classes.of_cell[e],
                    patch_start: body.patches.partition_point(|p| p.cell < number) as u32,
                    patch_end: if touched { body.patches.partition_point(|p| p.cell <= number) as u32 } else { 0 },
                    hold_start: holds.partition_point(|h| h.1 < number) as u32,
                    hold_end: holds.partition_point(|h| h.1 <= number) as u32,
                    fraction: classes.fractions[e] as f32,
                    whole: cell.fraction as f32,
                    pad: 0,
                }
            })
            .collect();
        let patches: Vec<[f32; 4]> = body.patches.iter().map(|p| vec4(p.point, p.area)).collect();
        let rest: Vec<[f32; 4]> = body.nodes.iter().zip(&body.node_volume).map(|(x, v)| vec4(*x, *v)).collect();
        let mut stencils = StencilTable::default();
        stencils.extend(body.points.stencils.iter());
        let first_patch = stencils.len() as u32;
        stencils.extend(body.surface.iter());
        let first_mass = stencils.len() as u32;
        stencils.extend(plan.masses.iter());
        let acting = if touched { first_mass } else { first_patch };
        let mass = MassTable::new(plan, &places, blocks);
        let elastic = ElasticTables::new(plan, &pattern, &stencils, acting as usize);

        let groups = coarse::groups(body, &pattern.blocks);
        let slices = coarse::slices(&groups);

        // Gathering lists: corners of each node, contributions of each block; both in the order of the cells.
        let node_rows: Vec<u32> = pattern.cell_rows.iter().map(|r| *r as u32).collect();
        let node_list: Vec<u32> = pattern.cell_list.iter().map(|(e, i)| 8 * e + u32::from(*i)).collect();
        let mut contributions: Vec<Vec<u32>> = vec![Vec::new(); blocks];
        for (e, at) in places.cells.iter().enumerate() {
            for (k, block) in at.iter().enumerate() {
                contributions[*block as usize].push(64 * e as u32 + k as u32);
            }
        }
        let mut place_rows = vec![0u32];
        for list in &contributions {
            place_rows.push(place_rows[place_rows.len() - 1] + list.len() as u32);
        }
        let mut ghosts = vec![0.0f64; blocks];
        places.ghosts.iter().for_each(|(block, factor)| ghosts[*block as usize] = *factor);
        let to_u32 = |v: &[usize]| -> Vec<u32> { v.iter().map(|x| *x as u32).collect() };
        let hold_sites: Vec<[u32; 2]> = holds.iter().map(|(i, cell)| [*cell, *i as u32]).collect();

        let frames = effects.frames(plan);
        let most = Most {
            members: members as u64,
            nodes: n as u64,
            row: (0..n).map(|a| pattern.blocks.rows[a + 1] - pattern.blocks.rows[a]).max().unwrap_or(0) as u64,
            supports: cells
                .iter()
                .map(|c| c.hold_end - c.hold_start + c.patch_end.saturating_sub(c.patch_start))
                .max()
                .unwrap_or(0)
                .into(),
            planes: plan.planes.len() as u64,
            obstacles: effects.moving()[0].into(),
            jets: effects.moving()[1].into(),
            patches: if effects.moving()[1] == 0 { 0 } else { patches.len() as u64 },
            frame: frames.most()[0],
            framed: frames.most()[1],
            pressed: if effects.on_contact() { plan.planes.len() as u64 } else { 0 },
            masses: plan.masses.len() as u64,
            stencil: stencils.longest() as u64,
            valence: elastic.of_node.longest(),
            stars: elastic.most_stars(),
            star: body.points.stencils.iter().map(|s| s.nodes.len()).max().unwrap_or(0) as u64,
            pairs: elastic.of_block.longest(),
            holders: elastic.holders.longest(),
            grips: effects.hold_numbers().iter().map(|n| u64::from(*n)).sum(),
            aging: effects.aging_rows.into(),
            groups: groups.len() as u64,
            group: groups.nodes.iter().map(Vec::len).max().unwrap_or(0) as u64,
            chunk: 1,
            stay: 0,
            many,
        };
        check_loops(&most)?;
        let chunk = (LOOPS / most.of_iteration()).clamp(1, LONGEST_CHUNK);
        let stay = 2 * (LOOPS / most.of_staying() / 2).min(LONGEST_CHUNK) as u32;
        let [rate_effects, rate_numbers] = effects.rate_places(plan);
        let [obstacles, jets] = effects.moving();
        let shape = Shape {
            members: 0,
            nodes: n as u32,
            cells: cells.len() as u32,
            blocks: blocks as u32,
            patches: if touched { patches.len() as u32 } else { 0 },
            holds: holds.len() as u32,
            clamps: plan.clamps.len() as u32,
            planes: plan.planes.len() as u32,
            masses: plan.masses.len() as u32,
            parameters: plan.layout.len() as u32,
            classes: classes.parts.len() as u32,
            steps: stages.len() as u32,
            h: body.length as f32,
            dt: plan.clock.step as f32,
            theta: plan.clock.theta as f32,
            world: (WORLD_SIZE * body.size()) as f32,
            pivot: [plan.pivot.x as f32, plan.pivot.y as f32, plan.pivot.z as f32],
            tolerance: plan.solver.tolerance.max(FINEST) as f32,
            iterations: 0,
            chunk: chunk as u32,
            most: MOST_ITERATIONS as u32,
            quantum: (0.25 * body.length).log2().floor().exp2() as f32,
            ghosts: u32::from(!body.ghosts().is_empty() && plan.solver.ghost != 0.0),
            fields: effects.bits
                | if coupled { FIELD_COUPLED } else { 0 }
                | if mixes { FIELD_MIXES } else { 0 }
                | if body.points.stars.is_some() { FIELD_STARS } else { 0 },
            time: plan.clock.step as f32,
            aging_rows: effects.aging_rows,
            point_items: n.max(if touched { patches.len() } else { 0 }) as u32,
            rate_numbers,
            rate_effects,
            first_patch,
            first_mass,
            elastic: body.points.len() as u32,
            held: u32::from(elastic.holds()),
            element_size: body.length as f32,
            elements: body.elements() as u32,
            per_element: body.points.per_element.max(1) as u32,
            groups: groups.len() as u32,
            coarse_kind: 0,
            group_size: groups.size as f32,
            slices: slices[0].len() as u32 - 1,
            crew: 0,
            obstacles,
            jets,
            patch_size: (body.area / body.patches.len().max(1) as f64).sqrt() as f32,
            moving_rows: effects.most_moving_rows(plan),
            contact_width: palpate_model::mechanics::contact::WIDTH as f32 * body.length as f32,
        };
        let mut tables = Arena::new("body_tables");
        tables.put("cells", &cells);
        let gradients: Vec<[f32; 4]> = classes.gradients.iter().flatten().map(|g| vec4(*g, 0.0)).collect();
        tables.put("mean_gradients", &gradients);
        tables.put("patches", &patches);
        tables.put("rest", &rest);
        stencils.put(&mut tables);
        elastic.put(&mut tables);
        mass.put(&mut tables);
        tables.put("node_rows", &node_rows);
        tables.put("node_list", &node_list);
        tables.put("block_rows", &to_u32(&pattern.blocks.rows));
        tables.put("columns", &pattern.blocks.columns);
        tables.put("diagonals", &to_u32(&pattern.blocks.diagonal));
        tables.put("place_rows", &place_rows);
        tables.put("places", &contributions.concat());
        tables.put("ghosts", &ghosts.iter().map(|g| *g as f32).collect::<Vec<_>>());
        coarse::put(&groups, &slices, plan, &mut tables);
        tables.put("effects", &effects.sites());
        tables.put("cell_effects", &effects.cell_sites());
        tables.put("holds", &hold_sites);
        effects.put_moving(plan, &mut tables);
        tables.upload(gpu, buffers)?;
        Ok(Geometry { shape, stay, classes, holds, effects, mass, groups, blocks: pattern.blocks })
    }
}

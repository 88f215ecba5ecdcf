//! Obstacles and nozzles that a file moves: their tables, and where they are over time, in double precision.

use super::Effects;
use crate::device::Arena;
use crate::layout::{Jet, MovingPose, Obstacle};
use crate::world::elastic::Lists;
use glam::{DMat3, DVec3};
use palpate_model::effects::moving::{self, Moving};
use palpate_model::effects::{Site, jet, obstacle};
use palpate_model::plan::{Physics, Plan};

/// Numbers of a [`MovingPose`].
const FLOATS: usize = size_of::<MovingPose>() / 4;
/// Rows of sums of a thing beside its own numbers: the start's time.
const MORE_ROWS: u32 = 1;

/// Things that move, in the device's order.
#[derive(Debug, Default)]
pub(super) struct Things {
    /// Obstacles: effect and first number among those of all.
    obstacles: Vec<(usize, u32)>,
    /// Nozzles, likewise.
    jets: Vec<(usize, u32)>,
}

impl Things {
    /// Adds the one of an effect of a plan, where there is one.
    pub(super) fn add(&mut self, plan: &Plan, effect: usize, site: &Site, first: u32) {
        match (site, of(plan, effect)) {
            (Site::Obstacle, Some(Moving { shape: Some(_), .. })) => self.obstacles.push((effect, first)),
            (Site::Jet, Some(_)) => self.jets.push((effect, first)),
            _ => {}
        }
    }

    fn all(&self) -> impl Iterator<Item = (usize, u32)> {
        self.obstacles.iter().chain(&self.jets).copied()
    }
}

/// What moves by an effect.
fn of(plan: &Plan, effect: usize) -> Option<&Moving> {
    plan.moving.get(effect).and_then(Option::as_deref)
}

fn vec4(v: DVec3) -> [f32; 4] {
    [v.x as f32, v.y as f32, v.z as f32, 0.0]
}

fn mat3(m: DMat3) -> [[f32; 4]; 3] {
    [m.x_axis, m.y_axis, m.z_axis].map(vec4)
}

/// Numbers of an effect.
fn count(plan: &Plan, effect: usize) -> u32 {
    plan.layout.effects().nth(effect).map_or(0, |e| e.1.len() as u32)
}

/// Stencils of the deformation gradient at patches, and which of them have a node.
#[derive(Debug, Default)]
pub(crate) struct Frames {
    rows: Vec<u32>,
    nodes: Vec<u32>,
    gradients: Vec<[f32; 4]>,
    /// Patch and entry, by node.
    of_node: Lists<[u32; 2]>,
}

impl Frames {
    fn new(plan: &Plan) -> Frames {
        let mut frames = Frames { rows: vec![0], ..Frames::default() };
        let mut of_node = vec![Vec::new(); plan.body.nodes.len()];
        for (patch, s) in (0..).zip(plan.frames.iter()) {
            for (node, g) in s.nodes.iter().zip(s.gradient) {
                of_node[*node as usize].push([patch, frames.nodes.len() as u32]);
                frames.nodes.push(*node);
                frames.gradients.push(vec4(*g));
            }
            frames.rows.push(frames.nodes.len() as u32);
        }
        Frames { of_node: Lists::new(&of_node), ..frames }
    }

    /// Most entries of a stencil, and most of a node.
    pub(crate) fn most(&self) -> [u64; 2] {
        [self.rows.windows(2).map(|w| u64::from(w[1] - w[0])).max().unwrap_or(0), self.of_node.longest()]
    }

    fn put(&self, tables: &mut Arena) {
        tables.put("frame_rows", &self.rows);
        tables.put("frame_nodes", &self.nodes);
        tables.put("frame_gradients", &self.gradients);
        self.of_node.put(["framed_rows", "framed_list"], tables);
    }
}

impl Effects {
    /// How many obstacles there are, and how many nozzles.
    pub(crate) fn moving(&self) -> [u32; 2] {
        [self.things.obstacles.len() as u32, self.things.jets.len() as u32]
    }

    /// Effects that move something, with the first row of their sums.
    pub(crate) fn moving_rows<'a>(&'a self, plan: &'a Plan) -> impl Iterator<Item = (usize, u32)> + 'a {
        self.things.all().scan(0, |rows, (effect, _)| {
            let first = *rows;
            *rows += count(plan, effect) + MORE_ROWS;
            Some((effect, first))
        })
    }

    /// Rows of all of them.
    pub(crate) fn most_moving_rows(&self, plan: &Plan) -> u32 {
        self.things.all().map(|(effect, _)| count(plan, effect) + MORE_ROWS).sum()
    }

    /// Adds the tables that all members share.
    pub(crate) fn put_moving(&self, plan: &Plan, tables: &mut Arena) {
        let mut rows = self.moving_rows(plan).map(|r| r.1);
        let (mut obstacles, mut coefficients) = (Vec::new(), Vec::new());
        for (effect, value) in &self.things.obstacles {
            let Some(shape) = of(plan, *effect).and_then(|m| m.shape.as_deref()) else { continue };
            let moving::Obstacle { distance, .. } = shape;
            let (low, counts, samples) = distance.lattice();
            obstacles.push(Obstacle {
                low: low.as_vec3().to_array(),
                spacing: distance.spacing() as f32,
                counts: counts.map(|n| n as u32),
                first: coefficients.len() as u32,
                value: *value,
                stride: self.stride,
                row: rows.next().unwrap_or_default(),
                pad: 0,
            });
            coefficients.extend(samples.iter().map(|c| *c as f32));
        }
        let nozzle = |(effect, value): &(usize, u32)| Jet {
            axis: of(plan, *effect).map_or(DVec3::ZERO, |m| m.axis).as_vec3().to_array(),
            value: *value,
            stride: self.stride,
            row: rows.next().unwrap_or_default(),
            pad: [0; 2],
        };
        let jets: Vec<Jet> = self.things.jets.iter().map(nozzle).collect();
        tables.put("obstacles", &obstacles);
        tables.put("distances", &coefficients);
        tables.put("jets", &jets);
        let normals: Vec<_> = plan.body.patches.iter().map(|p| vec4(p.normal)).collect();
        tables.put("patch_normals", if jets.is_empty() { &[] } else { &normals });
        self.frames(plan).put(tables);
    }

    /// How the body deforms at its patches, where jets ask for it.
    pub(crate) fn frames(&self, plan: &Plan) -> Frames {
        if self.things.jets.is_empty() { Frames::default() } else { Frames::new(plan) }
    }

    /// Numbers of the poses of `members`.
    pub(super) fn moving_size(&self, members: usize) -> usize {
        members * (self.steps + 1) * 2 * self.things.all().count() * FLOATS
    }

    /// Poses of all things, `[B][1 + stages][2][things]` of [`MovingPose`]: of obstacles at the end of a stage and at its beginning, of nozzles
    /// at the instant that forces are taken at, twice.
    pub(super) fn moving_poses(&self, plan: &Plan, batch: &[Physics]) -> Vec<f32> {
        let stages = plan.clock.stages();
        // End of a stage, its beginning, and the instant of the forces.
        let of_stages = stages.iter().map(|s| [s.time, s.time - s.length, s.time - (1.0 - s.theta) * s.length]);
        let instants: Vec<[f64; 3]> = std::iter::once([0.0; 3]).chain(of_stages).collect();
        let mut out: Vec<MovingPose> = Vec::new();
        for physics in batch {
            for [end, beginning, middle] in &instants {
                for at in [end, beginning] {
                    let values = |effect: usize, first: usize| DVec3::from_slice(&physics.effects[effect][first..first + 3]);
                    let obstacles =
                        self.things.obstacles.iter().map(|(e, _)| (*e, physics.start + at, values(*e, obstacle::OFFSET), false));
                    let jets = self.things.jets.iter().map(|(e, _)| (*e, physics.start + middle, values(*e, jet::OFFSET), true));
                    out.extend(
                        obstacles.chain(jets).map(|(effect, time, offset, turns)| pose(plan, effect, time, offset, turns)),
                    );
                }
            }
        }
        bytemuck::cast_slice(&out).to_vec()
    }
}

/// Pose of the thing of an effect at a time [s], shifted by an offset that stands in the world or, where it `turns` with the thing, in its coordinates.
fn pose(plan: &Plan, effect: usize, time: f64, offset: DVec3, turns: bool) -> MovingPose {
    let Some(moving) = of(plan, effect) else { return MovingPose::default() };
    let pose = moving.motion.pose(time);
    let (first, second) = if turns { (pose.rotation * moving.axis).any_orthonormal_pair() } else { (DVec3::ZERO, DVec3::ZERO) };
    let [shift, rate] = if turns { [pose.rotation * offset, pose.rotation_rate * offset] } else { [offset, DVec3::ZERO] };
    MovingPose {
        turn: mat3(pose.rotation),
        turn_rate: mat3(pose.rotation_rate),
        shift: vec4(pose.translation + shift),
        shift_rate: vec4(pose.velocity + rate),
        first: vec4(first),
        second: vec4(second),
    }
}

//! Tables of the frames: points sorted into cubes, markers sorted by site, observed displacements.

use crate::layout::{Mark, Shot};
use glam::DVec3;
use palpate_model::effects::sensors::Sensors;
use palpate_model::observation::Frame;
use palpate_model::plan::Plan;

/// Most cubes along y and z: a cell's loop over rows of cubes stays far below [`super::MOST_LOOPS`] with it.
const MOST_ACROSS: u32 = 40;
/// Part of the points, on either side, that may lie outside the lattice of cubes (in its outermost ones): strays must not
/// stretch it.
const STRAYS: f64 = 0.005;

/// A float and what it leaves of a vector.
pub(crate) fn split(v: DVec3) -> [[f32; 4]; 2] {
    let high = v.as_vec3();
    let rest = (v - high.as_dvec3()).as_vec3();
    [[high.x, high.y, high.z, 0.0], [rest.x, rest.y, rest.z, 0.0]]
}

/// Everything about frames.
#[derive(Clone, Debug, Default)]
pub(crate) struct Shots {
    pub(crate) shots: Vec<Shot>,
    /// Positions from their frame's origin, and the camera's number.
    pub(crate) points: Vec<[f32; 4]>,
    /// Which point of its frame each of `points` is.
    pub(crate) point_order: Vec<u32>,
    pub(crate) cube_starts: Vec<u32>,
    pub(crate) marks: Vec<Mark>,
    /// Which marker of its frame each of `marks` is.
    pub(crate) mark_order: Vec<u32>,
    /// First marker of each site, counted in the frame, `[F][sites + 1]`.
    pub(crate) mark_rows: Vec<u32>,
    pub(crate) measured: Vec<[f32; 4]>,
}

impl Shots {
    /// Of the recording as these sensors took it, `[sensors][F]`; markers and displacements are the same for all.
    pub(crate) fn of(plan: &Plan, sensors: &[Sensors]) -> Shots {
        let mut all = Shots::default();
        for s in sensors {
            all.add(plan, s);
        }
        all
    }

    fn add(&mut self, plan: &Plan, sensors: &Sensors) {
        let all = self;
        // Where markers are at rest: their goal is a displacement.
        let sites = &plan.observation.markers;
        let rest: Vec<DVec3> = sites.iter().map(|s| s.carry(|i| plan.body.nodes[i]).0 + s.stalk).collect();
        let count = plan.observation.frames.len();
        let first_camera = all.shots.len() / count.max(1) * plan.observation.cameras.len();
        for (frame, f) in plan.observation.frames.iter().enumerate() {
            let known = (all.shots.len() >= count).then(|| all.shots[frame]);
            let mut shot = Shot {
                point_start: all.points.len() as u32,
                point_count: f.points.len() as u32,
                marker_start: known.map_or(all.marks.len() as u32, |s| s.marker_start),
                marker_count: f.markers.len() as u32,
                node_start: known.map_or((all.measured.len() / 2) as u32, |s| s.node_start),
                node_count: node_count(plan, f) as u32,
                cube_start: all.cube_starts.len() as u32,
                ..Shot::default()
            };
            let moved = sensors.points(&plan.observation.cameras, &f.points);
            let points = moved.as_ref().unwrap_or(&f.points);
            let origin = points.iter().map(|p| p.position).sum::<DVec3>() / points.len().max(1) as f64;
            [shot.shift, shot.shift_rest] = split(origin - plan.body.center);
            let from: Vec<[f32; 3]> = points.iter().map(|p| (p.position - origin).as_vec3().to_array()).collect();
            let cubes = Cubes::new(&from, plan.body.length as f32);
            (shot.cubes, shot.low, shot.inverse_edge) = (cubes.size, cubes.low, cubes.inverse_edge);
            all.cube_starts.extend(cubes.starts.iter().map(|s| s + shot.point_start));
            for &i in &cubes.order {
                let [x, y, z] = from[i as usize];
                all.points.push([x, y, z, (first_camera + points[i as usize].camera as usize) as f32]);
            }
            all.point_order.extend(cubes.order);
            all.shots.push(shot);
            if known.is_some() {
                continue;
            }

            let mut order: Vec<u32> = (0..f.markers.len() as u32).collect();
            order.sort_by_key(|&m| f.markers[m as usize].site);
            for &m in &order {
                let marker = &f.markers[m as usize];
                let [goal, goal_rest] = split(marker.position - rest[marker.site as usize]).map(|[x, y, z, _]| [x, y, z]);
                all.marks.push(Mark { goal, site: marker.site, goal_rest, pad: 0 });
            }
            let before = |site: usize| order.partition_point(|&m| (f.markers[m as usize].site as usize) < site) as u32;
            all.mark_rows.extend((0..=sites.len()).map(before));
            all.mark_order.extend(order);
            all.measured.extend(measured(plan, f).into_iter().flatten());
        }
    }
}

/// Nodes that a frame's displacements are compared at: all of them as soon as one was seen.
pub(crate) fn node_count(plan: &Plan, frame: &Frame) -> usize {
    if frame.displacements.is_empty() { 0 } else { plan.body.nodes.len() }
}

/// Scalar residuals of a frame on the device, those of nodes that were not seen among them.
pub(crate) fn row_count(plan: &Plan, frame: &Frame) -> usize {
    frame.points.len() + 3 * (frame.markers.len() + node_count(plan, frame))
}

/// A frame's displacements node by node: a float with 1 where the node was seen, and what the float leaves.
fn measured(plan: &Plan, frame: &Frame) -> Vec<[[f32; 4]; 2]> {
    let mut all = vec![[[0.0; 4]; 2]; node_count(plan, frame)];
    for d in &frame.displacements {
        all[d.node as usize] = split(d.value);
        all[d.node as usize][0][3] = 1.0;
    }
    all
}

/// Points sorted by the cubes of a lattice, x fastest.
pub(crate) struct Cubes {
    pub(crate) size: [u32; 3],
    pub(crate) low: [f32; 3],
    pub(crate) inverse_edge: f32,
    /// First point of each cube, and one past the last.
    pub(crate) starts: Vec<u32>,
    pub(crate) order: Vec<u32>,
}

impl Cubes {
    /// Cubes of an edge [m], or of a larger one where there would be more than two a point.
    pub(crate) fn new(points: &[[f32; 3]], edge: f32) -> Cubes {
        let mut low = [0.0; 3];
        let mut extent = [0.0; 3];
        for a in 0..3 {
            let mut along: Vec<f32> = points.iter().map(|p| p[a]).collect();
            if !along.is_empty() {
                along.sort_by(f32::total_cmp);
                let skip = (STRAYS * along.len() as f64) as usize;
                low[a] = along[skip];
                extent[a] = along[along.len() - 1 - skip] - low[a];
            }
        }
        let most = (2 * points.len()).max(64) as f64;
        let mut edge = f64::from(edge);
        let mut size = [1; 3];
        // 600 enlargements pass the largest float; what is still too large then is not a number, and one cube holds all.
        for _ in 0..600 {
            let along = extent.map(|e| (f64::from(e) / edge).floor() + 1.0);
            let across = along[1].max(along[2]);
            if along[0] * along[1] * along[2] <= most && across <= f64::from(MOST_ACROSS) {
                size = along.map(|n| n as u32);
                break;
            }
            edge *= 1.25;
        }
        let inverse_edge = (1.0 / edge) as f32;
        let cube = |p: &[f32; 3]| {
            let c = [0, 1, 2].map(|a| ((p[a] - low[a]) * inverse_edge).floor().clamp(0.0, (size[a] - 1) as f32) as usize);
            (c[2] * size[1] as usize + c[1]) * size[0] as usize + c[0]
        };
        let mut starts = vec![0; (size[0] * size[1] * size[2]) as usize + 1];
        let of: Vec<usize> = points.iter().map(cube).collect();
        of.iter().for_each(|&c| starts[c + 1] += 1);
        for c in 1..starts.len() {
            starts[c] += starts[c - 1];
        }
        let mut order: Vec<u32> = (0..points.len() as u32).collect();
        order.sort_by_key(|&i| of[i as usize]);
        Cubes { size, low, inverse_edge, starts, order }
    }
}

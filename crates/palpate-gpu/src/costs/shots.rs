//! Tables of the frames of all recordings: points sorted into cubes, markers sorted by site, observed displacements.

use super::readings::most_sites;
use crate::layout::{Mark, Shot};
use glam::DVec3;
use palpate_model::cutcells::pullback::NOISE_REACH;
use palpate_model::effects::sensors::Sensors;
use palpate_model::observation::{Frame, Observation, ReadingKind};
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
    /// First marker of each site, counted in the frame, `[F][most sites + 1]`.
    pub(crate) mark_rows: Vec<u32>,
    pub(crate) measured: Vec<[f32; 4]>,
    /// First shot of every take.
    pub(crate) firsts: Vec<u32>,
}

/// A recording, by its number, as these sensors took it.
pub(crate) type Take = (usize, Sensors);

impl Shots {
    /// Of the takes; markers and displacements of a recording are the same in all of them.
    pub(crate) fn of(plan: &Plan, takes: &[Take]) -> Shots {
        let mut all = Shots::default();
        let (mut bare, mut sites): (Vec<Vec<Shot>>, u32) = (Vec::new(), 0);
        for number in 0..plan.recordings() {
            let recording = plan.recording(number).observation;
            let places = Shot {
                first_site: sites,
                node_rows: (number * (plan.body.nodes.len() + 1)) as u32,
                reach: (NOISE_REACH * recording.channel(ReadingKind::Depth).map_or(0.0, |c| c.noise)) as f32,
                ..Shot::default()
            };
            bare.push(all.add_vectors(plan, &recording, places));
            sites += recording.markers.len() as u32;
        }
        let mut cameras = 0;
        for (number, sensors) in takes {
            let recording = plan.recording(*number).observation;
            all.firsts.push(all.shots.len() as u32);
            all.add_points(plan, &recording, sensors, &bare[*number], cameras);
            cameras += recording.cameras.len();
        }
        all
    }

    /// Markers and displacements of a recording: its shots without points.
    fn add_vectors(&mut self, plan: &Plan, recording: &Observation, places: Shot) -> Vec<Shot> {
        // Where markers are at rest: their goal is a displacement.
        let sites = &recording.markers;
        let rest: Vec<DVec3> = sites.iter().map(|s| s.carry(|i| plan.body.nodes[i]).0 + s.stalk).collect();
        let mut shots = Vec::new();
        for f in &recording.frames {
            shots.push(Shot {
                marker_start: self.marks.len() as u32,
                marker_count: f.markers.len() as u32,
                node_start: (self.measured.len() / 2) as u32,
                node_count: node_count(plan, f) as u32,
                mark_start: self.mark_rows.len() as u32,
                ..places
            });
            let mut order: Vec<u32> = (0..f.markers.len() as u32).collect();
            order.sort_by_key(|&m| f.markers[m as usize].site);
            for &m in &order {
                let marker = &f.markers[m as usize];
                let [goal, goal_rest] = split(marker.position - rest[marker.site as usize]).map(|[x, y, z, _]| [x, y, z]);
                self.marks.push(Mark { goal, site: marker.site, goal_rest, pad: 0 });
            }
            let before = |site: usize| order.partition_point(|&m| (f.markers[m as usize].site as usize) < site) as u32;
            self.mark_rows.extend((0..=most_sites(plan)).map(before));
            self.mark_order.extend(order);
            self.measured.extend(measured(plan, f).into_iter().flatten());
        }
        shots
    }

    /// Points of a take, whose cameras begin at `first_camera`.
    fn add_points(&mut self, plan: &Plan, recording: &Observation, sensors: &Sensors, bare: &[Shot], first_camera: usize) {
        for (f, bare) in recording.frames.iter().zip(bare) {
            let mut shot = Shot {
                point_start: self.points.len() as u32,
                point_count: f.points.len() as u32,
                cube_start: self.cube_starts.len() as u32,
                ..*bare
            };
            let moved = sensors.points(&recording.cameras, &f.points);
            let points = moved.as_ref().unwrap_or(&f.points);
            let origin = points.iter().map(|p| p.position).sum::<DVec3>() / points.len().max(1) as f64;
            [shot.shift, shot.shift_rest] = split(origin - plan.body.center);
            let from: Vec<[f32; 3]> = points.iter().map(|p| (p.position - origin).as_vec3().to_array()).collect();
            let cubes = Cubes::new(&from, plan.body.length as f32);
            (shot.cubes, shot.low, shot.inverse_edge) = (cubes.size, cubes.low, cubes.inverse_edge);
            self.cube_starts.extend(cubes.starts.iter().map(|s| s + shot.point_start));
            for &i in &cubes.order {
                let [x, y, z] = from[i as usize];
                self.points.push([x, y, z, (first_camera + points[i as usize].camera as usize) as f32]);
            }
            self.point_order.extend(cubes.order);
            self.shots.push(shot);
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

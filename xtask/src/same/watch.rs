//! What is seen of a scene: its surface, markers and nodes carried along a motion that is written down, not simulated, so that a change
//! of the simulation leaves the measurement as it is.

use glam::{DQuat, DVec3};
use palpate_model::observation::{
    Camera, Channel, Frame, Observation, ObservedDisplacement, ObservedMarker, ObservedPoint, ReadingKind,
};
use palpate_model::plan::Plan;
use palpate_model::plan::build::{PlanError, build_plan};
use palpate_model::scene::Scene;
use palpate_model::shape::shape_of;

/// What is seen.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Seen {
    /// Depth points.
    Points,
    /// Markers.
    Markers,
    /// Points and markers.
    Both,
    /// The displacement of every node.
    Nodes,
}

/// Edge of the triangles whose corners are depth points, over the edge of a cell.
const SPACING: f64 = 0.8;

/// The plan of a scene of which `seen` is seen at these times [s].
pub fn watched(scene: &Scene, seen: Seen, times: &[f64]) -> Result<Plan, PlanError> {
    let noises = [(ReadingKind::Depth, 1e-3), (ReadingKind::Marker, 2e-3), (ReadingKind::Displacement, 5e-3)];
    let channels = noises.map(|(kind, noise)| Channel::new(kind, noise)).to_vec();
    let rests = scene.observation.as_ref().map_or(Vec::new(), |o| o.markers.clone());
    let body = build_plan(scene, Observation::default(), &[])?.body;
    let motion = Motion::of(scene, body.center);
    let surface = shape_of(&scene.object).surface(SPACING * body.length).vertices;
    // One on each side: every point is seen by the camera nearest to it.
    let cameras: Vec<Camera> =
        DVec3::AXES.into_iter().flat_map(|a| [a, -a]).map(|a| Camera::Pinhole { center: body.center + a, axis: -a }).collect();
    let point = |place: DVec3| {
        let away = |c: &u32| cameras[*c as usize].center().map_or(f64::INFINITY, |p| p.distance(place));
        ObservedPoint { position: place, camera: (0..6).min_by(|a, b| away(a).total_cmp(&away(b))).unwrap_or(0) }
    };
    let frame = |&time: &f64| {
        let mut frame = Frame { time, ..Frame::default() };
        if matches!(seen, Seen::Points | Seen::Both) {
            frame.points = surface.iter().map(|p| point(motion.carry(*p, time))).collect();
        }
        if matches!(seen, Seen::Markers | Seen::Both) {
            let marker = |(site, m): (u32, DVec3)| ObservedMarker { site, position: motion.carry(m, time) };
            frame.markers = (0..).zip(rests.iter().map(|m| m.position)).map(marker).collect();
        }
        if seen == Seen::Nodes {
            frame.displacements = ObservedDisplacement::of_all(body.nodes.iter().map(|p| motion.carry(*p, time) - *p));
        }
        frame
    };
    let frames = times.iter().map(frame).collect();
    build_plan(scene, Observation { channels, cameras: cameras.clone(), frames, ..Observation::default() }, &rests)
}

/// Free flight with spin where nothing is held, and a small shear in any case, so that no residual is zero.
struct Motion {
    center: DVec3,
    start: f64,
    velocity: DVec3,
    gravity: DVec3,
    spin: DVec3,
}

impl Motion {
    fn of(scene: &Scene, center: DVec3) -> Motion {
        let free = if scene.clamps.is_empty() { 1.0 } else { 0.0 };
        Motion {
            center,
            start: scene.time.start,
            velocity: free * scene.initial.velocity,
            gravity: free * scene.gravity,
            spin: free * scene.initial.angular_velocity,
        }
    }

    /// Where a point of the body at rest [m] is seen at a time [s].
    fn carry(&self, p: DVec3, time: f64) -> DVec3 {
        let (t, arm) = (time - self.start, p - self.center);
        let flown = self.velocity * t + 0.5 * self.gravity * (t * t);
        let shear = DVec3::new(0.02 * arm.z, -0.01 * arm.x, 0.03 * arm.y);
        self.center + flown + DQuat::from_scaled_axis(self.spin * t) * (arm + shear)
    }
}

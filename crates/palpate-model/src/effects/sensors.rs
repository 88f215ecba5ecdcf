//! The measurement effects of one member: undone before a recording is compared, applied when one is made.
//!
//! Effects act on a reading in the order of the scene and are undone in reverse.

use super::reading::{Reading, Seen};
use super::{Law, Numbered, Site, Unstated};
use crate::observation::{Camera, MarkerSite, Observation, ObservedPoint};
use crate::params::Layout;
use glam::{DAffine3, DMat3, DVec3};
use num_dual::Dual64;

/// Most parameters of a law of readings.
pub const MOST: usize = 8;

/// One effect on depth readings.
#[derive(Clone)]
struct Link {
    law: &'static Law,
    reading: &'static dyn Reading,
    /// The one camera that it concerns; `None` = all.
    camera: Option<u32>,
    /// Place of the first parameter in θ.
    at: usize,
    values: Vec<f64>,
}

/// An offset of one marker.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Offset {
    marker: u32,
    /// Place of the offset's x in θ.
    at: usize,
    value: DVec3,
}

/// The measurement effects of one member.
#[derive(Clone, Default)]
pub struct Sensors {
    links: Vec<Link>,
    /// Places in θ of the clocks' offsets, and their sum [s].
    clocks: Vec<usize>,
    ahead: f64,
    offsets: Vec<Offset>,
}

impl std::fmt::Debug for Sensors {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let links = self.links.iter().map(|l| (l.law.kind, &l.values));
        f.debug_list().entries(links).entry(&self.ahead).entries(&self.offsets).finish()
    }
}

impl Sensors {
    /// The measurement effects of a parameter vector `[P]`.
    pub fn new(layout: &Layout, theta: &[f64]) -> Sensors {
        let mut s = Sensors::default();
        for (law, range) in layout.effects() {
            let values = &theta[range.clone()];
            match law.site {
                Site::Readings(reading) => s.links.push(Link {
                    law,
                    reading,
                    camera: numbered(law, values, Numbered::Camera),
                    at: range.start,
                    values: values.to_vec(),
                }),
                Site::Clock => {
                    s.clocks.push(range.start);
                    s.ahead += values[0];
                }
                Site::Marker => s.offsets.push(Offset {
                    marker: numbered(law, values, Numbered::Marker).unwrap_or(0),
                    at: range.start + 1,
                    value: DVec3::from_slice(&values[1..4]),
                }),
                _ => {}
            }
        }
        s
    }

    /// Time that the stamps of frames are ahead by [s].
    pub fn ahead(&self) -> f64 {
        self.ahead
    }

    /// Places in θ of numbers that [`Sensors::ahead`] is the sum of.
    pub fn clocks(&self) -> &[usize] {
        &self.clocks
    }

    /// True when depth points lie where the recording has them.
    pub fn exact_points(&self) -> bool {
        self.links.is_empty()
    }

    fn links_of(&self, camera: u32) -> impl DoubleEndedIterator<Item = &Link> {
        self.links.iter().filter(move |l| l.camera.is_none_or(|c| c == camera))
    }

    fn undo(&self, seen: Seen<f64>, camera: u32) -> Seen<f64> {
        self.links_of(camera).rev().fold(seen, |s, l| l.reading.undo(s, &l.values))
    }

    /// What would have been read without the effects, which leave points without a line of sight where they are.
    pub fn truth(&self, camera: &Camera, point: &ObservedPoint) -> Seen<f64> {
        let seen = camera.sees(point.position);
        if *camera == Camera::Unknown { seen } else { self.undo(seen, point.camera) }
    }

    /// A frame's points where they truly were; `None` when that is where the recording has them.
    pub fn points(&self, cameras: &[Camera], points: &[ObservedPoint]) -> Option<Vec<ObservedPoint>> {
        let moved = |p: &ObservedPoint| -> ObservedPoint {
            ObservedPoint { position: self.truth(&cameras[p.camera as usize], p).position(), ..*p }
        };
        (!self.exact_points()).then(|| points.iter().map(moved).collect())
    }

    /// The cameras where they truly were.
    pub fn cameras(&self, cameras: &[Camera]) -> Vec<Camera> {
        let moved = |(number, c): (usize, &Camera)| {
            let at = |center: DVec3, axis: DVec3| self.undo(c.sees(center + axis), number as u32);
            match c {
                Camera::Pinhole { center, axis } => {
                    let seen = at(*center, *axis);
                    Camera::Pinhole { center: DVec3::from_array(seen.center), axis: DVec3::from_array(seen.axis) }
                }
                Camera::Scanner { center } => Camera::Scanner { center: DVec3::from_array(at(*center, DVec3::X).center) },
                Camera::Unknown => Camera::Unknown,
            }
        };
        cameras.iter().enumerate().map(moved).collect()
    }

    /// Calls `add` with every place in θ that moves a reading (as the recording has it) and ∂(true point)/∂θ there; places for which
    /// `wanted` is false are left out.
    pub fn point_slopes(
        &self,
        camera: &Camera,
        point: &ObservedPoint,
        wanted: impl Fn(usize) -> bool,
        mut add: impl FnMut(usize, DVec3),
    ) {
        if *camera == Camera::Unknown {
            return;
        }
        let mut before = camera.sees(point.position);
        let chain = || self.links_of(point.camera).rev();
        for (n, link) in chain().enumerate() {
            for (slot, p) in link.law.params.iter().enumerate() {
                if !wanted(link.at + slot) || matches!(p.default, Unstated::Choice(_)) {
                    continue;
                }
                let lift = |l: &Link| {
                    let mut z = [Dual64::from(0.0); MOST];
                    z.iter_mut().zip(&l.values).for_each(|(z, v)| z.re = *v);
                    z
                };
                let mut z = lift(link);
                z[slot].eps = 1.0;
                let mut seen = link.reading.undo_dual(before.lift(), &z);
                for later in chain().skip(n + 1) {
                    seen = later.reading.undo_dual(seen, &lift(later));
                }
                add(link.at + slot, DVec3::from_array(seen.point.map(|x| x.eps)));
            }
            before = link.reading.undo(before, &link.values);
        }
    }

    /// Depth that a camera reads for a point at its true depth: `camera` is where the camera truly is.
    pub fn read(&self, camera: &Camera, number: u32, point: DVec3) -> f64 {
        self.links_of(number).fold(camera.sees(point), |s, l| l.reading.apply(s, &l.values)).depth()
    }

    /// Pose (camera to world) that a recording states for a camera that truly is at `pose`.
    pub fn stated_pose(&self, number: u32, pose: DAffine3) -> DAffine3 {
        moved(pose, |seen| self.links_of(number).fold(seen, |s, l| l.reading.apply(s, &l.values)))
    }

    /// Where a camera truly is that a recording states at `pose`; the inverse of [`Sensors::stated_pose`].
    pub fn true_pose(&self, number: u32, pose: DAffine3) -> DAffine3 {
        moved(pose, |seen| self.undo(seen, number))
    }

    /// Offset of a marker [m].
    pub fn marker_offset(&self, marker: u32) -> DVec3 {
        self.offsets.iter().filter(|o| o.marker == marker).map(|o| o.value).sum()
    }

    /// Places in θ of the three components of offsets of a marker.
    pub fn marker_places(&self, marker: u32) -> impl Iterator<Item = usize> + '_ {
        self.offsets.iter().filter(move |o| o.marker == marker).map(|o| o.at)
    }

    /// A site as its marker truly sits.
    pub fn site<'a>(&self, observation: &'a Observation, marker: u32) -> std::borrow::Cow<'a, MarkerSite> {
        let site = &observation.markers[marker as usize];
        let offset = self.marker_offset(marker);
        if offset == DVec3::ZERO {
            return std::borrow::Cow::Borrowed(site);
        }
        std::borrow::Cow::Owned(MarkerSite { stalk: site.stalk + offset, ..site.clone() })
    }
}

/// A camera's pose after what moves its readings.
fn moved(pose: DAffine3, by: impl Fn(Seen<f64>) -> Seen<f64>) -> DAffine3 {
    // A law that moves the camera turns every direction fixed to it as it turns the axis.
    let along = |axis: DVec3| by(Camera::Pinhole { center: pose.translation, axis }.sees(pose.translation + axis));
    let m = pose.matrix3;
    let [x, y, z] = [m.x_axis, m.y_axis, m.z_axis].map(|a| DVec3::from_array(along(a).axis));
    let center = DVec3::from_array(along(m.z_axis).center);
    DAffine3::from_mat3_translation(DMat3::from_cols(x, y, z), center)
}

/// The number that an effect chooses, `None` when it has no such choice.
fn numbered(law: &Law, values: &[f64], of: Numbered) -> Option<u32> {
    law.params.iter().zip(values).find(|(p, _)| p.default == Unstated::Choice(of)).map(|(_, v)| *v as u32)
}

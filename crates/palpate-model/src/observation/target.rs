//! Targets: where points of a body shall be at some times, so that a design can be fitted to a wish instead of a recording.

use super::{Channel, Frame, Observation, ObservedMarker, ReadingKind, TrackRest};
use glam::DVec3;

/// Points of the body and where they shall be at one time.
#[derive(Clone, Debug, PartialEq)]
pub struct Target {
    /// Places at rest [m].
    pub points: Vec<DVec3>,
    /// Where they shall be [m], one for each.
    pub positions: Vec<DVec3>,
    /// When [s].
    pub time: f64,
    /// Standard deviation that is as good as met [m], of each coordinate. The channel has that of the first target.
    pub tolerance: f64,
}

impl Observation {
    /// What a recording that meets the targets would hold: one channel of tracked points.
    pub fn of_targets(targets: &[Target]) -> Observation {
        let (mut o, mut first) = (Observation::default(), 0);
        let common = targets.first().map(|t| t.tolerance);
        for t in targets {
            let markers = t.positions.iter().enumerate();
            let markers = markers.map(|(k, position)| ObservedMarker { site: (first + k) as u32, position: *position }).collect();
            o.frames.push(Frame {
                time: t.time,
                markers,
                noise: Some(t.tolerance).filter(|own| Some(*own) != common),
                ..Frame::default()
            });
            first += t.points.len();
        }
        o.tracks = TrackRest { places: targets.iter().flat_map(|t| t.points.iter().copied()).collect(), tolerance: None };
        o.channels.extend(targets.first().map(|t| Channel::new(ReadingKind::Track, t.tolerance)));
        o.frames.sort_by(|a, b| a.time.total_cmp(&b.time));
        o.frames.dedup_by(|later, first| {
            let same = (later.time, later.noise, later.drift) == (first.time, first.noise, first.drift);
            if same {
                first.markers.append(&mut later.markers);
            }
            same
        });
        o
    }
}

//! Which frames belong to a step, and where on the cubic Hermite curve through both ends of the step each is read.

use super::view::Recording;

/// Place of a frame inside a step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Instant {
    /// Number of the frame.
    pub frame: usize,
    /// Factors of u₀, v₀, u₁, v₁.
    pub value: [f64; 4],
    /// Derivatives of the factors by time [1/s]; zero where the state is held.
    pub rate: [f64; 4],
}

/// Frames that belong to step k of a simulation in steps of `dt` [s] that starts at `start` on the recording's clock.
pub fn instants(recording: &Recording, dt: f64, start: f64, k: usize) -> Vec<Instant> {
    let (frames, steps) = (&recording.observation.frames, recording.steps);
    if steps == 0 {
        let hold = |frame| Instant { frame, value: [1.0, 0.0, 0.0, 0.0], rate: [0.0; 4] };
        return (0..frames.len()).map(hold).collect();
    }
    let place = |time: f64| {
        let x = (time - start) / dt;
        // A frame on a step boundary belongs to the step that ends there, also after rounding.
        let x = if (x - x.round()).abs() < 1e-9 { x.round() } else { x };
        let step = (x.ceil() - 1.0).clamp(0.0, steps as f64 - 1.0);
        (step as usize, x - step)
    };
    let first = frames.partition_point(|f| place(f.time).0 < k);
    let last = frames.partition_point(|f| place(f.time).0 <= k);
    (first..last)
        .map(|frame| {
            let s = place(frames[frame].time).1;
            if let Some(drift) = frames[frame].drift {
                return drifting(frame, s, dt, drift);
            }
            if s < 0.0 {
                return Instant { frame, value: [1.0, 0.0, 0.0, 0.0], rate: [0.0; 4] };
            }
            if s > 1.0 {
                return Instant { frame, value: [0.0, 0.0, 1.0, 0.0], rate: [0.0; 4] };
            }
            let (s2, s3) = (s * s, s * s * s);
            Instant {
                frame,
                value: [2.0 * s3 - 3.0 * s2 + 1.0, (s3 - 2.0 * s2 + s) * dt, -2.0 * s3 + 3.0 * s2, (s3 - s2) * dt],
                rate: [(6.0 * s2 - 6.0 * s) / dt, 3.0 * s2 - 4.0 * s + 1.0, (-6.0 * s2 + 6.0 * s) / dt, 3.0 * s2 - 2.0 * s],
            }
        })
        .collect()
}

/// Frames that belong to step k of a sequence of states at `times` [s], of which there are two at least: every frame is the state nearest in
/// time, and nothing lies between states. The first step has the frames of both its ends.
pub fn instants_at(recording: &Recording, times: &[f64], k: usize) -> Vec<Instant> {
    let last = recording.steps.min(times.len() - 1);
    let state = |time: f64| {
        let next = times[..=last].partition_point(|t| *t < time).min(last);
        if next > 0 && time - times[next - 1] < times[next] - time { next - 1 } else { next }
    };
    let held = |frame: usize| {
        let value = match state(recording.observation.frames[frame].time) {
            0 if k == 0 => [1.0, 0.0, 0.0, 0.0],
            s if s == k + 1 => [0.0, 0.0, 1.0, 0.0],
            _ => return None,
        };
        Some(Instant { frame, value, rate: [0.0; 4] })
    };
    (0..recording.observation.frames.len()).filter_map(held).collect()
}

/// A frame that compares velocities, `drift` seconds of them, at s of a step; what is held does not move.
fn drifting(frame: usize, s: f64, dt: f64, drift: f64) -> Instant {
    if !(0.0..=1.0).contains(&s) {
        return Instant { frame, value: [0.0; 4], rate: [0.0; 4] };
    }
    let value = [(6.0 * s * s - 6.0 * s) / dt, 3.0 * s * s - 4.0 * s + 1.0, (6.0 * s - 6.0 * s * s) / dt, 3.0 * s * s - 2.0 * s];
    let rate = [(12.0 * s - 6.0) / (dt * dt), (6.0 * s - 4.0) / dt, (6.0 - 12.0 * s) / (dt * dt), (6.0 * s - 2.0) / dt];
    Instant { frame, value: value.map(|v| drift * v), rate: rate.map(|r| drift * r) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::observation::{Frame, Observation};
    use std::sync::Arc;

    #[test]
    fn a_drifting_frame_sees_the_velocity_of_the_cubic() {
        let dt = 0.1;
        let frame = |time: f64, drift| Frame { time, drift, ..Frame::default() };
        let times = [0.13, 0.15, 0.2];
        let mut frames: Vec<Frame> = times.iter().map(|t| frame(*t, Some(0.4))).collect();
        frames.push(frame(0.9, Some(0.4)));
        let recording = Recording { observation: Arc::new(Observation { frames, ..Observation::default() }), steps: 4 };
        // u = t³ in the second step, from 0.1 s to 0.2 s.
        let [a, b] = [0.1f64, 0.2];
        let ends = [a.powi(3), 3.0 * a * a, b.powi(3), 3.0 * b * b];
        let seen = |f: [f64; 4]| -> f64 { f.iter().zip(ends).map(|(f, u)| f * u).sum() };
        let all = instants(&recording, dt, 0.0, 1);
        assert_eq!(all.len(), 3);
        for (i, t) in all.iter().zip(times) {
            assert!((seen(i.value) - 0.4 * 3.0 * t * t).abs() < 1e-14, "{t}");
            assert!((seen(i.rate) - 0.4 * 6.0 * t).abs() < 1e-13, "{t}");
        }
        assert_eq!(instants(&recording, dt, 0.0, 3)[0].value, [0.0; 4]);
    }

    #[test]
    fn frames_of_a_sequence_are_its_states() {
        let times = [0.0, 0.4, 1.7, 2.0];
        let frames = [1e-12, 0.4, 1.69, 2.5].map(|time| Frame { time, ..Frame::default() }).to_vec();
        let recording = Recording { observation: Arc::new(Observation { frames, ..Observation::default() }), steps: 3 };
        let of = |k: usize| instants_at(&recording, &times, k).iter().map(|i| (i.frame, i.value)).collect::<Vec<_>>();
        let end = [0.0, 0.0, 1.0, 0.0];
        assert_eq!(of(0), [(0, [1.0, 0.0, 0.0, 0.0]), (1, end)]);
        assert_eq!((of(1), of(2)), (vec![(2, end)], vec![(3, end)]));
    }
}

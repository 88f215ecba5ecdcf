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

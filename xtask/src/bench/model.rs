//! Time of a step on a graphics processor that is not at hand, from what a step comes to: dispatches and bytes.

use serde::{Deserialize, Serialize};

/// A graphics processor as the model sees it.
#[derive(Clone, Copy, Debug)]
pub struct Card {
    /// Its name.
    pub name: &'static str,
    /// A dispatch that has something to do, with the barrier before it [s].
    pub launch: f64,
    /// A dispatch of no workgroups [s].
    pub empty: f64,
    /// A meeting of workgroups that stay [s].
    pub meeting: f64,
    /// Recording a dispatch on the host [s].
    pub record: f64,
    /// Bandwidth that kernels like ours draw [bytes/s].
    pub bandwidth: f64,
    /// What a single workgroup draws [bytes/s].
    pub one: f64,
}

/// An H100 with 80 GB of HBM3. bench/bench-h100-2026-11-26.json has some 6 µs for a dispatch of an iteration of a small body, whatever it computes.
/// A meeting is an atomic count and looks at it through the second-level cache, some 0.7 µs each way; nobody has timed one. Empty dispatches and
/// recording as they were counted with this engine's recorder; two thirds of 3.35 TB/s; a workgroup has one of 132
/// multiprocessors.
pub const H100: Card =
    Card { name: "H100", launch: 6.0e-6, empty: 1.2e-6, meeting: 2.0e-6, record: 2.1e-6, bandwidth: 2.2e12, one: 2.2e12 / 132.0 };

/// What a step of a batch comes to, on average over the steps that were counted.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Counts {
    /// Steps that were counted.
    pub steps: usize,
    /// Iterations of Newton's method, of the member that takes the most.
    pub newton: f64,
    /// Iterations of conjugate gradients for all of them, likewise.
    pub linear: f64,
    /// Iterations for the adjoint, likewise.
    pub adjoint: f64,
    /// Dispatches recorded for a step forward.
    pub recorded: f64,
    /// Those with something to do.
    pub live: f64,
    /// Meetings of workgroups that stay for all iterations of a solve, where they do.
    #[serde(default)]
    pub meetings: f64,
    /// Host's time to record and hand over a step [s].
    pub host: f64,
    /// Numbers that a step of all members reads and writes, each pass by itself [bytes].
    pub bytes: f64,
}

/// What the model makes of counts.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Modelled {
    /// Time on the device of a step of the whole batch [s].
    pub device: f64,
    /// Time that the host records, beside it [s].
    pub host: f64,
}

impl Card {
    /// Time of a step.
    pub fn step(&self, c: &Counts) -> Modelled {
        let waits = c.live * self.launch + (c.recorded - c.live).max(0.0) * self.empty + c.meetings * self.meeting;
        let device = waits + c.bytes / self.bandwidth;
        Modelled { device, host: c.recorded.max(c.live) * self.record }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_step_is_launches_meetings_and_bytes() {
        let counts = Counts { recorded: 700.0, live: 600.0, meetings: 50.0, bytes: 4.4e8, ..Counts::default() };
        let m = H100.step(&counts);
        assert!((m.device - (600.0 * 6.0e-6 + 100.0 * 1.2e-6 + 50.0 * 2.0e-6 + 2e-4)).abs() < 1e-12);
        assert!((m.host - 1.47e-3).abs() < 1e-12);
    }
}

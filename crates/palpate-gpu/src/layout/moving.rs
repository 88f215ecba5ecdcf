//! Rigid things that a file moves.

use bytemuck::{Pod, Zeroable};

/// Pose of a thing that moves, x ↦ R x + b, and its rates.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct MovingPose {
    /// Columns of R.
    pub turn: [[f32; 4]; 3],
    /// Columns of dR/dt [1/s].
    pub turn_rate: [[f32; 4]; 3],
    /// b [m], with a member's offset.
    pub shift: [f32; 4],
    /// db/dt [m/s].
    pub shift_rate: [f32; 4],
    /// Across the axis of a nozzle, in the world.
    pub first: [f32; 4],
    /// Across both.
    pub second: [f32; 4],
}

/// An obstacle's lattice of distances, and where its numbers stand.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct Obstacle {
    /// Place of the first sample in its own coordinates [m].
    pub low: [f32; 3],
    /// Distance of samples [m].
    pub spacing: f32,
    /// Samples along every axis.
    pub counts: [u32; 3],
    /// Its first coefficient among all.
    pub first: u32,
    /// Its first number among those of all effects.
    pub value: u32,
    /// Numbers of all effects of a member.
    pub stride: u32,
    /// Its first row of sums.
    pub row: u32,
    /// Fills up.
    pub pad: u32,
}

/// A nozzle, and where the numbers of its jet stand.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct Jet {
    /// Unit vector that it blows along, in its own coordinates.
    pub axis: [f32; 3],
    /// Its first number among those of all effects.
    pub value: u32,
    /// Numbers of all effects of a member.
    pub stride: u32,
    /// Its first row of sums.
    pub row: u32,
    /// Fills up.
    pub pad: [u32; 2],
}

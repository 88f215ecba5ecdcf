//! Structs of the observation: twins of `shaders/shared/{look,found,hexahedron}.wgsl` and `shaders/costs/markers.wgsl`.

use bytemuck::{Pod, Zeroable};

/// Sizes and constants of what is observed.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct Sight {
    /// Members B of the batch.
    pub members: u32,
    /// Simulation nodes N.
    pub nodes: u32,
    /// Simulation and band nodes.
    pub extended: u32,
    /// Band cells.
    pub cells: u32,
    /// Looks that scratch buffers hold.
    pub slots: u32,
    /// Most points of a frame.
    pub points: u32,
    /// Most scalar residuals of a frame.
    pub rows: u32,
    /// Most markers of a frame.
    pub markers: u32,
    /// Groups of eight lanes that share a cell's candidates.
    pub stripes: u32,
    /// Most marker sites of a recording.
    pub sites: u32,
    /// Most frames F of a recording.
    pub frames: u32,
    /// Parameters P.
    pub parameters: u32,
    /// Lattice nodes along each axis.
    pub lattice: [u32; 3],
    /// Parameters that are offsets of markers.
    pub offsets: u32,
    /// Edge of a cell [m].
    pub h: f32,
    /// Half width of the cost's band [m].
    pub band: f32,
    /// Cosine beyond which a side is turned away.
    pub turned_away: f32,
    /// Numbers that move depth readings.
    pub readings: u32,
}

/// One frame, seen by one member.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct Look {
    /// Member.
    pub member: u32,
    /// Frame.
    pub frame: u32,
    /// Shot.
    pub shot: u32,
    /// Fills up.
    pub pad: u32,
    /// Factors of u₀, v₀, u₁, v₁.
    pub value: [f32; 4],
    /// Their derivatives by time [1/s].
    pub rate: [f32; 4],
    /// 1/(n σ²) of depth points, markers, tracked points and observed displacements [1/m²].
    pub weights: [f32; 4],
}

/// A point of a frame, as a look found it.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct Found {
    /// Place in its cell.
    pub xi: [f32; 3],
    /// Deformed distance [m].
    pub phi: f32,
    /// World gradient of the deformed distance.
    pub gradient: [f32; 3],
    /// Band cell, or `NONE`.
    pub cell: u32,
}

/// A marker at one look.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct Carried {
    /// Columns of its rotation.
    pub turn: [[f32; 4]; 3],
    /// Columns of G⁻¹ of the polar decomposition.
    pub pair: [[f32; 4]; 3],
    /// dJ/d(position).
    pub pull: [f32; 4],
    /// w of the gradient by F = R \[w\]×.
    pub spin: [f32; 4],
}

/// One frame: where its parts lie, and the lattice of cubes that its points are sorted by.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct Shot {
    /// First point.
    pub point_start: u32,
    /// Points.
    pub point_count: u32,
    /// First marker.
    pub marker_start: u32,
    /// Markers.
    pub marker_count: u32,
    /// First observed node.
    pub node_start: u32,
    /// Nodes of observed displacements: none or all N, those that were not seen among them.
    pub node_count: u32,
    /// First entry of `cube_starts`.
    pub cube_start: u32,
    /// Fills up.
    pub pad: u32,
    /// Cubes along each axis.
    pub cubes: [u32; 3],
    /// Fills up.
    pub pad_cubes: u32,
    /// Lowest corner of the cubes, from the frame's origin [m].
    pub low: [f32; 3],
    /// One over a cube's edge [1/m].
    pub inverse_edge: f32,
    /// Frame's origin minus the body's [m].
    pub shift: [f32; 4],
    /// What single precision leaves of it [m].
    pub shift_rest: [f32; 4],
    /// First entry of `mark_rows`.
    pub mark_start: u32,
    /// First site of its recording.
    pub first_site: u32,
    /// First of its recording's rows of sites at nodes.
    pub node_rows: u32,
    /// How far a hidden point looks towards the camera beside its distance [m].
    pub reach: f32,
}

/// A cell of the band.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct BandCell {
    /// Extended nodes of the corners.
    pub nodes: [u32; 8],
    /// Lattice place of the first corner.
    pub lattice: [u32; 3],
    /// Fills up.
    pub pad: u32,
    /// Rest position of the first corner, from the body's origin [m].
    pub corner: [f32; 4],
}

/// Where a marker sits.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct Site {
    /// From the attachment point to the marker's centre at rest [m].
    pub stalk: [f32; 3],
    /// 1 of a tracked point.
    pub track: u32,
    /// Columns of the rest shape's deformation gradient, minus the identity.
    pub excess: [[f32; 4]; 3],
}

/// A marker of a frame.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct Mark {
    /// Measured minus rest position [m].
    pub goal: [f32; 3],
    /// Site, counted in its recording.
    pub site: u32,
    /// What single precision leaves of `goal` [m].
    pub goal_rest: [f32; 3],
    /// Fills up.
    pub pad: u32,
}

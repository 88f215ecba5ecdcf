//! Structs of tracking: `shared/crowd.wgsl`.

use bytemuck::{Pod, Zeroable};

/// A frame's points and the places of a surface.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct Crowd {
    /// Places K.
    pub places: u32,
    /// Points N.
    pub points: u32,
    /// Cameras C.
    pub cameras: u32,
    /// Every so-manieth place and point is in the cubes.
    pub thin: u32,
    /// Entries of a section of the hash.
    pub span: u32,
    /// Sections.
    pub sections: u32,
    /// Cubes.
    pub cells: u32,
    /// Fills up.
    pub pad: u32,
    /// Cubes along each axis.
    pub cubes: [u32; 3],
    /// Fills up.
    pub pad_cubes: u32,
    /// Lowest corner of the cubes from the common centre [m].
    pub low: [f32; 3],
    /// Cubes over a length [1/m].
    pub inverse_edge: f32,
    /// Square of the distance up to which somebody is near [m²].
    pub reach: f32,
    /// −1/(2σ²) [1/m²].
    pub falloff: f32,
    /// What outliers weigh against the peak of a place, over the areas of all that are seen.
    pub floor: f32,
    /// How far behind the nearest place on a line of sight one may lie [m].
    pub slack: f32,
}

/// How a camera looks at a body.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct Eye {
    /// Centre from the common one [m]; then 1, or 0 for a camera without lines of sight.
    pub center: [f32; 4],
    /// Unit vector along which depth counts; then pixels over the tangent of an angle.
    pub axis: [f32; 4],
    /// Unit vector along the rows of the picture.
    pub right: [f32; 4],
    /// Unit vector along its columns.
    pub down: [f32; 4],
}

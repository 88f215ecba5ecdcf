//! Structs that host and kernels share. The build script asserts that every field lies where WGSL has it.

mod crowd;
mod looks;
mod moving;

use bytemuck::{Pod, Zeroable};
pub use crowd::{Crowd, Eye};
pub use looks::{BandCell, Carried, Found, Look, Mark, Shot, Sight, Site};
pub use moving::{Jet, MovingPose, Obstacle};

/// Arguments of one dispatch.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
pub struct Call {
    /// Time step.
    pub step: u32,
    /// 0 = static balance, 1 = step.
    pub mode: u32,
    /// Section of the roster.
    pub roster: u32,
    /// Whatever the pass says.
    pub extra: u32,
}

/// Sizes and constants of a plan.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct Shape {
    /// Members B of the current batch.
    pub members: u32,
    /// Simulation nodes N.
    pub nodes: u32,
    /// Cells.
    pub cells: u32,
    /// 3 × 3 blocks of the matrix.
    pub blocks: u32,
    /// Surface patches.
    pub patches: u32,
    /// Clamp cells of all clamps.
    pub holds: u32,
    /// Clamps.
    pub clamps: u32,
    /// Contact planes.
    pub planes: u32,
    /// Point masses.
    pub masses: u32,
    /// Parameters P.
    pub parameters: u32,
    /// Classes of cells that share element matrices.
    pub classes: u32,
    /// Stages: solves of all steps.
    pub steps: u32,
    /// Edge of a cell [m]; of passes of cells alone.
    pub h: f32,
    /// Length of the stage [s].
    pub dt: f32,
    /// Weight of the new state.
    pub theta: f32,
    /// Largest displacement before a body counts as lost [m].
    pub world: f32,
    /// Centre of the initial spin [m].
    pub pivot: [f32; 3],
    /// Relative accuracy of a Newton solve.
    pub tolerance: f32,
    /// Most Newton iterations of a step.
    pub iterations: u32,
    /// CG iterations of one dispatch.
    pub chunk: u32,
    /// Most CG iterations of one solve.
    pub most: u32,
    /// Displacements are stored as a multiple of this power of two [m] and a rest.
    pub quantum: f32,
    /// 1 with a ghost penalty.
    pub ghosts: u32,
    /// What effects change, and numbers of the laws of cells: bits of `shared/structs.wgsl`.
    pub fields: u32,
    /// Time of the new state since the start [s].
    pub time: f32,
    /// Half width of contact [m].
    pub contact_width: f32,
    /// Numbers of effects that change the stiffness in time.
    pub aging_rows: u32,
    /// Nodes or patches, whichever are more.
    pub point_items: u32,
    /// Numbers of a member among the rates of a direction.
    pub rate_numbers: u32,
    /// Where those of effects begin.
    pub rate_effects: u32,
    /// Number of the first patch among the stencils.
    pub first_patch: u32,
    /// Number of the first point mass among them.
    pub first_mass: u32,
    /// Elastic points; they are the first stencils.
    pub elastic: u32,
    /// 1 where clamps hold nodes, as they do on bodies without cells.
    pub held: u32,
    /// Length of an element [m]: the edge of a cell, or of a cube of six mean tetrahedra. What is not about cells goes by it.
    pub element_size: f32,
    /// Elements: cells, or tetrahedra.
    pub elements: u32,
    /// Elastic points of a tetrahedron; 1 where there are none.
    pub per_element: u32,
    /// Groups of nodes on the second level of the preconditioner.
    pub groups: u32,
    /// Kind of the stage there: of one kind are those of the same length and weights, and the static problem.
    pub coarse_kind: u32,
    /// Edge of a group [m].
    pub group_size: f32,
    /// Slices of them that products are made in.
    pub slices: u32,
    /// Workgroups that stay for all iterations of a system's solve; 0: none stays.
    pub crew: u32,
    /// Obstacles that a file moves.
    pub obstacles: u32,
    /// Nozzles that a file moves.
    pub jets: u32,
    /// Edge of a mean patch [m].
    pub patch_size: f32,
    /// Rows of sums of the numbers of obstacles and jets.
    pub moving_rows: u32,
}

/// Parameters of one member.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct Member {
    /// Young's modulus [Pa].
    pub young: f32,
    /// Density [kg/m³].
    pub density: f32,
    /// Rayleigh damping [1/s].
    pub mass_damping: f32,
    /// Rayleigh damping [s].
    pub stiffness_damping: f32,
    /// Ghost penalty γ h μ at Young's modulus 1, and its derivative by ν.
    pub ghost: [f32; 2],
    /// Which element matrices.
    pub slot: u32,
    /// Time of the initial state [s].
    pub start: f32,
    /// Gravity [m/s²].
    pub gravity: [f32; 4],
    /// Initial velocity [m/s].
    pub velocity: [f32; 4],
    /// Initial angular velocity [rad/s].
    pub spin: [f32; 4],
    /// λ/E and μ/E, and their derivatives by Poisson's ratio.
    pub lame: [f32; 4],
    /// Viscosity: coefficient [Pa·s^h] and exponent, and the slot of the element matrices at ν = 0 (the first); one entry fills up.
    pub flow: [f32; 4],
}

/// How the coefficients of one member change along a direction; `shared/rates.wgsl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct Rate {
    /// Of Young's modulus [Pa].
    pub young: f32,
    /// Of Poisson's ratio.
    pub poisson: f32,
    /// Of the density [kg/m³].
    pub density: f32,
    /// Of the Rayleigh damping of mass [1/s].
    pub mass_damping: f32,
    /// Of the Rayleigh damping of stiffness [s].
    pub stiffness_damping: f32,
    /// Of the time of the start [s].
    pub start: f32,
    /// Of the viscosity's coefficient [Pa·s^h] and exponent.
    pub viscosity: [f32; 2],
    /// Of gravity [m/s²].
    pub gravity: [f32; 4],
    /// Of the initial velocity [m/s].
    pub velocity: [f32; 4],
    /// Of the initial angular velocity [rad/s].
    pub spin: [f32; 4],
}

/// A contact plane of one member.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct Plane {
    /// Unit normal and height [m].
    pub normal: [f32; 4],
    /// Derivative of the normal by θ.
    pub by_theta: [f32; 4],
    /// Derivative of the normal by φ.
    pub by_phi: [f32; 4],
    /// Penalty stiffness [Pa/m].
    pub stiffness: f32,
    /// 1 when it is proportional to Young's modulus.
    pub scales: f32,
    /// Fills up.
    pub pad: [f32; 2],
}

/// An effect on points or cells: its law, where it acts, and where its numbers lie.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct EffectSite {
    /// Place of the law in the table of effects.
    pub law: u32,
    /// A site of `shared/points.wgsl`.
    pub site: u32,
    /// First of its parameters among a member's.
    pub first: u32,
    /// Number of its parameters.
    pub count: u32,
    /// Row of the nodes' measures.
    pub measures: u32,
    /// First row of the measures' derivatives by the parameters, or `NONE`.
    pub slopes: u32,
    /// Parameters of all effects of a member.
    pub stride: u32,
    /// Rows of measures of a member.
    pub rows: u32,
}

/// A cell.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct Cell {
    /// Nodes of the corners.
    pub nodes: [u32; 8],
    /// Class of its element matrices.
    pub kind: u32,
    /// First patch on it.
    pub patch_start: u32,
    /// One past the last patch.
    pub patch_end: u32,
    /// First clamp cell on it, in the order of `hold_list`.
    pub hold_start: u32,
    /// One past the last.
    pub hold_end: u32,
    /// Part of its volume that is filled and not held by a clamp.
    pub fraction: f32,
    /// Part of its volume that is filled.
    pub whole: f32,
    /// Fills up.
    pub pad: u32,
}

/// An entry of a stencil.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct Entry {
    /// The node.
    pub node: u32,
    /// Its weight.
    pub weight: f32,
}

/// Two entries of a stencil, which make a block of the matrix.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct Pair {
    /// The stencil.
    pub stencil: u32,
    /// Entry of the block's row.
    pub row: u32,
    /// Entry of its column.
    pub column: u32,
}

/// A clamp that holds a node.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct Holder {
    /// Number of the clamp.
    pub by: u32,
    /// Stiffness of the spring [N/m].
    pub stiffness: f32,
    /// Held surface that the node stands for [m²].
    pub area: f32,
}

/// Pose of a clamp at one time: x ↦ A x + b and its rate.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct ClampPose {
    /// Columns of A.
    pub turn: [[f32; 4]; 3],
    /// Columns of A − I.
    pub excess: [[f32; 4]; 3],
    /// b [m].
    pub shift: [f32; 4],
    /// Columns of dA/dt.
    pub turn_rate: [[f32; 4]; 3],
    /// db/dt [m/s].
    pub shift_rate: [f32; 4],
}

/// Derivative of a clamp's pose by a parameter of an effect.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct HoldSlope {
    /// Columns of dA/dp.
    pub turn: [[f32; 4]; 3],
    /// db/dp [m].
    pub shift: [f32; 4],
}

/// Where the nonlinear solve of one member stands.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct Newton {
    /// A stage of `shared/structs.wgsl`.
    pub stage: u32,
    /// 1: use the convex part of the tangent.
    pub convex: u32,
    /// 1: use dissipation's tangent without negative curvature.
    pub majorised: u32,
    /// Newton iterations so far.
    pub iteration: u32,
    /// Trials of the line search so far.
    pub trial: u32,
    /// Norm of the residual.
    pub norm: f32,
    /// Sizes of the forces, in the same norm.
    pub scale: f32,
    /// Relative accuracy of the next direction.
    pub forcing: f32,
    /// Norm at which conjugate gradients stop.
    pub goal: f32,
    /// Length of the step being tried.
    pub length: f32,
    /// Potential [J] at the last accepted point.
    pub potential: f32,
    /// Sum of the absolute shares of the potential [J].
    pub shares: f32,
    /// Residual times direction [J].
    pub slope: f32,
    /// rᵀ M⁻¹ r of the linear solve.
    pub rz: f32,
    /// CG iterations of this solve.
    pub cg: u32,
    /// CG iterations of all solves.
    pub total: u32,
    /// Norm that rounding alone leaves.
    pub floor: f32,
}

/// Whether a member is well.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct Health {
    /// 0 = well, else a code of `shared/structs.wgsl`.
    pub code: u32,
    /// Time step in which it failed; 0 = start, k + 1 = step k.
    pub step: u32,
    /// Two numbers that explain.
    pub detail: [f32; 2],
}

//! A scene as plain checked data (format `scene/1`): everything known about an experiment, and what is to be found out.
//! Reading and writing the TOML is `palpate-io`'s business.

mod in_code;

use crate::effects::Effect;
use crate::materials::Model;
use crate::mechanics::motion::RigidMotion;
use crate::observation::{MarkerRest, ReadingKind};
use crate::params::Layout;
use crate::params::fields::FieldSpec;
use crate::plan::scheme::{self, Scheme};
use crate::shape::TriMesh;
use crate::space::points::TetMesh;
use glam::{DAffine3, DVec3};
use std::path::PathBuf;

/// One experiment; SI units.
#[derive(Clone, Debug)]
pub struct Scene {
    /// Where the scene was read from (for messages and result files).
    pub path: PathBuf,
    /// Free text.
    pub title: String,
    /// Rest shape and its resolution.
    pub object: Object,
    /// Material of the whole body.
    pub material: Material,
    /// Gravity [m/s²].
    pub gravity: DVec3,
    /// Regions that are held or moved.
    pub clamps: Vec<Clamp>,
    /// Half-spaces that the body cannot enter.
    pub planes: Vec<Plane>,
    /// Point masses fixed to the body.
    pub masses: Vec<PointMass>,
    /// Laws beyond the material, in the order of the file.
    pub effects: Vec<Effect>,
    /// What varies over the body.
    pub fields: Vec<FieldSpec>,
    /// State at the start.
    pub initial: Initial,
    /// Time steps.
    pub time: Time,
    /// Numerical choices.
    pub solver: Solver,
    /// What was measured, if anything.
    pub observation: Option<ObservationSpec>,
    /// What is to be found out, if anything.
    pub fit: Option<FitSpec>,
}

impl Scene {
    /// The parameters of this scene but for the values of fields, of which only a body knows how many there are.
    pub fn layout(&self) -> Layout {
        self.layout_with(&[])
    }

    /// The parameters of this scene with fields of so many values.
    pub fn layout_with(&self, fields: &[usize]) -> Layout {
        let laws: Vec<usize> = self.effects.iter().map(|e| e.law).collect();
        Layout::new(self.planes.len(), self.masses.len(), &laws, fields)
    }
}

/// Rest shape.
#[derive(Clone, Debug)]
pub struct Object {
    /// Where the surface comes from.
    pub source: BodySource,
    /// Rigid placement of the shape in the world.
    pub pose: DAffine3,
    /// How fine the grid is.
    pub resolution: Resolution,
}

/// Where the surface comes from.
#[derive(Clone, Debug)]
pub enum BodySource {
    /// A triangle mesh in its own coordinates, checked (and repaired where safe) by `palpate-io`.
    Mesh {
        /// The file it was read from.
        path: PathBuf,
        /// The surface, before `pose`.
        mesh: TriMesh,
        /// Edges with one triangle in the file, which the repair has closed.
        open_edges: usize,
    },
    /// A closed form, before `pose`.
    Analytic(Analytic),
    /// Tetrahedra, checked by `palpate-io`.
    Tetrahedra {
        /// The file they were read from.
        path: PathBuf,
        /// The mesh, before `pose`.
        mesh: TetMesh,
        /// Its surface.
        surface: TriMesh,
    },
}

/// Analytic bodies, lengths in metres.
#[derive(Clone, Debug, PartialEq)]
pub enum Analytic {
    /// A ball.
    Ball {
        /// Radius.
        radius: f64,
        /// Centre.
        center: DVec3,
    },
    /// A torus.
    Torus {
        /// Distance of the tube's centre line from the centre.
        major: f64,
        /// Radius of the tube.
        minor: f64,
        /// Centre.
        center: DVec3,
        /// Axis of rotation (any length).
        axis: DVec3,
    },
    /// An axis-aligned box.
    Box {
        /// Lowest corner.
        min: DVec3,
        /// Highest corner.
        max: DVec3,
    },
    /// A solid cylinder with flat ends.
    Cylinder {
        /// Radius.
        radius: f64,
        /// Length along the axis.
        height: f64,
        /// Centre.
        center: DVec3,
        /// Axis (any length).
        axis: DVec3,
    },
}

/// How fine the grid is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Resolution {
    /// That of the file's own elements.
    Own,
    /// Edge of a cell [m].
    CellSize(f64),
    /// Number of cells along the longest side of the body's bounding box.
    Cells(u32),
    /// Left open: somebody chooses before the body is cut.
    Open,
}

/// An isotropic material with Rayleigh damping.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Material {
    /// Its law.
    pub model: &'static Model,
    /// How heavy.
    pub inertia: Inertia,
    /// Young's modulus [Pa].
    pub youngs_modulus: f64,
    /// Poisson's ratio.
    pub poisson_ratio: f64,
    /// Rayleigh damping, mass-proportional [1/s].
    pub mass_damping: f64,
    /// Rayleigh damping, stiffness-proportional [s].
    pub stiffness_damping: f64,
}

/// How heavy the body is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Inertia {
    /// Mass density [kg/m³].
    Density(f64),
    /// Mass of the whole body [kg], divided by the volume of the body on its grid.
    Mass(f64),
}

/// A Dirichlet region: the part of the surface and body inside the box follows `motion`.
#[derive(Clone, Debug)]
pub struct Clamp {
    /// Lowest corner [m].
    pub min: DVec3,
    /// Highest corner [m].
    pub max: DVec3,
    /// True when the box is given in the mesh's own coordinates (before `pose`).
    pub object_frame: bool,
    /// Prescribed rigid motion; `None` = held still.
    pub motion: Option<RigidMotion>,
    /// File the motion was read from.
    pub motion_path: Option<PathBuf>,
}

/// A contact plane.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Plane {
    /// A point of the plane [m].
    pub point: DVec3,
    /// Unit normal, away from the forbidden half-space.
    pub normal: DVec3,
    /// Penalty pressure per penetration [Pa/m]; `None` = scales with the material.
    pub stiffness: Option<f64>,
}

/// A point mass fixed to the body.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PointMass {
    /// Point of the rest configuration [m].
    pub point: DVec3,
    /// Mass [kg].
    pub mass: f64,
}

/// State at the start.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Initial {
    /// Velocity [m/s].
    pub velocity: DVec3,
    /// Angular velocity [rad/s].
    pub angular_velocity: DVec3,
    /// Centre of the spin; `None` = centre of mass.
    pub pivot: Option<DVec3>,
    /// Shape at the start.
    pub state: InitialShape,
}

/// Shape at the start.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum InitialShape {
    /// The rest shape.
    Rest,
    /// In equilibrium under gravity, clamps, planes and masses.
    StaticEquilibrium,
}

/// Time steps.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Time {
    /// Length of a step [s].
    pub step: f64,
    /// Number of steps; 0 with static equilibrium = a static problem.
    pub steps: usize,
    /// Time of the initial state on the recording's clock [s].
    pub start: f64,
    /// Weight of the new state, 0.5 ≤ θ < 1, where the scheme leaves it open.
    pub theta: f64,
    /// How a step is taken.
    pub scheme: &'static Scheme,
    /// What is to be simulated [s], where step and number of steps are left open: somebody chooses them before the plan is built.
    pub open: Option<f64>,
}

impl Default for Time {
    /// No step at all, of a length that serves a static problem.
    fn default() -> Time {
        Time { step: 1.0, steps: 0, start: 0.0, theta: 0.6, scheme: &scheme::ALL[0], open: None }
    }
}

impl Time {
    /// No step at all of the θ-scheme with this weight of the new state.
    pub fn weighted(theta: f64) -> Time {
        Time { theta, scheme: scheme::theta(), ..Time::default() }
    }
}

/// Numerical choices; the defaults are what a user wants.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Solver {
    /// Element formulation.
    pub element: Element,
    /// Linear solver.
    pub linear: LinearSolver,
    /// Relative accuracy of the nonlinear solve of a step.
    pub tolerance: f64,
    /// Most Newton iterations of a step. A body that its weight crushes to several hundred per cent takes 30 to 60 where cells turn inside out
    /// one after another; others end after three to five.
    pub newton_iterations: usize,
    /// Ghost penalty γ, dimensionless.
    pub ghost: f64,
}

impl Default for Solver {
    fn default() -> Self {
        Solver { element: Element::Enhanced, linear: LinearSolver::Auto, tolerance: 1e-8, newton_iterations: 60, ghost: 0.02 }
    }
}

/// Element formulation.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Element {
    /// Trilinear plus nine condensed incompatible modes and linear dilatation: exact in bending, no locking.
    Enhanced,
    /// Plain trilinear, exactly integrated over the cut cell.
    Trilinear,
    /// Plain trilinear, integrated at the cell's corners (the paper).
    Corner,
}

/// Linear solver of a step.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LinearSolver {
    /// Chosen by size and number of right-hand sides.
    Auto,
    /// Sparse Cholesky factorisation.
    Cholesky,
    /// Preconditioned conjugate gradients.
    ConjugateGradient,
}

/// What of a recording is compared, and how.
#[derive(Clone, Debug, PartialEq)]
pub struct ObservationSpec {
    /// Folder of the recording.
    pub recording: PathBuf,
    /// File in the folder, normally `recording.toml`.
    pub file: String,
    /// Kinds of readings that are compared.
    pub costs: Vec<ReadingKind>,
    /// Half width of the narrow band, in cells.
    pub band: f64,
    /// First time used [s].
    pub from: f64,
    /// Last time used [s].
    pub to: f64,
    /// Every n-th frame is used.
    pub every: usize,
    /// Every n-th pixel per row and column is used.
    pub pixel_stride: usize,
    /// Rest places of markers that the recording itself does not state.
    pub markers: Vec<MarkerRest>,
}

impl ObservationSpec {
    /// Every frame and pixel of a recording, with what holds where a scene states no more.
    pub fn new(recording: impl Into<PathBuf>, costs: Vec<ReadingKind>) -> Self {
        ObservationSpec {
            recording: recording.into(),
            file: "recording.toml".into(),
            costs,
            band: 4.0,
            from: f64::NEG_INFINITY,
            to: f64::INFINITY,
            every: 1,
            pixel_stride: 1,
            markers: Vec::new(),
        }
    }
}

/// What is to be found out.
#[derive(Clone, Debug, PartialEq)]
pub struct FitSpec {
    /// The optimiser; `None` where the scene leaves the choice.
    pub optimizer: Option<Optimizer>,
    /// Most iterations per start.
    pub iterations: usize,
    /// Number of starts.
    pub starts: usize,
    /// Seed of the starts.
    pub seed: u64,
    /// Threads; 0 = all.
    pub threads: usize,
    /// Free parameters.
    pub parameters: Vec<FitParameter>,
}

/// Optimisers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Optimizer {
    /// Resilient propagation: signs of the gradient only (the paper).
    Rprop,
    /// Gradient descent with adaptive (Barzilai–Borwein) steps.
    GradientDescent,
    /// Limited-memory quasi-Newton.
    Lbfgs,
    /// Gauss–Newton with Levenberg–Marquardt damping.
    GaussNewton,
    /// The same without a matrix: products by a tangent and an adjoint, for fields.
    GaussNewtonCg,
    /// Simplex search without gradients.
    NelderMead,
}

impl Optimizer {
    /// All by their names in files and on the command line.
    pub const ALL: [(&'static str, Optimizer); 6] = [
        ("rprop", Optimizer::Rprop),
        ("gradient-descent", Optimizer::GradientDescent),
        ("lbfgs", Optimizer::Lbfgs),
        ("gauss-newton", Optimizer::GaussNewton),
        ("gauss-newton-cg", Optimizer::GaussNewtonCg),
        ("nelder-mead", Optimizer::NelderMead),
    ];

    /// Its name.
    pub fn name(self) -> &'static str {
        Optimizer::ALL.iter().find(|o| o.1 == self).map_or("", |o| o.0)
    }
}

/// One free number.
#[derive(Clone, Debug, PartialEq)]
pub struct FitParameter {
    /// Path in the scene file: a component of a vector and a region of a field have their own entry, a field by cells or nodes has one for
    /// all its values; `material.mass` stays as written.
    pub path: String,
    /// Where starts are drawn from (equal ends: a fixed start).
    pub start: (f64, f64),
    /// Allowed range.
    pub bounds: (f64, f64),
    /// Value and standard deviation that are known beforehand: a Gaussian prior in the number's own unit.
    pub known: Option<(f64, f64)>,
    /// With several scenes: not shared between them.
    pub per_scene: bool,
}

//! A scene as plain checked data (format `scene/1`): everything known about an experiment, and what is to be found out.
//! Reading and writing the TOML is `palpate-io`'s business.

mod fit;
mod in_code;
mod synthesis;

pub use fit::{FitParameter, FitSpec, Optimizer, TrainFrames, WarmStart};
pub use synthesis::{Handle, Keyframe, Synthesis};

use crate::effects::Effect;
use crate::materials::Model;
use crate::materials::principal_stretch::PrincipalStretch;
use crate::materials::viscosity::Viscosity;
use crate::mechanics::motion::RigidMotion;
use crate::observation::target::Target;
use crate::observation::{MarkerRest, ReadingKind};
use crate::params::Layout;
use crate::params::fields::FieldSpec;
use crate::plan::scheme::{self, Scheme};
use crate::shape::TriMesh;
use crate::space::points::TetMesh;
use crate::space::stars::StarSpec;
pub use crate::space::tets::Tetrahedron;
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
    /// Curves of its stiffness, where its model has some.
    pub curves: PrincipalStretch,
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
    /// Where points of the body shall be, of a scene that is compared with a wish instead of a recording.
    pub targets: Vec<Target>,
    /// Who pulls at the body, and where it shall be led, of a scene that a motion is made for.
    pub synthesis: Synthesis,
    /// How it is tracked.
    pub tracking: Tracking,
    /// What is to be found out, if anything.
    pub fit: Option<FitSpec>,
}

/// How a body is tracked from frame to frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tracking {
    /// Each frame is a step from the one before; else the equilibrium under the loads. `None` = as the scene's frames are: a step where
    /// there are several or nothing holds the body.
    pub dynamic: Option<bool>,
    /// How far the prior may be wrong [J]; `None` = that of the largest evidence.
    pub temperature: Option<f64>,
    /// Share of depth points that belong to something else, 0 to 0.9.
    pub outliers: f64,
    /// How far a depth point may be from its place at the beginning [m]; `None` = half the body.
    pub spread: Option<f64>,
}

impl Default for Tracking {
    fn default() -> Tracking {
        Tracking { dynamic: None, temperature: None, outliers: 0.05, spread: None }
    }
}

impl Scene {
    /// The parameters of this scene but for the values of fields, of which only a body knows how many there are.
    pub fn layout(&self) -> Layout {
        self.layout_with(&[])
    }

    /// The parameters of this scene with fields of so many values.
    pub fn layout_with(&self, fields: &[usize]) -> Layout {
        let laws: Vec<usize> = self.effects.iter().map(|e| e.law).collect();
        Layout::new(self.planes.len(), self.masses.len(), &laws, fields).with_material(self)
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

impl Object {
    /// True of a body of tetrahedra, whether a file has them or they are made here.
    pub fn is_of_tetrahedra(&self) -> bool {
        let made = matches!(self.resolution, Resolution::Edge(_) | Resolution::OpenEdge);
        made || matches!(self.source, BodySource::Tetrahedra { .. })
    }

    /// True of a body of points with their stars.
    pub fn is_of_points(&self) -> bool {
        matches!(self.source, BodySource::Cloud(_))
    }
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
    /// Points, each of which is simulated with its neighbours.
    Cloud(Box<Cloud>),
}

/// A cloud of points that fills a body, checked by `palpate-io`.
#[derive(Clone, Debug)]
pub struct Cloud {
    /// The file they were read from.
    pub path: PathBuf,
    /// The points, before `pose` [m].
    pub points: Vec<DVec3>,
    /// The surface around them, a mesh or a closed form.
    pub hull: BodySource,
    /// What is made of them.
    pub stars: StarSpec,
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

/// What the body is made of, and how fine.
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
    /// Longest edge of the tetrahedra that the inside is filled with [m].
    Edge(f64),
    /// Tetrahedra, their edge left open.
    OpenEdge,
}

/// An isotropic material with its damping.
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
    /// Viscosity; `None` = elastic but for Rayleigh damping.
    pub viscosity: Option<Viscosity>,
}

/// How heavy the body is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Inertia {
    /// Mass density [kg/m³].
    Density(f64),
    /// Mass of the whole body [kg], divided by the volume of the body on its grid.
    Mass(f64),
}

/// A Dirichlet region: what it holds of the body follows `motion`.
#[derive(Clone, Debug)]
pub struct Clamp {
    /// What it holds.
    pub region: ClampRegion,
    /// Prescribed rigid motion; `None` = held still.
    pub motion: Option<RigidMotion>,
    /// File the motion was read from.
    pub motion_path: Option<PathBuf>,
}

/// What a clamp holds.
#[derive(Clone, Debug, PartialEq)]
pub enum ClampRegion {
    /// The part of surface and body inside a box.
    Box {
        /// Lowest corner [m].
        min: DVec3,
        /// Highest corner [m].
        max: DVec3,
        /// True when the box is given in the mesh's own coordinates (before `pose`).
        object_frame: bool,
    },
    /// The nodes of a named group of a volume mesh.
    Group(String),
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
    /// The shape given, which is the equilibrium: the stress-free shape follows from it.
    Given,
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
    /// Element formulation of bodies that are cut out of a lattice.
    pub element: Element,
    /// Of bodies that are made of tetrahedra.
    pub tetrahedron: Tetrahedron,
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
        Solver {
            element: Element::Enhanced,
            tetrahedron: Tetrahedron::default(),
            linear: LinearSolver::Auto,
            tolerance: 1e-8,
            newton_iterations: 60,
            ghost: 0.02,
        }
    }
}

/// Element formulation of cells.
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

//! A scene and its recording, ready to be simulated, compared and fitted.

use crate::choose::{Choice, choose};
use crate::embed::Embedding;
use crate::engine::Backend;
use crate::error::Error;
use crate::events::Stage;
use crate::fitting::{self, FitOptions, Fitted};
use crate::interrupt::Interrupt;
use crate::memory::require_for_body;
use crate::residuals::ResidualSummary;
use glam::DVec3;
use palpate_engine::{FailureKind, FrameResiduals, Snapshot, Stop, number};
use palpate_io::recording::{ObservationError, Recording};
use palpate_io::{check_overlap, parse_scene, read_recording, read_text, scene_error};
use palpate_model::effects::sensors::Sensors;
use palpate_model::observation::{MarkerRest, Observation};
use palpate_model::plan::Plan;
use palpate_model::plan::build::{PlanError, build_plan_of};
use palpate_model::plan::locking::locking;
use palpate_model::scene::{InitialShape, ObservationSpec, Scene};
use palpate_model::shape::{Shape, TriMesh, shape_of};
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::sync::Arc;

mod changed;
mod doubts;

/// A time [s]: four decimals, or few digits where it is none that anything moves in.
pub(crate) fn short(t: f64) -> String {
    if t.abs() < 1e6 { format!("{t:.4}") } else { number(t) }
}

/// Depth, in cells, from which on a plane that reaches into the body at rest deserves a word.
const CUT: f64 = 0.25;

/// Part of the sag of a bar that may be missing on linear tetrahedra before a word is said: what a modulus is known to, at best.
const LOCKS: f64 = 0.05;

/// One scene, its recording where it names one, and the plan made of both.
#[derive(Clone, Debug)]
pub struct Experiment {
    pub(crate) scene: Scene,
    text: String,
    recording: Option<Arc<Recording>>,
    shape: Arc<dyn Shape>,
    pub(crate) plan: Plan,
    chosen: Vec<Choice>,
    warnings: Vec<String>,
}

/// All states of one simulation.
#[derive(Clone, Debug)]
pub struct Simulation {
    /// The states, the initial one first; times count from it.
    pub snapshots: Vec<Snapshot>,
    /// The rest surface, carried by the nodes.
    pub surface: Embedding,
    /// Triangles of the surface.
    pub triangles: Vec<[u32; 3]>,
}

impl Simulation {
    /// The deformed surface of a state.
    pub fn mesh(&self, state: usize) -> TriMesh {
        TriMesh { vertices: self.surface.deform(&self.snapshots[state].displacement), triangles: self.triangles.clone() }
    }
}

impl Experiment {
    /// Reads a scene file and, where it has an `[observation]`, its recording.
    ///
    /// # Errors
    /// [`Error::File`] with the first thing that is wrong with a file, or when the recording lies nowhere near the object.
    pub fn open(path: impl AsRef<Path>) -> Result<Experiment, Error> {
        Experiment::open_at(path.as_ref())
    }

    fn open_at(path: &Path) -> Result<Experiment, Error> {
        let _span = tracing::info_span!("open", scene = %path.display()).entered();
        Experiment::of_text(&read_text(path)?, path)
    }

    /// Reads a scene file and leaves its recording alone, which need not exist: enough to simulate.
    ///
    /// # Errors
    /// [`Error::File`] with the first thing that is wrong with a file.
    pub fn open_without_recording(path: impl AsRef<Path>) -> Result<Experiment, Error> {
        Experiment::open_unseen(path.as_ref())
    }

    fn open_unseen(path: &Path) -> Result<Experiment, Error> {
        let text = read_text(path)?;
        let _stage = Stage::begin("read the scene");
        let _span = tracing::info_span!("open", scene = %path.display()).entered();
        let loaded = tracing::info_span!("load").in_scope(|| parse_scene(&text, path))?;
        let scene = Scene { observation: None, ..loaded.value };
        Experiment::new(scene, text, loaded.warnings)
    }

    /// A scene given as text; relative paths in it start from the folder of `path`.
    ///
    /// # Errors
    /// As [`Experiment::open`].
    pub fn from_toml(text: &str, path: impl AsRef<Path>) -> Result<Experiment, Error> {
        Experiment::of_text(text, path.as_ref())
    }

    fn of_text(text: &str, path: &Path) -> Result<Experiment, Error> {
        let loaded = tracing::info_span!("load").in_scope(|| parse_scene(text, path))?;
        Experiment::new(loaded.value, text.to_string(), loaded.warnings)
    }

    /// An experiment of a scene built in code; `text` is its file's text, or empty when there is none.
    ///
    /// # Errors
    /// As [`Experiment::open`].
    pub fn new(scene: Scene, text: String, warnings: Vec<String>) -> Result<Experiment, Error> {
        Experiment::build(scene, text, warnings, None)
    }

    /// The same with the recording that the scene's `[observation]` means, where it is at hand.
    fn build(
        mut scene: Scene,
        text: String,
        mut warnings: Vec<String>,
        known: Option<Arc<Recording>>,
    ) -> Result<Experiment, Error> {
        let _stage = Stage::begin("shape, recording and plan");
        let path = scene.path.clone();
        let fault = |key: &str, message: String| Error::from(scene_error(&path, &text, key, message));
        let shape = shape_of(&scene.object);
        let mut recording = None;
        let (mut observation, mut rest) = (Observation::default(), Vec::new());
        if let Some(spec) = &mut scene.observation {
            let read = match known {
                Some(known) => known,
                None => {
                    let place = place_of(spec).map_err(|e| fault("observation.recording", e))?;
                    Arc::new(tracing::info_span!("load", recording = %place.display()).in_scope(|| read_recording(&place))?)
                }
            };
            warnings.extend(read.warnings.iter().cloned());
            warnings.extend(doubts::thin(&read, spec, &path, &text));
            (observation, rest) = read.observation(spec, &mut warnings).map_err(|e| match e {
                ObservationError::Recording(e) => Error::from(e),
                ObservationError::Scene { key, message } => fault(&key, message),
            })?;
            leave_out_what_is_held(&scene, rest.len(), &mut observation);
            if let Some(chosen) = scene.fit.as_ref().and_then(|f| f.frames.as_ref()) {
                let there = observation.frames.len();
                if let Some(last) = chosen.numbers.iter().flatten().find(|k| **k >= there) {
                    let text = format!("there is no frame {last}: {there} are used, and counted from 0");
                    return Err(fault("fit.frames", text));
                }
                let mut number = 0..;
                observation.frames.retain(|_| number.next().is_some_and(|k| chosen.holds(k)));
            }
            let (min, max) = shape.bounds();
            check_overlap(&observation, min, max).map_err(|e| fault("observation.recording", e))?;
            recording = Some(read);
        }
        if !scene.targets.is_empty() {
            observation = Observation::of_targets(&scene.targets);
        }
        Experiment::made(scene, text, shape, (observation, rest, recording), warnings)
    }

    /// The same scene, changed by hand, compared with something that no recording holds.
    ///
    /// # Errors
    /// The scene gives no plan.
    pub(crate) fn compared(&self, scene: Scene, observation: Observation) -> Result<Experiment, Error> {
        Experiment::made(scene, self.text.clone(), self.shape.clone(), (observation, Vec::new(), None), Vec::new())
    }

    fn made(
        mut scene: Scene,
        text: String,
        shape: Arc<dyn Shape>,
        (observation, rest, recording): (Observation, Vec<MarkerRest>, Option<Arc<Recording>>),
        warnings: Vec<String>,
    ) -> Result<Experiment, Error> {
        let chosen = choose(&mut scene, shape.as_ref(), &observation);
        require_for_body(&scene, shape.as_ref())?;
        let cutting = (Stage::begin("cut the body"), tracing::info_span!("assemble").entered());
        let plan = build_plan_of(&scene, shape.clone(), observation, &rest)
            .map_err(|e| plan_fault(&scene, &text, recording.as_deref(), e))?;
        drop(cutting);
        let mut experiment = Experiment { scene, text, recording, shape, plan, chosen, warnings };
        experiment.check_times()?;
        experiment.check_planes();
        experiment.check_elements();
        let doubts = doubts::doubts(&experiment);
        experiment.warnings.extend(doubts);
        Ok(experiment)
    }

    /// Frames outside the simulated time are compared with a state that is held: some deserve a word, and when all are, nothing of
    /// the motion is compared at all.
    fn check_times(&mut self) -> Result<(), Error> {
        let frames = &self.plan.observation.frames;
        let (Some(first), Some(last)) = (frames.first(), frames.last()) else { return Ok(()) };
        if self.plan.clock.steps == 0 {
            return Ok(());
        }
        let ahead = Sensors::new(&self.plan.layout, &self.plan.theta).ahead();
        let (from, to) = (self.start_time() + ahead, self.end_time() + ahead);
        // Times in files are rounded to microseconds.
        let slack = 1e-6 * (1.0 + to.abs());
        let outside = frames.iter().filter(|f| f.time < from - slack || f.time > to + slack).count();
        let fits_start = self.scene.fit.iter().flat_map(|f| &f.parameters).any(|p| p.path == "time.start");
        if outside == 0 || fits_start {
            return Ok(());
        }
        let count = if outside == frames.len() { "all".to_string() } else { format!("{outside} of") };
        let text = format!(
            "{count} {} frames ({} s to {} s) lie outside the simulated time ({} s to {} s)",
            frames.len(),
            short(first.time),
            short(last.time),
            short(from),
            short(to)
        );
        if outside == frames.len() {
            return Err(
                self.fault("observation.frames", format!("{text}; adapt [time] start and duration, or choose other frames"))
            );
        }
        let name = self.scene.path.display();
        self.warnings
            .push(format!("{name}: {text} and are compared with its first or last state; adapt [observation] frames or [time]"));
        Ok(())
    }

    /// A plane that cuts through the body at rest throws it out in the first step, or squeezes it against what holds it.
    fn check_planes(&mut self) {
        if self.scene.initial.state != InitialShape::Rest {
            return;
        }
        let body = &self.plan.body;
        for (i, plane) in self.scene.planes.iter().enumerate() {
            let depth = body.patches.iter().map(|p| plane.normal.dot(plane.point - p.point)).fold(0.0, f64::max);
            if depth > CUT * body.length {
                self.warnings.push(format!(
                    "{}: plane.{i} cuts {} m deep into the body at rest: contact pushes it out from the first step on; move the plane or the \
                     body, or start from initial.state = \"static-equilibrium\"",
                    self.scene.path.display(),
                    number(depth)
                ));
            }
        }
    }

    /// Linear tetrahedra make a body stiffer than its material, and what is fitted on them belongs to the mesh.
    fn check_elements(&mut self) {
        let nu = self.scene.material.poisson_ratio;
        let Some(l) = locking(&self.plan.body, self.scene.solver.tetrahedron, nu) else { return };
        if l.missing > LOCKS {
            self.warnings.push(format!(
                "{}: tet4 locks: at ν = {} a bar that is {} elements thick, as this body is about, sags some {:.0} % too little, and a modulus \
                 that is fitted is that of the mesh; use [solver] element = \"tet10\"",
                self.scene.path.display(),
                number(nu),
                number((10.0 * l.across).round() / 10.0),
                100.0 * l.missing
            ));
        }
    }

    /// An error about a key of the scene, with its line.
    pub(crate) fn fault(&self, key: &str, message: impl Into<String>) -> Error {
        scene_error(&self.scene.path, &self.text, key, message).into()
    }

    /// The scene.
    pub fn scene(&self) -> &Scene {
        &self.scene
    }

    /// The scene file's text; empty for a scene built in code.
    pub fn text(&self) -> &str {
        &self.text
    }

    /// The recording, where the scene names one.
    pub fn recording(&self) -> Option<&Arc<Recording>> {
        self.recording.as_ref()
    }

    /// What the scene left open and was chosen for it: key, value in SI units, and why.
    pub fn chosen(&self) -> &[Choice] {
        &self.chosen
    }

    /// The rest shape.
    pub fn shape(&self) -> &dyn Shape {
        self.shape.as_ref()
    }

    /// What a backend gets.
    pub fn plan(&self) -> &Plan {
        &self.plan
    }

    /// Adds something that deserves attention.
    pub(crate) fn warn(&mut self, text: String) {
        self.warnings.push(text);
    }

    /// What looked suspicious without being wrong, one line each.
    pub fn warnings(&self) -> &[String] {
        &self.warnings
    }

    /// Time of the first state on the recording's clock [s].
    pub fn start_time(&self) -> f64 {
        self.plan.times.first().copied().unwrap_or(self.scene.time.start)
    }

    /// Time of the last state on the recording's clock [s].
    pub fn end_time(&self) -> f64 {
        if let Some(last) = self.plan.times.last() {
            return *last;
        }
        self.scene.time.start + self.scene.time.step * self.scene.time.steps as f64
    }

    /// The rest surface with edges about `edge` [m], carried by the simulation's nodes, and its triangles. The edge is made
    /// longer where it would give more than some 150 000 triangles.
    pub fn surface(&self, edge: f64) -> (Embedding, Vec<[u32; 3]>) {
        // Triangles of edge e have about 0.4 e² of area.
        let edge = edge.max((self.plan.body.area / (0.4 * 150_000.0)).sqrt());
        let mesh = self.shape.surface(edge);
        (Embedding::new(&self.plan.body, mesh.vertices), mesh.triangles)
    }

    /// Simulates with the scene's own values and keeps every state.
    ///
    /// # Errors
    /// [`Error::Simulation`] when it fails: what happened, when, and what may help.
    pub fn simulate(&self, backend: Backend) -> Result<Simulation, Error> {
        Ok(self.simulate_until(backend, &Interrupt::default(), |_, _| {})?.0)
    }

    /// The same, with how far every reading of the recording lies from the simulation, frame by frame in the order of their times. `hear` is told
    /// the number of every state, the initial one 0, and how many there will be.
    ///
    /// # Errors
    /// As [`Experiment::simulate`], and [`Error::Interrupted`] where it was stopped.
    pub fn simulate_until(
        &self,
        backend: Backend,
        interrupt: &Interrupt,
        mut hear: impl FnMut(usize, usize),
    ) -> Result<(Simulation, Vec<FrameResiduals>), Error> {
        let (mut snapshots, mut frames) = (Vec::new(), Vec::new());
        let visited = backend.visit_until(&self.plan, &self.plan.theta, interrupt.at_once(), |k, s, residuals| {
            hear(k, self.plan.clock.steps);
            snapshots.push(s);
            frames.extend(residuals);
            std::ops::ControlFlow::Continue(())
        });
        match visited {
            Err(Error::Simulation(f)) if f.kind == FailureKind::Stopped => return Err(Error::Interrupted),
            other => other?,
        };
        frames.sort_by_key(|f| f.frame);
        let (surface, triangles) = self.surface(0.5 * self.plan.body.length);
        Ok((Simulation { snapshots, surface, triangles }, frames))
    }

    /// How far the measurement lies from a simulation with parameters θ `[P]`.
    ///
    /// # Errors
    /// [`Error::Simulation`] when that fails.
    pub fn residuals(&self, backend: Backend, theta: &[f64]) -> Result<ResidualSummary, Error> {
        ResidualSummary::new(self, backend, theta, &Stop::default())
    }

    /// Finds the free parameters of the scene's `[fit]` table.
    ///
    /// # Errors
    /// [`Error::Scene`] when there is nothing to fit or to compare with, [`Error::Fit`] when no start can be computed.
    pub fn fit(&self, options: FitOptions) -> Result<Fitted, Error> {
        fitting::fit(std::slice::from_ref(self), options)
    }

    /// Up in the world: against gravity, z without it.
    pub fn up(&self) -> DVec3 {
        (-self.scene.gravity).try_normalize().unwrap_or(DVec3::Z)
    }
}

/// Tracked points that an attachment draws to their places say nothing of the body when they are compared with it.
fn leave_out_what_is_held(scene: &Scene, markers: usize, observation: &mut Observation) {
    let held: BTreeSet<u32> =
        scene.effects.iter().filter_map(|e| e.drive.as_ref()).flat_map(|d| d.tracked.iter().copied()).collect();
    if held.is_empty() || observation.tracks.places.is_empty() {
        return;
    }
    let first = markers as u32;
    for f in &mut observation.frames {
        f.markers.retain(|m| m.site < first || !held.contains(&(m.site - first)));
    }
}

/// The file of the recording that an `[observation]` names.
fn place_of(spec: &ObservationSpec) -> Result<PathBuf, String> {
    let place = if spec.recording.is_dir() { spec.recording.join(&spec.file) } else { spec.recording.clone() };
    if place.exists() { Ok(place) } else { Err(format!("there is no recording at {}", place.display())) }
}

/// A fault found while the plan is built, where its key stands: in the scene, or in the recording for what only that states.
fn plan_fault(scene: &Scene, text: &str, recording: Option<&Recording>, e: PlanError) -> Error {
    let (Some(spec), Some(recording)) = (&scene.observation, recording) else {
        // Points of targets are tracked ones.
        let of_points = if scene.targets.is_empty() { "keyframe.0.points" } else { "target.0.points" };
        let key = if e.key == "points.rest" { of_points } else { &e.key };
        return scene_error(&scene.path, text, key, e.message).into();
    };
    let in_recording = |key: &str| {
        // It was read a moment ago; without it the line is missing and nothing else.
        let text = read_text(&recording.path).unwrap_or_default();
        scene_error(&recording.path, &text, key, e.message.clone()).into()
    };
    if e.key.starts_with("points.") || e.key.starts_with("displacements.") {
        return in_recording(&e.key);
    }
    let Some((name, part)) = e.key.strip_prefix("markers.rest \"").and_then(|k| k.rsplit_once("\".")) else {
        return scene_error(&scene.path, text, &e.key, e.message).into();
    };
    if let Some(i) = spec.markers.iter().position(|m| m.name == name) {
        return scene_error(&scene.path, text, &format!("observation.marker.{i}.{part}"), e.message).into();
    }
    let place = recording.markers.iter().flat_map(|m| &m.rest).position(|m| m.name == name).unwrap_or(0);
    in_recording(&format!("markers.rest.{place}.{part}"))
}

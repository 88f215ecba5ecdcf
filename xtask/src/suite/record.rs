//! Recordings of true scenes, made on another grid, with another time step, element and seed than the diagnosis uses.

use super::setup::Setup;
use palpate::render::Sensor;
use palpate::synthetic::{Observers, observe};
use palpate::{Backend, Error, Experiment};
use palpate_io::recording::Recording;
use palpate_io::write_recording;
use palpate_model::scene::{Element, Scene};
use std::ops::ControlFlow;
use std::path::Path;

/// Metres per count: rounding stays far below the noise.
const DEPTH_SCALE: f64 = 5e-5;

/// How a recording is made.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Maker {
    /// Cells and time step are those of the diagnosis divided by this.
    pub refine: f64,
    /// Element.
    pub element: Element,
    /// False for readings without noise.
    pub noisy: bool,
    /// Seed of the noise.
    pub seed: u64,
}

impl Maker {
    /// A finer grid that never falls onto the diagnosis' one, in steps shorter by the same factor. Errors of the second order are then a
    /// quarter to a tenth of the diagnosis' own: what nature does has none. Every third case has plain trilinear elements, and needs
    /// the finest grid for that.
    pub fn other(case: u64, other: bool) -> Maker {
        let element = if case.is_multiple_of(3) { Element::Trilinear } else { Element::Enhanced };
        let refine = [3.15, 2.15, 2.4][(case % 3) as usize];
        Maker { refine, element, noisy: true, seed: 2 * case + u64::from(other) }
    }

    /// The diagnosis' own grid without noise: what differs is the effect alone.
    pub fn own() -> Maker {
        Maker { refine: 1.0, element: Element::Enhanced, noisy: false, seed: 1 }
    }
}

/// The experiment that is recorded.
fn truth(scene: &Scene, maker: &Maker) -> Result<Experiment, Error> {
    let mut scene = Scene { observation: None, fit: None, ..scene.clone() };
    scene.solver.element = maker.element;
    // A plane that states no stiffness gets one that follows the grid: the ground is the same for every grid.
    let coarse = Experiment::new(scene.clone(), String::new(), Vec::new())?;
    let default =
        palpate_model::mechanics::contact::DEFAULT_STIFFNESS * scene.material.youngs_modulus / coarse.plan().body.length;
    scene.planes.iter_mut().for_each(|p| {
        p.stiffness.get_or_insert(default);
    });
    let e = Experiment::new(scene, String::new(), Vec::new())?;
    if maker.refine == 1.0 { Ok(e) } else { e.refined(maker.refine) }
}

/// The experiment that a setup's diagnosis is given: the setup's own scene, or that of its other recording, with a recording of a true one,
/// kept in `folder`.
///
/// # Errors
/// The true scene cannot be built, simulated or written, or nothing is seen.
pub fn observed(setup: &Setup, hidden: &Scene, maker: &Maker, folder: &Path, other: bool) -> Result<Experiment, Error> {
    let recording = record(setup, &truth(hidden, maker)?, maker)?;
    write_recording(folder, &recording).map_err(|e| Error::Failed(e.to_string()))?;
    let text = setup.text(folder, other);
    Experiment::new(setup.parse(&text)?, text, Vec::new())
}

/// Records a true experiment as the cameras and markers of its setup see it.
fn record(setup: &Setup, e: &Experiment, maker: &Maker) -> Result<Recording, Error> {
    let (start, end) = (e.scene().time.start, e.end_time());
    let count = ((end - start) / setup.spacing + 1e-9).floor() as usize;
    let observers = Observers {
        cameras: setup.cameras()?,
        markers: setup.markers(),
        points: Vec::new(),
        displacements: false,
        times: (1..=count).map(|k| start + k as f64 * setup.spacing).collect(),
        sensor: Sensor {
            noise: if maker.noisy { setup.noise } else { 0.0 },
            dropout: 0.0,
            depth_scale: DEPTH_SCALE,
            seed: maker.seed,
        },
    };
    let mut recording = observe(e, Backend::Cpu, &observers, |_| ControlFlow::Continue(()))?;
    // The noise is stated as it is, also where none was added: readings are counted in its units.
    let sigma = (setup.noise.powi(2) + DEPTH_SCALE * DEPTH_SCALE / 12.0).sqrt();
    recording.cameras.iter_mut().for_each(|c| c.noise_sigma = Some(sigma));
    if let Some(m) = &mut recording.markers {
        m.noise_sigma = Some(setup.noise);
    }
    Ok(recording)
}

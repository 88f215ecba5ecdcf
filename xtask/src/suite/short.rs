//! A scene in a few lines.

use super::setup::Setup;

/// Young's modulus.
pub const E: &str = "material.youngs_modulus";
/// Stiffness damping.
pub const BETA: &str = "material.stiffness_damping";

/// A scene in short.
pub struct Short {
    /// Its shape.
    pub shape: &'static str,
    /// Edge of a cell [m].
    pub cell_size: f64,
    /// Density [kg/m³].
    pub density: f64,
    /// Model of the material, where it is not the default.
    pub model: Option<&'static str>,
    /// E [Pa], ν, α [1/s], β [s].
    pub material: [f64; 4],
    /// What it stands on or is held by.
    pub support: &'static str,
    /// Lines of it as they are true, and as a method is given them.
    pub given: &'static [(&'static str, &'static str)],
    /// Step [s].
    pub step: f64,
    /// Their number.
    pub steps: usize,
    /// Of the scheme.
    pub theta: f64,
    /// What is free, and where its fit starts.
    pub free: &'static [(&'static str, f64)],
    /// Cameras as on the command line.
    pub cameras: &'static [&'static str],
    /// Markers on the surface.
    pub markers: &'static [(&'static str, [f64; 3])],
    /// Frames are this far apart [s].
    pub spacing: f64,
    /// Noise [m].
    pub noise: f64,
    /// Velocity and angular velocity at the start.
    pub start: [[f64; 3]; 2],
    /// What it turns about.
    pub pivot: Option<[f64; 3]>,
    /// What the held-out recording starts with beside that.
    pub other_start: [[f64; 3]; 2],
}

impl Short {
    /// In full.
    pub fn setup(&self, name: &str) -> Setup {
        let [e, nu, alpha, beta] = self.material;
        let model = self.model.map_or_else(String::new, |m| format!("model = \"{m}\"\n"));
        let body = format!(
            "format = \"scene/1\"\n[object]\nshape = {}\ncell_size = {}\n[material]\n{model}density = {}\nyoungs_modulus = {e}\n\
             poisson_ratio = {nu}\nmass_damping = {alpha}\nstiffness_damping = {beta}\n{}[time]\nstep = {}\nsteps = {}\ntheta = {}\n",
            self.shape, self.cell_size, self.density, self.support, self.step, self.steps, self.theta
        );
        Setup {
            name: name.into(),
            body,
            given: self.given.iter().map(|(a, b)| (a.to_string(), b.to_string())).collect(),
            fit: self.free.iter().map(|(path, start)| Setup::free(path, *start)).collect(),
            cameras: self.cameras.iter().map(|c| c.to_string()).collect(),
            poses: Vec::new(),
            markers: self.markers.iter().map(|(n, p)| (n.to_string(), *p)).collect(),
            spacing: self.spacing,
            noise: self.noise,
            start: self.start,
            pivot: self.pivot,
            other_start: self.other_start,
        }
    }
}

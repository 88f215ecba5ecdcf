//! Meshes, points and splats from files, carried by a body's motion.
//!
//! A place in an element moves as that does. One beyond the cells follows the affine motion that fits the nodes around it best, so that a rigid
//! motion carries everything exactly; weighing nodes by their distance does not (at a turn of 45° a tenth of their spacing is lost).
//! The backend that simulates adds up for every frame.

use crate::engine::Backend;
use crate::error::Error;
use crate::experiment::Experiment;
use glam::{DAffine3, DMat3, DVec3};
use palpate_gpu::Skinning;
use palpate_io::carried::Carried;
use palpate_model::space::carrier::Followers;
use std::path::Path;

/// How far places may lie outside the elements without a warning, in elements.
const FAR: f64 = 2.0;

/// A file that a body carries.
pub struct Skin {
    file: Carried,
    followers: Followers,
    /// Places at rest in the world [m].
    rest: Vec<DVec3>,
    /// From the file's coordinates into the world.
    pose: DAffine3,
    /// The device that moves places; `None` = the CPU.
    device: Option<Skinning>,
}

impl Skin {
    /// Reads a file and finds what its places follow; with a sentence where some lie far from the body.
    ///
    /// # Errors
    /// The file cannot be read, or none of its places is near the body; or a device was asked for that cannot be had.
    pub fn new(experiment: &Experiment, path: &Path, backend: Backend) -> Result<(Skin, Option<String>), Error> {
        let file = Carried::read(path)?;
        let (pose, body) = (experiment.scene().object.pose, &experiment.plan().body);
        let rest: Vec<DVec3> = file.places().iter().map(|p| pose.transform_point3(*p)).collect();
        let followers = body.followers(&rest);
        let allowed = FAR * body.length;
        let far = followers.away.iter().filter(|d| **d > allowed).count();
        let farthest = followers.away.iter().copied().fold(0.0, f64::max);
        let doubt = (far > 0).then(|| {
            format!(
                "{}: {far} of {} {} lie more than {allowed:.4} m outside the body, the farthest {farthest:.4} m; they follow what is nearest to them",
                path.display(),
                rest.len(),
                file.noun()
            )
        });
        if far == rest.len() {
            let doubt = doubt.unwrap_or_default();
            return Err(Error::Input(format!("{doubt} (are they in metres, and in the coordinates of object.mesh?)")));
        }
        let device = backend.skinning(&followers.stencils, body.nodes.len())?;
        Ok((Skin { file, followers, rest, pose, device }, doubt))
    }

    /// Writes the file as it is at node displacements `[N]` [m].
    ///
    /// # Errors
    /// The file cannot be written, or the device fails.
    pub fn write(&mut self, path: &Path, displacement: &[DVec3]) -> Result<(), Error> {
        let known = self.device.as_mut().map(|d| d.moved(displacement)).transpose().map_err(Error::Device)?;
        let moved = |i: usize| {
            let s = self.followers.stencils.get(i);
            let (u, h) = known.as_ref().map_or_else(|| (s.at(displacement), s.gradient_of(displacement)), |all| all[i]);
            (self.rest[i] + u, (DMat3::IDENTITY + h) * self.pose.matrix3)
        };
        Ok(self.file.write(path, moved)?)
    }
}

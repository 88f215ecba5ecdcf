//! A scene of the suite: a body whose truth is known, what is free in it, and what watches it.

use crate::tetrahedra::watch::Watchers;
use glam::{DAffine3, DQuat, DVec3};
use palpate::Error;
use palpate::render::Pinhole;
use palpate_diagnose::Way;
use palpate_io::parse_scene;
use palpate_model::scene::Scene;
use std::path::Path;

/// A scene with its cameras and markers.
#[derive(Clone, Debug, PartialEq)]
pub struct Setup {
    /// Name.
    pub name: String,
    /// The scene file without start, observation and fit; its values are the true ones unless something is hidden.
    pub body: String,
    /// Velocity [m/s] and angular velocity [rad/s] at the start.
    pub start: [[f64; 3]; 2],
    /// What it turns about [m]; the centre of mass where nothing is said.
    pub pivot: Option<[f64; 3]>,
    /// What a method is free to fit from the start, as scene file.
    pub fit: String,
    /// Lines of the body as they are true, and as a method is given them; numbers of the material that are free are given at their start.
    pub given: Vec<(String, String)>,
    /// Cameras as on the command line.
    pub cameras: Vec<String>,
    /// Where cameras stand that stand elsewhere: number, and pose, world from camera.
    pub poses: Vec<(u32, DAffine3)>,
    /// Markers on the rest surface [m].
    pub markers: Vec<(String, [f64; 3])>,
    /// Frames are this far apart [s].
    pub spacing: f64,
    /// Noise of a depth reading and of a marker's coordinate [m].
    pub noise: f64,
    /// The start of the held-out recording: velocity [m/s] and angular velocity [rad/s] added.
    pub other_start: [[f64; 3]; 2],
}

impl Setup {
    /// The true scene with nothing hidden; the held-out recording's when `other`.
    ///
    /// # Errors
    /// The scene cannot be read.
    pub fn truth(&self, other: bool) -> Result<Scene, Error> {
        self.parse(&format!("{}{}", self.body, self.initial(other)))
    }

    /// The scene file that a method gets, which compares with a recording in `folder`.
    pub fn text(&self, folder: &Path, other: bool) -> String {
        let costs = [(self.cameras.is_empty(), "sparse-surface"), (self.markers.is_empty(), "markers")];
        let costs: Vec<&str> = costs.iter().filter(|c| !c.0).map(|c| c.1).collect();
        let seen = format!("[observation]\nrecording = {:?}\ncost = {costs:?}\n", folder.display().to_string());
        format!("{}{}{seen}{}", self.stated(), self.initial(other), self.fit)
    }

    /// The body without the truth of what is free.
    fn stated(&self) -> String {
        let mut body = self.given.iter().fold(self.body.clone(), |b, (truth, given)| b.replace(truth, given));
        let mut lines = self.fit.lines();
        while let Some(line) = lines.next() {
            let Some(key) = line.strip_prefix("path = \"material.").and_then(|l| l.strip_suffix('"')) else { continue };
            let start = lines.next().and_then(|l| l.strip_prefix("start = [")?.split(',').next()).unwrap_or_default().to_string();
            let one = |l: &str| match l.split_once(" = ") {
                Some((k, _)) if k == key => format!("{key} = {start}\n"),
                _ => format!("{l}\n"),
            };
            body = body.lines().map(one).collect();
        }
        body
    }

    /// A scene from text of this setup.
    ///
    /// # Errors
    /// The scene cannot be read.
    pub fn parse(&self, text: &str) -> Result<Scene, Error> {
        Ok(parse_scene(text, format!("{}.toml", self.name))?.value)
    }

    /// The start, as scene file.
    fn initial(&self, other: bool) -> String {
        let added = |k: usize, a: usize| self.start[k][a] + if other { self.other_start[k][a] } else { 0.0 };
        let [v, w] = [0, 1].map(|k| [0, 1, 2].map(|a| added(k, a)));
        let pivot = self.pivot.map_or(String::new(), |p| format!("pivot = {p:?}\n"));
        format!("[initial]\nvelocity = {v:?}\nangular_velocity = {w:?}\n{pivot}")
    }

    /// The same with cameras elsewhere and another start, as a way says.
    #[must_use]
    pub fn moved(mut self, way: &Way) -> Setup {
        for (start, more) in self.start.iter_mut().zip([way.push, way.spin]) {
            *start = (DVec3::from(*start) + more).to_array();
        }
        self.poses.extend(&way.cameras);
        self
    }

    /// The same, with gravity from another side.
    ///
    /// # Errors
    /// The scene cannot be read.
    pub fn turned(mut self, turn: DQuat) -> Result<Setup, Error> {
        if turn != DQuat::IDENTITY {
            let line = format!("gravity = {:?}", (turn * self.truth(false)?.gravity).to_array());
            self.body = match self.body.lines().find(|l| l.starts_with("gravity = ")) {
                Some(stated) => self.body.replace(stated, &line),
                None => format!("{}[world]\n{line}\n", self.body),
            };
        }
        Ok(self)
    }

    /// Its cameras.
    ///
    /// # Errors
    /// A camera's description is wrong.
    pub fn cameras(&self) -> Result<Vec<Pinhole>, Error> {
        let one = |(i, text): (usize, &String)| {
            let c: Pinhole = text.parse().map_err(|e| Error::Input(format!("{}: {e}", self.name)))?;
            let moved = self.poses.iter().rev().find(|(number, _)| *number as usize == i);
            let world_from_camera = moved.map_or(c.world_from_camera, |(_, pose)| *pose);
            Ok(Pinhole { name: format!("cam{i}"), world_from_camera, ..c })
        };
        self.cameras.iter().enumerate().map(one).collect()
    }

    /// Its markers.
    pub fn markers(&self) -> Vec<(String, DVec3)> {
        self.markers.iter().map(|(n, p)| (n.clone(), DVec3::from(*p))).collect()
    }

    /// What watches it, for recordings of the tetrahedra.
    ///
    /// # Errors
    /// A camera's description is wrong.
    pub fn watchers(&self, noisy: bool, seed: u64) -> Result<Watchers, Error> {
        Ok(Watchers {
            cameras: self.cameras()?,
            markers: self.markers(),
            noise: if noisy { self.noise } else { 0.0 },
            stated: self.noise,
            seed,
        })
    }

    /// What is free, as lines of a scene file: path and start.
    pub fn free(path: &str, start: f64) -> String {
        format!("[[fit.parameter]]\npath = \"{path}\"\nstart = [{start}, {start}]\n")
    }
}

#[cfg(test)]
mod tests {
    use super::super::list::List;
    use std::path::Path;

    /// Whoever reads a scene must not read the truth of what is free in it.
    #[test]
    fn scenes_do_not_state_the_truth_of_what_is_free() {
        for c in List::read().unwrap().cases().unwrap() {
            let setup = c.setup().unwrap();
            let (truth, given) = (setup.truth(false).unwrap(), setup.parse(&setup.text(Path::new("seen"), false)).unwrap());
            for p in given.fit.iter().flat_map(|f| &f.parameters) {
                let [of_truth, stated] = [&truth, &given].map(|s| match p.path.as_str() {
                    "material.youngs_modulus" => s.material.youngs_modulus,
                    "material.stiffness_damping" => s.material.stiffness_damping,
                    "material.mass_damping" => s.material.mass_damping,
                    "plane.0.height" => s.planes[0].point.dot(s.planes[0].normal),
                    "plane.0.phi" => s.planes[0].normal.z.atan2(s.planes[0].normal.x),
                    // Everybody knows what it is on earth; that it is free is the difficulty.
                    "world.gravity.z" => f64::NAN,
                    other => panic!("{}: {other}", c.name),
                });
                assert_ne!(of_truth, stated, "{} {}", c.name, p.path);
            }
            assert_eq!((truth.time.step, truth.initial.velocity), (given.time.step, given.initial.velocity));
        }
    }
}

//! Places of the surface as cameras see them: which of them are visible, and which rays prove that the body is not where it is claimed to be.

use super::cubes::Cubes;
use crate::costs::Look;
use glam::{DMat3, DVec3};
use palpate_model::cutcells::grid::SIGNS;
use palpate_model::observation::{Camera, ReadingKind};
use palpate_model::space::body::{Body, Patch};
use palpate_model::space::stencil::{Stencil, Stencils};
use std::collections::{BTreeMap, BTreeSet};

/// A place may lie this many spacings behind the nearest one on its line of sight and still be seen: surfaces are slanted.
const BEHIND: f64 = 2.0;
/// Edge of a pixel of the picture that visibility is judged by, in spacings: few pixels between places stay empty.
const PIXEL: f64 = 1.5;
/// Noise of a reading beyond which a ray has passed through the body.
const THROUGH: f64 = 3.0;

/// The pieces of a body's surface.
#[derive(Debug)]
pub struct Places {
    /// Mean distance of neighbours [m].
    pub spacing: f64,
    /// Displacement gradient in every element.
    gradients: Stencils,
}

/// A piece where the body is now.
#[derive(Clone, Copy, Debug)]
pub struct Place {
    /// Its middle [m].
    pub position: DVec3,
    /// Outward normal, of any length.
    pub normal: DVec3,
    /// Area at rest [m²].
    pub area: f64,
}

/// What a camera sees, in pixels that are as wide as places are apart.
struct Picture {
    center: DVec3,
    axis: DVec3,
    right: DVec3,
    down: DVec3,
    /// Tangent of the angle that a pixel takes.
    pixel: f64,
    /// Distance along the axis of the nearest place that faces the camera, by pixel [m].
    nearest: BTreeMap<(i64, i64), f64>,
}

impl Picture {
    /// `None` where there are no lines of sight.
    fn new(camera: &Camera, places: &[Place], spacing: f64) -> Option<Picture> {
        let center = camera.center()?;
        let axis = match camera {
            Camera::Pinhole { axis, .. } => *axis,
            // A scanner looks at the body.
            _ => {
                let middle = places.iter().map(|p| p.position).sum::<DVec3>() / places.len().max(1) as f64;
                (middle - center).try_normalize()?
            }
        };
        let right = axis.any_orthonormal_vector();
        let mut mean = 0.0;
        places.iter().for_each(|p| mean += (p.position - center).length() / places.len() as f64);
        let pixel = PIXEL * spacing / mean.max(spacing);
        let mut picture = Picture { center, axis, right, down: axis.cross(right), pixel, nearest: BTreeMap::new() };
        let facing = places.iter().filter(|p| picture.faces(p));
        let at: Vec<((i64, i64), f64)> = facing.filter_map(|p| picture.pixel_of(p.position)).collect();
        for (at, depth) in at {
            let nearest = picture.nearest.entry(at).or_insert(depth);
            *nearest = nearest.min(depth);
        }
        Some(picture)
    }

    fn faces(&self, p: &Place) -> bool {
        p.normal.dot(p.position - self.center) < 0.0
    }

    fn pixel_of(&self, p: DVec3) -> Option<((i64, i64), f64)> {
        let away = p - self.center;
        let depth = away.dot(self.axis);
        let at = |side: DVec3| (away.dot(side) / depth / self.pixel).round() as i64;
        (depth > 0.0).then(|| ((at(self.right), at(self.down)), depth))
    }

    fn sees(&self, p: &Place, slack: f64) -> bool {
        self.faces(p)
            && self
                .pixel_of(p.position)
                .is_some_and(|(at, depth)| depth <= self.nearest.get(&at).copied().unwrap_or(depth) + slack)
    }
}

impl Places {
    /// The pieces of a body.
    pub fn new(body: &Body) -> Places {
        let mut gradients = Stencils::default();
        if let Some(cut) = &body.cut {
            let weight = 0.25 / cut.grid.h;
            let g = SIGNS.map(|s| weight * DVec3::from_array(s));
            cut.cells.iter().for_each(|c| _ = gradients.push_with_gradient(&c.nodes, &[0.125; 8], &g));
        } else {
            body.points.means().for_each(|s| _ = gradients.push_with_gradient(s.nodes, s.value, s.gradient));
        }
        Places { spacing: (body.area / body.patches.len().max(1) as f64).sqrt(), gradients }
    }

    /// Largest displacement gradient in an element (Frobenius norm).
    pub fn largest_gradient(&self, u: &[DVec3]) -> f64 {
        let square = |m: DMat3| m.x_axis.length_squared() + m.y_axis.length_squared() + m.z_axis.length_squared();
        self.gradients.iter().map(|s| square(s.gradient_of(u))).fold(0.0, f64::max).sqrt()
    }

    /// Where they are at displacement u `[N]`.
    pub fn at(&self, body: &Body, u: &[DVec3]) -> Vec<Place> {
        let turned: Vec<DMat3> = self.gradients.iter().map(|s| cofactor(DMat3::IDENTITY + s.gradient_of(u))).collect();
        let place = |(p, s): (&Patch, Stencil)| Place {
            position: p.point + s.at(u),
            normal: turned[p.cell as usize] * p.normal,
            area: p.area,
        };
        body.pieces().map(place).collect()
    }

    /// For every camera which places it sees; all, where there are no lines of sight.
    pub fn seen(&self, places: &[Place], cameras: &[Camera]) -> Vec<Vec<bool>> {
        let slack = BEHIND * self.spacing;
        let of_camera = |c: &Camera| match Picture::new(c, places, self.spacing) {
            Some(picture) => places.iter().map(|p| picture.sees(p, slack)).collect(),
            None => vec![true; places.len()],
        };
        cameras.iter().map(of_camera).collect()
    }

    /// Which places at displacement u have one of the frame's readings on their line of sight, or near them where there is none.
    pub fn read(&self, body: &Body, look: Look, u: &[DVec3]) -> Vec<bool> {
        let (points, cameras) = (&look.seen().points, &look.observation.cameras);
        let places = self.at(body, u);
        let mut read = vec![false; places.len()];
        for (c, camera) in cameras.iter().enumerate() {
            let of_camera = points.iter().filter(|p| p.camera as usize == c);
            let Some(picture) = Picture::new(camera, &places, self.spacing) else {
                let all: Vec<DVec3> = of_camera.map(|p| p.position).collect();
                let (reach, cubes) = (PIXEL * self.spacing, Cubes::new(&all, PIXEL * self.spacing));
                for (read, place) in read.iter_mut().zip(&places).filter(|_| !all.is_empty()) {
                    cubes.near(place.position, |k| *read |= (all[k] - place.position).length() <= reach);
                }
                continue;
            };
            let filled: BTreeSet<(i64, i64)> = of_camera.filter_map(|p| Some(picture.pixel_of(p.position)?.0)).collect();
            for (read, place) in read.iter_mut().zip(&places) {
                let at = picture.pixel_of(place.position).map(|p| p.0);
                *read |= at.is_some_and(|at| filled.contains(&at)) && picture.sees(place, BEHIND * self.spacing);
            }
        }
        read
    }

    /// Of a frame's rays that meet the body, the share that pass through: their reading lies behind it, and no part of the surface is where it
    /// lies.
    pub fn pierced(&self, body: &Body, look: Look, u: &[DVec3]) -> f64 {
        let (points, cameras) = (&look.seen().points, &look.observation.cameras);
        if points.is_empty() {
            return 0.0;
        }
        let places = self.at(body, u);
        let pictures: Vec<Option<Picture>> = cameras.iter().map(|c| Picture::new(c, &places, self.spacing)).collect();
        let slack = BEHIND * self.spacing + THROUGH * look.observation.noise(ReadingKind::Depth);
        let all: Vec<DVec3> = places.iter().map(|p| p.position).collect();
        let cubes = Cubes::new(&all, slack);
        let (mut met, mut through) = (0usize, 0usize);
        for p in points {
            let Some(picture) = &pictures[p.camera as usize] else { continue };
            let Some((at, depth)) = picture.pixel_of(p.position) else { continue };
            let Some(nearest) = picture.nearest.get(&at) else { continue };
            met += 1;
            if depth <= nearest + slack {
                continue;
            }
            let mut away = f64::INFINITY;
            cubes.near(p.position, |k| away = away.min((all[k] - p.position).length()));
            through += usize::from(away > slack);
        }
        through as f64 / met.max(1) as f64
    }
}

/// det(F) F⁻ᵀ: it turns normals with their areas.
fn cofactor(f: DMat3) -> DMat3 {
    DMat3::from_cols(f.y_axis.cross(f.z_axis), f.z_axis.cross(f.x_axis), f.x_axis.cross(f.y_axis))
}

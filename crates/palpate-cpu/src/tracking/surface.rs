//! Places of the surface as cameras see them: which of them are visible, and which rays prove that the body is not where it is claimed to be.

use super::cubes::Cubes;
use glam::{DMat3, DVec3};
use palpate_engine::tracking::{Eye, PIXEL, Place, Rays, Sighting};
use palpate_model::cutcells::grid::SIGNS;
use palpate_model::space::body::{Body, Patch};
use palpate_model::space::stencil::{Stencil, Stencils};
use std::collections::{BTreeMap, BTreeSet};

/// The pieces of a body's surface.
#[derive(Debug)]
pub struct Places {
    /// Mean distance of neighbours [m].
    pub spacing: f64,
    /// Displacement gradient in every element.
    gradients: Stencils,
}

/// What a camera sees.
struct Picture {
    eye: Eye,
    /// Distance along the axis of the nearest place that faces the camera, by pixel [m].
    nearest: BTreeMap<(i64, i64), f64>,
}

impl Picture {
    fn new(eye: Eye, places: &[Place]) -> Picture {
        let mut nearest = BTreeMap::new();
        let facing = places.iter().filter(|p| eye.faces(p));
        for (at, depth) in facing.filter_map(|p| eye.pixel_of(p.position)) {
            let nearest = nearest.entry(at).or_insert(depth);
            *nearest = nearest.min(depth);
        }
        Picture { eye, nearest }
    }

    fn sees(&self, p: &Place, slack: f64) -> bool {
        let before = |(at, depth)| depth <= self.nearest.get(&at).copied().unwrap_or(depth) + slack;
        self.eye.faces(p) && self.eye.pixel_of(p.position).is_some_and(before)
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
}

/// The picture of every camera; `None` where there are no lines of sight.
fn pictures(s: &Sighting) -> Vec<Option<Picture>> {
    s.eyes().into_iter().map(|eye| Some(Picture::new(eye?, s.places))).collect()
}

/// For every camera which places it sees; all, where there are no lines of sight.
pub fn visible(s: &Sighting) -> Vec<Vec<bool>> {
    let of_picture = |picture: &Option<Picture>| match picture {
        Some(picture) => s.places.iter().map(|p| picture.sees(p, s.slack())).collect(),
        None => vec![true; s.places.len()],
    };
    pictures(s).iter().map(of_picture).collect()
}

/// Which places have one of the frame's readings on their line of sight, or near them where there is none.
pub fn read(s: &Sighting) -> Vec<bool> {
    let mut read = vec![false; s.places.len()];
    for (c, picture) in pictures(s).iter().enumerate() {
        let of_camera = s.points.iter().filter(|p| p.camera as usize == c);
        let Some(picture) = picture else {
            let all: Vec<DVec3> = of_camera.map(|p| p.position).collect();
            let (reach, cubes) = (PIXEL * s.spacing, Cubes::new(&all, PIXEL * s.spacing));
            for (read, place) in read.iter_mut().zip(s.places).filter(|_| !all.is_empty()) {
                cubes.near(place.position, |k| *read |= (all[k] - place.position).length() <= reach);
            }
            continue;
        };
        let filled: BTreeSet<(i64, i64)> = of_camera.filter_map(|p| Some(picture.eye.pixel_of(p.position)?.0)).collect();
        for (read, place) in read.iter_mut().zip(s.places) {
            let at = picture.eye.pixel_of(place.position).map(|p| p.0);
            *read |= at.is_some_and(|at| filled.contains(&at)) && picture.sees(place, s.slack());
        }
    }
    read
}

/// How a frame's rays meet the body.
pub fn rays(s: &Sighting) -> Rays {
    let mut rays = Rays::default();
    if s.points.is_empty() {
        return rays;
    }
    let (pictures, slack) = (pictures(s), s.depth());
    let all: Vec<DVec3> = s.places.iter().map(|p| p.position).collect();
    let cubes = Cubes::new(&all, slack);
    for p in s.points {
        let Some(picture) = &pictures[p.camera as usize] else { continue };
        let Some((at, depth)) = picture.eye.pixel_of(p.position) else { continue };
        let Some(nearest) = picture.nearest.get(&at) else { continue };
        rays.met += 1;
        if depth <= nearest + slack {
            continue;
        }
        let mut away = f64::INFINITY;
        cubes.near(p.position, |k| away = away.min((all[k] - p.position).length()));
        rays.through += usize::from(away > slack);
    }
    rays
}

/// det(F) F⁻ᵀ: it turns normals with their areas.
fn cofactor(f: DMat3) -> DMat3 {
    DMat3::from_cols(f.y_axis.cross(f.z_axis), f.z_axis.cross(f.x_axis), f.x_axis.cross(f.y_axis))
}

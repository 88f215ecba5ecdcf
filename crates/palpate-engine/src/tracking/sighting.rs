//! A frame's points against the surface's places: who belongs to whom, who sees whom. What every backend computes of it is `trait Correspond`;
//! what decides it is here once.

use crate::failure::Failure;
use glam::DVec3;
use palpate_model::observation::{Camera, ObservedPoint};
use std::fmt::Debug;

/// A place may lie this many spacings behind the nearest one on its line of sight and still be seen: surfaces are slanted.
pub const BEHIND: f64 = 2.0;
/// Edge of a pixel of the picture that visibility is judged by, in spacings: few pixels between places stay empty.
pub const PIXEL: f64 = 1.5;
/// Noise of a reading beyond which a ray has passed through the body.
pub const THROUGH: f64 = 3.0;
/// Reach of a Gaussian over σ: beyond lie 0.11 % of it.
pub const REACH: f64 = 4.0;
/// Most pairs that are looked at: with more, every so-manieth place and point stand for all.
const PAIRS: usize = 4_000_000;

/// A piece of the surface where the body is now.
#[derive(Clone, Copy, Debug)]
pub struct Place {
    /// Its middle [m].
    pub position: DVec3,
    /// Outward normal, of any length.
    pub normal: DVec3,
    /// Area at rest [m²].
    pub area: f64,
}

/// A frame and a surface.
#[derive(Clone, Copy, Debug)]
pub struct Sighting<'a> {
    /// Depth points `[N]`.
    pub points: &'a [ObservedPoint],
    /// What saw them `[C]`.
    pub cameras: &'a [Camera],
    /// Pieces of the surface `[K]`.
    pub places: &'a [Place],
    /// Mean distance of neighbouring places [m].
    pub spacing: f64,
    /// Standard deviation of a depth reading [m].
    pub noise: f64,
}

impl Sighting<'_> {
    /// How far behind the nearest place one may lie and be seen [m].
    pub fn slack(&self) -> f64 {
        BEHIND * self.spacing
    }

    /// How far behind the surface a reading has to lie that has passed through it [m].
    pub fn depth(&self) -> f64 {
        BEHIND * self.spacing + THROUGH * self.noise
    }

    /// The eye of every camera; `None` without lines of sight.
    pub fn eyes(&self) -> Vec<Option<Eye>> {
        self.cameras.iter().map(|c| Eye::new(c, self.places, self.spacing)).collect()
    }
}

/// P and Q of one place: `P_k = Σ_n p_kn` and `Q_k = Σ_n p_kn c_n` [m].
pub type Share = (f64, DVec3);

/// Rays of a frame against the body.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Rays {
    /// Those that meet it.
    pub met: usize,
    /// Those of them that pass through: their reading lies behind it, and no part of the surface is where it lies.
    pub through: usize,
}

impl Rays {
    /// Share of those that pass through; zero without any.
    pub fn share(&self) -> f64 {
        self.through as f64 / self.met.max(1) as f64
    }
}

/// Who belongs to whom in a frame (Wang et al. 2015, eq. 4). With the weights `π_k` of visible places by their area, the share of outliers w and
/// the volume V that they lie in, the share of the place k in the point n is
///
/// `p_kn = (1 − w) π_k L_kn / (Σ_j (1 − w) π_j L_jn + w/V)`, `L_kn = (2πσ²)^(−3/2) exp(−|c_n − s_k|²/2σ²)`.
pub trait Correspond: Debug {
    /// P and Q of every place `[K]`, for Gaussians of the standard deviation σ [m] and a share of outliers.
    ///
    /// # Errors
    /// A device breaks, or has no room.
    fn shares(&mut self, s: &Sighting, spread: f64, outliers: f64) -> Result<Vec<Share>, Failure>;

    /// For every camera which places it sees `[C][K]`; all, where there are no lines of sight.
    ///
    /// # Errors
    /// As [`Correspond::shares`].
    fn visible(&mut self, s: &Sighting) -> Result<Vec<Vec<bool>>, Failure>;

    /// Which places have a reading on their line of sight, or near them where there is none `[K]`.
    ///
    /// # Errors
    /// As [`Correspond::shares`].
    fn read(&mut self, s: &Sighting) -> Result<Vec<bool>, Failure>;

    /// How the frame's rays meet the body.
    ///
    /// # Errors
    /// As [`Correspond::shares`].
    fn rays(&mut self, s: &Sighting) -> Result<Rays, Failure>;
}

/// What the mixture is made of beside its places.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Mixing {
    /// Volume that outliers lie in: where points can be, outliers are [m³].
    pub volume: f64,
    /// Distance beyond which a place has no share [m].
    pub reach: f64,
    /// Every so-manieth place and point stand for all: wide Gaussians hold everything, and then a sample is as good.
    pub thin: usize,
}

impl Mixing {
    /// Of so many places and at least one point, for Gaussians of this standard deviation [m].
    pub fn new(points: &[ObservedPoint], places: usize, spread: f64) -> Mixing {
        let of_points = points.iter().map(|p| p.position);
        let (low, high) = of_points.fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(low, high), p| (low.min(p), high.max(p)));
        let side = (high - low).max(DVec3::splat(spread));
        let volume = side.x * side.y * side.z;
        let reach = REACH * spread;
        let near = (reach * reach * reach * 27.0 / volume).min(1.0);
        let pairs = near * places as f64 * points.len() as f64;
        Mixing { volume, reach, thin: (pairs / PAIRS as f64).sqrt().ceil().max(1.0) as usize }
    }
}

/// How a camera looks at a body, in pixels that are as wide as places are apart.
#[derive(Clone, Copy, Debug)]
pub struct Eye {
    /// Where lines of sight come from [m].
    pub center: DVec3,
    /// Unit vector along which depth counts.
    pub axis: DVec3,
    /// Unit vector along the rows of the picture.
    pub right: DVec3,
    /// Unit vector along its columns.
    pub down: DVec3,
    /// Tangent of the angle that a pixel takes.
    pub pixel: f64,
}

impl Eye {
    /// `None` where there are no lines of sight.
    pub fn new(camera: &Camera, places: &[Place], spacing: f64) -> Option<Eye> {
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
        Some(Eye { center, axis, right, down: axis.cross(right), pixel })
    }

    /// Whether a place faces it.
    pub fn faces(&self, p: &Place) -> bool {
        p.normal.dot(p.position - self.center) < 0.0
    }

    /// Column, row and depth [m] of a position; `None` behind it.
    pub fn pixel_of(&self, p: DVec3) -> Option<((i64, i64), f64)> {
        let away = p - self.center;
        let depth = away.dot(self.axis);
        let at = |side: DVec3| (away.dot(side) / depth / self.pixel).round() as i64;
        (depth > 0.0).then(|| ((at(self.right), at(self.down)), depth))
    }
}

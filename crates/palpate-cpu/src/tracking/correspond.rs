//! Who belongs to whom, in double precision.

use super::mixture::Mixture;
use super::surface;
use palpate_engine::Failure;
use palpate_engine::tracking::{Correspond, Rays, Share, Sighting};

/// Computes what points and places have to do with each other, on all cores. It cannot fail.
#[derive(Clone, Copy, Debug, Default)]
pub struct Correspondence;

impl Correspond for Correspondence {
    fn shares(&mut self, s: &Sighting, spread: f64, outliers: f64) -> Result<Vec<Share>, Failure> {
        Ok(Mixture::new(s, spread, outliers).shares)
    }

    fn visible(&mut self, s: &Sighting) -> Result<Vec<Vec<bool>>, Failure> {
        Ok(surface::visible(s))
    }

    fn read(&mut self, s: &Sighting) -> Result<Vec<bool>, Failure> {
        Ok(surface::read(s))
    }

    fn rays(&mut self, s: &Sighting) -> Result<Rays, Failure> {
        Ok(surface::rays(s))
    }
}

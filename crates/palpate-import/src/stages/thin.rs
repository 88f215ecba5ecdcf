//! How much of dense measurements a fit uses: enough to average noise, not so much that every evaluation waits.

use super::settle::{Said, median};
use crate::capture::Guess;
use crate::options::Options;
use palpate_io::Recording;

/// Readings a depth image of which a fit uses: more of one surface say the same.
const POINTS: usize = 2000;

/// Times a fit compares at.
const INSTANTS: usize = 100;

/// What a scene takes of a recording: every n-th pixel row and column, every n-th time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Thinned {
    /// Of rows and columns.
    pub stride: usize,
    /// Of times.
    pub every: usize,
}

/// Strides for the times of a recording between two.
pub fn choose(r: &Recording, from: f64, to: f64, o: &Options, said: &mut Said) -> Thinned {
    let used: Vec<_> = r.frames.iter().filter(|f| (from..=to).contains(&f.time)).collect();
    let wanted = o.points.unwrap_or(POINTS);
    let clouds: Vec<_> = r.clouds.iter().filter(|c| (from..=to).contains(&c.time)).collect();
    let counts = used.iter().map(|f| f.readings().count()).chain(clouds.iter().map(|c| c.points.len()));
    let dense = median(counts.map(|n| n as f64).collect()).unwrap_or(0.0);
    let stride = (dense / wanted as f64).sqrt().ceil().max(1.0) as usize;
    let mut times: Vec<f64> = used.iter().map(|f| f.time).chain(clouds.iter().map(|c| c.time)).collect();
    let markers = r.markers.iter().flat_map(|m| m.samples.iter().map(|s| s.time));
    let tracks = r.points.iter().flat_map(|p| p.track.times.iter().copied());
    times.extend(markers.chain(tracks).filter(|t| (from..=to).contains(t)));
    times.sort_by(f64::total_cmp);
    times.dedup();
    let every = times.len().div_ceil(INSTANTS).max(1);
    if stride > 1 {
        let text =
            format!("one of {stride} rows and columns, about {wanted} of {dense:.0} readings an image; the recording keeps all");
        said.guesses.push(Guess::scene("thinning", "observation.pixel_stride", text, "--points"));
    }
    if every > 1 {
        let text = format!("one of {every} times is compared, of {} in all; the recording keeps them", times.len());
        said.guesses.push(Guess::scene("thinning", "observation.frames", text, "--every (leaves times out of the recording)"));
    }
    Thinned { stride, every }
}

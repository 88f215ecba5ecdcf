//! When the motion begins: the first time at which something moved farther than noise, and back from there by a free fall.

use super::settle::{Said, median};
use crate::capture::Guess;
use crate::options::Options;
use glam::DVec3;
use palpate_io::Recording;

/// Standard gravity [m/s²].
pub const GRAVITY: f64 = 9.81;

/// Farther than this is no noise [m]: of a marker or a tracked point, of the middle of many depth readings.
const MARKER_STIR: f64 = 0.001;
const DEPTH_STIR: f64 = 0.002;

/// Less than this share of the whole motion is none yet.
const SHARE: f64 = 0.02;

/// What a recording does.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Motion {
    /// Nothing moves.
    Still,
    /// Every frame is an equilibrium of its own, the first one at this time [s].
    Sequence {
        /// On the source's clock.
        first: f64,
    },
    /// Something moves from a time on [s]; `rested` where it stood still before.
    Moving {
        /// The moment of release [s].
        from: f64,
        /// True where the recording shows it at rest before.
        rested: bool,
    },
}

/// Times and how far the body had moved since the first [m].
fn way(r: &Recording) -> (Vec<f64>, Vec<f64>, f64) {
    if let Some(m) = &r.markers {
        let mut first: Vec<Option<DVec3>> = vec![None; m.names.len()];
        let (mut times, mut far): (Vec<f64>, Vec<f64>) = Default::default();
        for s in &m.samples {
            let d = s.position.distance(*first[s.marker].get_or_insert(s.position));
            if times.last() != Some(&s.time) {
                times.push(s.time);
                far.push(0.0);
            }
            let last = far.len() - 1;
            far[last] = far[last].max(d);
        }
        return (times, far, MARKER_STIR);
    }
    if let Some(p) = &r.points {
        let mut first: Vec<Option<DVec3>> = vec![None; p.track.count()];
        let far = (0..p.track.times.len()).map(|t| {
            let mut all: Vec<f64> = p.track.seen(t).map(|(i, x)| x.distance(*first[i].get_or_insert(x))).collect();
            all.sort_by(f64::total_cmp);
            // One of many points that jumps is a tracker's slip.
            all.get((all.len() * 19 / 20).min(all.len().saturating_sub(1))).copied().unwrap_or(0.0)
        });
        let far = far.collect();
        return (p.track.times.clone(), far, MARKER_STIR);
    }
    if !r.clouds.is_empty() {
        let middle = |c: &palpate_io::recording::RecordedCloud| c.points.iter().sum::<DVec3>() / c.points.len().max(1) as f64;
        let mut first = None;
        let far = r.clouds.iter().map(middle).map(|p| p.distance(*first.get_or_insert(p))).collect();
        return (r.clouds.iter().map(|c| c.time).collect(), far, DEPTH_STIR);
    }
    let middle = |f: &palpate_io::recording::RecordedFrame| {
        let camera = &r.cameras[f.camera];
        let (mut sum, mut n) = (DVec3::ZERO, 0.0);
        for (u, v, c) in f.readings() {
            if let Some(p) = camera.point(u as f64, v as f64, camera.depth(c)) {
                sum += p;
                n += 1.0;
            }
        }
        sum / f64::max(n, 1.0)
    };
    // Of several cameras the first: they see different sides.
    let mut first = None;
    let camera = r.frames.first().map_or(0, |f| f.camera);
    let moves = r.cameras.len() > 1 && r.frames.iter().filter(|f| f.camera == camera).count() < 2;
    let frames: Vec<_> = r.frames.iter().filter(|f| moves || f.camera == camera).collect();
    let far = frames.iter().map(|f| middle(f)).map(|p| p.distance(*first.get_or_insert(p))).collect();
    (frames.iter().map(|f| f.time).collect(), far, DEPTH_STIR)
}

/// Looks for the moment of release; what is found is a guess where the user does not say it.
pub fn find(r: &Recording, o: &Options, said: &mut Said) -> Motion {
    let (times, far, stir) = way(r);
    let (first, last) = (times.first().copied().unwrap_or(0.0), times.last().copied().unwrap_or(0.0));
    if let Some(from) = o.release {
        return Motion::Moving { from, rested: from > first };
    }
    let most = far.iter().copied().fold(0.0, f64::max);
    if times.len() < 2 || most < stir {
        let text = match times.len() {
            0 | 1 => "there is one time alone: the body is taken to be at rest under its weight".to_string(),
            n => format!("nothing moves by {} mm in {n} times: the body is taken to be at rest under its weight", 1e3 * stir),
        };
        said.guesses.push(Guess::scene("release time", "initial.state", text, "--release"));
        return Motion::Still;
    }
    let border = f64::max(stir, SHARE * most);
    let begun = (0..far.len()).find(|k| far[*k] > border && far.get(k + 1).is_none_or(|f| *f > border)).unwrap_or(0);
    // How far the first times are apart says whether rest was seen at all.
    let usual = median(times.windows(2).map(|w| w[1] - w[0]).collect()).unwrap_or(0.0);
    let from = f64::max(first, times[begun] - (2.0 * far[begun] / GRAVITY).sqrt());
    // No release is known to less than ten microseconds.
    let from = f64::max(first, (from * 1e5).round() / 1e5);
    let rested = from > first + 0.5 * usual;
    let text = if rested {
        format!(
            "{from:.4} s, a free fall before the first time at which something has moved by {:.1} mm ({:.4} s)",
            1e3 * far[begun],
            times[begun]
        )
    } else {
        format!("{first:.4} s, the first time, since the body moves from there on; it may have been released before")
    };
    said.guesses.push(Guess::scene("release time", "time.start", text, "--release"));
    Motion::Moving { from: (if rested { from } else { first }).min(last), rested }
}

//! Markers and tracks in metres, where they are at rest, and which of them never move.

use super::release::Motion;
use super::settle::Said;
use crate::capture::{Capture, Guess, Markers, Tracks};
use crate::error::{ImportError, refuse, refuse_option};
use crate::options::{Options, Unit};
use crate::place::Place;
use glam::DVec3;
use palpate_io::Recording;
use palpate_io::recording::{MarkerSample, RecordedMarkers, RecordedPoints, Sequence};
use palpate_model::observation::MarkerRest;
use std::path::PathBuf;

/// Noise of a coordinate where nothing says it [m]: less than common mocap has, as much as markers move on soft skin.
const NOISE: f64 = 0.001;

/// Objects that are larger than this, or smaller than the other, are in another unit [m].
const LARGEST: f64 = 50.0;
const SMALLEST: f64 = 5e-4;

/// What is larger than this in no known unit are millimetres: ten metres of soft body in front of a camera, or a centimetre.
const METRES: f64 = 10.0;

/// The unit of clouds, markers or tracks, whose places are these.
pub fn unit(
    c: &Capture,
    place: &Place,
    places: impl Iterator<Item = DVec3>,
    key: &str,
    o: &Options,
    said: &mut Said,
) -> Result<f64, ImportError> {
    let mut bounds: Option<[DVec3; 2]> = None;
    for p in places.filter(|p| p.is_finite()) {
        bounds = Some(bounds.map_or([p, p], |[a, b]| [a.min(p), b.max(p)]));
    }
    let Some([low, high]) = bounds else { return refuse(&place.path, "holds no place that is finite") };
    let size = (high - low).length();
    let unit = match (o.unit, &c.unit, c.usual_unit) {
        (Some(u), Some((stated, what)), _) if u != *stated => {
            return refuse_option("unit", u, format!("contradicts the file, which is in {stated} ({what})"));
        }
        (Some(u), ..) => u,
        (None, Some((stated, what)), _) => {
            said.facts.push(format!("lengths in {stated}: {what}"));
            *stated
        }
        (None, None, Some((usual, why))) => {
            said.guesses.push(Guess::recording("unit", key, format!("lengths are {usual}, {why}"), "--unit"));
            usual
        }
        (None, None, None) => {
            let guess = if size > METRES { Unit::Millimetre } else { Unit::Metre };
            let text = format!("lengths are {guess}, since all places lie within {size:.4} of it");
            said.guesses.push(Guess::recording("unit", key, text, "--unit"));
            guess
        }
    };
    let metres = size * unit.metres();
    let several = size > 0.0;
    if metres > LARGEST || several && metres < SMALLEST {
        let hint = Unit::ALL.iter().find(|u| (0.01..3.0).contains(&(size * u.metres())));
        let hint = hint.map_or(String::new(), |u| format!("; --unit {u} would make it {:.3} m", size * u.metres()));
        let text = format!("all places lie within {metres} m in {unit}, expected {SMALLEST} to {LARGEST} m{hint}");
        return refuse(&place.path, text);
    }
    Ok(unit.metres())
}

fn noise(key: &str, o: &Options, said: &mut Said) -> Option<f64> {
    if o.noise.is_none() {
        let text = format!("{NOISE} m a coordinate");
        said.guesses.push(Guess::recording("noise", format!("{key}.noise_sigma"), text, "--noise"));
    }
    Some(o.noise.unwrap_or(NOISE))
}

/// Markers without rest places: those follow when the release is known.
pub fn markers(m: &Markers, metres: f64, o: &Options, said: &mut Said) -> RecordedMarkers {
    let n = m.names.len();
    let sample =
        |(i, p): (usize, &Option<DVec3>)| p.map(|p| MarkerSample { time: m.times[i / n], marker: i % n, position: p * metres });
    RecordedMarkers {
        file: PathBuf::new(),
        names: m.names.clone(),
        samples: m.places.iter().enumerate().filter_map(sample).collect(),
        noise_sigma: noise("markers", o, said),
        noise_systematic: 0.0,
        rest: Vec::new(),
    }
}

/// The same of tracks.
pub fn tracks(t: &Tracks, metres: f64, o: &Options, said: &mut Said) -> RecordedPoints {
    let track = Sequence {
        file: PathBuf::new(),
        times: t.times.clone(),
        vectors: t.places.iter().map(|p| *p * metres).collect(),
        noise_sigma: noise("points", o, said),
        noise_systematic: 0.0,
    };
    RecordedPoints { track, rest: Vec::new(), tolerance: None }
}

/// Gives markers and tracks their places at rest: the mean of what was seen up to the release. What was not seen by then has none and goes.
pub fn at_rest(r: &mut Recording, motion: Motion, place: &Place, said: &mut Said) -> Result<(), ImportError> {
    let until = match motion {
        Motion::Still => f64::INFINITY,
        Motion::Sequence { first } => first + 1e-9,
        Motion::Moving { from, .. } => from + 1e-9,
    };
    let when = match motion {
        Motion::Still => "the mean of all times, since nothing moves".to_string(),
        Motion::Sequence { .. } => "the first frame, in which the body hangs under its weight".to_string(),
        Motion::Moving { rested: true, .. } => "the mean of the times before the release".to_string(),
        Motion::Moving { rested: false, .. } => "the first time; the body may have moved or sagged already".to_string(),
    };
    let mean = |seen: &mut dyn Iterator<Item = DVec3>| -> Option<DVec3> {
        let (sum, n) = seen.fold((DVec3::ZERO, 0.0), |(s, n), p| (s + p, n + 1.0));
        (n > 0.0).then(|| sum / n)
    };
    if let Some(m) = &mut r.markers {
        let rest: Vec<Option<DVec3>> = (0..m.names.len())
            .map(|k| mean(&mut m.samples.iter().filter(|s| s.marker == k && s.time <= until).map(|s| s.position)))
            .collect();
        let kept: Vec<usize> = (0..m.names.len()).filter(|k| rest[*k].is_some()).collect();
        if kept.is_empty() {
            return refuse(&place.path, "no marker was seen up to the release");
        }
        if kept.len() < m.names.len() {
            let lost: Vec<&str> = (0..m.names.len()).filter(|k| rest[*k].is_none()).map(|k| m.names[k].as_str()).collect();
            said.losses.push(format!("markers that were not seen at rest are left out: {}", lost.join(", ")));
        }
        let number: Vec<Option<usize>> = (0..m.names.len()).map(|k| kept.iter().position(|x| *x == k)).collect();
        m.samples.retain_mut(|s| number[s.marker].map(|k| s.marker = k).is_some());
        m.names = kept.iter().map(|k| m.names[*k].clone()).collect();
        m.rest = (m.names.iter().zip(&kept))
            .filter_map(|(name, k)| Some(MarkerRest { name: name.clone(), position: rest[*k]?, surface: None }))
            .collect();
        let text = format!("markers at rest: {when}, each on the nearest point of the surface");
        said.guesses.push(Guess::recording("rest", "markers.rest", text, "--release, --pose, or the file's [[markers.rest]]"));
    }
    if let Some(p) = &mut r.points {
        let n = p.track.count();
        let times = || (0..p.track.times.len()).filter(|t| p.track.times[*t] <= until);
        let rest: Vec<Option<DVec3>> =
            (0..n).map(|i| mean(&mut times().map(|t| p.track.vectors[t * n + i]).filter(|v| !v.is_nan()))).collect();
        let kept: Vec<usize> = (0..n).filter(|i| rest[*i].is_some()).collect();
        if kept.is_empty() {
            return refuse(&place.path, "no point was seen up to the release");
        }
        if kept.len() < n {
            said.losses.push(format!("{} of {n} points were not seen at rest and are left out", n - kept.len()));
        }
        p.track.vectors = p.track.vectors.chunks(n).flat_map(|row| kept.iter().map(|i| row[*i])).collect();
        p.rest = kept.iter().filter_map(|i| rest[*i]).collect();
        let text = format!("points at rest: {when}");
        said.guesses.push(Guess::recording("rest", "points.rest", text, "--release"));
        // Shape and pose are guesses themselves: a narrow tolerance would refuse what they get wrong.
        let bounds = super::masks::bounds(&p.rest).map_or(0.0, |[a, b]| (b - a).length());
        let tolerance = (bounds.max(1e-3) * 1e4).round() / 1e4;
        p.tolerance = Some(tolerance);
        let text =
            format!("points may lie {tolerance} m off the surface, as far as they are apart, until shape and pose are right");
        said.guesses.push(Guess::recording("pose", "points.tolerance", text, "--mesh and --pose"));
    }
    Ok(())
}

/// Markers that move less than a fiftieth as far as the others, a millimetre at most: they sit on what holds the body. Their bounds at rest.
pub fn held(r: &Recording) -> Option<[DVec3; 2]> {
    let m = r.markers.as_ref()?;
    let mut far = vec![0.0f64; m.names.len()];
    for s in &m.samples {
        far[s.marker] = far[s.marker].max(s.position.distance(m.rest.get(s.marker)?.position));
    }
    let most = far.iter().copied().fold(0.0, f64::max);
    let border = f64::min(1e-3, 0.02 * most);
    let still: Vec<DVec3> = m.rest.iter().zip(&far).filter(|(_, f)| **f < border).map(|(r, _)| r.position).collect();
    super::masks::bounds(&still)
}

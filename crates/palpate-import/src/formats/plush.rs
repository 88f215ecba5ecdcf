//! Folders laid out as the data set PLUSH of Chen et al. (*Virtual Elastic Objects*, CVPR 2022): tracks of a soft toy's points, one file a frame
//! in `reconstruction/`, what of them is the toy and what is fixed, the path of the nozzle that blew at it, and frames for training and validation.

use super::{Format, nozzle};
use crate::Watch;
use crate::arrays::{Array, Numbers, read_arrays};
use crate::capture::{Capture, Equilibria, Guess, Tracks};
use crate::error::{ImportError, refuse};
use crate::intrinsics::read_json;
use crate::options::Options;
use crate::place::Place;
use crate::times::by_rate;
use crate::torch::{Entries, read_torch};
use glam::DVec3;
use palpate_model::shape::spread;
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

/// See the file's head.
pub const FORMAT: Format = Format {
    name: "plush",
    what: "folder of the PLUSH data set: reconstruction/*.npz with tracked vertices, mask.pt beside them",
    detect: |place| {
        let frames = frames_of(place).len();
        let told = [MASK, PATH, SPLIT].iter().find_map(|end| file(place, end));
        told.filter(|_| frames > 0).map(|f| format!("{frames} files in reconstruction/, and {}", place.name(f)))
    },
    read,
};

/// What says which points are the object, where the nozzle was, what was trained on and how cameras stood.
const MASK: &str = "mask.pt";
const PATH: &str = "aruco_path.json";
const SPLIT: &str = "siminfo.pt";
const CAMERAS: &str = "calibration.json";

/// Frames a second of the data set's cameras.
const RATE: f64 = 40.0;

/// Points that are kept where the user does not say how many: a surface of some thousand points has all of a slow motion.
const POINTS: usize = 3000;

/// At most this part of them are fixed ones.
const FIXED: usize = 5;

/// Files with a frame each.
fn frames_of(place: &Place) -> Vec<PathBuf> {
    let within = |f: &Path| format!("/{}", place.name(f)).contains("/reconstruction/");
    place.with_ending(&["npz"]).filter(|f| within(f)).cloned().collect()
}

/// The first file whose name ends so.
fn file<'a>(place: &'a Place, end: &str) -> Option<&'a PathBuf> {
    place.files.iter().find(|f| place.name(f).ends_with(end))
}

fn read(place: &Place, o: &Options, watch: &mut Watch) -> Result<Capture, ImportError> {
    let files = frames_of(place);
    let Some(first) = files.first() else { return refuse(&place.path, "has no reconstruction/*.npz with tracked vertices") };
    let mut capture = Capture { title: place.title(), ..Capture::default() };
    let key = "points";
    let (fact, guess) = match o.fps {
        Some(fps) => (format!("frames at {fps} a second (--fps)"), None),
        None => {
            let text = format!("{RATE} frames a second, as the data set was recorded; by the numbers in file names");
            (format!("frames at {RATE} a second"), Some(Guess::recording("rate", key, text, "--fps")))
        }
    };
    let times = by_rate(&files, o.fps.unwrap_or(RATE), fact, guess)?;
    capture.guesses.extend(times.guess);
    capture.facts.push(times.fact);
    let rest = vertices(first)?;
    let chosen = choose(place, o, first, &rest, &mut capture)?;
    let mut places = Vec::with_capacity(files.len() * chosen.all.len());
    for (k, path) in files.iter().enumerate() {
        watch.at(k, files.len(), "vertices")?;
        let all = if k == 0 { rest.clone() } else { vertices(path)? };
        if all.len() != rest.len() {
            let text = format!(
                "holds {} vertices, {} holds {}: the same ones are tracked in all frames",
                all.len(),
                place.name(first),
                rest.len()
            );
            return refuse(path, text);
        }
        // What a tracker lost has no place at that time.
        places.extend(chosen.all.iter().map(|i| if all[*i].is_finite() { all[*i] } else { DVec3::NAN }));
    }
    capture.tracks = Some(Tracks { times: times.seconds, count: chosen.all.len(), places });
    capture.equilibria = Some(Equilibria { fixed: chosen.fixed, train: train(place, files.len(), &mut capture)? });
    capture.up = Some((DVec3::Y, "y, against the first camera's y: it was held level".into()));
    if let Some(path) = file(place, PATH) {
        nozzle::read(path, o.fps.unwrap_or(RATE), files.len(), &mut capture)?;
    }
    if let Some(path) = file(place, CAMERAS) {
        let cameras = read_json(path)?;
        let n = cameras.as_object().map(|c| c.len()).or(cameras.as_array().map(|c| c.len())).unwrap_or(0);
        capture.facts.push(format!("{} tells of {n} cameras; videos are not read, and it is not needed", place.name(path)));
    }
    let beside = ["val_gt", "val_simed"].iter().any(|n| place.files.iter().any(|f| place.name(f).contains(n)));
    if beside {
        capture.losses.push("simulation/ holds meshes of the published simulation; they are no measurement and stay out".into());
    }
    Ok(capture)
}

/// The vertices of a frame.
fn vertices(path: &Path) -> Result<Vec<DVec3>, ImportError> {
    let all = read_arrays(path)?;
    let Some(array) = all.iter().find(|a| a.name == "vertices") else {
        let known: Vec<String> = all.iter().map(|a| format!("{} {}", a.name, a.shape_text())).collect();
        return refuse(path, format!("holds no array \"vertices\"; there are: {}", known.join(", ")));
    };
    if !matches!(array.shape[..], [n, 3] if n > 0) || !matches!(array.numbers, Numbers::Real(_)) {
        return refuse(path, format!("array \"vertices\" has shape {}, expected floats of shape (N, 3)", array.shape_text()));
    }
    Ok(array.reals().chunks_exact(3).map(DVec3::from_slice).collect())
}

/// Vertices that are kept, and the places among them of the fixed ones.
struct Chosen {
    all: Vec<usize>,
    fixed: Vec<usize>,
}

/// Some thousand of the object's vertices, far from each other.
fn choose(place: &Place, o: &Options, first: &Path, rest: &[DVec3], capture: &mut Capture) -> Result<Chosen, ImportError> {
    let (mut object, mut fixed): (Vec<usize>, BTreeSet<usize>) = ((0..rest.len()).collect(), BTreeSet::new());
    match file(place, MASK) {
        None => {
            let text = format!("all {} vertices are the object: there is no {MASK}", rest.len());
            capture.guesses.push(Guess::recording("object", "points", text, "the data set's mask.pt, or --box"));
        }
        Some(path) => {
            let entries = read_torch(path)?;
            let Some(mask) = set(path, &entries, "objectInd", rest.len(), None)? else {
                return refuse(path, format!("has no entry \"objectInd\"; there are: {}", known(&entries)));
            };
            object = mask;
            fixed = set(path, &entries, "fixed", rest.len(), Some(&object))?.unwrap_or_default().into_iter().collect();
        }
    }
    let told = object.len();
    if let Some(path) = file(place, SPLIT)
        && let Some(sampled) = set(path, &read_torch(path)?, "sampledVerts", rest.len(), Some(&object))?
    {
        let sampled: BTreeSet<usize> = sampled.into_iter().collect();
        let both: Vec<usize> = object.iter().copied().filter(|i| sampled.contains(i)).collect();
        match both.is_empty() {
            true => capture.facts.push("sampledVerts names none of the object's vertices and is passed over".into()),
            false => object = both,
        }
    }
    object.retain(|i| rest[*i].is_finite());
    if object.is_empty() {
        return refuse(first, "has no vertex of the object that is finite");
    }
    let (held, free): (Vec<usize>, Vec<usize>) = object.iter().partition(|i| fixed.contains(i));
    let most = o.points.unwrap_or(POINTS);
    let held = thinned(rest, held, (most / FIXED).max(1));
    let free = thinned(rest, free, most.saturating_sub(held.len()).max(1));
    let mut all: Vec<usize> = held.iter().chain(&free).copied().collect();
    all.sort_unstable();
    let held: BTreeSet<usize> = held.into_iter().collect();
    let places: Vec<usize> = (0..all.len()).filter(|k| held.contains(&all[*k])).collect();
    let text = format!("{} vertices, {told} of them the object's, {} of these fixed", rest.len(), fixed.len());
    capture.facts.push(text);
    if all.len() < object.len() {
        let text = format!(
            "{} of the object's {} vertices, far from each other, {} fixed ones among them",
            all.len(),
            object.len(),
            places.len()
        );
        capture.guesses.push(Guess::recording("thinning", "points.file", text, "--points"));
    }
    Ok(Chosen { all, fixed: places })
}

/// At most so many of these vertices, each far from the others, beginning next to their middle.
fn thinned(rest: &[DVec3], of: Vec<usize>, most: usize) -> Vec<usize> {
    if of.len() <= most {
        return of;
    }
    let places: Vec<DVec3> = of.iter().map(|i| rest[*i]).collect();
    let middle = places.iter().sum::<DVec3>() / places.len() as f64;
    let away = |k: &usize| places[*k].distance_squared(middle);
    let first = (0..places.len()).min_by(|a, b| away(a).total_cmp(&away(b))).unwrap_or(0);
    spread(&places, first, most).into_iter().map(|k| of[k]).collect()
}

/// Names of entries and what they are.
fn known(entries: &Entries) -> String {
    let one = |(name, a): &(String, Result<Array, String>)| match a {
        Ok(a) => format!("{name} {}", a.shape_text()),
        Err(e) => format!("{name} ({e})"),
    };
    entries.iter().map(one).collect::<Vec<_>>().join(", ")
}

/// Vertices that an entry names, rising: by their numbers, or by a truth value for each of all `count`, or each of the object's.
fn set(
    path: &Path,
    entries: &Entries,
    name: &str,
    count: usize,
    object: Option<&[usize]>,
) -> Result<Option<Vec<usize>>, ImportError> {
    let Some((_, found)) = entries.iter().find(|e| e.0 == name) else { return Ok(None) };
    let fault = |text: String| refuse(path, format!("entry \"{name}\" {text}"));
    let array = match found {
        Ok(a) => a,
        Err(e) => return fault(e.clone()),
    };
    let Numbers::Whole(numbers) = &array.numbers else {
        return fault("holds fractions, expected numbers of vertices or truth values".into());
    };
    let truths = numbers.iter().all(|x| *x == 0 || *x == 1);
    let ones = numbers.iter().enumerate().filter(|(_, x)| **x == 1).map(|(k, _)| k);
    if truths && numbers.len() == count {
        return Ok(Some(ones.collect()));
    }
    if let Some(object) = object.filter(|o| truths && numbers.len() == o.len() && numbers.len() > 2) {
        return Ok(Some(ones.map(|k| object[k]).collect()));
    }
    let mut all = BTreeSet::new();
    for x in numbers {
        match usize::try_from(*x).ok().filter(|x| *x < count) {
            Some(x) => drop(all.insert(x)),
            None => return fault(format!("names vertex {x}; there are {count}, counted from 0")),
        }
    }
    Ok(Some(all.into_iter().collect()))
}

/// Numbers of the frames that were trained on; none where nothing says it.
fn train(place: &Place, frames: usize, capture: &mut Capture) -> Result<Vec<usize>, ImportError> {
    let Some(path) = file(place, SPLIT) else { return Ok(Vec::new()) };
    let entries = read_torch(path)?;
    let mut of = |name: &str| -> Result<Vec<usize>, ImportError> {
        let Some(all) = set(path, &entries, name, usize::MAX, None)? else { return Ok(Vec::new()) };
        if let Some(last) = all.iter().find(|k| **k >= frames) {
            let text = format!("{name} names frame {last}, there are {frames}: it and others beyond are passed over");
            capture.losses.push(text);
        }
        Ok(all.into_iter().filter(|k| *k < frames).collect())
    };
    let (train, test) = (of("trainingInd")?, of("valInd")?);
    if !train.is_empty() {
        capture.facts.push(format!("{} frames to train on, {} to try it on (simInfo.pt)", train.len(), test.len()));
    }
    Ok(train)
}

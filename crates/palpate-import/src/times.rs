//! When frames were taken: lists of times, numbers in file names, or a rate.

use crate::capture::Guess;
use crate::error::{ImportError, read_text, refuse, refuse_option};
use crate::place::Place;
use palpate_io::InputError;
use std::path::{Path, PathBuf};

/// Times that rise, and what was assumed for them.
pub struct Times {
    /// One a frame [s]; the first is 0 where they came from a clock of the computer.
    pub seconds: Vec<f64>,
    /// What was assumed.
    pub guess: Option<Guess>,
    /// Where they come from.
    pub fact: String,
}

/// Frames a second where nothing says it: what nearly all depth cameras are set to.
const USUAL_RATE: f64 = 30.0;

/// Larger numbers in file names than this are readings of a clock; smaller ones count frames.
const CLOCK: f64 = 1e7;

/// Names of files that list times.
const LISTS: [&str; 6] = ["timestamps.txt", "timestamps.csv", "times.txt", "times.csv", "timestamp.txt", "depth_timestamps.txt"];

/// The times of frames that lie in files: an `fps` given by the user, a list beside them, their names, a rate that the source states, or a guess.
pub fn of_files(place: &Place, files: &[PathBuf], fps: Option<f64>, stated: Option<f64>) -> Result<Times, ImportError> {
    if let Some(fps) = fps {
        return by_rate(files, fps, format!("frames at {fps} a second (--fps)"), None);
    }
    let list = place.files.iter().find(|f| {
        let name = f.file_name().map(|n| n.to_string_lossy().to_ascii_lowercase()).unwrap_or_default();
        LISTS.contains(&name.as_str())
    });
    if let Some(list) = list {
        return by_list(list, files.len());
    }
    let numbers: Option<Vec<f64>> = files.iter().map(|f| number_in(f)).collect();
    if let Some(n) = numbers.filter(|n| n.iter().all(|x| *x > CLOCK))
        && n.len() > 1
    {
        return by_clock(files, &n);
    }
    if let Some(rate) = stated {
        return by_rate(files, rate, format!("frames at {rate} a second, as the source says"), None);
    }
    let text = format!("{USUAL_RATE} frames a second, since neither a list of times nor names of files say it");
    let guess = Guess::recording("rate", "frame", text, "--fps");
    by_rate(files, USUAL_RATE, format!("frames at {USUAL_RATE} a second"), (files.len() > 1).then_some(guess))
}

/// The last number in a file's name; `None` without one.
fn number_in(file: &Path) -> Option<f64> {
    let name = file.file_stem()?.to_string_lossy().into_owned();
    let part = name.split(|c: char| !(c.is_ascii_digit() || c == '.')).rfind(|p| p.contains(|c: char| c.is_ascii_digit()))?;
    part.trim_matches('.').parse().ok()
}

/// Frames that are numbered in their names and have gaps keep the gaps.
pub fn by_rate(files: &[PathBuf], rate: f64, fact: String, guess: Option<Guess>) -> Result<Times, ImportError> {
    if !(rate > 0.0 && rate <= 1e6) {
        return refuse_option("fps", rate, "must be > 0 and at most 1000000 (1/s)");
    }
    let numbers: Option<Vec<f64>> = files.iter().map(|f| number_in(f)).collect();
    let rising = |n: &Vec<f64>| n.iter().all(|x| *x <= CLOCK && x.fract() == 0.0) && n.windows(2).all(|w| w[1] > w[0]);
    let seconds = match numbers.filter(rising) {
        Some(n) => n.iter().map(|x| (x - n[0]) / rate).collect(),
        None => (0..files.len()).map(|k| k as f64 / rate).collect(),
    };
    Ok(Times { seconds, guess, fact })
}

fn by_clock(files: &[PathBuf], numbers: &[f64]) -> Result<Times, ImportError> {
    rising(numbers, |k| InputError::file(&files[k], "its name has the number of the file before it, or a smaller one"))?;
    let mut steps: Vec<f64> = numbers.windows(2).map(|w| w[1] - w[0]).collect();
    steps.sort_by(f64::total_cmp);
    let (unit, name) = unit_of(steps[steps.len() / 2]);
    let seconds = numbers.iter().map(|x| (x - numbers[0]) * unit).collect();
    let guess = Guess::recording("clock", "frame", format!("numbers in file names are {name}, by their distance"), "--fps");
    Ok(Times { seconds, guess: Some(guess), fact: "times from file names".into() })
}

/// Seconds of a unit of time in which frames are so far apart as those of a camera: 2 to 1000 a second.
fn unit_of(step: f64) -> (f64, &'static str) {
    let units = [(1.0, "seconds"), (1e-3, "milliseconds"), (1e-6, "microseconds"), (1e-9, "nanoseconds")];
    *units.iter().find(|(u, _)| (0.001..0.5).contains(&(step * u))).unwrap_or(&units[0])
}

fn by_list(list: &Path, count: usize) -> Result<Times, ImportError> {
    let text = read_text(list)?;
    let mut numbers: Vec<(usize, f64)> = Vec::new();
    for (i, line) in text.lines().enumerate() {
        let line = line.trim();
        if line.is_empty() || line.starts_with('#') {
            continue;
        }
        // A table may have the frame's number first and the time last.
        let last = line.split([',', ';', '\t', ' ']).rfind(|w| !w.is_empty() && w.parse::<f64>().is_ok());
        match last.and_then(|w| w.parse::<f64>().ok()).filter(|x| x.is_finite()) {
            Some(x) => numbers.push((i + 1, x)),
            // One line of names may go before.
            None if numbers.is_empty() && i == 0 => {}
            None => return Err(InputError::line(list, i + 1, format!("\"{line}\" holds no time")).into()),
        }
    }
    if numbers.len() != count {
        return refuse(list, format!("holds {} times for {count} depth images", numbers.len()));
    }
    let all: Vec<f64> = numbers.iter().map(|n| n.1).collect();
    rising(&all, |k| InputError::line(list, numbers[k].0, format!("{} is not after the time before it", all[k])))?;
    let steps: Vec<f64> = all.windows(2).map(|w| w[1] - w[0]).collect();
    let step = steps.iter().copied().fold(0.0, |a: f64, b| a.max(b));
    let (unit, name) = if steps.is_empty() { (1.0, "seconds") } else { unit_of(step) };
    let name_of = list.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default();
    let guess = (unit != 1.0)
        .then(|| Guess::recording("clock", "frame", format!("times in {name_of} are {name}, by their distance"), "--fps"));
    let first = if all[0].abs() > CLOCK || unit != 1.0 { all[0] } else { 0.0 };
    Ok(Times { seconds: all.iter().map(|x| (x - first) * unit).collect(), guess, fact: format!("times from {name_of}") })
}

/// Refuses times that do not rise.
pub fn rising(times: &[f64], fault: impl Fn(usize) -> InputError) -> Result<(), ImportError> {
    match (1..times.len()).find(|k| times[*k] <= times[k - 1] || times[*k].is_nan()) {
        Some(k) => Err(fault(k).into()),
        None => Ok(()),
    }
}

//! The targets of `fuzz/` on a stable compiler: over their corpus, and over files made of it by mutations from a fixed seed; and random scenes.

#[path = "../../../fuzz/src/lib.rs"]
mod targets;

use cpu_time::ProcessTime;
use palpate::{Backend, Experiment};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::path::Path;
use std::time::Duration;
use targets::TARGETS;

/// Mutated files for every file of the corpus; `PALPATE_FUZZ_MINUTES` goes on for so long instead. `PALPATE_FUZZ_ONLY` names one target, and
/// `PALPATE_FUZZ_SEED` draws other damages.
const EXECUTIONS: usize = 150;

/// Longest time of a processor that one small file may take: it announces something, and somebody believes it.
const LONGEST: Duration = Duration::from_secs(20);

/// Texts that readers trip over.
const WORDS: [&str; 16] = [
    "-1",
    "0",
    "1e300",
    "-1e-300",
    "nan",
    "inf",
    "4294967295",
    "18446744073709551615",
    "99999999999999999999",
    "../",
    "\"",
    "[[",
    "]",
    "\0",
    "\u{feff}",
    "é",
];

/// Bytes of a corpus file with a few things changed.
fn mutated(random: &mut ChaCha8Rng, mut data: Vec<u8>, other: &[u8]) -> Vec<u8> {
    for _ in 0..random.random_range(1..=4) {
        let at = random.random_range(0..=data.len());
        let end = (at + random.random_range(0..=32)).min(data.len());
        match random.random_range(0..8) {
            0 if at < data.len() => data[at] ^= 1 << random.random_range(0..8),
            1 if at < data.len() => data[at] = [0, 1, 127, 128, 255][random.random_range(0..5)],
            2 => drop(data.drain(at..end)),
            3 => {
                let part = data[at..end].to_vec();
                data.splice(at..at, part);
            }
            4 => {
                let word = WORDS[random.random_range(0..WORDS.len())];
                data.splice(at..end.min(at + word.len()), word.bytes());
            }
            5 => data.truncate(at),
            6 => {
                let from = random.random_range(0..=other.len());
                let to = (from + random.random_range(0..=64)).min(other.len());
                data.splice(at..at, other[from..to].iter().copied());
            }
            // A number of a text becomes another.
            _ => {
                let Some(first) = (at..data.len()).find(|i| data[*i].is_ascii_digit()) else { continue };
                let last = (first..data.len()).find(|i| !b"0123456789.eE-+".contains(&data[*i])).unwrap_or(data.len());
                let word = WORDS[random.random_range(0..9)];
                data.splice(first..last, word.bytes());
            }
        }
    }
    data
}

/// Files of a target's corpus, with their names.
fn corpus(name: &str) -> Vec<(String, Vec<u8>)> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../fuzz/corpus").join(name);
    let mut files: Vec<_> = std::fs::read_dir(&folder).expect("every target has a corpus").flatten().map(|f| f.path()).collect();
    files.sort();
    assert!(!files.is_empty(), "{}", folder.display());
    let name = |f: &Path| f.file_name().unwrap_or_default().to_string_lossy().into_owned();
    files.iter().map(|f| (name(f), std::fs::read(f).expect("it can be read"))).collect()
}

/// A file that a reader refuses at its first line leads nowhere, unless a run has found it.
#[test]
fn what_runs_begin_with_is_read() {
    let mut wrong = Vec::new();
    for (name, target) in TARGETS {
        let dir = tempfile::tempdir().expect("a folder");
        for (file, data) in corpus(name) {
            if target(dir.path(), &data) == file.starts_with("refused-") {
                wrong.push(format!("{name}/{file}"));
            }
        }
    }
    assert!(wrong.is_empty(), "read or refused against their names: {wrong:?}");
}

#[test]
fn no_reader_panics_or_hangs_on_a_damaged_file() {
    let number = |name| std::env::var(name).ok().map(|n| n.parse::<f64>().unwrap_or_else(|_| panic!("{name}: {n} is no number")));
    let all = number("PALPATE_FUZZ_MINUTES").map(|m| Duration::from_secs_f64(60.0 * m));
    let seed = number("PALPATE_FUZZ_SEED").map_or(0, |s| s as u64);
    let only = std::env::var("PALPATE_FUZZ_ONLY").ok();
    let chosen = |name: &str| only.as_ref().is_none_or(|o| o == name);
    let count = TARGETS.iter().filter(|(name, _)| chosen(name)).count();
    assert!(count > 0, "no target is {only:?}");
    for (number, (name, target)) in TARGETS.into_iter().enumerate().filter(|(_, (name, _))| chosen(name)) {
        let dir = tempfile::tempdir().expect("a folder");
        let files: Vec<Vec<u8>> = corpus(name).into_iter().map(|(_, data)| data).collect();
        let mut random = ChaCha8Rng::seed_from_u64(seed * TARGETS.len() as u64 + number as u64);
        let run = |data: &[u8]| {
            let begun = ProcessTime::now();
            let kept = dir.path().join("last");
            std::fs::write(&kept, data).expect("writable");
            let done = std::panic::catch_unwind(|| target(dir.path(), data));
            let slow = begun.elapsed() > LONGEST;
            if done.is_err() || slow {
                let kept = std::env::temp_dir().join(format!("palpate-fuzz-{name}"));
                std::fs::write(&kept, data).expect("writable");
                panic!("{name}: {} on {}", if slow { "slow" } else { "panics" }, kept.display());
            }
        };
        files.iter().for_each(|f| run(f));
        let (begun, mut done) = (ProcessTime::now(), 0);
        let share = all.map(|a| a / count as u32);
        while share.map_or(done < EXECUTIONS * files.len(), |s| begun.elapsed() < s) {
            let (of, with) = (random.random_range(0..files.len()), random.random_range(0..files.len()));
            let data = mutated(&mut random, files[of].clone(), &files[with]);
            run(&data);
            done += 1;
        }
        println!("{name}: {done} files of {} kinds", files.len());
    }
}

/// A scene in which every number is allowed, though few would be chosen.
fn scene(random: &mut ChaCha8Rng) -> String {
    let log = |random: &mut ChaCha8Rng, low: f64, high: f64| (random.random_range(low.ln()..high.ln())).exp();
    let size = log(random, 0.01, 1.0);
    let shape = match random.random_range(0..4) {
        0 => format!("{{ ball = {{ radius = {}, center = [0, 0, {}] }} }}", 0.5 * size, random.random_range(-1.0..1.0)),
        1 => format!("{{ torus = {{ major = {}, minor = {} }} }}", 0.4 * size, size * random.random_range(0.1..0.3)),
        2 => format!(
            "{{ cylinder = {{ radius = {}, height = {size}, axis = [1, 1, 0.2] }} }}",
            size * random.random_range(0.1..0.5)
        ),
        _ => {
            format!("{{ box = {{ min = [0, 0, 0], max = [{size}, {}, {}] }} }}", 0.5 * size, size * random.random_range(0.1..1.0))
        }
    };
    let mut text = format!(
        "format = \"scene/1\"\n[object]\nshape = {shape}\ncells = {}\n[material]\ndensity = {}\nyoungs_modulus = {}\npoisson_ratio = {}\n\
         mass_damping = {}\n[time]\nstep = {}\nsteps = {}\n[initial]\nvelocity = [{}, 0, {}]\n",
        random.random_range(2..7),
        log(random, 1.0, 2e4),
        log(random, 10.0, 1e11),
        random.random_range(0.0..0.4999),
        random.random_range(0.0..100.0),
        log(random, 1e-5, 0.5),
        random.random_range(1..5),
        random.random_range(-20.0..20.0),
        random.random_range(-20.0..20.0),
    );
    if random.random_bool(0.5) {
        text += &format!("[[clamp]]\nbox = {{ min = [-2, -2, -2], max = [{}, 2, 2] }}\n", random.random_range(-0.5..0.5) * size);
    }
    if random.random_bool(0.5) {
        text += &format!(
            "[[plane]]\npoint = [0, 0, {}]\nnormal = [{}, 0, 1]\n",
            random.random_range(-1.0..0.2),
            random.random_range(-1.0..1.0)
        );
    }
    text
}

#[test]
fn random_scenes_are_simulated_or_refused_in_words() {
    let mut random = ChaCha8Rng::seed_from_u64(99);
    let (mut simulated, mut refused) = (0, 0);
    for k in 0..60 {
        let text = scene(&mut random);
        let told = Experiment::from_toml(&text, "random.toml").and_then(|e| e.simulate(Backend::Cpu));
        match told {
            Ok(s) => {
                simulated += 1;
                let last = s.snapshots.last().expect("there is one");
                assert!(last.displacement.iter().all(|u| u.is_finite()), "scene {k}: a state is not finite\n{text}");
            }
            Err(e) => {
                refused += 1;
                assert!(e.to_string().len() > 20 && !e.to_string().contains("panic"), "scene {k}: {e}\n{text}");
            }
        }
    }
    println!("{simulated} simulated, {refused} refused");
    assert!(simulated > 20, "only {simulated} of 60 could be simulated");
}

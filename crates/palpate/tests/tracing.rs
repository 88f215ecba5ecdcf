//! A program that subscribes to `tracing` sees what takes how long.

use palpate::{Backend, Experiment, FitOptions};
use std::collections::BTreeSet;
use std::sync::{Arc, Mutex};
use tracing::span::{Attributes, Id};
use tracing::{Level, Subscriber};
use tracing_subscriber::layer::{Context, Layer, SubscriberExt};
use tracing_subscriber::registry::{LookupSpan, Registry};

/// A body that shall be somewhere else: a fit without a recording.
const SCENE: &str = r#"format = "scene/1"
[object]
shape = { box = { min = [0, 0, 0], max = [0.1, 0.03, 0.03] } }
cell_size = 0.03
[material]
density = 1000
youngs_modulus = 1e5
poisson_ratio = 0.4
[time]
step = 0.01
steps = 5
[[target]]
time = 0.05
tolerance = 1e-3
points = [[0.1, 0.015, 0.015]]
positions = [[0.1, 0.015, 0.05]]
[fit]
[[fit.parameter]]
path = "initial.velocity.z"
start = 0.1
"#;

/// Name, level and surrounding of every kind of span that was made.
type Seen = Arc<Mutex<BTreeSet<(&'static str, Level, Option<&'static str>)>>>;

struct Listener(Seen);

impl<S: Subscriber + for<'a> LookupSpan<'a>> Layer<S> for Listener {
    fn on_new_span(&self, _: &Attributes<'_>, id: &Id, context: Context<'_, S>) {
        let span = context.span(id).expect("it was just made");
        let around = span.parent().map(|p| p.name());
        self.0.lock().unwrap().insert((span.name(), *span.metadata().level(), around));
    }
}

#[test]
fn spans_say_what_is_part_of_what() {
    let seen = Seen::default();
    // Starts run in threads of their own: whoever listens to one thread would miss them.
    tracing::subscriber::set_global_default(Registry::default().with(Listener(seen.clone()))).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("scene.toml");
    std::fs::write(&path, SCENE).unwrap();
    let experiment = Experiment::open(&path).unwrap();
    // A thread of a pool goes on in the caller's span.
    let options = FitOptions { backend: Backend::Cpu, threads: Some(1), ..FitOptions::default() };
    experiment.fit(options).unwrap();
    let seen = seen.lock().unwrap();
    for wanted in [
        ("open", Level::INFO, None),
        ("load", Level::INFO, Some("open")),
        ("assemble", Level::INFO, Some("open")),
        ("fit", Level::INFO, None),
        ("start", Level::INFO, Some("fit")),
        ("evaluation", Level::DEBUG, Some("fit")),
        ("step", Level::TRACE, Some("evaluation")),
    ] {
        assert!(seen.contains(&wanted), "{wanted:?}: {seen:?}");
    }
}

//! Long computations beside Python: they run in a thread of their own while this one keeps the interpreter free, hands on what is heard of
//! the progress, and looks for Ctrl-C.

use crate::errors::argument;
use palpate::Interrupt;
use pyo3::prelude::*;
use std::sync::OnceLock;
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::time::Duration;

/// How often Ctrl-C is looked for while nothing else happens.
const LOOK: Duration = Duration::from_millis(50);

/// What a computation says of its progress.
#[pyclass(frozen, get_all, module = "palpate", name = "Progress")]
#[derive(Clone, Debug, Default)]
pub struct Progress {
    /// What is done: "simulate", "fit", "diagnose" or "track".
    what: String,
    /// Steps or frames that are done.
    done: Option<usize>,
    /// How many there will be.
    total: Option<usize>,
    /// In words.
    message: String,
    /// Number of the start, of a fit.
    start: Option<usize>,
    /// Number of the iteration, of a fit; 0 is the start itself.
    iteration: Option<usize>,
    /// Cost at its end.
    cost: Option<f64>,
    /// Values of what is free.
    values: Option<Vec<f64>>,
}

#[pymethods]
impl Progress {
    fn __repr__(&self) -> String {
        format!("<palpate.Progress {}: {}>", self.what, self.message)
    }
}

/// Where a computation says how far it is; silent where nobody listens.
pub struct Voice(Option<Sender<Progress>>);

impl Voice {
    fn say(&self, p: impl FnOnce() -> Progress) {
        if let Some(to) = &self.0 {
            // Whoever listens ends only after whoever speaks.
            let _ = to.send(p());
        }
    }

    /// So many of so many are done.
    pub fn at(&self, what: &str, done: usize, total: usize) {
        let message = || format!("{done} of {total}");
        self.say(|| Progress {
            what: what.into(),
            done: Some(done),
            total: Some(total),
            message: message(),
            ..Progress::default()
        });
    }

    /// In words.
    pub fn words(&self, what: &str, message: &str) {
        self.say(|| Progress { what: what.into(), message: message.into(), ..Progress::default() });
    }

    /// An iteration of a fit: number of its start and its own, cost, and values of what is free.
    pub fn iteration(&self, start: usize, iteration: usize, cost: f64, values: &[f64]) {
        self.say(|| Progress {
            what: "fit".into(),
            message: format!("start {start}, iteration {iteration}: cost {cost:.4}"),
            start: Some(start),
            iteration: Some(iteration),
            cost: Some(cost),
            values: Some(values.to_vec()),
            ..Progress::default()
        });
    }
}

/// Threads of a pool do not come along when a process is forked, and whoever waits for them waits for ever.
fn forked(py: Python<'_>) -> PyResult<()> {
    static FIRST: OnceLock<u32> = OnceLock::new();
    let own = std::process::id();
    if *FIRST.get_or_init(|| own) == own {
        return Ok(());
    }
    let text = "palpate was at work before this process was forked, and its threads did not come along; use \
                multiprocessing.get_context(\"spawn\")";
    Err(argument(py, "multiprocessing", text))
}

/// What one wait brought.
enum Heard {
    News(Progress),
    Nothing,
    End,
}

fn wait(from: &mut Receiver<Progress>) -> Heard {
    match from.recv_timeout(LOOK) {
        Ok(p) => Heard::News(p),
        Err(RecvTimeoutError::Timeout) => Heard::Nothing,
        Err(RecvTimeoutError::Disconnected) => Heard::End,
    }
}

/// Runs `work`, whose progress goes to the callable `listener`. Ctrl-C, and an exception in the listener, raise the interrupt that the work
/// looks at; what it returns then comes with the exception.
pub fn run<T: Send>(
    py: Python<'_>,
    listener: Option<&Bound<'_, PyAny>>,
    work: impl FnOnce(&Voice, &Interrupt) -> T + Send,
) -> PyResult<(T, Option<PyErr>)> {
    forked(py)?;
    let interrupt = Interrupt::default();
    let (to, mut from) = channel();
    let voice = Voice(listener.is_some().then(|| to.clone()));
    let seen = interrupt.clone();
    Ok(std::thread::scope(|scope| {
        let worker = scope.spawn(move || {
            let done = work(&voice, &seen);
            // The end of the talk is the end of the work.
            drop((voice, to));
            done
        });
        let mut fault: Option<PyErr> = None;
        loop {
            let from = &mut from;
            let said = match py.detach(move || wait(from)) {
                Heard::End => break,
                Heard::News(p) if fault.is_none() => listener.map_or(Ok(()), |l| l.call1((p,)).map(|_| ())),
                _ => Ok(()),
            };
            if fault.is_none() {
                fault = said.and_then(|()| py.check_signals()).err();
                if fault.is_some() {
                    interrupt.raise();
                }
            }
        }
        match py.detach(move || worker.join()) {
            Ok(done) => (done, fault),
            Err(panic) => std::panic::resume_unwind(panic),
        }
    }))
}

/// Runs what nobody can interrupt: Ctrl-C leaves it alone, to end when it does.
///
/// # Errors
/// `KeyboardInterrupt`, or what a handler of signals raises.
pub fn load<T: Send + 'static>(py: Python<'_>, work: impl FnOnce() -> T + Send + 'static) -> PyResult<T> {
    forked(py)?;
    let (to, mut from) = channel();
    let worker = std::thread::spawn(move || {
        let done = work();
        drop::<Sender<Progress>>(to);
        done
    });
    loop {
        let from = &mut from;
        if let Heard::End = py.detach(move || wait(from)) {
            break;
        }
        py.check_signals()?;
    }
    match py.detach(move || worker.join()) {
        Ok(done) => Ok(done),
        Err(panic) => std::panic::resume_unwind(panic),
    }
}

//! Signs of life of a long command on stderr: a bar on a terminal, a line now and then in a log, or events that a program reads.

mod convergence;

pub(crate) use convergence::{Convergence, UNITS};

use crate::events::{Kind, tell};
use clap::ValueEnum;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use std::io::Write;
use std::sync::mpsc::{RecvTimeoutError, Sender, channel};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// How a command shows that it is alive.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Liveliness {
    /// Not at all
    #[value(name = "none")]
    Silent,
    /// A bar, for terminals
    #[value(name = "bar")]
    Bars,
    /// A line every few seconds, for logs
    Lines,
    /// An event every few seconds, as `--log` shows them
    #[value(skip)]
    Events,
}

/// No line in the first moments: short commands need none.
const FIRST: Duration = Duration::from_millis(1500);
/// Least time between two lines.
const BETWEEN: Duration = Duration::from_secs(5);
/// Longest time without a line, while nothing new happens.
const QUIET: Duration = Duration::from_secs(60);

/// How often a bar shows that time goes on while nothing is heard.
const TICK: Duration = Duration::from_millis(500);

/// The progress of one command. It ends with its owner: the bar disappears, lines end.
pub struct Track {
    bar: ProgressBar,
    lines: Option<Lines>,
    length: u64,
    position: u64,
}

/// A thread that writes the newest message when it is time to.
struct Lines {
    news: Sender<String>,
    writer: JoinHandle<()>,
}

/// Decides when a line is due.
struct Pace {
    begun: Instant,
    last: Option<Instant>,
    waiting: Option<String>,
    told: String,
}

impl Pace {
    fn new(begun: Instant) -> Pace {
        Pace { begun, last: None, waiting: None, told: String::new() }
    }

    fn hear(&mut self, message: String) {
        self.waiting = Some(message);
    }

    /// When the next line may be written.
    fn due(&self) -> Instant {
        match (self.last, &self.waiting) {
            (None, _) => self.begun + FIRST,
            (Some(t), Some(_)) => t + BETWEEN,
            (Some(t), None) => t + QUIET,
        }
    }

    /// The line to write now, if there is one.
    fn line(&mut self, what: &str, now: Instant) -> Option<String> {
        if now < self.due() || (self.told.is_empty() && self.waiting.is_none()) {
            return None;
        }
        self.last = Some(now);
        self.told = self.waiting.take().unwrap_or_else(|| std::mem::take(&mut self.told));
        Some(format!("{what}, {:.0} s: {}", now.duration_since(self.begun).as_secs_f64(), self.told))
    }
}

/// Writes lines as events.
struct Events;

impl Write for Events {
    fn write(&mut self, line: &[u8]) -> std::io::Result<usize> {
        tell(Kind::Progress, String::from_utf8_lossy(line).trim_end(), None, None);
        Ok(line.len())
    }

    fn flush(&mut self) -> std::io::Result<()> {
        Ok(())
    }
}

impl Lines {
    fn new(what: &str, mut to: impl Write + Send + 'static) -> Lines {
        let (news, heard) = channel::<String>();
        let what = what.to_string();
        let writer = std::thread::spawn(move || {
            let mut pace = Pace::new(Instant::now());
            loop {
                let wait = pace.due().saturating_duration_since(Instant::now());
                // Nothing to say yet: whatever comes wakes the thread.
                let wait = if pace.told.is_empty() && pace.waiting.is_none() { QUIET } else { wait };
                match heard.recv_timeout(wait) {
                    Ok(message) => pace.hear(message),
                    Err(RecvTimeoutError::Timeout) => {}
                    Err(RecvTimeoutError::Disconnected) => return,
                }
                if let Some(line) = pace.line(&what, Instant::now()) {
                    // A log that is gone is no reason to stop computing.
                    let _ = to.write_all(format!("{line}\n").as_bytes());
                }
            }
        });
        Lines { news, writer }
    }
}

/// What a bar looks like; one of unknown length is none.
fn style(length: u64) -> ProgressStyle {
    let template = match length {
        0 => "{prefix} {elapsed} {wide_msg}",
        _ => "{prefix} [{bar:30}] {percent:>3}% {elapsed}/{duration} {msg}",
    };
    ProgressStyle::with_template(template).unwrap_or_else(|_| ProgressStyle::default_bar())
}

impl Track {
    /// Progress of `what` over `length` units; 0: unknown.
    pub fn new(how: Liveliness, length: u64, what: &str) -> Track {
        let bar = match how {
            Liveliness::Silent | Liveliness::Lines | Liveliness::Events => ProgressBar::hidden(),
            Liveliness::Bars => {
                let bar = ProgressBar::with_draw_target(Some(length), ProgressDrawTarget::stderr());
                let bar = bar.with_style(style(length)).with_prefix(what.to_string());
                bar.enable_steady_tick(TICK);
                bar
            }
        };
        let lines = match how {
            Liveliness::Lines => Some(Lines::new(what, std::io::stderr())),
            Liveliness::Events => Some(Lines::new(what, Events)),
            Liveliness::Silent | Liveliness::Bars => None,
        };
        Track { bar, lines, length, position: 0 }
    }

    /// How many units there are, once it is known.
    pub fn measure(&mut self, length: u64) {
        self.length = length;
        self.bar.set_length(length);
        self.bar.set_style(style(length));
    }

    /// Moves to a unit, with what is to be said about it.
    pub fn at(&mut self, position: u64, message: &str) {
        self.position = position;
        self.bar.set_position(position);
        self.bar.set_message(message.to_string());
        let Some(lines) = &self.lines else { return };
        let share = match self.length {
            0 => String::new(),
            n => format!("{} %", 100 * position.min(n) / n),
        };
        let parts: Vec<&str> = [share.as_str(), message].into_iter().filter(|p| !p.is_empty()).collect();
        // The writer lives as long as this.
        let _ = lines.news.send(parts.join(", "));
    }

    /// Moves on by some units.
    pub fn on(&mut self, by: u64, message: &str) {
        self.at(self.position + by, message);
    }

    /// Lets something else be written to the terminal, with the bar out of its way.
    pub fn aside<T>(&self, write: impl FnOnce() -> T) -> T {
        self.bar.suspend(write)
    }

    /// Ends.
    pub fn finish(self) {
        drop(self);
    }
}

impl Drop for Track {
    fn drop(&mut self) {
        self.bar.finish_and_clear();
        if let Some(Lines { news, writer }) = self.lines.take() {
            drop(news);
            // It only writes; that it may have failed to is of no interest.
            let _ = writer.join();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_keep_their_distance_and_long_silence_is_broken() {
        let begun = Instant::now();
        let mut pace = Pace::new(begun);
        let mut lines = Vec::new();
        // Something new three times a second for ten seconds, then a stage of two minutes.
        for tick in 0..1300 {
            let now = begun + Duration::from_millis(100 * tick);
            if tick % 3 == 0 && tick <= 100 {
                pace.hear(format!("stage {tick}"));
            }
            lines.extend(pace.line("diagnosing", now));
        }
        let expected = ["2 s: stage 15", "6 s: stage 63", "12 s: stage 99", "72 s: stage 99"];
        assert_eq!(lines, expected.map(|l| format!("diagnosing, {l}")));
    }

    #[test]
    fn a_command_that_says_nothing_writes_nothing_and_ends() {
        let mut pace = Pace::new(Instant::now() - QUIET * 2);
        assert_eq!(pace.line("fitting", Instant::now()), None);
        let mut track = Track::new(Liveliness::Lines, 10, "fitting");
        track.on(3, "best cost 2");
        assert_eq!(track.position, 3);
        track.finish();
    }
}

//! The command line as a function: arguments in, exit code out.

use crate::commands::{
    batch, coarsen, diagnose, export, fit, import, inspect, observe, pictures, place, simulate, synthesize, track,
};
use crate::error::Error;
use crate::events::{Kind, begin, tell};
use crate::interrupt::Interrupt;
use crate::options::Talk;
use crate::progress::{Liveliness, Track};
use clap::error::ErrorKind;
use clap::{Parser, Subcommand};
use std::borrow::Cow;
use std::ffi::OsString;
use std::io::Write;

/// Exit code after an interruption (Ctrl-C), by convention 128 + SIGINT. What was found until then has been written.
pub const INTERRUPTED: i32 = 130;

const AFTER_HELP: &str = "\
A first session:
  palpate import   camera-folder --out ball    a recording and a first scene of one's own measurements
  palpate inspect  scene.toml                  what would be simulated and fitted, and what looks wrong
  palpate simulate scene.toml --format png     pictures of the motion in out/scene/
  palpate fit      scene.toml --out found      parameters, errors and a report in found/
  palpate track    scene.toml --out seen       the moving body in every frame of its recording
  palpate place    scene.toml --out parts      over which regions of the body a number varies
  palpate simulate found/model.toml            the scene with the found values
  palpate synthesize found/model.toml          a motion that nobody has seen: pulls, wind, keyframes, edits
  palpate pictures found --format gif          what the report shows as pictures, charts and a movie
  palpate diagnose scene.toml --out why        what the model lacks, and the corrected scene
  palpate export   found --format mujoco       the body for another simulator

Exit codes: 0 success, 1 the computation failed, 2 bad input, 130 interrupted (Ctrl-C; the best so far is written).";

#[derive(Debug, Parser)]
#[command(name = "palpate", version, about = "Fits the physics of soft bodies to measured motion", after_help = AFTER_HELP)]
struct Cli {
    #[command(subcommand)]
    command: Command,
    #[command(flatten)]
    talk: Talk,
}

#[derive(Debug, Subcommand)]
enum Command {
    Import(Box<import::Arguments>),
    Simulate(simulate::Arguments),
    Synthesize(synthesize::Arguments),
    Observe(observe::Arguments),
    Track(track::Arguments),
    Fit(fit::Arguments),
    Place(place::Arguments),
    Batch(batch::Arguments),
    Coarsen(coarsen::Arguments),
    Export(export::Arguments),
    Diagnose(diagnose::Arguments),
    Pictures(pictures::Arguments),
    Inspect(inspect::Arguments),
}

/// Longest message in one line; nobody reads more of what was given.
const LONGEST: usize = 4000;

/// A message, with its middle left out where it is very long.
fn line(text: &str) -> Cow<'_, str> {
    let count = text.chars().count();
    if count <= LONGEST {
        return Cow::Borrowed(text);
    }
    let (head, tail) = (text.chars().take(LONGEST / 2), text.chars().skip(count - LONGEST / 4));
    Cow::Owned(format!("{} … {}", head.collect::<String>(), tail.collect::<String>()))
}

/// Where a command talks to.
pub struct Console<'a> {
    out: &'a mut dyn Write,
    err: &'a mut dyn Write,
    talk: Talk,
    alive: Liveliness,
    /// Stops a long command in good order.
    pub interrupt: Interrupt,
}

impl Console<'_> {
    /// The same talk to another place (a log), without progress.
    pub fn aside<'b>(&self, out: &'b mut dyn Write, err: &'b mut dyn Write) -> Console<'b> {
        Console {
            out,
            err,
            talk: Talk { json: false, quiet: false, progress: None, log: None },
            alive: Liveliness::Silent,
            interrupt: self.interrupt.clone(),
        }
    }

    /// True when the result is to be JSON.
    pub fn json(&self) -> bool {
        self.talk.json
    }

    /// Prints the result. A reader that has gone away is not an error.
    pub fn print(&mut self, text: &str) {
        let _ = writeln!(self.out, "{text}");
    }

    /// A note that may be silenced.
    pub fn note(&mut self, text: &str) {
        if self.talk.log.is_some() {
            tell(Kind::Note, &line(text), None, None);
        } else if !self.talk.quiet {
            let _ = writeln!(self.err, "{}", line(text));
        }
    }

    /// Warnings, one line each.
    pub fn warn(&mut self, warnings: &[String]) {
        for w in warnings {
            if self.talk.log.is_some() {
                tell(Kind::Warning, &line(w), None, None);
            } else {
                let _ = writeln!(self.err, "warning: {}", line(w));
            }
        }
    }

    /// Progress of `what` over `length` units (0: unknown) on stderr.
    pub fn progress(&self, length: u64, what: &str) -> Track {
        let how = match self.talk {
            Talk { quiet: true, .. } => Liveliness::Silent,
            Talk { log: Some(_), .. } => Liveliness::Events,
            Talk { progress, .. } => progress.unwrap_or(self.alive),
        };
        Track::new(how, length, what)
    }
}

/// True where the command that these arguments name ends in good order when it is interrupted. The others are ended by the system.
pub fn listens<A: Into<OsString> + Clone>(arguments: impl IntoIterator<Item = A>) -> bool {
    Cli::try_parse_from(arguments)
        .is_ok_and(|cli| !matches!(cli.command, Command::Inspect(_) | Command::Export(_) | Command::Pictures(_)))
}

/// Runs the command line `arguments` (the first is the program's name) and returns the exit code. Progress is shown
/// on the process's stderr, as `alive` says where no option does; all else goes to `out` and `err`.
pub fn run<A: Into<OsString> + Clone>(
    arguments: impl IntoIterator<Item = A>,
    out: &mut dyn Write,
    err: &mut dyn Write,
    interrupt: Interrupt,
    alive: Liveliness,
) -> i32 {
    let cli = match Cli::try_parse_from(arguments) {
        Ok(cli) => cli,
        Err(e) if e.use_stderr() => {
            let _ = writeln!(err, "{}", line(&usage_error(&e)));
            return 2;
        }
        // --help and --version are answers, not errors.
        Err(e) => {
            let _ = write!(out, "{e}");
            return 0;
        }
    };
    // Commands begin with reading; each says when it begins to compute or write.
    interrupt.read(None, "nothing was written");
    cli.talk.log.iter().for_each(|log| begin(*log));
    let mut console = Console { out, err, talk: cli.talk, alive, interrupt };
    let done = match &cli.command {
        Command::Import(a) => import::run(a, &mut console),
        Command::Simulate(a) => simulate::run(a, &mut console),
        Command::Synthesize(a) => synthesize::run(a, &mut console),
        Command::Observe(a) => observe::run(a, &mut console),
        Command::Track(a) => track::run(a, &mut console),
        Command::Fit(a) => fit::run(a, &mut console),
        Command::Place(a) => place::run(a, &mut console),
        Command::Batch(a) => batch::run(a, &mut console),
        Command::Coarsen(a) => coarsen::run(a, &mut console),
        Command::Export(a) => export::run(a, &mut console),
        Command::Diagnose(a) => diagnose::run(a, &mut console),
        Command::Pictures(a) => pictures::run(a, &mut console),
        Command::Inspect(a) => inspect::run(a, &mut console),
    };
    let code = done.unwrap_or_else(|e: Error| {
        if console.talk.log.is_some() {
            tell(Kind::Error, &line(&e.to_string()), None, Some(e.exit_code()));
        } else {
            let _ = writeln!(console.err, "error: {}", line(&e.to_string()));
        }
        e.exit_code()
    });
    let _ = console.out.flush();
    code
}

/// What is wrong with a command line in one line, like every other error: the key, the reason, what is allowed or meant. No
/// command at all is a question, and is answered with the help.
fn usage_error(e: &clap::Error) -> String {
    let text = e.to_string();
    if e.kind() == ErrorKind::DisplayHelpOnMissingArgumentOrSubcommand {
        return text.trim_end().to_string();
    }
    // Clap writes the error with indented details, tips, the usage and a pointer to the help, in this order.
    let told = text.lines().map(str::trim).take_while(|l| !l.starts_with("Usage:") && !l.starts_with("For more information"));
    told.filter(|l| !l.is_empty())
        .map(|l| l.strip_prefix("tip: ").map_or(l.to_string(), |tip| format!("({tip})")))
        .collect::<Vec<_>>()
        .join(" ")
}

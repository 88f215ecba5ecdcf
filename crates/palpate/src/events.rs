//! What happens in a command as events on stderr, one a line, for programs that read it (`--log`).

use crate::options::Log;
use serde::Serialize;
use std::io::Write as _;
use std::sync::OnceLock;
use std::time::{Instant, SystemTime};

/// The form, once somebody asked for events.
static FORM: OnceLock<Log> = OnceLock::new();

/// What an event is about.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub(crate) enum Kind {
    /// How far a command is.
    Progress,
    /// Something that is worth knowing.
    Note,
    /// Something that looks suspicious.
    Warning,
    /// Why the command ends.
    Error,
    /// A stage has ended.
    Stage,
}

/// One line of JSON.
#[derive(Serialize)]
struct Line<'a> {
    /// In UTC.
    time: String,
    kind: Kind,
    message: &'a str,
    /// How long the stage took [s].
    #[serde(skip_serializing_if = "Option::is_none")]
    seconds: Option<f64>,
    /// Exit code that an error ends with.
    #[serde(skip_serializing_if = "Option::is_none")]
    code: Option<i32>,
}

/// From now on events of this process are written to stderr; the first form that is asked for stays.
pub(crate) fn begin(form: Log) {
    // A second command in one process goes on as the first began.
    let _ = FORM.set(form);
}

/// Writes an event, where anybody asked for events.
pub(crate) fn tell(kind: Kind, message: &str, seconds: Option<f64>, code: Option<i32>) {
    if let Some(form) = FORM.get() {
        // A log that is gone is no reason to stop computing.
        let _ = std::io::stderr().write_all(text(*form, kind, message, seconds, code).as_bytes());
    }
}

fn text(form: Log, kind: Kind, message: &str, seconds: Option<f64>, code: Option<i32>) -> String {
    let time = humantime::format_rfc3339_millis(SystemTime::now()).to_string();
    match form {
        Log::Json => serde_json::to_string(&Line { time, kind, message, seconds, code }).unwrap_or_default() + "\n",
        Log::Text => {
            let took = seconds.map_or(String::new(), |s| format!(" took {s:.3} s"));
            format!("{time} {kind:?} {message}{took}\n")
        }
    }
}

/// A stage of a command; its end is an event.
pub(crate) struct Stage {
    name: &'static str,
    begun: Instant,
}

impl Stage {
    /// Begins.
    pub fn begin(name: &'static str) -> Stage {
        Stage { name, begun: Instant::now() }
    }
}

impl Drop for Stage {
    fn drop(&mut self) {
        tell(Kind::Stage, self.name, Some(self.begun.elapsed().as_secs_f64()), None);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_event_is_a_line_that_programs_and_people_read() {
        let json = text(Log::Json, Kind::Stage, "cut \"it\"\n", Some(0.25), None);
        let value: serde_json::Value = serde_json::from_str(&json).expect("it is JSON");
        assert_eq!(
            (&value["kind"], &value["message"], &value["seconds"]),
            (&"stage".into(), &"cut \"it\"\n".into(), &0.25.into())
        );
        assert!(json.ends_with("}\n") && json.lines().count() == 1 && value.get("code").is_none(), "{json}");
        let plain = text(Log::Text, Kind::Stage, "cut", Some(0.25), None);
        assert!(plain.ends_with("Z Stage cut took 0.250 s\n"), "{plain}");
    }
}

//! `palpate.lock` in a folder that a command writes into.

use super::Document;
use serde::{Deserialize, Serialize};

/// Who writes into a folder (`lock/1`); the file is there as long as it does.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct LockDocument {
    /// How often it has shown that it lives, in ten digits: a sixth of `patience` goes by from one to the next.
    pub beat: String,
    /// Name of its machine.
    pub host: String,
    /// Number of the process there.
    pub process: u32,
    /// When it began, in UTC.
    pub since: String,
    /// A lock in which nothing has changed for so long is dead [s].
    pub patience: f64,
    /// Which kernel numbers the process, and in which namespace; empty where the system does not say.
    pub namespace: String,
    /// When the process began, in ticks since the machine did; `None` where the system does not say.
    pub beginning: Option<u64>,
    /// What only this lock says.
    pub token: String,
}

impl Document for LockDocument {
    const FORMAT: &'static str = "lock/1";
}

#[cfg(test)]
mod tests {
    use super::super::tests::{keys, round_trip};
    use super::*;

    #[test]
    fn a_lock_is_what_it_was_when_it_is_read_again() {
        let lock = LockDocument {
            beat: "0000000012".into(),
            host: "node7".into(),
            process: 4242,
            since: "2026-01-31T12:00:00Z".into(),
            patience: 60.0,
            namespace: "5d3c pid:[4026531836]".into(),
            beginning: Some(77),
            token: "node7-4242-1".into(),
        };
        let file = round_trip(&lock);
        let all = ["beat", "beginning", "format", "host", "namespace", "patience", "process", "since", "token"];
        assert_eq!(keys(&file), all);
    }
}

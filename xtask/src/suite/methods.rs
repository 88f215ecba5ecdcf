//! Methods that answer the cases: palpate's diagnosis and what it is measured against.

use super::ablation;
use super::answer::Answer;
use super::baselines;
use super::case::Recorded;
use crate::rows;
use palpate::{Backend, Clock, DiagnoseOptions, Error, diagnose};
use std::str::FromStr;
use std::time::Duration;

/// A method.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Method {
    /// `palpate diagnose`.
    Palpate,
    /// A fit that takes its model for true.
    Plain,
    /// A free force field beside the model.
    Field,
    /// A Gaussian-process discrepancy beside the model.
    Process,
    /// `palpate diagnose` with another search: a place in [`ablation::ALL`].
    Ablated(usize),
}

impl Method {
    /// All that are compared.
    pub const ALL: [Method; 4] = [Method::Palpate, Method::Plain, Method::Field, Method::Process];

    /// Name in rows.
    pub fn name(self) -> &'static str {
        match self {
            Method::Palpate => "palpate",
            Method::Plain => "plain",
            Method::Field => "field",
            Method::Process => "process",
            Method::Ablated(k) => ablation::ALL[k].name,
        }
    }

    /// What it says of a case.
    ///
    /// # Errors
    /// It has no answer.
    pub fn answer(
        self,
        case: &str,
        recorded: &Recorded,
        budget: Duration,
        say: &mut (dyn FnMut(&str) + Send),
    ) -> Result<Answer, Error> {
        let clock = rows::processor_clock();
        let timed = |a: Answer| Answer { seconds: clock.elapsed().as_secs_f64(), ..a };
        match self {
            Method::Plain => baselines::plain(case, &recorded.seen).map(timed),
            Method::Field => baselines::field::answer(case, &recorded.seen).map(timed),
            Method::Process => baselines::process::answer(case, &recorded.seen).map(timed),
            Method::Palpate | Method::Ablated(_) => {
                let mut options = options(budget, &clock, say);
                if let Method::Ablated(k) = self {
                    (ablation::ALL[k].set)(&mut options.statistics.search);
                }
                let found = diagnose(std::slice::from_ref(&recorded.seen), recorded.other.as_ref(), options)?;
                Ok(Answer::of(case, &found))
            }
        }
    }
}

/// With what a diagnosis of a case runs.
pub(super) fn options<'a>(budget: Duration, clock: &Clock, say: &'a mut (dyn FnMut(&str) + Send)) -> DiagnoseOptions<'a> {
    DiagnoseOptions {
        backend: Backend::Cpu,
        budget: Some(budget),
        clock: clock.clone(),
        on_progress: Some(say),
        ..DiagnoseOptions::default()
    }
}

impl FromStr for Method {
    type Err = String;

    fn from_str(name: &str) -> Result<Method, String> {
        let names = Method::ALL.map(Method::name);
        let found = Method::ALL.into_iter().find(|m| m.name() == name);
        found.ok_or_else(|| format!("there is no method \"{name}\"; there are {}", names.join(", ")))
    }
}

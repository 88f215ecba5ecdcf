//! What is computed of a case on one backend.

use super::cases::Case;
use palpate::{Backend, FitOptions, report};
use palpate_cpu::CpuBackend;
use palpate_engine::{Evaluation, ParamBatch, Request, ResidualRow, Rollout, Snapshot, Wanted};
use palpate_model::plan::Plan;
use serde_json::Value;
use std::collections::BTreeMap;
use std::ops::ControlFlow;

/// One quantity: its numbers, to be compared bit by bit, and some of them to be compared by size.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Quantity {
    /// What the numbers belong to, sorted: paths of parameters `[K]`. Empty where all belong together.
    pub keys: Vec<String>,
    /// The numbers: any where there are no keys, else as many for each key `[K, R]`.
    pub numbers: Vec<f64>,
    /// True where the numbers of a key belong to keys themselves `[K, K]`.
    pub square: bool,
    /// Numbers that tell how far a change goes, by key or by a name. Those of one entry have the same size.
    pub values: BTreeMap<String, Vec<f64>>,
}

impl Quantity {
    /// Numbers without keys.
    fn plain(numbers: Vec<f64>, values: BTreeMap<String, Vec<f64>>) -> Quantity {
        Quantity { numbers, values, ..Quantity::default() }
    }

    /// One number per key.
    fn keyed(numbers: BTreeMap<String, f64>) -> Quantity {
        let values = numbers.iter().map(|(k, v)| (k.clone(), vec![*v])).collect();
        Quantity { keys: numbers.keys().cloned().collect(), numbers: numbers.into_values().collect(), square: false, values }
    }

    /// A column of a matrix `[R, K]` per key, the keys in any order.
    fn columns(keys: &[String], numbers: &[f64]) -> Quantity {
        let column = |i: usize| numbers.iter().skip(i).step_by(keys.len()).copied().collect::<Vec<f64>>();
        let sorted: BTreeMap<&String, Vec<f64>> = keys.iter().enumerate().map(|(i, k)| (k, column(i))).collect();
        Quantity {
            keys: sorted.keys().map(|k| k.to_string()).collect(),
            values: sorted.iter().map(|(k, c)| (k.to_string(), extent(c))).collect(),
            numbers: sorted.into_values().flatten().collect(),
            square: false,
        }
    }

    /// A square matrix `[K, K]` by its keys in any order.
    fn matrix(keys: &[String], numbers: &[f64]) -> Quantity {
        let n = keys.len();
        let mut order: Vec<usize> = (0..n).collect();
        order.sort_by_key(|i| &keys[*i]);
        Quantity {
            keys: order.iter().map(|i| keys[*i].clone()).collect(),
            numbers: order.iter().flat_map(|i| order.iter().map(move |j| numbers[i * n + j])).collect(),
            values: (0..n).map(|i| (keys[i].clone(), vec![numbers[i * n + i]])).collect(),
            square: true,
        }
    }

    /// Hash of the bits (FNV-1a) of all numbers that belong to `wanted` keys only; of all where there are no keys.
    pub fn hash(&self, wanted: impl Fn(&str) -> bool) -> String {
        let n = self.keys.len();
        let kept: Vec<usize> = (0..n).filter(|i| wanted(&self.keys[*i])).collect();
        let row = self.numbers.len().checked_div(n).unwrap_or(0);
        let beside: Vec<usize> = if self.square { kept.clone() } else { (0..row).collect() };
        let numbers: Vec<f64> = if n == 0 {
            self.numbers.clone()
        } else {
            kept.iter().flat_map(|i| beside.iter().map(move |j| self.numbers[i * row + j])).collect()
        };
        let bytes = numbers.iter().flat_map(|x| x.to_bits().to_le_bytes());
        let hash = bytes.fold(0xcbf2_9ce4_8422_2325_u64, |h, b| (h ^ u64::from(b)).wrapping_mul(0x0100_0000_01b3));
        format!("{hash:016x}")
    }
}

/// Everything measured of one case by name of the quantity.
pub type Measured = BTreeMap<String, Quantity>;

/// States, cost and derivatives of a case; on the CPU also its fit, where it has one.
///
/// # Errors
/// The case cannot be read, or its evaluation fails.
pub fn measure(case: &Case, backend: Backend) -> Result<Measured, String> {
    let wrong = |e: palpate::Error| format!("{}: {e}", case.name);
    let plan = case.plan()?;
    let mut all = Measured::new();
    all.insert("states".into(), states(&plan, backend).map_err(wrong)?);
    let keys: Vec<String> = plan.layout.keys.iter().map(|k| k.spec().path.to_string()).collect();
    let theta = ParamBatch::from_rows(&case.members(&plan));
    let mut evaluator = backend.evaluator(&plan, case.members).map_err(wrong)?;
    let adjoint = evaluator.evaluate(&theta, &Request { gradient: Wanted::All, sensitivities: Vec::new() });
    let forward = evaluator.evaluate(&theta, &Request { gradient: Wanted::Nothing, sensitivities: (0..keys.len()).collect() });
    for (b, (adjoint, forward)) in adjoint.iter().zip(&forward).enumerate() {
        if let Some(f) = adjoint.failure.as_ref().or(forward.failure.as_ref()) {
            return Err(format!("{}: {f}", case.name));
        }
        let whose = if case.members == 1 { String::new() } else { format!(" of member {b}") };
        derivatives(&keys, adjoint, forward, &whose, &mut all);
    }
    if backend == Backend::Cpu {
        rows(&plan, &keys, &mut all).map_err(|e| format!("{}: {e}", case.name))?;
    }
    if case.is_fitted() && backend == Backend::Cpu {
        let experiment = case.experiment()?;
        let fitted = experiment.fit(FitOptions { backend, ..FitOptions::default() }).map_err(wrong)?;
        let mut numbers = BTreeMap::new();
        let document = serde_json::to_value(report::fit_document(&fitted, &[experiment], Vec::new(), Vec::new()))
            .map_err(|e| format!("{}: {e}", case.name))?;
        leaves(&document, "", &mut numbers);
        numbers.remove("seconds");
        all.insert("fit".into(), Quantity::keyed(numbers));
    }
    Ok(all)
}

fn derivatives(keys: &[String], adjoint: &Evaluation, forward: &Evaluation, whose: &str, all: &mut Measured) {
    let by_key = |values: &[f64]| Quantity::keyed(keys.iter().cloned().zip(values.iter().copied()).collect());
    let sums = [
        ("cost", adjoint.cost),
        ("matched", adjoint.matched as f64),
        ("residuals", adjoint.residuals as f64),
        ("sum of squares", adjoint.sum_squares),
        ("sum", adjoint.sum_signed),
        ("cost beside tangents", forward.cost),
    ];
    let sums = sums.map(|(name, x)| (name.to_string(), x));
    all.insert(format!("cost{whose}"), Quantity::keyed(sums.into()));
    all.insert(format!("gradient{whose}"), by_key(&adjoint.gradient));
    if let Some(c) = &forward.curvature {
        all.insert(format!("gradient by tangents{whose}"), by_key(&c.gradient));
        all.insert(format!("Gauss-Newton matrix{whose}"), Quantity::matrix(keys, &c.matrix));
    }
}

/// Every residual by itself, without and with its derivatives, as a diagnosis reads them.
fn rows(plan: &Plan, keys: &[String], all: &mut Measured) -> Result<(), String> {
    let mut rollout = Rollout::new(CpuBackend, plan, 1).map_err(|e| e.to_string())?;
    let every: Vec<usize> = (0..keys.len()).collect();
    for (name, along) in [("residuals", &[][..]), ("residuals with derivatives", &every)] {
        let lin = rollout.linearise(&plan.theta, along).map_err(|e| e.to_string())?;
        let part = |of: fn(&ResidualRow) -> f64| lin.rows.residuals.iter().map(of).collect::<Vec<f64>>();
        // A point that meets nothing has no value; no distance is ever infinite.
        let parts = [
            ("value", part(|r| r.value.unwrap_or(f64::MAX))),
            ("weight", part(|r| r.weight)),
            ("sight", part(|r| r.along_sight)),
        ];
        let values =
            parts.iter().map(|(n, x)| (n.to_string(), extent(&x.iter().map(|x| x.min(1e3)).collect::<Vec<_>>()))).collect();
        all.insert(name.into(), Quantity::plain(parts.into_iter().flat_map(|p| p.1).collect(), values));
        if !along.is_empty() {
            all.insert("derivatives of residuals".into(), Quantity::columns(keys, &lin.rows.sensitivity));
        }
    }
    Ok(())
}

/// u and v of the first, the middle and the last state.
fn states(plan: &Plan, backend: Backend) -> Result<Quantity, palpate::Error> {
    let steps = plan.clock.steps;
    let (mut numbers, mut values) = (Vec::new(), BTreeMap::new());
    let visit = |k: usize, s: Snapshot, _| {
        if [0, steps / 2, steps].contains(&k) {
            for (name, field) in [("u", s.displacement), ("v", s.velocity)] {
                let flat: Vec<f64> = field.iter().flat_map(|x| x.to_array()).collect();
                values.insert(format!("{name} at step {k}"), extent(&flat));
                numbers.extend(flat);
            }
        }
        ControlFlow::Continue(())
    };
    backend.visit(plan, &plan.theta, visit)?;
    Ok(Quantity::plain(numbers, values))
}

/// Norm of a vector and its sum with random signs: a change of that over the norm is about the relative size of the vector's change.
fn extent(x: &[f64]) -> Vec<f64> {
    let norm = x.iter().map(|x| x * x).sum::<f64>().sqrt();
    let sign = |i: usize| if (i as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15) >> 63 == 0 { 1.0 } else { -1.0 };
    vec![norm, x.iter().enumerate().map(|(i, x)| sign(i) * x).sum()]
}

/// All numbers of a JSON value by their path.
fn leaves(value: &Value, path: &str, all: &mut BTreeMap<String, f64>) {
    let below = |key: &str| if path.is_empty() { key.to_string() } else { format!("{path}.{key}") };
    match value {
        Value::Number(x) => {
            all.insert(path.to_string(), x.as_f64().unwrap_or(f64::NAN));
        }
        Value::Array(list) => list.iter().enumerate().for_each(|(i, v)| leaves(v, &below(&i.to_string()), all)),
        Value::Object(map) => map.iter().for_each(|(k, v)| leaves(v, &below(k), all)),
        _ => {}
    }
}

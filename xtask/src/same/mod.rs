//! `cargo xtask same`: whether states, costs, derivatives and fits of a set of small scenes have the bits that are stored.

mod cases;
mod measure;
mod store;
mod watch;

use crate::table;
use cases::{CASES, Case};
use measure::{Measured, measure};
use palpate::Backend;
use palpate_gpu::Choice;
use std::time::Instant;
use store::{Part, Record, Row, Store};

/// What to do.
pub struct Options {
    /// Only cases whose name holds this.
    pub only: Option<String>,
    /// Only this backend, `cpu` or `gpu`; else the CPU and, where there is an adapter, the GPU.
    pub backend: Option<String>,
    /// Why what is computed now is to be stored; `None` = it is compared.
    pub why: Option<String>,
}

/// Compares with `bench/same.json`, or writes it.
///
/// # Errors
/// A case cannot be computed, or something differs.
pub fn run(options: &Options) -> Result<(), String> {
    let path = table::root().join("bench/same.json");
    let mut store = Store::read(&path)?;
    let wanted: Vec<&Case> = CASES.iter().filter(|c| options.only.as_ref().is_none_or(|o| c.name.contains(o.as_str()))).collect();
    if wanted.is_empty() {
        return Err(format!("there is no such case; there are: {}", CASES.map(|c| c.name).join(", ")));
    }
    let mut rows = Vec::new();
    for backend in backends(options)? {
        let place = made_on(backend)?;
        let part = store.backends.entry(backend.name().into()).or_default();
        match &options.why {
            Some(why) => bless(part, &place, &wanted, backend, why, options.only.is_none())?,
            None => rows.extend(compare(part, &place, &wanted, backend, options.only.is_none())?),
        }
    }
    if options.why.is_some() {
        store.write(&path)?;
        println!("written to {}", path.display());
        return Ok(());
    }
    report(&rows)
}

fn backends(options: &Options) -> Result<Vec<Backend>, String> {
    match options.backend.as_deref() {
        Some("cpu") => Ok(vec![Backend::Cpu]),
        Some("gpu") => Ok(vec![Backend::Gpu]),
        _ if adapter().is_ok() => Ok(vec![Backend::Cpu, Backend::Gpu]),
        _ => {
            println!("gpu: left out, there is no usable graphics adapter");
            Ok(vec![Backend::Cpu])
        }
    }
}

/// Name and driver of the adapter that the GPU backend takes.
fn adapter() -> Result<String, String> {
    let choice = Choice::from_env();
    let found = palpate_gpu::adapters().into_iter().find(|a| a.refusal.is_none() && a.is_meant(&choice));
    found.map(|a| a.name).ok_or_else(|| "there is no usable graphics adapter".into())
}

/// What decides the bits of a backend beside the code.
fn made_on(backend: Backend) -> Result<String, String> {
    match backend {
        Backend::Gpu => adapter(),
        _ => Ok(format!("{} {}, {}", std::env::consts::ARCH, std::env::consts::OS, vectors())),
    }
}

/// The vector instructions that loops and faer's products are compiled for here.
fn vectors() -> &'static str {
    #[cfg(target_arch = "x86_64")]
    if std::arch::is_x86_feature_detected!("avx2") && std::arch::is_x86_feature_detected!("fma") {
        return "AVX2 and FMA";
    }
    "baseline"
}

fn measured<'a>(wanted: &'a [&Case], backend: Backend) -> impl Iterator<Item = Result<(&'a Case, Measured), String>> {
    wanted.iter().map(move |case| {
        let clock = Instant::now();
        let all = measure(case, backend).map_err(|e| format!("{}, {e}", backend.name()))?;
        println!("{} {}: {:.1} s", backend.name(), case.name, clock.elapsed().as_secs_f64());
        Ok((*case, all))
    })
}

fn bless(part: &mut Part, place: &str, wanted: &[&Case], backend: Backend, why: &str, all: bool) -> Result<(), String> {
    if part.made_on != place && !all {
        return Err(format!(
            "{}: what is stored was computed on {}, this is {place}; store all cases or none",
            backend.name(),
            part.made_on
        ));
    }
    part.made_on = place.into();
    if all {
        part.cases.retain(|name, _| wanted.iter().any(|c| c.name == name));
    }
    for done in measured(wanted, backend) {
        let (case, all) = done?;
        // What did not change keeps its reason.
        let kept = part.cases.get(case.name).is_some_and(|r| r.compare(&all).is_empty());
        if !kept {
            part.cases.insert(case.name.into(), Record::new(&all, table::today(), why));
        }
    }
    Ok(())
}

fn compare(part: &Part, place: &str, wanted: &[&Case], backend: Backend, all: bool) -> Result<Vec<Row>, String> {
    let comparable = part.made_on == place || part.cases.is_empty();
    if !comparable {
        println!("{}: not comparable, what is stored was computed on {}, this is {place}", backend.name(), part.made_on);
    }
    let mut rows = Vec::new();
    for done in measured(wanted, backend) {
        let (case, all) = done?;
        rows.extend(part.compare(case.name, backend.name(), &all));
    }
    let gone = part.cases.keys().filter(|name| all && !wanted.iter().any(|c| c.name == *name));
    rows.extend(gone.map(|name| Row {
        case: name.clone(),
        backend: backend.name().into(),
        quantity: "all".into(),
        far: "no longer computed".into(),
        counts: true,
    }));
    if !comparable {
        rows.iter_mut().for_each(|r| r.counts = false);
    }
    Ok(rows)
}

fn report(rows: &[Row]) -> Result<(), String> {
    if !rows.is_empty() {
        let heading = ["case", "backend", "quantity", "relative change (of)"].map(String::from).to_vec();
        let line = |r: &Row| {
            let note = if r.counts { "" } else { " [not counted]" };
            vec![r.case.clone(), r.backend.clone(), r.quantity.clone(), format!("{}{note}", r.far)]
        };
        table::print(
            "not as stored in bench/same.json",
            &std::iter::once(heading).chain(rows.iter().map(line)).collect::<Vec<_>>(),
        );
    }
    match rows.iter().filter(|r| r.counts).count() {
        0 => {
            println!("same: nothing that counts differs");
            Ok(())
        }
        n => Err(format!("same: {n} quantities differ; where they must, `cargo xtask same --bless --why \"…\"` stores them")),
    }
}

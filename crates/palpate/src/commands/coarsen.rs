//! `palpate coarsen`: a coarse body that moves like a fine one.

use crate::cli::{Console, INTERRUPTED};
use crate::coarsen::{CoarsenOptions, Coarsened, coarsen, usual_numbers};
use crate::error::Error;
use crate::experiment::Experiment;
use crate::options::{BackendName, count, out_folder};
use crate::results;
use clap::Args;
use palpate_engine::number;
use palpate_model::params::unit_behind;
use palpate_model::scene::Resolution;
use std::path::PathBuf;

const AFTER_HELP: &str = "\
Examples:
  palpate coarsen bunny.toml --cells 8                   8 cells along the longest side that move like the scene's own
  palpate coarsen bunny.toml --cell-size 0.02 --free material.youngs_modulus,material.stiffness_damping
  palpate coarsen bunny.toml --edge-length 0.03            tetrahedra with edges of at most 3 cm
  palpate coarsen bunny.toml --cells 8 --out small && palpate simulate small/model.toml

The scene is simulated as it is, points of its surface are followed, and numbers of the coarse body are fitted to their motion. A second
motion (a shake of the clamps, a push) then shows whether they hold for more than the first.

The numbers make up for errors of the coarse elements. They belong to that mesh and are no properties of the material; model.toml and
coarsening.json (format coarsening/1) say so. The folder holds both, the recordings that were followed, and coarse.toml, the fit's scene.";

/// Find numbers with which a coarse body moves like a fine one
#[derive(Clone, Debug, Args)]
#[command(after_help = AFTER_HELP)]
pub struct Arguments {
    /// Scene file of the fine body
    scene: PathBuf,
    /// Cells of the coarse body along its longest side
    #[arg(long, value_name = "N", required_unless_present_any = ["cell_size", "edge_length"], value_parser = count(1..=4096))]
    cells: Option<u64>,
    /// Edge of a cell of the coarse body [m]
    #[arg(long, value_name = "M", conflicts_with = "cells")]
    cell_size: Option<f64>,
    /// Longest edge of the coarse body's tetrahedra [m], where it is to be made of these
    #[arg(long, value_name = "M", conflicts_with_all = ["cells", "cell_size"])]
    edge_length: Option<f64>,
    /// Numbers that are fitted, separated by commas [default: modulus, Poisson's ratio, and the damping that the scene has]
    #[arg(long, value_name = "PATH", value_delimiter = ',')]
    free: Vec<String>,
    /// Points of the surface that are followed
    #[arg(long, value_name = "N", default_value_t = 200, value_parser = count(1..=100_000))]
    points: u64,
    /// Times at which they are compared
    #[arg(long, value_name = "N", default_value_t = 60, value_parser = count(1..=100_000))]
    frames: u64,
    /// Output folder [default: out/SCENE-coarse]
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// What computes
    #[arg(long, value_enum, default_value = "auto")]
    backend: BackendName,
}

pub fn run(a: &Arguments, console: &mut Console) -> Result<i32, Error> {
    let folder = out_folder(&a.out, &a.scene, "-coarse");
    crate::folder::check(&folder)?;
    let mut track = console.progress(0, "coarsening");
    track.on(0, "reading");
    let fine = Experiment::open_without_recording(&a.scene)?;
    let length = |name: &str, h: f64| match h > 0.0 && h.is_finite() {
        true => Ok(h),
        false => Err(Error::Input(format!("--{name}: {h} is not allowed: must be > 0 (m)"))),
    };
    let resolution = match (a.cells, a.cell_size, a.edge_length) {
        (Some(n), ..) => Resolution::Cells(n as u32),
        (None, Some(h), _) => Resolution::CellSize(length("cell-size", h)?),
        (None, None, h) => Resolution::Edge(length("edge-length", h.unwrap_or(f64::NAN))?),
    };
    let (backend, note) = a.backend.choose(fine.plan(), 1, &mut track)?;
    track.aside(|| note.iter().for_each(|n| console.note(n)));
    let _lock = crate::folder::take(&folder, console)?;
    console.interrupt.serve();
    let free = if a.free.is_empty() { usual_numbers(&fine) } else { a.free.clone() };
    let mut hear = |what: &str| track.on(1, what);
    let options = CoarsenOptions {
        resolution,
        free,
        points: a.points as usize,
        frames: a.frames as usize,
        backend,
        interrupt: console.interrupt.clone(),
        hear: &mut hear,
    };
    let done = coarsen(&fine, &folder, options)?;
    track.finish();
    console.warn(&done.document.warnings);
    if console.json() {
        console.print(&results::line(&done.document));
    } else {
        console.print(&text(&done));
    }
    Ok(if done.document.interrupted { INTERRUPTED } else { 0 })
}

fn text(done: &Coarsened) -> String {
    let d = &done.document;
    let mm = |m: f64| format!("{:.3} mm", 1e3 * m);
    let share = |a: f64, b: f64| format!("{:.0} %", 100.0 * a / b);
    let state = if d.interrupted { "interrupted: " } else { "" };
    let mut out = format!(
        "{state}{} in place of {}: off by {} with the fine body's numbers, {} with these ({})",
        d.mesh,
        d.fine,
        mm(d.before),
        mm(d.after),
        share(d.after, d.before)
    );
    for n in &d.numbers {
        out += &format!("\n  {} = {}{} (fine: {})", n.path, number(n.coarse), unit_behind(&n.unit), number(n.fine));
    }
    out += "\n  they belong to this mesh and are no properties of the material";
    match &d.check {
        Some(c) => {
            out += &format!(
                "\n  in {}: off by {} before, {} with these numbers, {} with numbers of its own",
                c.motion,
                mm(c.before),
                mm(c.transferred),
                mm(c.refitted)
            );
        }
        None => out += "\n  not checked on a second motion",
    }
    out + &format!("\n  model: {}", done.model.display())
}

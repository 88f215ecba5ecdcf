//! `cargo xtask verify`: whether the equations are solved, and whether what comes out is what theory says. One file a study; each is stored as
//! it ends, and the page `docs/verification.md` is written from what is stored.

mod beams;
mod bounce;
mod cook;
mod friction;
mod hertz;
mod linear;
pub mod report;
pub(crate) mod scenes;
mod space;
mod sphere;
mod spin;
mod taylor;
mod time;
mod vibration;

use crate::real::report::Made;
use crate::table;
use report::{Found, Report, Row};
use std::time::Instant;

/// A study.
pub struct Study {
    /// Its name on the command line and in the file.
    pub name: &'static str,
    /// Heading on the page.
    pub title: &'static str,
    /// What is done.
    pub text: &'static str,
    run: fn() -> Result<Vec<Row>, String>,
}

/// All, in the order of the page.
pub static STUDIES: &[Study] = &[
    Study {
        name: "space",
        title: "Order in space",
        text: "A smooth displacement with strains of up to 15 % is given on a free box, which is made of whole cells or cuts cells on all \
               sides. The loads that\nit would need are integrated in their weak form over the box, and Newton's method finds the discrete \
               solution. Its error is the root mean square\nover the mass.",
        run: space::run,
    },
    Study {
        name: "time",
        title: "Order in time",
        text: "A beam of cut cells swings in a clamp that turns and moves without a jerk; states after a period of its bending are compared with \
               those of\n1024 steps of TR-BDF2.",
        run: time::run,
    },
    Study {
        name: "taylor",
        title: "Gradient",
        text: "Order of |J(θ + εd) − J(θ) − ε ∇J·d| in ε for every kind of parameter and every effect of the table: a ball thrown into a corner, \
               or held\nby a clamp. Numbers of one kind or effect move together, each by its own size and sign.",
        run: taylor::run,
    },
    Study {
        name: "cantilever",
        title: "Cantilever in large deflections",
        text: "A beam 16 times as long as thick with a weight at its end. On two cut cells across it the ghost penalty makes it 1.6 % too stiff\n(deflection; whole cells have none).",
        run: beams::run,
    },
    Study {
        name: "cook",
        title: "Cook's membrane",
        text: "A panel of E = 1, ν = 1/3 under a small load of 1 per thickness, extruded to a thickness of 2; its slanted sides cut cells.",
        run: cook::run,
    },
    Study {
        name: "vibration",
        title: "Thick hollow sphere",
        text: "Radii of 1.8 and 6 m, 200 GPa, ν = 0.3, 8000 kg/m³; its stiffness and masses alone, no time step.",
        run: vibration::run,
    },
    Study {
        name: "hertz",
        title: "Contact: a ball pressed flat",
        text: "A ball between two rigid plates, ν = 0.3, contacts of a fifth of its radius, the default contact. At such contacts Hertz's formula is \
               8 % off\n(he has a half-space, the ball has another side), so that the exact linear solution is the measure; figures are means over \
               two places of the lattice.",
        run: hertz::run,
    },
    Study {
        name: "bounce",
        title: "Contact: a ball that bounces",
        text: "An undamped ball of 5 cm, 100 kPa, on cells of a fifth of its radius, lands at 0.3 m/s with the default scheme and contact.",
        run: bounce::run,
    },
    Study {
        name: "friction",
        title: "Friction",
        text: "A block slides to rest; an elastic ball rolls, or slips, down a slope of tan α = ¼ for 0.4 s, in steps of 5 ms of the default scheme.",
        run: friction::run,
    },
    Study {
        name: "spin",
        title: "Free spin",
        text: "A block of 6 × 4 × 2 cm and 100 kPa turns ten times about its stable axis in 100 steps a turn.",
        run: spin::run,
    },
];

/// Runs studies, all where none is named, and writes file and page.
///
/// # Errors
/// There is no such study, one cannot be run, or a figure is not what it has to be.
pub fn run(only: &[String]) -> Result<(), String> {
    if let Some(unknown) = only.iter().find(|o| STUDIES.iter().all(|s| s.name != o.as_str())) {
        let names: Vec<&str> = STUDIES.iter().map(|s| s.name).collect();
        return Err(format!("there is no study \"{unknown}\"; there are: {}", names.join(", ")));
    }
    let root = table::root();
    for study in STUDIES.iter().filter(|s| only.is_empty() || only.iter().any(|o| o == s.name)) {
        let start = Instant::now();
        let rows = (study.run)().map_err(|e| format!("{}: {e}", study.name))?;
        let head = ["figure", "required", "measured", "", "source"].map(String::from).to_vec();
        let lines: Vec<Vec<String>> = std::iter::once(head).chain(rows.iter().map(|r| r.cells().to_vec())).collect();
        table::print(study.title, &lines);
        // What others have stored meanwhile stays.
        let mut report = Report::load(&root)?;
        report.studies.insert(study.name.into(), Found { made: Made::now()?, seconds: start.elapsed().as_secs_f64(), rows });
        table::save("verify", &report)?;
        let page = root.join("docs/verification.md");
        std::fs::write(&page, report.page()).map_err(|e| format!("{}: {e}", page.display()))?;
    }
    let report = Report::load(&root)?;
    let failures = report.failures();
    if failures.is_empty() {
        println!("\nall figures are what they have to be: docs/verification.md");
        return Ok(());
    }
    let list: Vec<String> =
        failures.iter().map(|r| format!("  {}: {}, required {}", r.what, r.cells()[2], r.cells()[1])).collect();
    Err(format!("{} figures are not what they have to be:\n{}", list.len(), list.join("\n")))
}

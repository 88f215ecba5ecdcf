//! Input decks of CalculiX, which are those of Abaqus: `*NODE`, `*ELEMENT` of C3D10 or C3D4, sets, materials, one step.

use super::{Format, file};
use crate::feature::{Carried, Feature};
use crate::specimen::{Clock, Specimen};
use crate::text::{head, rows, short};
use crate::{ExportError, File};

/// The deck.
pub const FORMAT: Format = Format {
    name: "calculix",
    what: "input deck of CalculiX and Abaqus",
    ending: "inp",
    has_quadratic: true,
    carries,
    law: |model| match model {
        "neo-hookean" | "neo-hookean-log" | "stable-neo-hookean" => Some(("*HYPERELASTIC, NEO HOOKE", false)),
        _ => Some(("*ELASTIC, St. Venant and Kirchhoff's law in large rotations", false)),
    },
    write,
};

/// Increments that a static step begins with: large rotations are followed, and CalculiX takes smaller ones where they are needed.
const INCREMENTS: f64 = 4.0;

fn carries(feature: Feature, _: bool) -> Carried {
    match feature {
        Feature::Elasticity => Carried::As("`*ELASTIC` or `*HYPERELASTIC`"),
        Feature::Moduli | Feature::Densities => Carried::As("a material for each 1 %"),
        Feature::Density => Carried::As("`*DENSITY`"),
        Feature::MassDamping => Carried::As("`*DAMPING, ALPHA`"),
        Feature::StiffnessDamping => Carried::As("`*DAMPING, BETA`"),
        Feature::Clamps => Carried::As("`*BOUNDARY` of a node set"),
        Feature::Planes => Carried::Not("a contact plane would have to be meshed as a second body"),
        Feature::Masses => Carried::Not("whether gravity acts on MASS elements is not documented"),
        Feature::Gravity => Carried::As("`*DLOAD, GRAV`"),
        Feature::StartShape => Carried::As("`*INITIAL CONDITIONS, TYPE=DISPLACEMENT`"),
        Feature::StartVelocity | Feature::StartSpin => Carried::As("`*INITIAL CONDITIONS, TYPE=VELOCITY`"),
        Feature::Clock => Carried::As("`*DYNAMIC, DIRECT`"),
    }
}

/// Numbers over lines as data lines of sets have them: at most sixteen, with a comma after each.
fn listed(numbers: impl IntoIterator<Item = u32>) -> String {
    rows(numbers, 12, ", ", ",\n") + "\n"
}

fn write(s: &Specimen, lost: &[String]) -> Result<Vec<File>, ExportError> {
    let mut out: String = head(s, lost).iter().map(|l| format!("** {l}\n")).collect();
    out += "*NODE, NSET=NALL\n";
    for (n, x) in s.mesh.nodes.iter().enumerate() {
        out += &format!("{}, {}, {}, {}\n", n + 1, short(x.x), short(x.y), short(x.z));
    }
    let kind = if s.mesh.is_quadratic() { "C3D10" } else { "C3D4" };
    out += &format!("*ELEMENT, TYPE={kind}, ELSET=EALL\n");
    for e in 0..s.mesh.tets.len() {
        // Middles of edges 12, 23, 31, 14, 24, 34: the order that they have here.
        out += &format!("{}, {}\n", e + 1, rows(s.mesh.element(e).map(|n| n + 1), 16, ", ", ",\n"));
    }
    for (i, h) in s.held.iter().enumerate() {
        out += &format!("*NSET, NSET=CLAMP{i}\n{}", listed(h.nodes.iter().map(|n| n + 1)));
    }
    let parts = s.parts();
    for (k, (modulus, density, tets)) in parts.iter().enumerate() {
        let set = if parts.len() == 1 { "EALL".to_string() } else { format!("PART{k}") };
        if parts.len() > 1 {
            out += &format!("*ELSET, ELSET={set}\n{}", listed(tets.iter().map(|e| e + 1)));
        }
        out += &format!("*MATERIAL, NAME=M{k}\n{}*DENSITY\n{}\n", elasticity(s, *modulus), short(*density));
        out += &format!("*SOLID SECTION, ELSET={set}, MATERIAL=M{k}\n");
    }
    let m = &s.material;
    if m.mass_damping != 0.0 || m.stiffness_damping != 0.0 {
        out += &format!("*DAMPING, ALPHA={}, BETA={}\n", short(m.mass_damping), short(m.stiffness_damping));
    }
    if !s.held.is_empty() {
        out += "*BOUNDARY\n";
        (0..s.held.len()).for_each(|i| out += &format!("CLAMP{i}, 1, 3\n"));
    }
    out += &start(s);
    out += &step(s);
    Ok(vec![file(s, &FORMAT, out)])
}

/// The law of a material of this modulus [Pa].
fn elasticity(s: &Specimen, modulus: f64) -> String {
    let nu = s.material.poisson_ratio;
    if !s.material.model.contains("neo-hookean") {
        return format!("*ELASTIC\n{}, {}\n", short(modulus), short(nu));
    }
    // W = C10 (I1' − 3) + (J − 1)²/D1 with C10 = μ/2 and D1 = 2/K.
    let (mu, bulk) = (modulus / (2.0 * (1.0 + nu)), modulus / (3.0 * (1.0 - 2.0 * nu)));
    format!("*HYPERELASTIC, NEO HOOKE\n{}, {}\n", short(0.5 * mu), short(2.0 / bulk))
}

fn start(s: &Specimen) -> String {
    let mut out = String::new();
    let mut table = |kind: &str, at: &dyn Fn(glam::DVec3) -> glam::DVec3| {
        out += &format!("*INITIAL CONDITIONS, TYPE={kind}\n");
        for (n, x) in s.mesh.nodes.iter().enumerate() {
            for (axis, value) in at(*x).to_array().into_iter().enumerate() {
                out += &format!("{}, {}, {}\n", n + 1, axis + 1, short(value));
            }
        }
    };
    if s.start.is_some() {
        table("DISPLACEMENT", &|x| s.start_of(x) - x);
    }
    if let Some(v) = s.spin {
        table("VELOCITY", &|x| v.at(s.start_of(x)));
    }
    out
}

fn step(s: &Specimen) -> String {
    let mut out = String::new();
    match s.clock {
        Clock::Static => out += &format!("*STEP, NLGEOM, INC=1000\n*STATIC\n{}, 1.\n", short(1.0 / INCREMENTS)),
        Clock::Motion { step, steps } => {
            out +=
                &format!("*STEP, NLGEOM, INC={}\n*DYNAMIC, DIRECT\n{}, {}\n", steps + 1, short(step), short(step * steps as f64));
        }
    }
    let g = s.gravity.length();
    if g > 0.0 {
        let n = s.gravity / g;
        out += &format!("*DLOAD\nEALL, GRAV, {}, {}, {}, {}\n", short(g), short(n.x), short(n.y), short(n.z));
    }
    out + "*NODE FILE\nU\n*END STEP\n"
}

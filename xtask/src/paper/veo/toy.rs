//! A toy of two parts as a user meets it: watched while a jet goes over it, a stiffness found for every point, then touched by what it has never
//! felt. The truth is made of other elements: hexahedra twice as fine as the points lie, or quadratic tetrahedra.

use super::super::cases::{Figures, Row};
use super::clouds::{FIELD, FOUND, HALVES, HULL, MODULUS, PRIOR, SPACING, bar, fitted, held, record, seen, text, write_field};
use crate::tetrahedra::mesh::Mesh;
use glam::DVec3;
use palpate::Experiment;
use palpate_io::cloud::write_cloud;
use std::fmt::Write as _;
use std::fs;
use std::path::Path;

/// Where along the bar the jet blows [m], and whether from the side instead of from above, state by state. The fit sees the first ones.
const SWEEP: [(f64, bool); 6] = [(0.15, false), (0.15, true), (0.09, false), (0.09, true), (0.12, false), (0.13, true)];
const TRAINED: usize = 4;
/// Distance of the nozzle from the bar's middle [m].
const AWAY: f64 = 0.12;
/// Heights of the cylinder's axis [m]: first above the bar, then ever deeper.
const PRESSED: [f64; 5] = [0.062, 0.058, 0.054, 0.050, 0.046];

/// Writes the nozzle's poses. It blows along its own x axis.
fn nozzle(folder: &Path) -> Result<(), String> {
    let half = std::f64::consts::FRAC_1_SQRT_2;
    let mut csv = String::from("time,x,y,z,qx,qy,qz,qw\n");
    for (time, (x, aside)) in SWEEP.iter().enumerate() {
        let (y, z, turn) = if *aside { (0.02 - AWAY, 0.02, "0,0,Q") } else { (0.02, 0.02 + AWAY, "0,Q,0") };
        writeln!(csv, "{time},{x},{y},{z},{},{half}", turn.replace('Q', &half.to_string())).map_err(text)?;
    }
    fs::write(folder.join("nozzle.csv"), csv).map_err(text)
}

/// Writes the poses of the cylinder that is pressed onto the soft half.
fn press(folder: &Path) -> Result<(), String> {
    let mut csv = String::from("time,x,y,z,qx,qy,qz,qw\n");
    for (time, z) in PRESSED.iter().enumerate() {
        writeln!(csv, "{time},0.12,0.02,{z},0,0,0,1").map_err(text)?;
    }
    fs::write(folder.join("press.csv"), csv).map_err(text)
}

/// Writes the bar as quadratic tetrahedra, six to a cube of edge `brick` [m].
fn tetrahedra(folder: &Path, brick: f64) -> Result<(), String> {
    let planes = |n: usize| (0..=n).map(|k| brick * k as f64).collect::<Vec<f64>>();
    let (long, wide) = ((0.16 / brick).round() as usize, (0.04 / brick).round() as usize);
    let mesh = Mesh::block([&planes(long), &planes(wide), &planes(wide)]);
    let mut out = format!("$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n{}\n", mesh.nodes.len());
    for (n, x) in mesh.nodes.iter().enumerate() {
        writeln!(out, "{} {} {} {}", n + 1, x.x, x.y, x.z).map_err(text)?;
    }
    writeln!(out, "$EndNodes\n$Elements\n{}", mesh.tets.len()).map_err(text)?;
    for (n, tet) in mesh.tets.iter().enumerate() {
        let mut nodes = tet.map(|n| (n + 1).to_string());
        // Gmsh counts the last two middles the other way round.
        nodes.swap(8, 9);
        writeln!(out, "{} 11 2 1 1 {}", n + 1, nodes.join(" ")).map_err(text)?;
    }
    fs::write(folder.join("bar.msh"), format!("{out}$EndElements\n")).map_err(text)
}

const JET: &str = "[world]\ngravity = [0, 0, 0]\n[time]\nmode = \"quasi-static\"\n\
                   [[load]]\nkind = \"jet\"\nmotion = \"nozzle.csv\"\naxis = [1, 0, 0]\nthrust = 0.4\n";

/// The scene of the touch; stiffness of the contact as of a plane on cells as long as the points are apart.
fn touch() -> String {
    format!(
        "[world]\ngravity = [0, 0, 0]\n[time]\nmode = \"quasi-static\"\n[[obstacle]]\nmotion = \"press.csv\"\nstiffness = {}\n\
         shape = {{ cylinder = {{ radius = 0.02, height = 0.08, center = [0, 0, 0], axis = [0, 1, 0] }} }}\n",
        20.0 * MODULUS / SPACING
    )
}

/// Mean, 95th percentile and largest of distances [mm].
fn spread(mut all: Vec<f64>) -> [f64; 3] {
    all.sort_by(f64::total_cmp);
    let mean = all.iter().sum::<f64>() / all.len() as f64;
    [mean, all[(0.95 * (all.len() - 1) as f64).round() as usize], all[all.len() - 1]].map(|x| 1e3 * x)
}

/// Distances of the same points in the states under the obstacle.
fn apart(a: &[Vec<DVec3>], b: &[Vec<DVec3>]) -> Vec<f64> {
    a.iter().zip(b).skip(1).flat_map(|(a, b)| a.iter().zip(b).map(|(a, b)| a.distance(*b))).collect()
}

/// Who answers, and what is said of the distances.
const WHO: [&str; 3] = ["per point", "one modulus", "does not move"];
const SPREAD: [&str; 3] = ["mean", "95 %", "max"];

/// Errors under the obstacle as Chen et al. state theirs (table 1), in millimetres.
pub fn table(rows: &[Row]) -> String {
    let mut out = String::from("| truth | a stiffness | mean | 95 % | max |\n|---|---|---|---|---|\n");
    for (case, truth) in [("toy", "hexahedra"), ("toy-tet", "tetrahedra")] {
        let row = rows.iter().rev().find(|r| r.case == case);
        for who in WHO {
            let of = |what: &str| {
                row.and_then(|r| r.figures.get(&format!("{who}: {what} [mm]"))).map_or("–".into(), |x| format!("{x:.2}"))
            };
            out += &format!("| {truth} | {who} | {} |\n", SPREAD.map(of).join(" | "));
        }
    }
    out
}

/// The whole way; `quadratic`: with a truth of tetrahedra.
pub fn run(folder: &Path, quadratic: bool) -> Result<Figures, String> {
    let points = held([16, 4, 4], SPACING);
    write_cloud(folder.join("rest.ply"), &points).map_err(text)?;
    nozzle(folder)?;
    press(folder)?;
    let truth = if quadratic {
        tetrahedra(folder, SPACING)?;
        "volume_mesh = \"bar.msh\"".to_string()
    } else {
        format!("{HULL}cell_size = {}", 0.5 * SPACING)
    };
    let times = |n: usize| (0..n).map(|k| k as f64).collect::<Vec<f64>>();
    record(&bar(&truth, &format!("{JET}{HALVES}")), &points, &times(SWEEP.len()), 0.02 * SPACING, folder)?;

    let object = format!("points = \"rest.ply\"\ndiscretisation = \"points\"\n{HULL}");
    let observation = format!(
        "[observation]\nrecording = \"seen\"\ncost = \"points\"\n[fit]\nframes = {{ train = {{ every = 1, count = {TRAINED} }} }}\n"
    );
    let fit = |more: &str| -> Result<_, String> {
        let e =
            Experiment::from_toml(&bar(&object, &format!("{JET}{observation}{more}")), folder.join("f.toml")).map_err(text)?;
        Ok((fitted(&e)?, e))
    };
    let (one, _) = fit("[[fit.parameter]]\npath = \"material.youngs_modulus\"\nstart = 1e5\n")?;
    let (many, e) = fit(&format!("[[fit.parameter]]\npath = \"field.0\"\n{FIELD}{PRIOR}"))?;
    write_field(folder, &many.result.theta[0][e.plan().layout.resolve("field.0")])?;

    let found = crate::real::found(&one, "material.youngs_modulus");
    let states = |object: &str, modulus: f64, more: &str| {
        let scene = bar(object, &format!("{}{more}", touch()));
        let scene = scene.replace(&format!("youngs_modulus = {MODULUS}"), &format!("youngs_modulus = {modulus}"));
        seen(&scene, &points, &times(PRESSED.len()), folder)
    };
    let right = states(&truth, MODULUS, HALVES)?;
    let of_one = states(&object, found, "")?;
    let of_points = states(&object, MODULUS, &format!("{FIELD}{FOUND}"))?;
    let still = vec![points.clone(); PRESSED.len()];

    let mut out = Figures::new();
    for (who, states) in WHO.into_iter().zip([&of_points, &of_one, &still]) {
        for (what, x) in SPREAD.into_iter().zip(spread(apart(states, &right))) {
            out.insert(format!("{who}: {what} [mm]"), x);
        }
    }
    let held_out = |f: &palpate::Fitted| f.held_out.as_ref().map_or(f64::NAN, |h| 1e3 * h.test.rms);
    out.insert("per point: rms of the other states of the sweep [mm]".into(), held_out(&many));
    out.insert("one modulus: rms of the other states of the sweep [mm]".into(), held_out(&one));
    out.insert("one modulus [kPa]".into(), 1e-3 * found);
    out.insert("seconds of the fit".into(), many.result.seconds);
    Ok(out)
}

//! Bodies of points in scenes: against cells made of the same points (A12), a bar of two parts (A8), and the measured beam (A13).

use super::Figures;
use glam::DVec3;
use palpate::render::Sensor;
use palpate::synthetic::{Observers, observe};
use palpate::{Backend, Coordinates, Experiment, FitOptions, Fitted, Objective};
use palpate_io::cloud::write_cloud;
use palpate_io::npy::{Array, write_npz};
use palpate_io::recording::Recording;
use std::ops::ControlFlow;
use std::path::Path;
use std::time::Instant;

/// Points with a layer on the plane x = 0, by which the body is held: in the middles of cubes of edge `h` [m], moved by up to a quarter of it.
pub(super) fn held(count: [usize; 3], h: f64) -> Vec<DVec3> {
    let layer = super::bars::points([1, count[1], count[2]], 11).into_iter().map(|x| x * DVec3::new(0.0, 1.0, 1.0));
    super::bars::points(count, 12).into_iter().chain(layer).map(|x| h * x).collect()
}

pub(super) fn text(e: impl std::fmt::Display) -> String {
    e.to_string()
}

pub(super) fn fitted(e: &Experiment) -> Result<Fitted, String> {
    e.fit(FitOptions { backend: Backend::Cpu, ..FitOptions::default() }).map_err(text)
}

/// What is seen of a scene's points at the times of its states.
fn watched(truth: &str, points: &[DVec3], times: &[f64], noise: f64, folder: &Path) -> Result<Recording, String> {
    let e = Experiment::from_toml(truth, folder.join("truth.toml")).map_err(text)?;
    let observers = Observers {
        cameras: Vec::new(),
        markers: Vec::new(),
        points: points.to_vec(),
        displacements: false,
        times: times.to_vec(),
        sensor: Sensor { noise, dropout: 0.0, depth_scale: 0.001, seed: 2 },
    };
    observe(&e, Backend::Cpu, &observers, |_| ControlFlow::Continue(())).map_err(text)
}

/// Writes it.
pub(super) fn record(truth: &str, points: &[DVec3], times: &[f64], noise: f64, folder: &Path) -> Result<(), String> {
    let mut seen = watched(truth, points, times, noise, folder)?;
    if let Some(points) = &mut seen.points {
        // Points lie deep within cells of half their spacing.
        points.tolerance = Some(1.0);
    }
    palpate_io::write_recording(folder.join("seen"), &seen).map_err(text)
}

/// Where the points of a scene lie at the times of its states [m] `[T][N]`.
pub(super) fn seen(truth: &str, points: &[DVec3], times: &[f64], folder: &Path) -> Result<Vec<Vec<DVec3>>, String> {
    let seen = watched(truth, points, times, 0.0, folder)?.points.ok_or("no points are seen")?;
    Ok(seen.track.vectors.chunks_exact(points.len()).map(<[DVec3]>::to_vec).collect())
}

/// Spacing of the bars' points [m].
pub(super) const SPACING: f64 = 0.01;
pub(super) const MODULUS: f64 = 2e5;

pub(super) fn bar(object: &str, more: &str) -> String {
    format!(
        "format = \"scene/1\"\n[object]\n{object}\n[material]\nmodel = \"neo-hookean\"\ndensity = 1000\nyoungs_modulus = {MODULUS}\npoisson_ratio = 0.3\n\
         [[clamp]]\nbox = {{ min = [-1, -1, -1], max = [1e-4, 1, 1] }}\n{more}"
    )
}

/// A12: one cloud as points and as cells within a surface around it, and the modulus that the points' motion in a body of finer cells gives back.
pub fn both(folder: &Path) -> Result<Figures, String> {
    let points = held([16, 4, 4], SPACING);
    write_cloud(folder.join("rest.ply"), &points).map_err(text)?;
    let cloud = |kind: &str| format!("points = \"rest.ply\"\nvolume = 2.64e-4\n{kind}");
    let still = "[initial]\nstate = \"static-equilibrium\"\n[time]\nduration = 0\n";
    let kinds = [cloud("discretisation = \"points\""), cloud("cell_size = 0.01"), cloud("cell_size = 0.005")];
    let tip = |object: &String| -> Result<f64, String> {
        let e = Experiment::from_toml(&bar(object, still), folder.join("s.toml")).map_err(text)?;
        let s = e.simulate(Backend::Cpu).map_err(text)?;
        let rest = e.surface(0.5 * SPACING).0;
        let places = rest.deform(&vec![DVec3::ZERO; e.plan().body.nodes.len()]);
        let moved = rest.deform(&s.snapshots[0].displacement);
        let end = places.iter().zip(&moved).filter(|(x, _)| x.x > 15.0 * SPACING).map(|(x, y)| (*y - *x).z);
        let all: Vec<f64> = end.collect();
        Ok(all.iter().sum::<f64>() / all.len() as f64)
    };
    let tips = kinds.iter().map(tip).collect::<Result<Vec<f64>, _>>()?;
    record(&bar(&kinds[2], still), &points, &[0.0], 1e-4, folder)?;
    let fit = "[observation]\nrecording = \"seen\"\ncost = \"points\"\n[fit]\n[[fit.parameter]]\npath = \"material.youngs_modulus\"\nstart = 1e5\n";
    let found = |object: &String| -> Result<f64, String> {
        let e = Experiment::from_toml(&bar(object, &format!("{still}{fit}")), folder.join("f.toml")).map_err(text)?;
        Ok(crate::real::found(&fitted(&e)?, "material.youngs_modulus"))
    };
    let [of_points, of_cells] = [found(&kinds[0])?, found(&kinds[1])?];
    let mut out = Figures::new();
    for (name, x) in [
        ("tip of points [mm]", 1e3 * tips[0]),
        ("tip of cells [mm]", 1e3 * tips[1]),
        ("tip of finer cells [mm]", 1e3 * tips[2]),
        (super::TIPS, tips[0] / tips[1]),
        (super::LN, (of_points / of_cells).ln()),
    ] {
        out.insert(name.into(), x);
    }
    Ok(out)
}

/// Force on the end of the bar at every state [N]; the last two are what fits are tried on.
const LOADS: [[f64; 3]; 6] =
    [[0.0, 0.0, -0.25], [0.0, 0.25, 0.0], [4.0, 0.0, 0.0], [0.0, -0.2, 0.2], [0.0, 0.15, -0.2], [2.0, 0.0, 0.2]];

/// Of those the fits see the first ones.
const TRAINED: usize = 4;

/// A bar around the cloud, and its outer half four times softer.
pub(super) const HULL: &str = "shape = { box = { min = [0, 0, 0], max = [0.16, 0.04, 0.04] } }\n";
pub(super) const HALVES: &str = "[[field]]\npath = \"material.youngs_modulus\"\nbasis = \"regions\"\nblend = \"nearest\"\n\
                                 regions = [{ center = [0.04, 0.02, 0.02], radius = 0.01 }, { center = [0.12, 0.02, 0.02], radius = 0.01, value = 0.25 }]\n";

/// A stiffness for every point, what is expected of it, and a fit's.
pub(super) const FIELD: &str = "[[field]]\npath = \"material.youngs_modulus\"\nbasis = \"points\"\n";
pub(super) const PRIOR: &str = "[field.prior]\nkind = \"matern\"\nlength = 0.08\ndeviation = 1.0\n";
pub(super) const FOUND: &str = "file = \"found.npz\"\n";

/// Writes a fit's stiffnesses where [`FOUND`] reads them.
pub(super) fn write_field(folder: &Path, values: &[f64]) -> Result<(), String> {
    let array = Array { shape: vec![values.len()], values: values.to_vec() };
    write_npz(folder.join("found.npz"), &[("E", &array)]).map_err(text)
}

/// A8: a bar of two parts, the outer half four times softer, seen on hexahedra twice as fine as the points are apart.
pub fn two_parts(folder: &Path) -> Result<Figures, String> {
    let points = held([16, 4, 4], SPACING);
    write_cloud(folder.join("rest.ply"), &points).map_err(text)?;
    let places: Vec<String> =
        (0..16).map(|k| format!("[0.16, {}, {}]", 0.01 * (k % 4) as f64 + 0.005, 0.01 * (k / 4) as f64 + 0.005)).collect();
    let total: Vec<String> = LOADS.iter().map(|f| format!("{f:?}")).collect();
    let loads = format!(
        "[world]\ngravity = [0, 0, 0]\n[time]\nmode = \"quasi-static\"\n[[load]]\nkind = \"file\"\nplaces = [{}]\ntotal = [{}]\ntimes = [0, 1, 2, 3, 4, 5]\n",
        places.join(", "),
        total.join(", ")
    );
    let times: Vec<f64> = (0..LOADS.len()).map(|k| k as f64).collect();
    let truth = format!("{HULL}cell_size = 0.005");
    record(&bar(&truth, &format!("{loads}{HALVES}")), &points, &times, 0.02 * SPACING, folder)?;
    let observation =
        "[observation]\nrecording = \"seen\"\ncost = \"points\"\n[fit]\nframes = { train = { every = 1, count = 4 } }\n";
    let object = format!("points = \"rest.ply\"\ndiscretisation = \"points\"\n{HULL}");
    let one = "[[fit.parameter]]\npath = \"material.youngs_modulus\"\nstart = 1e5\n";
    let (field, prior) = (FIELD, PRIOR);
    let free = "[[fit.parameter]]\npath = \"field.0\"\n";
    let run = |more: &str| -> Result<(Fitted, Vec<f64>), String> {
        let e =
            Experiment::from_toml(&bar(&object, &format!("{loads}{observation}{more}")), folder.join("f.toml")).map_err(text)?;
        let fitted = fitted(&e)?;
        let values = fitted.result.theta[0][e.plan().layout.resolve("field.0")].to_vec();
        Ok((fitted, values))
    };
    let ((one, _), (many, values)) = (run(one)?, run(&format!("{free}{field}{prior}"))?);
    write_field(folder, &values)?;
    let modulus = crate::real::found(&one, "material.youngs_modulus");
    // What the fits did not see, without the noise that was laid over it.
    let right = seen(&bar(&truth, &format!("{loads}{HALVES}")), &points, &times, folder)?;
    let apart = |scene: String| -> Result<f64, String> {
        let found = seen(&scene, &points, &times, folder)?;
        let all = right.iter().zip(&found).skip(TRAINED).flat_map(|(a, b)| a.iter().zip(b).map(|(a, b)| a.distance_squared(*b)));
        let squares: Vec<f64> = all.collect();
        Ok(1e3 * (squares.iter().sum::<f64>() / squares.len() as f64).sqrt())
    };
    let of_one =
        apart(bar(&object, &loads).replace(&format!("youngs_modulus = {MODULUS}"), &format!("youngs_modulus = {modulus}")))?;
    let of_points = apart(bar(&object, &format!("{loads}{field}{FOUND}")))?;
    let mean_ln = |outer: bool| {
        let (own, other) = if outer { (0.09, 0.15) } else { (0.01, 0.07) };
        let of = points.iter().zip(&values).filter(|(x, _)| (own..other).contains(&x.x)).map(|(_, v)| v.ln());
        let all: Vec<f64> = of.collect();
        all.iter().sum::<f64>() / all.len() as f64
    };
    let mut out = Figures::new();
    for (name, x) in [
        ("one modulus: rms of the other states [mm]", of_one),
        ("per point: rms of the other states [mm]", of_points),
        (super::HELD, of_points / of_one),
        (super::RATIO, (mean_ln(true) - mean_ln(false)).exp()),
        ("one modulus [kPa]", 1e-3 * modulus),
        ("evaluations", many.result.evaluations as f64),
        ("seconds of the fit", many.result.seconds),
    ] {
        out.insert(name.into(), x);
    }
    Ok(out)
}

/// A sequence of a hundred equilibria of 3000 points: how long the cost and its gradient by every point's stiffness take.
pub fn frames(folder: &Path) -> Result<Figures, String> {
    const FRAMES: usize = 100;
    let points = held([30, 10, 10], SPACING);
    write_cloud(folder.join("rest.ply"), &points).map_err(text)?;
    let turned = |k: usize| std::f64::consts::TAU * k as f64 / FRAMES as f64;
    let total: Vec<String> =
        (0..FRAMES).map(|k| format!("[0, {}, {}]", 2.0 * turned(k).sin(), 2.0 * turned(k).cos() - 2.0)).collect();
    let times: Vec<f64> = (0..FRAMES).map(|k| k as f64).collect();
    let loads = format!(
        "[world]\ngravity = [0, 0, 0]\n[time]\nmode = \"quasi-static\"\n[[load]]\nkind = \"file\"\n\
         places = [[0.295, 0.02, 0.02], [0.295, 0.08, 0.02], [0.295, 0.02, 0.08], [0.295, 0.08, 0.08]]\ntotal = [{}]\ntimes = {times:?}\n",
        total.join(", ")
    );
    let object =
        "points = \"rest.ply\"\ndiscretisation = \"points\"\nshape = { box = { min = [0, 0, 0], max = [0.3, 0.1, 0.1] } }\n";
    record(&bar(object, &loads), &points, &times, 1e-4, folder)?;
    let fit = format!(
        "{loads}[observation]\nrecording = \"seen\"\ncost = \"points\"\n[fit]\n[[fit.parameter]]\npath = \"field.0\"\n{FIELD}{PRIOR}"
    );
    let e = Experiment::from_toml(&bar(object, &fit), folder.join("f.toml")).map_err(text)?;
    let mut objective = Objective::new(std::slice::from_ref(&e), Backend::Cpu, Coordinates::default()).map_err(text)?;
    let start = objective.start();
    let clock = Instant::now();
    let (value, gradient) = objective.value_and_gradient(&start).map_err(text)?;
    let mut out = Figures::new();
    for (name, x) in [
        (super::HUNDRED, clock.elapsed().as_secs_f64()),
        ("points", points.len() as f64),
        ("numbers", gradient.len() as f64),
        ("cost", value),
    ] {
        out.insert(name.into(), x);
    }
    Ok(out)
}

/// A13: the measured beam as a cloud, 6 points thick, within its own surface.
pub fn beam(data: &Path, folder: &Path, changes: &[(&'static str, &'static str)]) -> Result<Figures, String> {
    let points: Vec<DVec3> = held([20, 6, 6], 0.005);
    let file = folder.join("rest.ply");
    write_cloud(&file, &points).map_err(text)?;
    let cloud = format!("points = \"{}\"\ndiscretisation = \"points\"", file.display());
    let mut all = vec![(
        "cell_size = 0.01              # 3 cells through the thickness: the enhanced element bends without locking",
        cloud.as_str(),
    )];
    all.extend(changes.iter().copied());
    let e = crate::real::open(data, "beam-quasi-static", &all).map_err(text)?;
    let fitted = fitted(&e)?;
    let mut out = Figures::new();
    out.insert(super::MODULUS.into(), 1e-3 * crate::real::found(&fitted, "material.youngs_modulus"));
    out.insert(super::RMS.into(), 1e3 * fitted.residual().0);
    out.insert("seconds of the fit".into(), fitted.result.seconds);
    Ok(out)
}

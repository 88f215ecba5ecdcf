//! The report of a fit as data, and the pictures that are drawn of it.

use super::{BALL, observed};
use palpate::results::report::{Role, Topic};
use std::fs;
use support::command::{arg, json, palpate, succeed};

#[test]
fn a_report_holds_what_it_shows_and_pictures_are_drawn_of_it_alone() {
    let folder = observed(BALL);
    let (scene, out) = (folder.path().join("fit.toml"), folder.path().join("out"));
    succeed(&["fit", "--no-grid-check", arg(&scene), "--starts", "2", "--pictures", "5", "--out", arg(&out)]);
    let page = out.join("report.html");
    assert!(fs::metadata(&page).unwrap().len() < 8_000_000);
    let data = palpate::report::read_report(&page).unwrap();
    let (scene, r) = (&data.scenes[0], json(out.join("result.json")));
    assert!((1..=5).contains(&scene.shown.len()) && scene.shown.iter().all(|f| f.motions.iter().all(Option::is_some)));
    // What is shown frame by frame is what the result says of all frames together: each has about as many points.
    let mean = |m: usize| {
        let all: Vec<f64> = scene.rms[m].iter().flatten().map(|r| r * r).collect();
        (all.iter().sum::<f64>() / all.len() as f64).sqrt()
    };
    let rms = r["residual"]["rms"].as_f64().unwrap();
    assert!((mean(1) / rms - 1.0).abs() < 0.1 && mean(0) > 2.0 * rms, "{} {} {rms}", mean(0), mean(1));
    let motion = scene.shown[scene.worst].motions[1].as_ref().unwrap();
    let (vertices, points) = (motion.vertices.vectors(), motion.points.vectors());
    assert_eq!((motion.residual.0.len(), motion.distances.0.len()), (vertices.len(), points.len()));
    // A measured point lies as far from the nearest vertex as its distance says, within the vertices' spacing.
    let spacing = 0.5
        * vertices[0].distance(
            *vertices[1..].iter().min_by(|a, b| vertices[0].distance(**a).total_cmp(&vertices[0].distance(**b))).unwrap(),
        );
    for (p, d) in points.iter().zip(motion.distances.numbers()).filter(|(_, d)| d.is_finite()) {
        let nearest = vertices.iter().map(|v| v.distance(*p)).fold(f64::INFINITY, f64::min);
        assert!(nearest >= d.abs() - 4.0 * spacing && nearest <= d.abs() + 4.0 * spacing, "{nearest} {d} {spacing}");
    }
    let of = |topic: Topic| data.charts.iter().filter(move |c| c.topic == topic);
    assert!(of(Topic::Histogram).count() == 1 && of(Topic::Residual).count() == 1 && of(Topic::Search).count() == 2);
    // Columns of the histogram are shares of all readings; some may lie beyond its ends.
    let histogram = of(Topic::Histogram).next().unwrap();
    let fitted = histogram.series.iter().find(|s| s.role == Role::After).unwrap();
    let within = fitted.y.numbers().sum::<f64>();
    assert!(within > 90.0 && within < 100.0 + 1e-3, "{within}");

    // Neither scene nor recording are needed any more.
    let moved = folder.path().join("moved");
    fs::create_dir(&moved).unwrap();
    fs::rename(&page, moved.join("report.html")).unwrap();
    fs::remove_dir_all(folder.path().join("seen")).unwrap();
    let drawn = succeed(&["pictures", arg(&moved), "--format", "png,svg,gif,vtu", "--width", "160", "--json"]);
    let files = serde_json::from_str::<serde_json::Value>(&drawn.out).unwrap()["files"].clone();
    let names: Vec<&str> = files.as_array().unwrap().iter().filter_map(|f| f.as_str()).collect();
    for name in [
        "search-cost.svg",
        "residual-0.png",
        "space-0.gif",
        "space-0-000.png",
        "camera-0-0.png",
        "surface-0-second-000.vtu",
        "readings-0-first.pvd",
    ] {
        assert!(names.contains(&name), "{name} in {names:?}");
        assert!(fs::metadata(moved.join("pictures").join(name)).unwrap().len() > 100, "{name}");
    }
    let residual =
        palpate_io::vtk::read_vtu_array(&moved.join("pictures/surface-0-second-000.vtu"), Some("residual"), false).unwrap();
    assert_eq!(residual.len(), vertices.len());
    // What is no report is refused with a word on what is.
    fs::write(moved.join("report.html"), "<html></html>").unwrap();
    let a = palpate(&["pictures", arg(&moved)]);
    assert!(a.code == 2 && a.err.contains("is no report with data inside"), "{} {}", a.code, a.err);
}

#[test]
fn simulated_cells_have_strain_and_stress() {
    let folder = observed(BALL);
    let out = folder.path().join("frames");
    succeed(&["simulate", arg(&folder.path().join("fit.toml")), "--out", arg(&out), "--format", "vtu", "--every", "1000"]);
    let mut frames: Vec<_> = fs::read_dir(&out)
        .unwrap()
        .filter_map(|e| Some(e.ok()?.path()))
        .filter(|p| p.extension().is_some_and(|e| e == "vtu"))
        .collect();
    frames.sort();
    let of = |k: usize| palpate_io::vtk::read_vtu_array(&frames[k], Some("von_mises"), true).unwrap();
    // At rest there is none; on the ground there is, and it is a pressure of the order of E times a strain.
    assert!(of(0).iter().all(|s| s.abs() < 1e-6));
    assert!(of(frames.len() - 1).iter().any(|s| *s > 1.0));
    let text = fs::read_to_string(&frames[0]).unwrap();
    assert!(["\"strain\"", "\"stress\""].iter().all(|name| text.contains(name)));
}

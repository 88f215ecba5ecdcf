//! Tables of motion capture: four markers on a ball that is let go.

use super::truth::*;
use glam::DVec3;
use palpate_import::{Options, Unit};
use palpate_io::recording::Recording;
use std::fmt::Write;

const HERTZ: f64 = 100.0;
const SAMPLES: usize = 40;

/// The ball's markers with y up, as OptiTrack has it [m].
fn y_up(t: f64, k: usize) -> DVec3 {
    let p = center(t) + marks()[k];
    DVec3::new(p.x, -p.y, -p.z)
}

/// The same with z up.
fn z_up(t: f64, k: usize) -> DVec3 {
    let p = center(t) + marks()[k];
    DVec3::new(p.x, p.z, -p.y)
}

fn at(i: usize) -> f64 {
    i as f64 / HERTZ
}

/// A marker that was hidden for a while.
fn hidden(i: usize, k: usize) -> bool {
    k == 2 && (20..25).contains(&i)
}

fn check(r: &Recording, scene: &str, truth: impl Fn(f64, usize) -> DVec3, digits: f64, gravity: &str) {
    let m = r.markers.as_ref().unwrap();
    assert_eq!(m.names, ["a", "b", "c", "d"]);
    assert_eq!(m.samples.len(), 4 * SAMPLES - 5);
    for s in &m.samples {
        assert!(s.position.distance(truth(s.time, s.marker)) < digits, "{s:?} {}", truth(s.time, s.marker));
    }
    for (k, rest) in m.rest.iter().enumerate() {
        // Up to the release the ball hangs; the time found may be a sample late, in which it falls by 0.5 mm.
        assert!(rest.position.distance(truth(0.0, k)) < 2e-4, "{rest:?}");
    }
    let release: f64 = scene.lines().find_map(|l| l.strip_prefix("start = ")).unwrap().parse().unwrap();
    assert!((release - RELEASE).abs() < 1.5 / HERTZ, "{release}");
    assert!(scene.contains(gravity), "{scene}");
}

fn motive(unit: &str, scale: f64) -> String {
    let mut t = format!(
        "Format Version,1.23,Take Name,Ball,Capture Frame Rate,100.000000,Export Frame Rate,100.000000,Capture Start Time,x,Total Frames in Take,40,\
         Total Exported Frames,{SAMPLES},Rotation Type,Quaternion,Length Units,{unit},Coordinate Space,Global\n\n"
    );
    let rigid = ["Rigid Body"; 8].join(",");
    let kinds = [["Marker"; 15].join(","), ["Rigid Body Marker"; 3].join(",")].join(",");
    writeln!(t, ",Type,{rigid},{kinds}").unwrap();
    let names = ["a", "b", "c", "d"].map(|n| vec![format!("Ball:{n}"); 3].join(",")).join(",");
    writeln!(t, ",Name,{},{names},{},{}", ["Ball"; 8].join(","), ["Unlabeled 1001"; 3].join(","), ["Ball:a"; 3].join(","))
        .unwrap();
    writeln!(t, ",ID,{}", ["1"; 26].join(",")).unwrap();
    writeln!(
        t,
        ",,Rotation,Rotation,Rotation,Rotation,Position,Position,Position,Mean Marker Error,{}",
        ["Position"; 18].join(",")
    )
    .unwrap();
    writeln!(t, "Frame,Time (Seconds),X,Y,Z,W,X,Y,Z,,{}", ["X,Y,Z"; 6].join(",")).unwrap();
    for i in 0..SAMPLES {
        write!(t, "{i},{:.6},0,0,0,1,9,9,9,0.1", at(i)).unwrap();
        for k in 0..4 {
            let p = y_up(at(i), k) * scale;
            if hidden(i, k) { t += ",,," } else { write!(t, ",{:.6},{:.6},{:.6}", p.x, p.y, p.z).unwrap() }
        }
        t += ",7,7,7,5,5,5\n";
    }
    t
}

#[test]
fn motive_with_y_up() {
    for (unit, scale, digits) in [("Meters", 1.0, 1e-6), ("Millimeters", 1000.0, 1e-8), ("Centimeters", 100.0, 1e-8)] {
        let bench = Bench::new();
        bench.write("ball.csv", motive(unit, scale));
        let (imported, r, scene) = bench.good("ball.csv", &Options::default());
        assert_eq!(imported.format, "optitrack");
        // Six digits behind the point, in the unit of the file.
        check(&r, &scene, y_up, digits, "gravity = [0.0, -9.81, 0.0]");
        assert!(imported.losses.iter().any(|l| l.contains("1 trajectories without a label")), "{:?}", imported.losses);
        assert!(imported.losses.iter().any(|l| l.contains("1 bodies and 1 places")), "{:?}", imported.losses);
    }
}

fn nexus() -> String {
    let mut t = String::from(
        "Devices\n1000\n,,Force\nFrame,Sub Frame,Fx\n,,N\n1,0,3.5\n\nTrajectories\n100\n,,Ball:a,,,Ball:b,,,Ball:c,,,Ball:d,,\n",
    );
    t += "Frame,Sub Frame,X,Y,Z,X,Y,Z,X,Y,Z,X,Y,Z\n,,mm,mm,mm,mm,mm,mm,mm,mm,mm,mm,mm,mm\n";
    for i in 0..SAMPLES {
        write!(t, "{},0", i + 51).unwrap();
        for k in 0..4 {
            let p = z_up(at(i), k) * 1000.0;
            if hidden(i, k) { t += ",,," } else { write!(t, ",{:.3},{:.3},{:.3}", p.x, p.y, p.z).unwrap() }
        }
        t += "\n";
    }
    t
}

fn qtm(separator: &str) -> String {
    let mut t = format!(
        "NO_OF_FRAMES\t{SAMPLES}\nNO_OF_CAMERAS\t8\nNO_OF_MARKERS\t4\nFREQUENCY\t100\nNO_OF_ANALOG\t0\nANALOG_FREQUENCY\t0\nDESCRIPTION\t--\n\
         TIME_STAMP\t2020-01-01, 10:00:00.000\t12345.6\nDATA_INCLUDED\t3D\nMARKER_NAMES\ta\tb\tc\td\n"
    )
    .replace('\t', separator);
    for i in 0..SAMPLES {
        let row: Vec<String> = (0..4)
            .map(|k| {
                let p = if hidden(i, k) { DVec3::ZERO } else { z_up(at(i), k) * 1000.0 };
                format!("{:.3}{separator}{:.3}{separator}{:.3}", p.x, p.y, p.z)
            })
            .collect();
        t += &(row.join(separator) + "\n");
    }
    t
}

#[test]
fn nexus_and_qtm_with_z_up_in_millimetres() {
    for (file, text, format) in
        [("ball.csv", nexus(), "vicon"), ("ball.tsv", qtm("\t"), "qualisys"), ("ball.csv", qtm(","), "qualisys")]
    {
        let bench = Bench::new();
        bench.write(file, text);
        let (imported, r, scene) = bench.good(file, &Options::default());
        assert_eq!(imported.format, format);
        // Three digits of a millimetre.
        check(&r, &scene, z_up, 1e-6, "gravity = [0.0, 0.0, -9.81]");
    }
}

/// A C3D file with floats in millimetres: header, one block of parameters, data.
fn c3d() -> Vec<u8> {
    let mut header = vec![0u8; 512];
    (header[0], header[1]) = (2, 0x50);
    let mut word = |k: usize, v: u16| header[2 * (k - 1)..2 * k].copy_from_slice(&v.to_le_bytes());
    [(2, 4), (4, 1), (5, SAMPLES as u16), (9, 3)].iter().for_each(|(k, v)| word(*k, *v));
    header[12..16].copy_from_slice(&(-1f32).to_le_bytes());
    header[20..24].copy_from_slice(&(HERTZ as f32).to_le_bytes());
    let mut p: Vec<u8> = vec![1, 80, 1, 84];
    p.extend([5, 0xFF]);
    p.extend(b"POINT");
    p.extend([3, 0, 0]);
    let mut texts = |name: &str, rows: &[&str], length: usize| {
        p.extend([name.len() as u8, 1]);
        p.extend(name.as_bytes());
        p.extend(((2 + 2 + 2 + rows.len() * length + 1) as u16).to_le_bytes());
        p.extend([0xFF, 2, length as u8, rows.len() as u8]);
        rows.iter().for_each(|r| p.extend(format!("{r:length$}").as_bytes()));
        p.push(0);
    };
    texts("UNITS", &["mm"], 2);
    texts("LABELS", &["a", "b", "c", "d"], 4);
    p.resize(512, 0);
    let mut all = header;
    all.extend(p);
    for i in 0..SAMPLES {
        for k in 0..4 {
            let x = z_up(at(i), k) * 1000.0;
            let residual = if hidden(i, k) { -1.0 } else { 0.0 };
            [x.x, x.y, x.z, residual].iter().for_each(|v| all.extend((*v as f32).to_le_bytes()));
        }
    }
    all
}

#[test]
fn c3d_of_floats() {
    let bench = Bench::new();
    bench.write("ball.c3d", c3d());
    let (imported, r, scene) = bench.good("ball.c3d", &Options::default());
    assert_eq!(imported.format, "c3d");
    // Single precision at half a metre.
    check(&r, &scene, z_up, 1e-6, "gravity = [0.0, 0.0, -9.81]");
}

#[test]
fn markers_that_never_move_are_held() {
    let bench = Bench::new();
    let mut t = String::from("Trajectories\n100\n,,a,,,b,,\nFrame,Sub Frame,X,Y,Z,X,Y,Z\n,,mm,mm,mm,mm,mm,mm\n");
    for i in 0..SAMPLES {
        writeln!(t, "{i},0,0.0,0.0,100.0,100.0,0.0,{:.3}", 100.0 + 10.0 * (at(i) - 0.1).clamp(0.0, 0.2) / 0.2).unwrap();
    }
    bench.write("t.csv", t);
    let (imported, _, scene) = bench.good("t.csv", &Options::default());
    assert!(scene.contains("[[clamp]]") && !scene.contains("[[plane]]"), "{scene}");
    assert!(imported.guesses.iter().any(|g| g.what == "clamp" && g.text.contains("never move")));
}

#[test]
fn what_contradicts_itself_is_refused() {
    let nexus = nexus();
    let line = |t: &str, word: &str| t.lines().position(|l| l.starts_with(word)).unwrap() + 1;
    let (units, frame) = (line(&nexus, ",,mm"), line(&nexus, "60,0"));
    let last = qtm("\t").trim_end().rsplit_once('\n').unwrap().0.to_string() + "\n";
    let cases: Vec<(&str, &str, String, Vec<String>)> = vec![
        (
            "mixed units",
            "t.csv",
            nexus.replacen(",,mm,mm", ",,mm,m", 1),
            vec![format!("t.csv:{units}"), "\"mm\" and in \"m\"".into()],
        ),
        (
            "a frame twice",
            "t.csv",
            nexus.replacen("\n60,0", "\n59,0", 1),
            vec![format!("t.csv:{frame}"), "does not come after".into()],
        ),
        ("a marker twice", "t.csv", nexus.replace("Ball:b", "Ball:a"), vec!["\"Ball:a\" occurs twice".into()]),
        (
            "no number",
            "t.csv",
            nexus.replacen("\n60,0,", "\n60,0,oops", 1),
            vec![format!("t.csv:{frame}"), "not a finite number".into()],
        ),
        ("truncated", "t.tsv", last, vec!["NO_OF_FRAMES".into(), "40".into(), "39".into()]),
        ("names", "t.tsv", qtm("\t").replace("NO_OF_MARKERS\t4", "NO_OF_MARKERS\t5"), vec!["NO_OF_MARKERS".into()]),
        ("6DOF", "t.tsv", qtm("\t").replace("\t3D", "\t6D"), vec!["DATA_INCLUDED".into()]),
        ("a wrong unit", "t.csv", motive("Meters", 1000.0), vec!["--unit mm would make it".into()]),
        ("local", "t.csv", motive("Meters", 1.0).replace("Global", "Local"), vec!["Coordinate Space".into()]),
        ("a unit nobody knows", "t.csv", motive("Furlongs", 1.0), vec!["Length Units".into(), "allowed: m, cm, mm".into()]),
        (
            "a head with nothing above",
            "t.csv",
            "Frame,Time (Seconds),Format Version,Take,X,Y,Z\n,Name,a,a,a,a,a\n".into(),
            vec!["lacks the rows \"Name\" and".into()],
        ),
        ("bodies alone", "t.csv", motive("Meters", 1.0).replace("Marker,", "Bone,"), vec!["no labelled marker".into()]),
    ];
    for (name, file, text, words) in cases {
        let bench = Bench::new();
        bench.write(file, text);
        let e = bench.bad(file, &Options::default());
        assert!(words.iter().all(|w| e.contains(w.as_str())), "{name}: {e}");
    }
    let bench = Bench::new();
    bench.write("t.csv", motive("Meters", 1.0));
    let e = bench.bad("t.csv", &Options { unit: Some(Unit::Millimetre), ..Options::default() });
    assert!(e.contains("--unit mm") && e.contains("contradicts"), "{e}");
    let e = bench.bad("t.csv", &Options { format: Some("vicon".into()), ..Options::default() });
    assert!(e.contains("Trajectories"), "{e}");
    let e = bench.bad("t.csv", &Options { format: Some("mocap".into()), ..Options::default() });
    assert!(e.contains("--format mocap") && e.contains("optitrack"), "{e}");
}

#[test]
fn damaged_tables_never_panic() {
    for (file, bytes) in [
        ("t.csv", motive("Meters", 1.0).into_bytes()),
        ("t.csv", nexus().into_bytes()),
        ("t.tsv", qtm("\t").into_bytes()),
        ("t.c3d", c3d()),
    ] {
        for k in 0..60 {
            let bench = Bench::new();
            bench.write(file, damaged(&bytes, k));
            // Good or bad, it ends.
            let _ = bench.import(file, &Options::default());
        }
    }
}

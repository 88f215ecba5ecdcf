//! Folders of depth images with intrinsics in JSON.

use super::truth::*;
use palpate_import::{Background, Options};
use palpate_io::recording::RawDepth;
use std::fs;

fn intrinsics() -> String {
    format!(
        r#"{{"width": {}, "height": {}, "fx": {FOCAL}, "fy": {FOCAL}, "ppx": {}, "ppy": {}, "model": "distortion.brown_conrady",
        "coeffs": [0, 0, 0, 0, 0], "depth_scale": 0.001, "fps": 30}}"#,
        SIZE[0], SIZE[1], CENTER[0], CENTER[1]
    )
}

fn folder(bench: &Bench) {
    bench.write("rs/intrinsics.json", intrinsics());
    for k in 0..FRAMES {
        png(&bench.path(&format!("rs/depth/{k:06}.png")), &counts(time(k), 0.001), SIZE);
    }
}

fn far() -> Options {
    Options { far: Some(0.9), ..Options::default() }
}

#[test]
fn a_folder_becomes_the_recording_that_was_seen() {
    let bench = Bench::new();
    folder(&bench);
    let (imported, r, scene) = bench.good("rs", &far());
    assert_eq!((imported.format, imported.images), ("realsense", FRAMES));
    for (k, f) in r.frames.iter().enumerate() {
        assert!((f.time - time(k)).abs() < 1e-12);
        let camera = &r.cameras[f.camera];
        let all = counts(f.time, 0.001);
        let (u0, v0) = (CENTER[0] - camera.center[0], CENTER[1] - camera.center[1]);
        let recorded: Vec<(usize, RawDepth)> =
            f.readings().map(|(u, v, c)| (u + u0 as usize + (v + v0 as usize) * SIZE[0], c)).collect();
        let seen = all.iter().copied().enumerate().filter(|(_, c)| *c < 900);
        let seen: Vec<(usize, RawDepth)> = seen.map(|(i, c)| (i, c.into())).collect();
        // Counts go through untouched, wherever the images are cut.
        assert_eq!(recorded, seen, "frame {k}");
    }
    let (off, n) = off_ball(&r);
    // Half a count along the ray; rays slant by less than a third.
    assert!(off < 0.0006 && n == imported.depth_readings, "{off}");
    let release: f64 = scene.lines().find_map(|l| l.strip_prefix("start = ")).unwrap().parse().unwrap();
    assert!((release - RELEASE).abs() < 0.02, "{release}");
    assert!(scene.contains("gravity = [0.0, 9.81, 0.0]"), "{scene}");
}

#[test]
fn a_mesh_in_millimetres_is_put_where_the_ball_is() {
    let bench = Bench::new();
    folder(&bench);
    let mesh = bench.write("ball.obj", ball_obj(1000.0));
    let (imported, ..) = bench.good("rs", &Options { mesh: Some(mesh), ..far() });
    let scene = palpate_io::read_scene(bench.path("out/scene.toml")).unwrap().value;
    let off = scene.object.pose.translation - center(0.0);
    // The mesh's chords lie up to 0.3 mm inside the ball, counts are of 1 mm; both even out over hundreds of points, and a cap of the ball is
    // all that is seen.
    assert!(off.length() < 0.002, "{off}");
    assert!(imported.guesses.iter().any(|g| g.what == "unit" && g.text.contains("mesh is in mm")));
}

#[test]
fn intrinsics_may_lie_elsewhere() {
    let bench = Bench::new();
    folder(&bench);
    fs::rename(bench.path("rs/intrinsics.json"), bench.path("elsewhere.json")).unwrap();
    let (imported, ..) = bench.good("rs", &Options { intrinsics: Some(bench.path("elsewhere.json")), ..far() });
    assert_eq!(imported.images, FRAMES);
}

#[test]
fn a_background_a_box_and_a_plane_leave_the_ball() {
    let bench = Bench::new();
    folder(&bench);
    // Two frames without the ball go before.
    let empty = vec![(WALL / 0.001) as u16; SIZE[0] * SIZE[1]];
    png(&bench.path("empty.png"), &empty, SIZE);
    for k in 0..FRAMES {
        fs::rename(bench.path(&format!("rs/depth/{k:06}.png")), bench.path(&format!("rs/depth/{:06}.png", k + 100))).unwrap();
    }
    for k in [98, 99] {
        png(&bench.path(&format!("rs/depth/{k:06}.png")), &empty, SIZE);
    }
    let all = [
        Options { background: Some(Background::Frames(0, 1)), ..Options::default() },
        Options { background: Some(Background::File(bench.path("empty.png"))), ..Options::default() },
        Options { within: Some([glam::DVec3::new(-0.2, -0.3, 0.3), glam::DVec3::new(0.2, 1.0, 0.9)]), ..Options::default() },
        Options { remove_plane: true, ..Options::default() },
    ];
    let full = (0..FRAMES).map(|k| counts(time(k), 0.001).iter().filter(|c| **c < 900).count()).sum::<usize>();
    for o in all {
        let (imported, r, _) = bench.good("rs", &Options { force: true, ..o.clone() });
        assert_eq!(imported.images, FRAMES, "{o:?}");
        assert_eq!(r.frames[0].readings().count(), counts(0.0, 0.001).iter().filter(|c| **c < 900).count(), "{o:?}");
        // Specks alone are lost: pixels at the ball's rim without two neighbours.
        assert!(
            imported.depth_readings <= full && imported.depth_readings + 4 * FRAMES > full,
            "{o:?} {}",
            imported.depth_readings
        );
    }
}

#[test]
fn what_contradicts_itself_is_refused() {
    /// A name, what is done to a good folder, and words of the answer.
    type Case<'a> = (&'a str, &'a dyn Fn(&Bench), &'a [&'a str]);
    let cases: [Case; 11] = [
        (
            "no intrinsics",
            &|b| fs::remove_file(b.path("rs/intrinsics.json")).unwrap(),
            &["no JSON file with intrinsics", "--intrinsics FILE"],
        ),
        (
            "a telescope",
            &|b| drop(b.write("rs/intrinsics.json", intrinsics().replace("150", "1e300"))),
            &["focal length", "0.04 to 60"],
        ),
        (
            "another size",
            &|b| drop(b.write("rs/intrinsics.json", intrinsics().replace("120", "640").replace("160", "480"))),
            &["000000.png", "120 × 160", "640 × 480"],
        ),
        ("NaN", &|b| drop(b.write("rs/intrinsics.json", intrinsics().replace("150", "NaN"))), &["intrinsics.json:1", "NaN"]),
        ("null", &|b| drop(b.write("rs/intrinsics.json", intrinsics().replace("60.5", "null"))), &["ppx", "not a finite number"]),
        ("focal length", &|b| drop(b.write("rs/intrinsics.json", intrinsics().replace("150", "-150"))), &["fx", "> 0"]),
        ("too many times", &|b| drop(b.write("rs/timestamps.txt", "0\n0.1\n")), &["timestamps.txt", "2 times for 12"]),
        (
            "a time twice",
            &|b| drop(b.write("rs/timestamps.txt", "0\n0.1\n0.1\n0.2\n0.3\n0.4\n0.5\n0.6\n0.7\n0.8\n0.9\n1.0\n")),
            &["timestamps.txt:3", "not after"],
        ),
        (
            "a picture",
            &|b| image::RgbImage::new(120, 160).save(b.path("rs/depth/000003.png")).unwrap(),
            &["000003.png", "picture of depth"],
        ),
        ("a truncated image", &|b| drop(b.write("rs/depth/000003.png", b"\x89PNG\r\n\x1a\n")), &["000003.png", "PNG"]),
        (
            "a unit that cannot be",
            &|b| drop(b.write("rs/intrinsics.json", intrinsics().replace("0.001", "0.5"))),
            &["median depth", "--depth-scale 0.001"],
        ),
    ];
    for (name, spoil, words) in cases {
        let bench = Bench::new();
        folder(&bench);
        spoil(&bench);
        let e = bench.bad("rs", &far());
        assert!(words.iter().all(|w| e.contains(w)), "{name}: {e}");
    }
    let bench = Bench::new();
    folder(&bench);
    let e = bench.bad("rs", &Options { far: Some(0.1), ..Options::default() });
    assert!(e.contains("--far") && e.contains("no reading"), "{e}");
    let e = bench.bad("rs", &Options { background: Some(Background::Frames(0, 99)), ..Options::default() });
    assert!(e.contains("--background 0..99") && e.contains("0 to 11"), "{e}");
    png(&bench.path("rs/depth/second/000000.png"), &counts(0.0, 0.001), SIZE);
    let e = bench.bad("rs", &far());
    assert!(e.contains("several folders (depth, depth/second)"), "{e}");
    let e = bench.bad("nothing", &far());
    assert!(e.contains("no such file or folder"), "{e}");
}

#[test]
fn nothing_is_written_among_the_source_or_after_an_interruption() {
    use palpate_import::{ImportError, Watch, import};
    use std::ops::ControlFlow;
    let bench = Bench::new();
    folder(&bench);
    for out in ["rs", "rs/depth", "rs/new/folder"] {
        let e = import(&bench.path("rs"), &bench.path(out), &far(), &mut Watch::new(&mut |_, _| ControlFlow::Continue(())));
        let e = e.unwrap_err().to_string();
        assert!(e.contains("--out") && e.contains("lies in the source"), "{e}");
    }
    let mut looks = 0;
    let _ = import(
        &bench.path("rs"),
        &bench.path("out"),
        &far(),
        &mut Watch::new(&mut |_, _| {
            looks += 1;
            ControlFlow::Continue(())
        }),
    );
    assert!(bench.path("out/scene.toml").exists() && looks > 3);
    let e = bench.import("rs", &far()).unwrap_err().to_string();
    assert!(e.contains("already there") && e.contains("--force"), "{e}");
    for stop in 0..looks {
        let mut k = 0;
        let mut watch = |_: f64, _: &str| {
            k += 1;
            if k > stop { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        };
        let e = import(&bench.path("rs"), &bench.path("other"), &far(), &mut Watch::new(&mut watch));
        assert!(matches!(e, Err(ImportError::Interrupted)) && !bench.path("other").exists(), "{stop}");
    }
}

#[test]
fn empty_frames_are_left_out_with_a_word() {
    let bench = Bench::new();
    folder(&bench);
    png(&bench.path("rs/depth/000004.png"), &vec![0; SIZE[0] * SIZE[1]], SIZE);
    let (imported, ..) = bench.good("rs", &far());
    assert_eq!(imported.images, FRAMES - 1);
    assert!(imported.losses.iter().any(|l| l.contains("1 of 12 depth images")), "{:?}", imported.losses);
}

#[test]
fn open3d_s_matrix_goes_column_by_column() {
    let bench = Bench::new();
    folder(&bench);
    let (w, h) = (SIZE[0], SIZE[1]);
    let m = format!("[{FOCAL}, 0, 0, 0, {FOCAL}, 0, {}, {}, 1]", CENTER[0], CENTER[1]);
    let json = format!(r#"{{"width": {w}, "height": {h}, "intrinsic_matrix": {m}, "depth_scale": 1000.0}}"#);
    bench.write("rs/intrinsics.json", json);
    let (_, r, _) = bench.good("rs", &far());
    assert!(off_ball(&r).0 < 0.0006);
    assert!((r.cameras[0].depth_scale.unwrap() - 0.001).abs() < 1e-15);
}

#[test]
fn floats_in_tiff_with_times_in_milliseconds() {
    let bench = Bench::new();
    bench.write("rs/intrinsics.json", intrinsics());
    let mut times = String::from("frame,timestamp\n");
    for k in 0..FRAMES {
        let path = bench.write(&format!("rs/depth/{k:06}.tiff"), "");
        let pixels: Vec<f32> = image(time(k)).into_iter().map(|z| z as f32).collect();
        let mut tiff = tiff::encoder::TiffEncoder::new(fs::File::create(path).unwrap()).unwrap();
        tiff.write_image::<tiff::encoder::colortype::Gray32Float>(SIZE[0] as u32, SIZE[1] as u32, &pixels).unwrap();
        times += &format!("{k},{:.4}\n", 1.7e12 + 1000.0 * time(k));
    }
    bench.write("rs/timestamps.csv", times);
    let (imported, r, _) = bench.good("rs", &far());
    // Depth in tenths of a millimetre; times of a clock that has four digits of a millisecond, in doubles of 1.7e12: 2e-7 s.
    assert!(off_ball(&r).0 < 1e-4, "{}", off_ball(&r).0);
    assert!(r.frames.iter().enumerate().all(|(k, f)| (f.time - time(k)).abs() < 1e-6));
    assert!(imported.guesses.iter().any(|g| g.what == "clock" && g.text.contains("milliseconds")), "{:?}", imported.guesses);
}

#[test]
fn damaged_folders_never_panic() {
    let json = intrinsics().into_bytes();
    for k in 0..80 {
        let bench = Bench::new();
        png(&bench.path("rs/depth/0.png"), &counts(0.0, 0.001), SIZE);
        if k % 4 == 0 {
            let image = fs::read(bench.path("rs/depth/0.png")).unwrap();
            bench.write("rs/depth/0.png", damaged(&image, k));
        }
        bench.write("rs/intrinsics.json", if k % 4 == 0 { json.clone() } else { damaged(&json, k) });
        let _ = bench.import("rs", &far());
    }
}

#[test]
fn raw_files_of_the_viewer_with_their_metadata() {
    let bench = Bench::new();
    for k in 0..FRAMES {
        let stamp = format!("{:.6}", 1.6e12 + 1000.0 * time(k));
        let bytes: Vec<u8> = counts(time(k), 0.001).iter().flat_map(|c| c.to_le_bytes()).collect();
        bench.write(&format!("v/take_Depth_{stamp}.raw"), bytes);
        let meta = format!(
            "Frame Info: \nType,Depth\nFormat,Z16\nFrame Number,{k}\nTimestamp (ms),{stamp}\nResolution x,{}\nResolution y,{}\nBytes per pixel,2\n\n\
             Intrinsic:,\nFx,{FOCAL:.6}\nFy,{FOCAL:.6}\nPPx,{:.6}\nPPy,{:.6}\nDistorsion,Brown Conrady\n",
            SIZE[0], SIZE[1], CENTER[0], CENTER[1]
        );
        bench.write(&format!("v/take_Depth_metadata_{stamp}.csv"), meta);
    }
    let (imported, r, _) = bench.good("v", &far());
    assert_eq!((imported.format, imported.images), ("realsense", FRAMES));
    // Half a count; times of six digits of a millisecond, as doubles of 1.6e12.
    assert!(off_ball(&r).0 < 0.0006 && r.frames.iter().enumerate().all(|(k, f)| (f.time - time(k)).abs() < 1e-6));
    for about in ["clock", "intrinsics", "unit"] {
        assert!(imported.guesses.iter().any(|g| g.what == about), "{about}: {:?}", imported.guesses);
    }
}

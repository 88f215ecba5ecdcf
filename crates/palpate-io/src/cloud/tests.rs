//! Clouds written and read again, and refused with what is wrong.

use super::*;

fn points() -> Vec<DVec3> {
    (0..7).map(|i| DVec3::new(0.1 * f64::from(i), 1.0 / 3.0, -2e-7)).collect()
}

#[test]
fn what_is_written_is_read_again_to_the_last_digit() {
    let folder = tempfile::tempdir().unwrap();
    for name in ["a.ply", "b.PCD"] {
        let path = folder.path().join(name);
        write_cloud(&path, &points()).unwrap();
        assert_eq!(read_cloud(&path).unwrap(), CloudFile { points: points(), ..CloudFile::default() }, "{name}");
    }
}

#[test]
fn text_files_say_their_time_and_viewpoint() {
    let head = "ply\nformat ascii 1.0\ncomment made by hand\ncomment time 0.25\nelement vertex 2\nproperty uchar red\nproperty float x\n\
                property int y\nproperty double z\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n";
    let c = decode_cloud(Path::new("c.ply"), format!("{head}9 0.5 1 2\n9 -nan(ind) 1 2\n3 0 1 0\n").as_bytes()).unwrap();
    assert_eq!((c.time, c.points[0], c.points.len()), (Some(0.25), DVec3::new(0.5, 1.0, 2.0), 2));
    assert!(!c.points[1].x.is_finite() && c.points[1].y == 1.0);
    let head =
        "VERSION 0.7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\nWIDTH 1\nHEIGHT 1\nVIEWPOINT 1 2 3 1 0 0 0\nPOINTS 1\n";
    let c = decode_cloud(Path::new("c.pcd"), format!("{head}DATA ascii\n0.5 1 2\n").as_bytes()).unwrap();
    assert_eq!((c.viewpoint, c.points), (Some(DVec3::new(1.0, 2.0, 3.0)), vec![DVec3::new(0.5, 1.0, 2.0)]));
}

#[test]
fn faults_are_named() {
    let folder = tempfile::tempdir().unwrap();
    let error = |name: &str, bytes: &[u8]| decode_cloud(&folder.path().join(name), bytes).unwrap_err().to_string();
    for (name, wanted) in [("a.ply", "not a readable PLY file"), ("a.pcd", "ends before its 7 points of 24 bytes")] {
        let path = folder.path().join(name);
        write_cloud(&path, &points()).unwrap();
        let bytes = std::fs::read(&path).unwrap();
        assert!(error(name, &bytes[..bytes.len() - 1]).contains(wanted), "{name}");
        // Whatever is cut off, nothing panics.
        (0..bytes.len()).for_each(|n| assert!(decode_cloud(&path, &bytes[..n]).is_err(), "{name} {n}"));
    }
    let bare = b"ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\nend_header\n1 2\n";
    assert!(error("a.ply", bare).contains("vertex 1 lacks x, y or z"));
    assert!(error("a.ply", &bare[..bare.len() - 4]).contains("not a readable PLY file"));
    let many = b"ply\nformat ascii 1.0\nelement vertex 99999999999999\nproperty float x\nend_header\n1\n";
    assert!(error("a.ply", many).contains("not a readable PLY file"));
    assert!(error("a.xyz", b"0 0 0").contains("allowed: .ply, .pcd"));
    assert!(read_cloud(&folder.path().join("no.ply")).unwrap_err().to_string().contains("no such file"));
}

//! What every reader is fuzzed with: plain functions of bytes and a folder to write them into. A reader may refuse anything; it must not
//! panic, hang, or take memory that a file merely announces.

use palpate_import::{Options, Watch};
use std::fs;
use std::ops::ControlFlow;
use std::path::Path;

/// Reads bytes as one kind of file, and tells whether it did or refused them; the folder is the target's own.
pub type Target = fn(&Path, &[u8]) -> bool;

/// A depth image of 4 × 3 pixels.
const DEPTH: &[u8] = include_bytes!("depth.png");

/// Every target by name; `corpus/NAME` holds files that it begins with.
pub const TARGETS: [(&str, Target); 19] = [
    ("scene", scene),
    ("recording", recording),
    ("ply", |dir, data| mesh(dir, "mesh.ply", data)),
    ("obj", |dir, data| mesh(dir, "mesh.obj", data)),
    ("stl", |dir, data| mesh(dir, "mesh.stl", data)),
    ("msh", |dir, data| volume(dir, "mesh.msh", data)),
    ("vtu", |dir, data| volume(dir, "mesh.vtu", data)),
    ("vtk", |dir, data| volume(dir, "mesh.vtk", data)),
    ("png", png),
    ("npy", |dir, data| array(dir, "array.npy", data)),
    ("npz", |dir, data| array(dir, "array.npz", data)),
    ("markers", markers),
    ("c3d", c3d),
    ("import", import),
    ("torch", torch),
    ("mcap", |dir, data| imported(&put(dir, "source.mcap", data), dir)),
    ("camera", camera),
    ("shape", shape),
    ("carried", carried),
];

fn put(dir: &Path, name: &str, data: &[u8]) -> std::path::PathBuf {
    let path = dir.join(name);
    fs::write(&path, data).expect("the folder is writable");
    path
}

fn scene(dir: &Path, data: &[u8]) -> bool {
    palpate_io::parse_scene(&String::from_utf8_lossy(data), dir.join("scene.toml")).is_ok()
}

fn recording(dir: &Path, data: &[u8]) -> bool {
    let beside: [(&str, &[u8]); 4] = [
        ("markers.csv", b"time,name,x,y,z\n0,a,0,0,0\n"),
        ("image.png", DEPTH),
        ("tracks.npz", include_bytes!("tracks.npz")),
        ("cloud.ply", include_bytes!("cloud.ply")),
    ];
    beside.into_iter().for_each(|(name, bytes)| drop(put(dir, name, bytes)));
    put(dir, "recording.toml", data);
    palpate_io::read_recording(dir).is_ok()
}

fn mesh(dir: &Path, name: &str, data: &[u8]) -> bool {
    palpate_io::read_mesh(put(dir, name, data)).is_ok()
}

fn volume(dir: &Path, name: &str, data: &[u8]) -> bool {
    palpate_io::mesh::read_tets(put(dir, name, data)).is_ok()
}

fn array(dir: &Path, name: &str, data: &[u8]) -> bool {
    palpate_io::npy::read_array(&put(dir, name, data), None).is_ok()
}

fn c3d(dir: &Path, data: &[u8]) -> bool {
    palpate_io::recording::read_c3d(put(dir, "motion.c3d", data)).is_ok()
}

fn png(dir: &Path, data: &[u8]) -> bool {
    const OF_IMAGE: &str = "format = \"recording/1\"\n[[camera]]\nname = \"c\"\nwidth = 4\nheight = 3\nfx = 4.0\nfy = 4.0\ncx = 1.5\ncy = 1.0\n\
        depth_scale = 0.001\nworld_from_camera = [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]\n\
        [[frame]]\ncamera = \"c\"\ntime = 0.0\ndepth = \"image.png\"\n";
    put(dir, "image.png", data);
    put(dir, "recording.toml", OF_IMAGE.as_bytes());
    let as_depth = palpate_io::read_recording(dir).is_ok();
    put(dir, "recording.toml", OF_IMAGE.replace("depth = ", "mask = ").as_bytes());
    let as_mask = palpate_io::read_recording(dir).is_ok();
    as_depth || as_mask
}

fn markers(dir: &Path, data: &[u8]) -> bool {
    put(dir, "markers.csv", data);
    put(dir, "recording.toml", b"format = \"recording/1\"\n[markers]\nfile = \"markers.csv\"\n");
    palpate_io::read_recording(dir).is_ok()
}

/// Reads a source, whatever came of it before.
fn imported(source: &Path, dir: &Path) -> bool {
    let mut look = |_: f64, _: &str| ControlFlow::Continue(());
    let options = Options { force: true, ..Options::default() };
    palpate_import::import(source, &dir.join("out"), &options, &mut Watch::new(&mut look)).is_ok()
}

/// The first byte says what the file is called.
fn import(dir: &Path, data: &[u8]) -> bool {
    let Some((first, data)) = data.split_first() else { return false };
    let endings = ["csv", "npz", "ply", "pcd", "tsv", "mcap", "c3d", "npy"];
    let source = put(dir, &format!("source.{}", endings[usize::from(*first) % endings.len()]), data);
    let read = imported(&source, dir);
    fs::remove_file(source).expect("the folder is writable");
    read
}

/// A folder with tracks of three vertices, and these bytes for the file that says which of them are the object.
fn torch(dir: &Path, data: &[u8]) -> bool {
    let (source, frames) = (dir.join("toy"), dir.join("toy/reconstruction"));
    fs::create_dir_all(&frames).expect("the folder is writable");
    let values = vec![0.0, 0.0, 0.0, 0.1, 0.0, 0.0, 0.0, 0.1, 0.1];
    let vertices = palpate_io::npy::Array { shape: vec![3, 3], values };
    palpate_io::npy::write_npz(frames.join("0.npz"), &[("vertices", &vertices)]).expect("the folder is writable");
    put(&frames, "mask.pt", data);
    imported(&source, dir)
}

/// A camera's folder with one image. The first byte says which of its files has these bytes, and the others are whole.
fn camera(dir: &Path, data: &[u8]) -> bool {
    const CAMERA: &[u8] = b"{\"width\": 4, \"height\": 3, \"fx\": 4, \"fy\": 4, \"ppx\": 1.5, \"ppy\": 1}";
    let Some((first, data)) = data.split_first() else { return false };
    let whole: &[(&str, &[u8])] = match first % 8 {
        0 => &[("depth/0.png", DEPTH), ("intrinsics.json", data)],
        1 => &[("depth/0.png", DEPTH), ("depth_metadata.csv", data)],
        2 => &[("depth/0.tif", data), ("intrinsics.json", CAMERA)],
        3 => &[("depth/0.raw", data), ("intrinsics.json", CAMERA)],
        4 => &[("depth/0.png", DEPTH), ("intrinsics.json", CAMERA), ("mask/0.png", data)],
        5 => &[("depth/0.png", DEPTH), ("intrinsics.json", CAMERA), ("depth.txt", data)],
        6 => {
            &[("depth/0.png", DEPTH), ("intrinsics.json", CAMERA), ("depth.txt", b"0.0 depth/0.png\n"), ("groundtruth.txt", data)]
        }
        // 320 × 288 pixels, a mode of the Azure Kinect.
        _ => &[("depth/0.png", include_bytes!("azure.png")), ("calibration.json", data)],
    };
    let source = dir.join("camera");
    for (name, bytes) in whole {
        let path = source.join(name);
        fs::create_dir_all(path.parent().expect("it is in a folder")).expect("the folder is writable");
        fs::write(path, bytes).expect("the folder is writable");
    }
    let read = imported(&source, dir);
    fs::remove_dir_all(source).expect("the folder is writable");
    read
}

/// A grid of distances, or both files of TetGen with a `|` between them.
fn shape(dir: &Path, data: &[u8]) -> bool {
    let Some((first, data)) = data.split_first() else { return false };
    if first % 2 == 0 {
        return palpate_io::read_sdf(put(dir, "grid.sdf", data), 0.001).is_ok();
    }
    let Some(bar) = data.iter().position(|b| *b == b'|') else { return false };
    put(dir, "mesh.ele", &data[bar + 1..]);
    volume(dir, "mesh.node", &data[..bar])
}

/// What a motion carries, and carries a little.
fn carried(dir: &Path, data: &[u8]) -> bool {
    let Some((first, data)) = data.split_first() else { return false };
    let name = if first % 2 == 0 { "mesh.obj" } else { "splats.ply" };
    let Ok(all) = palpate_io::carried::Carried::read(&put(dir, name, data)) else { return false };
    let (places, turn) = (all.places(), glam::DMat3::from_rotation_z(0.1));
    all.write(&dir.join(format!("moved-{name}")), |i| (turn * places[i], 1.1 * turn)).is_ok()
}

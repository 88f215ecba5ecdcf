//! What every reader is fuzzed with: plain functions of bytes and a folder to write them into. A reader may refuse anything; it must not
//! panic, hang, or take memory that a file merely announces.

use palpate_import::{Options, Watch};
use std::fs;
use std::ops::ControlFlow;
use std::path::Path;

/// Reads bytes as one kind of file; the folder is the target's own.
pub type Target = fn(&Path, &[u8]);

/// Every target by name; `corpus/NAME` holds files that it begins with.
pub const TARGETS: [(&str, Target); 15] = [
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
];

fn put(dir: &Path, name: &str, data: &[u8]) -> std::path::PathBuf {
    let path = dir.join(name);
    fs::write(&path, data).expect("the folder is writable");
    path
}

/// What came of it does not matter.
fn any<T>(_: T) {}

fn scene(dir: &Path, data: &[u8]) {
    any(palpate_io::parse_scene(&String::from_utf8_lossy(data), dir.join("scene.toml")));
}

fn recording(dir: &Path, data: &[u8]) {
    put(dir, "markers.csv", b"time,name,x,y,z\n0,a,0,0,0\n");
    put(dir, "recording.toml", data);
    any(palpate_io::read_recording(dir));
}

fn mesh(dir: &Path, name: &str, data: &[u8]) {
    any(palpate_io::read_mesh(put(dir, name, data)));
}

fn volume(dir: &Path, name: &str, data: &[u8]) {
    any(palpate_io::mesh::read_tets(put(dir, name, data)));
}

fn array(dir: &Path, name: &str, data: &[u8]) {
    any(palpate_io::npy::read_array(&put(dir, name, data), None));
}

fn c3d(dir: &Path, data: &[u8]) {
    any(palpate_io::recording::read_c3d(put(dir, "motion.c3d", data)));
}

fn png(dir: &Path, data: &[u8]) {
    const OF_IMAGE: &str = "format = \"recording/1\"\n[[camera]]\nname = \"c\"\nwidth = 4\nheight = 3\nfx = 4.0\nfy = 4.0\ncx = 1.5\ncy = 1.0\n\
        depth_scale = 0.001\nworld_from_camera = [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]\n\
        [[frame]]\ncamera = \"c\"\ntime = 0.0\ndepth = \"image.png\"\n";
    put(dir, "image.png", data);
    put(dir, "recording.toml", OF_IMAGE.as_bytes());
    any(palpate_io::read_recording(dir));
    put(dir, "recording.toml", OF_IMAGE.replace("depth = ", "mask = ").as_bytes());
    any(palpate_io::read_recording(dir));
}

fn markers(dir: &Path, data: &[u8]) {
    put(dir, "markers.csv", data);
    put(dir, "recording.toml", b"format = \"recording/1\"\n[markers]\nfile = \"markers.csv\"\n");
    any(palpate_io::read_recording(dir));
}

/// The first byte says what the file is called.
fn import(dir: &Path, data: &[u8]) {
    let Some((first, data)) = data.split_first() else { return };
    let endings = ["csv", "npz", "ply", "pcd", "txt", "trc", "bag", "mcap", "c3d", "xyz", "npy", "json"];
    let source = put(dir, &format!("source.{}", endings[usize::from(*first) % endings.len()]), data);
    let mut look = |_: f64, _: &str| ControlFlow::Continue(());
    any(palpate_import::import(
        &source,
        &dir.join("out"),
        &Options { force: true, ..Options::default() },
        &mut Watch::new(&mut look),
    ));
    drop(fs::remove_file(source));
}

/// A folder with tracks of three vertices, and these bytes for the file that says which of them are the object.
fn torch(dir: &Path, data: &[u8]) {
    let (source, frames) = (dir.join("toy"), dir.join("toy/reconstruction"));
    fs::create_dir_all(&frames).expect("the folder is writable");
    let values = vec![0.0, 0.0, 0.0, 0.1, 0.0, 0.0, 0.0, 0.1, 0.1];
    let vertices = palpate_io::npy::Array { shape: vec![3, 3], values };
    palpate_io::npy::write_npz(frames.join("0.npz"), &[("vertices", &vertices)]).expect("the folder is writable");
    put(&frames, "mask.pt", data);
    let mut look = |_: f64, _: &str| ControlFlow::Continue(());
    let options = Options { force: true, ..Options::default() };
    any(palpate_import::import(&source, &dir.join("out"), &options, &mut Watch::new(&mut look)));
}

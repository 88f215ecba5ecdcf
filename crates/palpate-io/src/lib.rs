//! Scenes, recordings and meshes from files to checked model types, and back.
//!
//! Invariant: everything that leaves this room is in SI units, finite and within its documented range; everything
//! that is wrong with a file is said here, once, with file, line, key, what is wrong and what is allowed. This room does
//! not know grids, solvers or optimisers.

mod document;
mod error;
mod input;
mod keys;
mod rigid;
mod room;

pub mod carried;
pub mod cloud;
pub mod lens;
pub mod mesh;
pub mod npy;
pub mod output;
pub mod recording;
pub mod scene;
pub mod sdf;
pub mod surface;
pub mod vtk;

pub use document::read_text;
pub use error::{InputError, Loaded, OutputError, shown};
pub use input::{check_plain, read_bytes};
pub use mesh::read_mesh;
pub use recording::{Recording, check_overlap, read_recording, write_recording};
pub use room::{Room, available, gigabytes};
pub use scene::{
    append_effects, edit_scene, name_field_files, parse_scene, read_scene, recast_scene, scene_error, scene_in, scene_of_tracks,
    scene_with_regions, scene_with_values, without_wishes, write_scene,
};
pub use sdf::{SdfGrid, read_sdf};
pub use surface::{write_obj, write_ply};
pub use vtk::{write_pvd, write_vtu};

//! Folders of a RealSense camera, or of any other: depth images and intrinsics in JSON (librealsense's names, or Open3D's).

use super::{Format, folder};

/// See the file's head.
pub const FORMAT: Format = Format {
    name: "realsense",
    what: "folder of depth images with intrinsics in JSON",
    detect: |place| {
        let images = folder::depth_files(place).len();
        let cameras = folder::camera_files(place).len();
        // A broken or missing file of intrinsics is told while reading, where the rest looks like a camera's folder.
        let named = place.with_ending(&["json"]).any(|f| place.name(f).contains("intrinsic"));
        (images > 0 && (cameras > 0 || named)).then(|| format!("{images} depth images beside intrinsics in JSON"))
    },
    read: |place, o, watch| folder::read(place, o, (0.001, "what RealSense D400 cameras are set to"), watch),
};

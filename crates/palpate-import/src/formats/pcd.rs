//! Sequences of files with a point cloud each: PCD (Point Cloud Library).

use super::Format;
use super::ply::read_sequence;

/// See the file's head.
pub const FORMAT: Format = Format {
    name: "pcd",
    what: "sequence of PCD point clouds",
    detect: |place| {
        let n = place.with_ending(&["pcd"]).count();
        (n > 0).then(|| format!("{n} PCD files"))
    },
    read: |place, o, watch| read_sequence(place, "pcd", o, watch),
};

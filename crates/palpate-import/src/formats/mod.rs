//! Formats that are read: one file each, and one line in [`ALL`].

mod azure;
mod c3d;
mod cdr;
mod folder;
mod mcap;
mod nozzle;
mod npy;
mod optitrack;
mod pcd;
mod plush;
mod ply;
mod qualisys;
mod realsense;
mod table;
mod tum;
mod vicon;

use crate::Watch;
use crate::capture::Capture;
use crate::error::{ImportError, refuse, refuse_option};
use crate::options::Options;
use crate::place::Place;

/// A format of sources.
pub struct Format {
    /// As `--format` names it.
    pub name: &'static str,
    /// In words.
    pub what: &'static str,
    /// Why a source is of this format; `None` where it is not.
    pub detect: fn(&Place) -> Option<String>,
    /// Reads a source.
    pub read: fn(&Place, &Options, &mut Watch) -> Result<Capture, ImportError>,
}

/// Every format, the more particular before the more general: the first that knows a source reads it.
pub const ALL: [&Format; 12] = [
    &mcap::FORMAT,
    &plush::FORMAT,
    &tum::FORMAT,
    &azure::FORMAT,
    &npy::FORMAT,
    &realsense::FORMAT,
    &pcd::FORMAT,
    &ply::FORMAT,
    &c3d::FORMAT,
    &optitrack::FORMAT,
    &vicon::FORMAT,
    &qualisys::FORMAT,
];

/// The format of a source: the one that was asked for, or the first that knows it; and why.
pub fn choose(place: &Place, asked: Option<&str>) -> Result<(&'static Format, String), ImportError> {
    let names: Vec<&str> = ALL.iter().map(|f| f.name).collect();
    if let Some(asked) = asked {
        return match ALL.iter().find(|f| f.name == asked) {
            Some(f) => Ok((f, "as --format says".into())),
            None => refuse_option("format", asked, format!("is not known; allowed: {}", names.join(", "))),
        };
    }
    match ALL.iter().find_map(|f| (f.detect)(place).map(|why| (*f, why))) {
        Some(found) => Ok(found),
        // A camera's folder all the same: that intrinsics are missing is told while reading, unless an option names them.
        None if !folder::depth_files(place).is_empty() => {
            Ok((&realsense::FORMAT, "depth images, without intrinsics in JSON".into()))
        }
        None => {
            let known: Vec<String> = ALL.iter().map(|f| format!("{} ({})", f.name, f.what)).collect();
            refuse(&place.path, format!("is of no format that is read; --format names one of: {}", known.join(", ")))
        }
    }
}

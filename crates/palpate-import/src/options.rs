//! What a user may say about a source beyond what is in it.

use glam::{DAffine3, DVec3};
use std::fmt;
use std::path::PathBuf;
use std::str::FromStr;

/// A unit of length.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Unit {
    /// Metres.
    Metre,
    /// Centimetres.
    Centimetre,
    /// Millimetres.
    Millimetre,
    /// Inches.
    Inch,
    /// Feet.
    Foot,
}

impl Unit {
    /// Every unit.
    pub const ALL: [Unit; 5] = [Unit::Metre, Unit::Centimetre, Unit::Millimetre, Unit::Inch, Unit::Foot];

    /// Metres of one.
    pub fn metres(self) -> f64 {
        match self {
            Unit::Metre => 1.0,
            Unit::Centimetre => 0.01,
            Unit::Millimetre => 0.001,
            Unit::Inch => 0.0254,
            Unit::Foot => 0.3048,
        }
    }
}

impl fmt::Display for Unit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Unit::Metre => "m",
            Unit::Centimetre => "cm",
            Unit::Millimetre => "mm",
            Unit::Inch => "in",
            Unit::Foot => "ft",
        })
    }
}

impl FromStr for Unit {
    type Err = String;

    fn from_str(text: &str) -> Result<Unit, String> {
        match text.trim().to_ascii_lowercase().as_str() {
            "m" | "meter" | "meters" | "metre" | "metres" => Ok(Unit::Metre),
            "cm" | "centimeter" | "centimeters" | "centimetres" => Ok(Unit::Centimetre),
            "mm" | "millimeter" | "millimeters" | "millimetres" => Ok(Unit::Millimetre),
            "in" | "inch" | "inches" => Ok(Unit::Inch),
            "ft" | "foot" | "feet" => Ok(Unit::Foot),
            _ => Err(format!("\"{text}\" is not a unit of length; allowed: m, cm, mm, in, ft")),
        }
    }
}

/// What shows the scene without the object.
#[derive(Clone, Debug, PartialEq)]
pub enum Background {
    /// Frames of the source, first and last, counted from 0.
    Frames(usize, usize),
    /// A depth image of the same camera.
    File(PathBuf),
}

impl FromStr for Background {
    type Err = String;

    fn from_str(text: &str) -> Result<Background, String> {
        let range = text.split_once("..").unwrap_or((text, text));
        match (range.0.parse(), range.1.parse()) {
            (Ok(a), Ok(b)) if a <= b => Ok(Background::Frames(a, b)),
            (Ok(a), Ok(b)) => Err(format!("frames {a}..{b} end before they begin")),
            _ if text.is_empty() => Err("must be a frame (0), a range of frames (0..9) or a depth image".into()),
            _ => Ok(Background::File(PathBuf::from(text))),
        }
    }
}

/// A plane under the object.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Floor {
    /// There is none.
    None,
    /// At this height along the upward direction [m].
    At(f64),
}

impl FromStr for Floor {
    type Err = String;

    fn from_str(text: &str) -> Result<Floor, String> {
        match text.parse::<f64>() {
            _ if text == "none" => Ok(Floor::None),
            Ok(h) if h.is_finite() => Ok(Floor::At(h)),
            _ => Err(format!("\"{text}\" must be a height along the upward direction (m), or none")),
        }
    }
}

/// All that may be said; what is `None` is taken from the source or guessed, and a guess is marked.
#[derive(Clone, Debug, Default)]
pub struct Options {
    /// Name of the source's format.
    pub format: Option<String>,
    /// Surface of the object at rest.
    pub mesh: Option<PathBuf>,
    /// Unit of that surface.
    pub mesh_unit: Option<Unit>,
    /// From the mesh's axes to the world, at rest [m].
    pub pose: Option<DAffine3>,
    /// From the camera's axes to the world [m].
    pub camera_pose: Option<DAffine3>,
    /// Unit of lengths in the source.
    pub unit: Option<Unit>,
    /// Metres of one count of a depth image.
    pub depth_scale: Option<f64>,
    /// JSON file of the camera's intrinsics.
    pub intrinsics: Option<PathBuf>,
    /// Frames per second.
    pub fps: Option<f64>,
    /// Upward direction in the axes of the source.
    pub up: Option<DVec3>,
    /// Readings nearer than this are not the object [m].
    pub near: Option<f64>,
    /// Readings farther than this are not the object [m].
    pub far: Option<f64>,
    /// Only what lies in this box of the world is the object: lowest and highest corner [m].
    pub within: Option<[DVec3; 2]>,
    /// What was there without the object is not the object.
    pub background: Option<Background>,
    /// The largest plane is not the object.
    pub remove_plane: bool,
    /// The plane under the object.
    pub floor: Option<Floor>,
    /// Box that is held [m].
    pub clamp: Option<[DVec3; 2]>,
    /// Time at which the motion begins, on the source's clock [s].
    pub release: Option<f64>,
    /// Time that is fitted [s].
    pub duration: Option<f64>,
    /// Every n-th frame is kept.
    pub every: Option<usize>,
    /// Depth readings a frame that a fit uses.
    pub points: Option<usize>,
    /// Standard deviation of a reading [m].
    pub noise: Option<f64>,
    /// Density of the object [kg/m³].
    pub density: Option<f64>,
    /// Young's modulus that a fit begins with [Pa].
    pub youngs_modulus: Option<f64>,
    /// Poisson's ratio.
    pub poisson_ratio: Option<f64>,
    /// Name of an array or a topic where a source holds several.
    pub pick: Option<String>,
    /// A folder with a recording in it may be written over.
    pub force: bool,
}

/// Numbers separated by commas.
pub fn numbers(text: &str, allowed: &[usize], what: &str) -> Result<Vec<f64>, String> {
    let all: Option<Vec<f64>> = text.split(',').map(|t| t.trim().parse().ok().filter(|x: &f64| x.is_finite())).collect();
    all.filter(|n| allowed.contains(&n.len())).ok_or_else(|| format!("\"{text}\" must be {what}"))
}

/// Direction: `x`, `-y`, … or three numbers.
pub fn direction(text: &str) -> Result<DVec3, String> {
    let (sign, axis) = text.strip_prefix('-').map_or((1.0, text.strip_prefix('+').unwrap_or(text)), |a| (-1.0, a));
    let v = match axis {
        "x" => sign * DVec3::X,
        "y" => sign * DVec3::Y,
        "z" => sign * DVec3::Z,
        _ => DVec3::from_slice(&numbers(text, &[3], "x, y, z, -x, -y, -z or three numbers x,y,z")?),
    };
    v.try_normalize().ok_or_else(|| format!("\"{text}\" has no direction"))
}

/// A box: x0,y0,z0,x1,y1,z1 in any order of its corners.
pub fn corners(text: &str) -> Result<[DVec3; 2], String> {
    let n = numbers(text, &[6], "six numbers x0,y0,z0,x1,y1,z1 (m)")?;
    let (a, b) = (DVec3::from_slice(&n[..3]), DVec3::from_slice(&n[3..]));
    let [low, high] = [a.min(b), a.max(b)];
    if (high - low).min_element() > 0.0 { Ok([low, high]) } else { Err(format!("\"{text}\" is flat; a box has a volume")) }
}

/// A rigid motion: x,y,z (a shift), x,y,z,qx,qy,qz,qw, or the 16 numbers of a 4 × 4 matrix, row by row.
pub fn rigid(text: &str) -> Result<DAffine3, String> {
    let what = "3 numbers (shift, m), 7 (shift and quaternion qx,qy,qz,qw) or 16 (4 × 4, row by row)";
    let n = numbers(text, &[3, 7, 16], what)?;
    rigid_of(&n)
}

/// The same of numbers.
pub(crate) fn rigid_of(n: &[f64]) -> Result<DAffine3, String> {
    if n.len() != 16 {
        let shift = DVec3::from_slice(&n[..3]);
        let q = if n.len() == 7 { glam::DQuat::from_slice(&n[3..]) } else { glam::DQuat::IDENTITY };
        // A quaternion in a file is rounded; one that is far from unit length is none.
        if (q.length() - 1.0).abs() >= 0.01 || q.is_nan() {
            return Err(format!("the quaternion has length {:.4}, must be 1", q.length()));
        }
        return Ok(DAffine3::from_rotation_translation(q.normalize(), shift));
    }
    let row = |i: usize| DVec3::new(n[4 * i], n[4 * i + 1], n[4 * i + 2]);
    let m = glam::DMat3::from_cols(row(0), row(1), row(2)).transpose();
    let g = (m.transpose() * m - glam::DMat3::IDENTITY).to_cols_array();
    // As in recordings: six digits or so.
    if !g.iter().all(|x| x.abs() < 1e-4) || m.determinant() < 0.0 || n[12..] != [0.0, 0.0, 0.0, 1.0] {
        return Err("the matrix is not rigid: a rotation, a shift in the last column, and 0,0,0,1 as the last row".into());
    }
    let q = glam::DQuat::from_mat3(&m).normalize();
    Ok(DAffine3::from_rotation_translation(q, DVec3::new(n[3], n[7], n[11])))
}

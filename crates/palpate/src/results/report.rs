//! What a report shows, as data: the block inside `report.html` that its viewer draws, and that `palpate pictures` reads again.
//!
//! Lengths are in metres. Long arrays are little-endian single precision in base64: a third of the size that digits take, and browsers read
//! them without parsing.

use super::Document;
use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use serde::{Deserialize, Deserializer, Serialize, Serializer, de};

/// What a report shows (`report/1`).
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ReportData {
    /// Its title.
    pub title: String,
    /// Names of the two motions that are compared: start values and fitted, or before and after.
    pub motions: [String; 2],
    /// Scene by scene.
    pub scenes: Vec<SceneData>,
    /// Everything that is drawn as a chart.
    pub charts: Vec<Chart>,
}

impl Document for ReportData {
    const FORMAT: &'static str = "report/1";
}

/// What a chart is about.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Topic {
    /// A marker, point or node over time, measured and simulated.
    Track,
    /// The residual of every frame, or along the body where there is a single one.
    #[default]
    Residual,
    /// Residuals counted.
    Histogram,
    /// Searches by iteration.
    Search,
    /// A curve of stiffness.
    Curve,
}

/// Whose series it is: that says its colour, on light and on dark ground.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Role {
    /// The first motion's.
    Before,
    /// The second motion's, or the best search's.
    #[default]
    After,
    /// What was measured.
    Measured,
    /// What noise would leave.
    Noise,
    /// A search that is not the best.
    Search,
}

/// How a series is drawn.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Style {
    /// A line.
    #[default]
    Line,
    /// A line of dashes.
    Dashed,
    /// A dot at every point.
    Dots,
    /// Columns from zero.
    Columns,
}

/// A chart.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Chart {
    /// Its name among all charts, of letters, digits and dashes.
    pub key: String,
    /// What it is about.
    pub topic: Topic,
    /// Number of its scene, from 0; absent of the whole fit.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub scene: Option<usize>,
    /// What of the scene: a marker, a kind of readings.
    pub subject: String,
    /// What it shows, in a sentence: its caption.
    pub title: String,
    /// The same for who does not see it, with the numbers that matter.
    pub words: String,
    /// What x is, with its unit.
    pub x: String,
    /// What y is, with its unit.
    pub y: String,
    /// True where y is drawn by its logarithm.
    pub logarithmic: bool,
    /// False of one that only who asks for it is shown.
    pub main: bool,
    /// What is drawn, later ones over earlier ones.
    pub series: Vec<Series>,
}

/// A series of a chart.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Series {
    /// Label in the legend; empty for none.
    pub label: String,
    /// Whose it is.
    pub role: Role,
    /// How it is drawn.
    pub style: Style,
    /// x of its points.
    pub x: Floats,
    /// y of its points; not a number where there is none.
    pub y: Floats,
}

impl Series {
    /// A series of points (x, y).
    pub fn new(label: impl Into<String>, role: Role, style: Style, points: impl IntoIterator<Item = (f64, f64)>) -> Series {
        let (x, y): (Vec<f32>, Vec<f32>) = points.into_iter().map(|(x, y)| (x as f32, y as f32)).unzip();
        Series { label: label.into(), role, style, x: Floats(x), y: Floats(y) }
    }
}

/// One scene with its recording.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct SceneData {
    /// Its file.
    pub name: String,
    /// Unit vector upwards.
    pub up: [f64; 3],
    /// Smallest and largest corner of all that is shown [m].
    pub bounds: [[f64; 3]; 2],
    /// Distance of the marks on its axes [m].
    pub tick: f64,
    /// The corner of the bounds where the axes meet [m].
    pub corner: [f64; 3],
    /// Lines of grids on the planes within reach, from end to end [m] `[L, 2, 3]`.
    pub floor: Floats,
    /// Unit vector from the middle of the bounds to whoever looks at first.
    pub view: [f64; 3],
    /// Residual at which colours are full [m].
    pub scale: f64,
    /// Distance that noise and the shape's rounding would leave, root mean square [m].
    pub noise: f64,
    /// Times of all frames [s] `[F]`.
    pub times: Vec<f64>,
    /// Root mean square distance of every frame [m], of both motions `[F]`; none of a motion that was not simulated.
    pub rms: [Vec<Option<f64>>; 2],
    /// Triangles of the surface, three vertices each.
    pub triangles: Indices,
    /// Frames that are shown in space.
    pub shown: Vec<ShownFrame>,
    /// Place in `shown` of the frame that is looked at first: one with a large residual.
    pub worst: usize,
    /// What cameras saw.
    pub overlays: Vec<Overlay>,
}

/// One frame in space.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ShownFrame {
    /// Number among all frames.
    pub frame: usize,
    /// Time on the recording's clock [s].
    pub time: f64,
    /// Both motions; `None` where one was not simulated.
    pub motions: [Option<ShownMotion>; 2],
}

/// A simulated surface beside what was measured.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ShownMotion {
    /// Vertices [m] `[V, 3]`.
    pub vertices: Floats,
    /// Mean residual around each vertex [m] `[V]`; not a number where nothing was measured.
    pub residual: Floats,
    /// Depth points [m] `[P, 3]`.
    pub points: Floats,
    /// Their signed distances [m] `[P]`, positive outside the body; not a number where one met nothing.
    pub distances: Floats,
    /// Measured places of everything else [m] `[M, 3]`.
    pub measured: Floats,
    /// Where the simulation has them [m] `[M, 3]`.
    pub simulated: Floats,
}

/// A camera's image with the simulated outlines in it.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Overlay {
    /// Name of the camera.
    pub camera: String,
    /// Time [s].
    pub time: f64,
    /// The picture as PNG in base64.
    pub png: String,
    /// What it shows, in words.
    pub words: String,
}

/// Numbers in single precision, in base64.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Floats(pub Vec<f32>);

/// Whole numbers of 32 bits, in base64.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Indices(pub Vec<u32>);

/// Words of four bytes out of base64.
fn words<'de, D: Deserializer<'de>>(from: D) -> Result<Vec<[u8; 4]>, D::Error> {
    let text = String::deserialize(from)?;
    let bytes = STANDARD.decode(text).map_err(de::Error::custom)?;
    if !bytes.len().is_multiple_of(4) {
        return Err(de::Error::custom("an array ends within a number"));
    }
    Ok(bytes.chunks_exact(4).map(|b| [b[0], b[1], b[2], b[3]]).collect())
}

impl Serialize for Floats {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        let bytes: Vec<u8> = self.0.iter().flat_map(|v| v.to_le_bytes()).collect();
        to.serialize_str(&STANDARD.encode(bytes))
    }
}

impl<'de> Deserialize<'de> for Floats {
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Floats, D::Error> {
        Ok(Floats(words(from)?.into_iter().map(f32::from_le_bytes).collect()))
    }
}

impl Serialize for Indices {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        let bytes: Vec<u8> = self.0.iter().flat_map(|v| v.to_le_bytes()).collect();
        to.serialize_str(&STANDARD.encode(bytes))
    }
}

impl<'de> Deserialize<'de> for Indices {
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Indices, D::Error> {
        Ok(Indices(words(from)?.into_iter().map(u32::from_le_bytes).collect()))
    }
}

impl Floats {
    /// Vectors, coordinate by coordinate.
    pub fn of_vectors<'a>(vectors: impl IntoIterator<Item = &'a glam::DVec3>) -> Floats {
        Floats(vectors.into_iter().flat_map(|v| v.to_array()).map(|x| x as f32).collect())
    }

    /// Numbers; what is `None` is not a number.
    pub fn of(numbers: impl IntoIterator<Item = Option<f64>>) -> Floats {
        Floats(numbers.into_iter().map(|x| x.map_or(f32::NAN, |x| x as f32)).collect())
    }

    /// The vectors again.
    pub fn vectors(&self) -> Vec<glam::DVec3> {
        self.0.chunks_exact(3).map(|c| glam::DVec3::new(c[0].into(), c[1].into(), c[2].into())).collect()
    }

    /// The numbers in double precision.
    pub fn numbers(&self) -> impl Iterator<Item = f64> {
        self.0.iter().map(|x| f64::from(*x))
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::round_trip;
    use super::*;

    #[test]
    fn a_report_is_what_it_was_when_it_is_read_again() {
        let motion = ShownMotion {
            vertices: Floats(vec![0.0, 1.5, -2.25]),
            residual: Floats(vec![1e-3]),
            points: Floats(vec![0.1, 0.2, 0.3]),
            distances: Floats(vec![f32::MIN_POSITIVE]),
            ..ShownMotion::default()
        };
        let scene = SceneData {
            name: "a.toml".into(),
            triangles: Indices(vec![0, 1, u32::MAX]),
            shown: vec![ShownFrame { frame: 3, time: 0.1, motions: [None, Some(motion)] }],
            rms: [Vec::new(), vec![Some(1e-3), None]],
            ..SceneData::default()
        };
        let series = vec![Series::new("fitted", Role::After, Style::Dots, [(0.0, 1.0), (0.5, 2.0)])];
        let chart = Chart { key: "search-cost".into(), topic: Topic::Search, series, ..Chart::default() };
        let data = ReportData { title: "a & b".into(), scenes: vec![scene], charts: vec![chart], ..ReportData::default() };
        let file = round_trip(&data);
        assert_eq!(file["scenes"][0]["triangles"], "AAAAAAEAAAD/////");
        assert!(serde_json::from_str::<Floats>("\"AAAA\"").unwrap_err().to_string().contains("within a number"));
    }
}

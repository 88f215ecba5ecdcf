//! Recordings: what was measured, from arrays or from a folder.

use crate::{arrays, errors, watch};
use glam::{DAffine3, DVec3};
use palpate_io::recording::{self as io, DepthPixels, DepthStack, Noise, RecordedCamera, Tracks};
use palpate_model::observation::MarkerRest;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::path::PathBuf;
use std::sync::Arc;

/// Counts of a depth image where depths were given in metres: so many that the farthest reading has the largest.
const MOST: f64 = u16::MAX as f64;

/// Everything that was measured of one object.
#[pyclass(frozen, module = "palpate")]
pub struct Recording {
    pub recording: Arc<io::Recording>,
}

impl Recording {
    pub fn new(recording: io::Recording) -> Recording {
        Recording { recording: Arc::new(recording) }
    }
}

/// Vectors `[T, N, 3]`, and their rest places `[N, 3]`.
fn tracks(
    given: &Bound<'_, PyAny>,
    rest: Option<&Bound<'_, PyAny>>,
    (name, rest_name): (&str, &str),
    times: &[f64],
    noise: Noise,
) -> PyResult<(Tracks, usize, Vec<DVec3>)> {
    let (shape, values) = arrays::numbers(given, name, &[Some(times.len()), None, Some(3)])?;
    let n = shape[1];
    let rest = match rest {
        Some(rest) => arrays::by_three(&arrays::numbers(rest, rest_name, &[Some(n), Some(3)])?.1),
        None => Vec::new(),
    };
    Ok((Tracks { times: times.to_vec(), vectors: arrays::by_three(&values), noise }, n, rest))
}

/// An entry of a camera's dictionary.
fn entry<'py, T>(camera: &Bound<'py, PyDict>, key: &str) -> PyResult<Option<T>>
where
    T: for<'a> FromPyObject<'a, 'py>,
{
    let Some(value) = camera.get_item(key)? else { return Ok(None) };
    let text = value.to_string();
    let wrong = || errors::argument(camera.py(), &format!("camera.{key}"), format!("{text} is not of the right type"));
    value.extract::<T>().map(Some).map_err(|_| wrong())
}

/// Keys of a camera's dictionary.
const KEYS: [&str; 9] =
    ["name", "K", "world_from_camera", "distortion", "depth_scale", "depth_offset", "noise_sigma", "noise_systematic", "masks"];

/// Depth images `[F, H, W]` of a camera: counts where they are whole numbers, metres where not.
fn depth(depths: &Bound<'_, PyAny>, camera: &Bound<'_, PyDict>, times: &[f64], number: usize) -> PyResult<DepthStack> {
    let py = camera.py();
    for key in camera.keys() {
        let key: String = key.extract()?;
        if !KEYS.contains(&key.as_str()) {
            let text = format!("unknown key; allowed: {}", KEYS.join(", "));
            return Err(errors::argument(py, &format!("camera.{key}"), text));
        }
    }
    let needed = |key: &str, what: &str| {
        let missing = || errors::argument(py, &format!("camera.{key}"), format!("is missing: {what}"));
        camera.get_item(key)?.ok_or_else(missing)
    };
    let k = arrays::numbers(&needed("K", "the 3 × 3 matrix of the pinhole")?, "camera.K", &[Some(3), Some(3)])?.1;
    if k[1] != 0.0 || k[3] != 0.0 || k[6..] != [0.0, 0.0, 1.0] {
        return Err(errors::argument(py, "camera.K", "must be [[fx, 0, cx], [0, fy, cy], [0, 0, 1]]"));
    }
    let pose = needed("world_from_camera", "a rigid 4 × 4 matrix")?;
    let pose = arrays::numbers(&pose, "camera.world_from_camera", &[Some(4), Some(4)])?.1;
    let wanted = [Some(times.len()), None, None];
    let offset = entry::<f64>(camera, "depth_offset")?.unwrap_or(0.0);
    let kind: String = py.import("numpy")?.call_method1("asarray", (depths,))?.getattr("dtype")?.getattr("kind")?.extract()?;
    let (shape, read) = arrays::numbers(depths, "depth", &wanted)?;
    let (scale, pixels) = match (kind.as_str(), entry::<f64>(camera, "depth_scale")?) {
        ("u" | "i", None) => {
            return Err(errors::argument(py, "camera.depth_scale", "is missing: metres per count of the depth images"));
        }
        ("u" | "i", Some(scale)) => match read.iter().find(|c| !(0.0..=MOST).contains(*c)) {
            Some(c) => return Err(errors::argument(py, "depth", format!("{c} is no count of 16 bits (0 to {MOST})"))),
            None => (Some(scale), DepthPixels::Counts(read.iter().map(|c| *c as u16).collect())),
        },
        // No sensor resolves a ten-millionth of its distance.
        (_, None) => (None, DepthPixels::Metres(read.iter().map(|z| *z as f32).collect())),
        _ => {
            let text = "belongs to counts (whole numbers); these depths are in metres";
            return Err(errors::argument(py, "camera.depth_scale", text));
        }
    };
    let masks = camera.get_item("masks")?.filter(|m| !m.is_none());
    let size = [Some(shape[0]), Some(shape[1]), Some(shape[2])];
    let masks = masks.map(|m| arrays::flags(&m, "camera.masks", &size)).transpose()?;
    let distortion = camera.get_item("distortion")?.filter(|d| !d.is_none());
    let distortion = distortion.map(|d| arrays::numbers(&d, "camera.distortion", &[None])).transpose()?;
    let mut coefficients = [0.0; 8];
    if let Some((_, given)) = distortion {
        if given.len() != 5 && given.len() != 8 {
            let text = format!("must be 5 numbers (k1 k2 p1 p2 k3) or 8 (k4 k5 k6 as well), found {}", given.len());
            return Err(errors::argument(py, "camera.distortion", text));
        }
        coefficients[..given.len()].copy_from_slice(&given);
    }
    let row = |i: usize| [pose[4 * i], pose[4 * i + 1], pose[4 * i + 2], pose[4 * i + 3]];
    let camera = RecordedCamera {
        name: entry(camera, "name")?.unwrap_or_else(|| format!("cam{number}")),
        width: shape[2],
        height: shape[1],
        focal: [k[0], k[4]],
        center: [k[2], k[5]],
        distortion: coefficients,
        world_from_camera: DAffine3::IDENTITY,
        depth_scale: scale,
        depth_offset: offset,
        noise_sigma: entry(camera, "noise_sigma")?,
        noise_systematic: entry(camera, "noise_systematic")?.unwrap_or(0.0),
    };
    Ok(DepthStack { camera, pose: [0, 1, 2, 3].map(row), times: times.to_vec(), pixels, masks })
}

#[pymethods]
impl Recording {
    /// Reads a recording: its folder, or a TOML file of the format.
    #[staticmethod]
    fn open(py: Python<'_>, path: PathBuf) -> PyResult<Recording> {
        let read = watch::load(py, move || palpate_io::read_recording(path))?;
        read.map(Recording::new).map_err(|e| errors::of(py, e))
    }

    /// A recording of what was seen at `times` [T]; metres and seconds, NaN where a thing was not seen.
    ///
    /// points [T, N, 3] are tracked points of the body, which lie at rest [N, 3] while it rests, at most tolerance [m] from its surface;
    /// markers [T, M, 3] have marker_rest [M, 3], and marker_surface [M, 3] where they are fixed to the surface;
    /// displacements [T, N, 3] are those of the scene's nodes [N, 3];
    /// depth [T, H, W] of one camera is in metres (NaN or 0: no reading), or in counts (whole numbers, 0: no reading).
    /// camera is a dictionary with K [3, 3] and world_from_camera [4, 4], and perhaps name, distortion, depth_scale, depth_offset, noise_sigma,
    /// noise_systematic and masks [T, H, W], true where the object is.
    /// noise_sigma [m] is the standard deviation of one coordinate or depth, noise_systematic [m] the size of errors that do not average out.
    #[staticmethod]
    #[pyo3(signature = (
        times, *, points = None, rest = None, tolerance = None, markers = None, marker_names = None, marker_rest = None,
        marker_surface = None, displacements = None, nodes = None, depth = None, camera = None, noise_sigma = None,
        noise_systematic = 0.0, title = "", source = "arrays"
    ))]
    fn from_arrays(
        py: Python<'_>,
        times: &Bound<'_, PyAny>,
        points: Option<&Bound<'_, PyAny>>,
        rest: Option<&Bound<'_, PyAny>>,
        tolerance: Option<f64>,
        markers: Option<&Bound<'_, PyAny>>,
        marker_names: Option<Vec<String>>,
        marker_rest: Option<&Bound<'_, PyAny>>,
        marker_surface: Option<&Bound<'_, PyAny>>,
        displacements: Option<&Bound<'_, PyAny>>,
        nodes: Option<&Bound<'_, PyAny>>,
        depth: Option<&Bound<'_, PyAny>>,
        camera: Option<&Bound<'_, PyDict>>,
        noise_sigma: Option<f64>,
        noise_systematic: f64,
        title: &str,
        source: &str,
    ) -> PyResult<Recording> {
        let (_, times) = arrays::numbers(times, "times", &[None])?;
        let noise = Noise { sigma: noise_sigma, systematic: noise_systematic };
        let fault = |e| errors::of(py, palpate::Error::File(e));
        let missing = |name: &str, why: &str| errors::argument(py, name, format!("is missing: {why}"));
        let mut r = io::Recording::empty(title, source);
        if let Some(points) = points {
            let rest = rest.ok_or_else(|| missing("rest", "where every point lies on the body at rest, [N, 3]"))?;
            let (track, _, rest) = tracks(points, Some(rest), ("points", "rest"), &times, noise)?;
            r = r.with_points(track, rest, tolerance).map_err(fault)?;
        }
        if let Some(markers) = markers {
            let place =
                marker_rest.ok_or_else(|| missing("marker_rest", "where every marker is while the body rests, [M, 3]"))?;
            let (track, m, at) = tracks(markers, Some(place), ("markers", "marker_rest"), &times, noise)?;
            let names = marker_names.unwrap_or_else(|| (0..m).map(|k| format!("m{k}")).collect());
            if names.len() != m {
                return Err(errors::argument(py, "marker_names", format!("holds {} names for {m} markers", names.len())));
            }
            let surface = marker_surface.map(|s| arrays::numbers(s, "marker_surface", &[Some(m), Some(3)])).transpose()?;
            let surface = surface.map(|(_, s)| arrays::by_three(&s));
            let rest = names.into_iter().enumerate().map(|(k, name)| MarkerRest {
                name,
                position: at[k],
                surface: surface.as_ref().map(|s| s[k]).filter(|s| !s.is_nan()),
            });
            r = r.with_markers(track, rest.collect()).map_err(fault)?;
        }
        if let Some(displacements) = displacements {
            let (track, n, rest) = tracks(displacements, nodes, ("displacements", "nodes"), &times, noise)?;
            r = r.with_displacements(track, n, rest).map_err(fault)?;
        }
        match (depth, camera) {
            (Some(d), Some(c)) => {
                let mut stack = self::depth(d, c, &times, 0)?;
                stack.camera.noise_sigma = stack.camera.noise_sigma.or(noise_sigma);
                if stack.camera.noise_systematic == 0.0 {
                    stack.camera.noise_systematic = noise_systematic;
                }
                r = r.with_depth(stack).map_err(fault)?;
            }
            (Some(_), None) => return Err(missing("camera", "a dictionary with K and world_from_camera")),
            (None, Some(_)) => return Err(missing("depth", "images [F, H, W]")),
            (None, None) => {}
        }
        if r.kinds().is_empty() {
            return Err(errors::argument(
                py,
                "from_arrays",
                "give points, markers, displacements or depth: nothing was measured",
            ));
        }
        Ok(Recording::new(r))
    }

    /// The recording with the images of one more depth camera.
    fn with_camera(
        &self,
        py: Python<'_>,
        times: &Bound<'_, PyAny>,
        depth: &Bound<'_, PyAny>,
        camera: &Bound<'_, PyDict>,
    ) -> PyResult<Recording> {
        let (_, times) = arrays::numbers(times, "times", &[None])?;
        let own = self.recording.as_ref().clone();
        let stack = self::depth(depth, camera, &times, own.cameras.len())?;
        own.with_depth(stack).map(Recording::new).map_err(|e| errors::of(py, e))
    }

    /// Writes the recording as a folder, which `palpate` on the command line and `Recording.open` read.
    fn save(&self, py: Python<'_>, folder: PathBuf) -> PyResult<()> {
        let own = self.recording.clone();
        watch::load(py, move || palpate_io::write_recording(folder, &own))?.map_err(|e| errors::of(py, e))
    }

    /// Names of the kinds of readings that it holds, as a scene's `cost` has them.
    #[getter]
    fn kinds(&self) -> Vec<&'static str> {
        use palpate_model::observation::ReadingKind;
        let name = |k: ReadingKind| match k {
            ReadingKind::Depth => "sparse-surface",
            ReadingKind::Marker => "markers",
            ReadingKind::Track => "points",
            ReadingKind::Displacement => "displacements",
        };
        self.recording.kinds().into_iter().map(name).collect()
    }

    #[getter]
    fn title(&self) -> &str {
        &self.recording.title
    }

    /// What looks suspicious without being wrong, one line each.
    #[getter]
    fn warnings(&self) -> Vec<String> {
        self.recording.warnings.clone()
    }

    fn __repr__(&self) -> String {
        format!("<palpate.Recording {}: {}>", self.recording.path.display(), self.kinds().join(", "))
    }
}

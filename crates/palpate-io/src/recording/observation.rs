//! A recording as an [`Observation`]: pixels and clouds to points of the surface, markers to frames.

use super::{RawDepth, RecordedFrame, RecordedMarkers, Recording, SeenFrom, Sequence};
use crate::error::{InputError, number};
use glam::DVec3;
use palpate_model::observation::{
    Camera, Channel, Frame, MarkerRest, NodeRest, Observation, ObservedDisplacement, ObservedMarker, ObservedPoint, ReadingKind,
    TrackRest,
};
use palpate_model::scene::ObservationSpec;

/// Noise of a depth reading where the recording states none [m]: that of common depth cameras at half a metre.
const DEPTH_NOISE: f64 = 0.002;

/// Noise of a coordinate of a marker, a tracked point or a displacement where the recording states none [m].
const MARKER_NOISE: f64 = 0.001;

/// Times closer than this are one instant [s]; clocks in files have microseconds.
const SAME_TIME: f64 = 1e-9;

/// Why a scene's `[observation]` and a recording do not go together.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ObservationError {
    /// The recording itself is at fault.
    #[error("{0}")]
    Recording(#[from] InputError),
    /// The scene asks for what the recording does not hold.
    #[error("{key}: {message}")]
    Scene {
        /// Key of the scene (`observation.frames`).
        key: String,
        /// What is wrong and what there is.
        message: String,
    },
}

/// A noise [m], or the usual one of depth readings with a word about it; `who` begins the sentence.
fn stated(noise: Option<f64>, warnings: &mut Vec<String>, who: impl Fn() -> String) -> f64 {
    noise.unwrap_or_else(|| {
        warnings.push(format!("{} no noise_sigma; {DEPTH_NOISE} m is assumed", who()));
        DEPTH_NOISE
    })
}

fn asked(key: impl Into<String>, message: String) -> ObservationError {
    ObservationError::Scene { key: key.into(), message }
}

impl Recording {
    /// What a scene's `[observation]` uses of this recording, in world coordinates; sites are left to the caller, who
    /// knows the body: `ObservedMarker::site` counts the returned rest places, and after them those of the tracks.
    ///
    /// Of times of images and clouds, and of markers, in `from..=to` every `every`-th is used; pixels on every `pixel_stride`-th row and column,
    /// and as large a part of a cloud's points.
    /// What was assumed is added to `warnings`.
    ///
    /// # Errors
    /// Nothing to use for a cost in the spec, or a marker without a rest place.
    pub fn observation(
        &self,
        spec: &ObservationSpec,
        warnings: &mut Vec<String>,
    ) -> Result<(Observation, Vec<MarkerRest>), ObservationError> {
        let mut o = Observation {
            cameras: self.cameras.iter().map(|c| Camera::Pinhole { center: c.position(), axis: c.axis() }).collect(),
            camera_names: self.cameras.iter().map(|c| c.name.clone()).collect(),
            ..Observation::default()
        };
        if spec.costs.contains(&ReadingKind::Depth) {
            self.add_depth(spec, &mut o, warnings)?;
        }
        let mut rest = Vec::new();
        if spec.costs.contains(&ReadingKind::Marker) {
            rest = self.add_markers(spec, &mut o, warnings)?;
        }
        if spec.costs.contains(&ReadingKind::Track) {
            self.add_points(spec, &mut o, rest.len() as u32, warnings)?;
        }
        if spec.costs.contains(&ReadingKind::Displacement) {
            self.add_displacements(spec, &mut o, warnings)?;
        }
        o.frames.sort_by(|a, b| a.time.total_cmp(&b.time));
        o.frames.dedup_by(|later, first| {
            let same = later.time - first.time < SAME_TIME;
            if same {
                first.points.append(&mut later.points);
                first.markers.append(&mut later.markers);
                first.displacements.append(&mut later.displacements);
            }
            same
        });
        Ok((o, rest))
    }

    /// Nothing to compare with is left; `times` are those at which the recording has it [s].
    fn no_data(&self, spec: &ObservationSpec, what: &str, times: impl Iterator<Item = f64>) -> ObservationError {
        let (first, last) = times.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), t| (a.min(t), b.max(t)));
        let path = self.path.display();
        if first > last {
            return asked("observation.cost", format!("{path} holds no {what}, which this cost needs"));
        }
        let chosen = match (spec.from.is_finite(), spec.to.is_finite()) {
            (true, true) => format!("between {} s and {} s", spec.from, spec.to),
            (true, false) => format!("from {} s on", spec.from),
            (false, true) => format!("up to {} s", spec.to),
            (false, false) => format!("on every {}-th row and column", spec.pixel_stride),
        };
        asked(
            "observation.frames",
            format!("no {what} is left {chosen}; {path} has them from {} s to {} s", number(first), number(last)),
        )
    }

    /// Readings of the surface: depth images and clouds.
    fn add_depth(&self, spec: &ObservationSpec, o: &mut Observation, warnings: &mut Vec<String>) -> Result<(), ObservationError> {
        let chosen = self.chosen_times(spec);
        let is_chosen = |time: f64| chosen.iter().any(|t| (t - time).abs() <= SAME_TIME);
        let mut unmasked = Vec::new();
        // Noise and systematic error of every sensor that is used, and its number.
        let mut used: Vec<(usize, f64, f64)> = Vec::new();
        let mut usable = vec![false; self.cameras.len()];
        for f in self.frames.iter().filter(|f| f.depth.is_some() && is_chosen(f.time)) {
            usable[f.camera] = true;
            let camera = &self.cameras[f.camera];
            let strided =
                f.readings().filter(|(u, v, _)| u.is_multiple_of(spec.pixel_stride) && v.is_multiple_of(spec.pixel_stride));
            let points = strided
                .map(|(u, v, count)| {
                    let position = camera.point(u as f64, v as f64, camera.depth(count)).ok_or_else(|| {
                        let text = format!("distortion of camera \"{}\" cannot be inverted at pixel ({u}, {v})", camera.name);
                        InputError::file(&self.path, text)
                    })?;
                    Ok(ObservedPoint { position, camera: f.camera as u32 })
                })
                .collect::<Result<Vec<_>, InputError>>()?;
            o.frames.push(Frame { time: f.time, points, ..Frame::default() });
            unmasked.extend(f.mask.is_none().then_some(f.time));
        }
        if let Some(first) = unmasked.first() {
            let (path, n, of) = (self.path.display(), unmasked.len(), o.frames.len());
            let (have, first) = (if n == 1 { "image has" } else { "images have" }, number(*first));
            let text = format!("{n} of {of} depth {have} no mask (the first at {first} s); every pixel may be the object");
            warnings.push(format!("{path}: {text}"));
        }
        self.warn_of_images(o, warnings);
        for (i, c) in self.cameras.iter().enumerate().filter(|(i, _)| usable[*i]) {
            let noise = stated(c.noise_sigma, warnings, || format!("{}: camera \"{}\" states", self.path.display(), c.name));
            used.push((i, noise, c.noise_systematic));
        }
        for (k, c) in self.clouds.iter().filter(|c| is_chosen(c.time)).enumerate() {
            let sensor = self.sensor(c.from, o);
            // As many are left as of an image's pixels.
            let every = spec.pixel_stride * spec.pixel_stride;
            let points = c.points.iter().step_by(every).map(|p| ObservedPoint { position: *p, camera: sensor as u32 }).collect();
            o.frames.push(Frame { time: c.time, points, ..Frame::default() });
            let mut aside = Vec::new();
            let said = if k == 0 { &mut *warnings } else { &mut aside };
            let noise = stated(c.noise_sigma, said, || format!("{}: [[cloud]] states", self.path.display()));
            if !used.contains(&(sensor, noise, c.noise_systematic)) {
                used.push((sensor, noise, c.noise_systematic));
            }
        }
        o.frames.sort_by(|a, b| a.time.total_cmp(&b.time));
        if o.frames.iter().all(|f| f.points.is_empty()) {
            let images = self.frames.iter().filter(|f| f.readings().next().is_some()).map(|f| f.time);
            let seen = images.chain(self.clouds.iter().filter(|c| !c.points.is_empty()).map(|c| c.time));
            return Err(self.no_data(spec, "depth reading of the object", seen));
        }
        // One noise serves all sensors: the root mean square of those in use.
        let noise = (used.iter().map(|u| u.1.powi(2)).sum::<f64>() / used.len() as f64).sqrt();
        let systematic = used.iter().map(|u| u.2).fold(0.0, f64::max);
        o.channels.push(Channel { kind: ReadingKind::Depth, noise, systematic });
        Ok(())
    }

    /// Times of images and clouds that a scene uses, rising.
    fn chosen_times(&self, spec: &ObservationSpec) -> Vec<f64> {
        let images = self.frames.iter().filter(|f| f.depth.is_some()).map(|f| f.time);
        let mut all: Vec<f64> = images.chain(self.clouds.iter().map(|c| c.time)).collect();
        all.retain(|t| (spec.from..=spec.to).contains(t));
        all.sort_by(f64::total_cmp);
        all.dedup_by(|later, first| *later - *first <= SAME_TIME);
        all.into_iter().step_by(spec.every).collect()
    }

    /// Number of what saw a cloud, among the cameras and behind them.
    fn sensor(&self, from: SeenFrom, o: &mut Observation) -> usize {
        let camera = match from {
            SeenFrom::Camera(c) => return c,
            SeenFrom::Origin(center) => Camera::Scanner { center },
            SeenFrom::Unknown => Camera::Unknown,
        };
        let behind = self.cameras.len();
        o.cameras[behind..].iter().position(|c| *c == camera).map_or_else(
            || {
                o.cameras.push(camera);
                o.camera_names.push(format!("cloud {}", o.cameras.len() - 1 - behind));
                o.cameras.len() - 1
            },
            |k| behind + k,
        )
    }

    /// Images that say nothing among others that do: without a reading of the object, or with readings at the end of the camera's range.
    fn warn_of_images(&self, o: &Observation, warnings: &mut Vec<String>) {
        let mut say = |times: Vec<f64>, of: usize, what: &str| {
            if let Some(first) = times.first() {
                let n = times.len();
                let path = self.path.display();
                warnings.push(format!("{path}: {n} of {of} depth images {what} (the first at {} s)", number(*first)));
            }
        };
        let seen = |t: f64| o.frames.iter().any(|f| (f.time - t).abs() < SAME_TIME);
        // Readings at the largest count, and all.
        let count = |i: &RecordedFrame| {
            i.readings().fold((0, 0), |(full, all), r| (full + usize::from(r.2 == RawDepth::Count(u16::MAX)), all + 1))
        };
        let images: Vec<(f64, (usize, usize))> =
            self.frames.iter().filter(|f| f.depth.is_some() && seen(f.time)).map(|f| (f.time, count(f))).collect();
        let times = |is: fn(usize, usize) -> bool| -> Vec<f64> {
            images.iter().filter(|(_, (full, all))| is(*full, *all)).map(|(time, _)| *time).collect()
        };
        say(times(|_, all| all == 0), images.len(), "hold no reading of the object");
        say(
            times(|full, all| all > 0 && 2 * full > all),
            images.len(),
            "hold mostly readings at the largest count, 65535: saturated?",
        );
    }

    fn add_markers(
        &self,
        spec: &ObservationSpec,
        o: &mut Observation,
        warnings: &mut Vec<String>,
    ) -> Result<Vec<MarkerRest>, ObservationError> {
        let none = || asked("observation.cost", format!("\"markers\" needs [markers], which {} lacks", self.path.display()));
        let m = self.markers.as_ref().ok_or_else(none)?;
        let rest = self.rest_places(m, spec)?;
        let (mut instants, mut last) = (0usize, f64::NEG_INFINITY);
        let before = o.frames.len();
        for s in m.samples.iter().filter(|s| (spec.from..=spec.to).contains(&s.time)) {
            let fresh = s.time - last > SAME_TIME;
            if fresh {
                instants += 1;
                last = s.time;
            }
            if !(instants - 1).is_multiple_of(spec.every) {
                continue;
            }
            if fresh {
                o.frames.push(Frame { time: s.time, ..Frame::default() });
            }
            if let Some(f) = o.frames.last_mut() {
                f.markers.push(ObservedMarker { site: s.marker as u32, position: s.position });
            }
        }
        if o.frames.len() == before {
            return Err(self.no_data(spec, "marker reading", m.samples.iter().map(|s| s.time)));
        }
        if m.noise_sigma.is_none() {
            warnings.push(format!("{}: markers state no noise_sigma; {MARKER_NOISE} m is assumed", self.path.display()));
        }
        let noise = m.noise_sigma.unwrap_or(MARKER_NOISE);
        o.channels.push(Channel { kind: ReadingKind::Marker, noise, systematic: m.noise_systematic });
        Ok(rest)
    }

    /// `first`: number of the first point's site.
    fn add_points(
        &self,
        spec: &ObservationSpec,
        o: &mut Observation,
        first: u32,
        warnings: &mut Vec<String>,
    ) -> Result<(), ObservationError> {
        let none = || asked("observation.cost", format!("\"points\" needs [points], which {} lacks", self.path.display()));
        let points = self.points.as_ref().ok_or_else(none)?;
        let marker = |(k, position): (usize, DVec3)| ObservedMarker { site: first + k as u32, position };
        let frame = |time, k| Frame { time, markers: points.track.seen(k).map(marker).collect(), ..Frame::default() };
        self.add_sequence(spec, o, &points.track, (ReadingKind::Track, "tracked point"), frame, warnings)?;
        o.tracks = TrackRest { places: points.rest.clone(), tolerance: points.tolerance };
        Ok(())
    }

    fn add_displacements(
        &self,
        spec: &ObservationSpec,
        o: &mut Observation,
        warnings: &mut Vec<String>,
    ) -> Result<(), ObservationError> {
        let lacks = || format!("\"displacements\" needs [displacements], which {} lacks", self.path.display());
        let all = self.displacements.as_ref().ok_or_else(|| asked("observation.cost", lacks()))?;
        let displacement = |(node, value): (usize, DVec3)| ObservedDisplacement { node: node as u32, value };
        let frame = |time, k| Frame { time, displacements: all.track.seen(k).map(displacement).collect(), ..Frame::default() };
        self.add_sequence(spec, o, &all.track, (ReadingKind::Displacement, "displacement"), frame, warnings)?;
        o.nodes = Some(NodeRest { count: all.track.count(), places: all.nodes.clone() });
        Ok(())
    }

    /// Frames of the times in use at which something was seen, and the channel.
    fn add_sequence(
        &self,
        spec: &ObservationSpec,
        o: &mut Observation,
        all: &Sequence,
        (kind, what): (ReadingKind, &str),
        frame: impl Fn(f64, usize) -> Frame,
        warnings: &mut Vec<String>,
    ) -> Result<(), ObservationError> {
        let chosen = (0..all.times.len()).filter(|k| (spec.from..=spec.to).contains(&all.times[*k])).step_by(spec.every);
        let before = o.frames.len();
        o.frames.extend(chosen.map(|k| frame(all.times[k], k)).filter(|f| f.residuals() > 0));
        if o.frames.len() == before {
            let seen = (0..all.times.len()).filter(|k| all.seen(*k).next().is_some()).map(|k| all.times[k]);
            return Err(self.no_data(spec, what, seen));
        }
        if all.noise_sigma.is_none() {
            let (path, name) = (self.path.display(), kind.name());
            warnings.push(format!("{path}: {name} state no noise_sigma; {MARKER_NOISE} m is assumed"));
        }
        let noise = all.noise_sigma.unwrap_or(MARKER_NOISE);
        o.channels.push(Channel { kind, noise, systematic: all.noise_systematic });
        Ok(())
    }

    /// The rest place of every marker, the scene's word before the recording's. A first sample would not do: a body is
    /// seldom at rest when recording begins.
    fn rest_places(&self, m: &RecordedMarkers, spec: &ObservationSpec) -> Result<Vec<MarkerRest>, ObservationError> {
        if let Some((i, r)) = spec.markers.iter().enumerate().find(|(_, r)| !m.names.contains(&r.name)) {
            let known: Vec<&str> = m.names.iter().map(String::as_str).collect();
            let (file, hint) = (m.file.display(), crate::keys::suggest(&r.name, &known));
            return Err(asked(
                format!("observation.marker.{i}.name"),
                format!("\"{}\" does not occur in {file}; {hint}", r.name),
            ));
        }
        let place = |name: &String| spec.markers.iter().chain(&m.rest).find(|r| r.name == *name).cloned();
        let missing: Vec<&str> = m.names.iter().filter(|n| place(n).is_none()).map(String::as_str).collect();
        if !missing.is_empty() {
            let text = format!(
                "no rest position for {}; give [[markers.rest]] in {} or [[observation.marker]] in the scene (name, position, surface)",
                missing.join(", "),
                self.path.display()
            );
            return Err(asked("observation.marker", text));
        }
        Ok(m.names.iter().filter_map(place).collect())
    }
}

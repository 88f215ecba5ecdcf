//! Who belongs to whom in a frame, on the device (`palpate_engine::tracking::Correspond`).
//!
//! Places and points are sorted by cubes, and by the pixels of pictures, as wide as they are apart. Whoever asks for those near it goes through rows
//! of cubes. Nothing is scattered and nothing added atomically: the same input gives the same bits.

mod crowd;
#[cfg(test)]
mod tests;

use crate::device::pipelines::{PASSES, pass};
use crate::device::recorder::{Args, Buffers, Groups, PassTime, Recorder, Size};
use crate::device::{Counter, Dispatches, Gpu, GpuError, Maker as _, whole};
use crowd::{BLOCK, Prepared, Task};
use palpate_engine::Failure;
use palpate_engine::tracking::{Correspond, Mixing, PIXEL, Rays, Share, Sighting};
use std::collections::HashMap;
use std::sync::Arc;

/// Most places and most points: eight lanes go through all of them where they crowd in a few cubes, and no invocation may loop longer than
/// adapters allow (`world/limits.rs`).
pub(crate) const MOST_ITEMS: usize = 240_000;

/// What `pierce_points` says of a ray.
const THROUGH: u32 = 2;

/// Lanes of an item in passes that go through what is near it.
const LANES: usize = 8;

/// Computes what points and places have to do with each other on a device. Buffers stay from one call to the next.
#[derive(Debug)]
pub struct Correspondence {
    gpu: Arc<Gpu>,
    buffers: Buffers,
    groups: Groups,
    timed: bool,
    times: HashMap<&'static str, PassTime>,
    counter: Option<Counter>,
}

impl Correspondence {
    /// On an open device.
    pub fn on(gpu: Arc<Gpu>) -> Correspondence {
        let (buffers, groups, times) = (Buffers::new(), Groups::new(), HashMap::new());
        Correspondence { gpu, buffers, groups, timed: false, times, counter: None }
    }

    /// The same with every pass timed, which waits after each call, where the device has a clock.
    #[must_use]
    pub fn timed(self) -> Correspondence {
        Correspondence { timed: true, ..self }
    }

    /// The same with dispatches counted.
    ///
    /// # Errors
    /// No room for the counts.
    pub fn counted(self) -> Result<Correspondence, GpuError> {
        Ok(Correspondence { counter: Some(Counter::new(&self.gpu)?), ..self })
    }

    /// Time per pass so far, by name.
    pub fn pass_times(&self) -> Vec<(&'static str, PassTime)> {
        let mut all: Vec<_> = self.times.iter().map(|(name, time)| (*name, time.clone())).collect();
        all.sort_by_key(|t| t.0);
        all
    }

    /// Dispatches so far; zero unless they are counted.
    pub fn dispatches(&self) -> Dispatches {
        self.counter.as_ref().map_or(Dispatches::default(), Counter::dispatches)
    }

    /// A buffer of at least so many bytes under a name.
    fn make_room(&mut self, name: &'static str, bytes: usize) -> Result<(), GpuError> {
        if self.buffers.get(name).is_none_or(|b| b.size() < whole(bytes as u64)) {
            // What was bound with the old one goes with it.
            self.groups.clear();
            self.buffers.insert(name, self.gpu.buffer(name, bytes as u64)?);
        }
        Ok(())
    }

    fn put<T: bytemuck::NoUninit>(&mut self, name: &'static str, data: &[T]) -> Result<(), GpuError> {
        self.make_room(name, size_of_val(data))?;
        self.gpu.queue.write_buffer(&self.buffers[name], 0, bytemuck::cast_slice(data));
        Ok(())
    }

    /// Sorts everybody, runs the passes, each over so many items of so many lanes, and returns what the last leaves in a buffer.
    fn compute<T: bytemuck::Pod>(
        &mut self,
        s: &Sighting,
        task: Task,
        passes: &[(usize, usize, usize)],
        (name, count): (&'static str, usize),
    ) -> Result<Vec<T>, GpuError> {
        let prepared = Prepared::new(s, task)?;
        let crowd = prepared.crowd;
        self.put("crowd", &[crowd])?;
        self.put("crowd_places", &prepared.places)?;
        self.put("crowd_normals", &prepared.normals)?;
        self.put("crowd_points", &prepared.points)?;
        self.put("eyes", &prepared.eyes)?;
        let entries = (crowd.span * crowd.sections) as usize;
        let pairs = s.cameras.len() * s.places.len();
        for (name, bytes) in [
            ("entries", 8 * entries),
            ("merged", 8 * entries),
            ("starts", 8 * (crowd.cells as usize + 1)),
            ("weights", 4 * pairs),
            ("floors", 4 * s.cameras.len()),
            ("inverses", 4 * s.points.len()),
            (name, size_of::<T>() * count),
        ] {
            self.make_room(name, bytes)?;
        }
        let Correspondence { gpu, buffers, groups, timed, times, counter } = self;
        let mut r = Recorder::new(gpu, buffers, groups, *timed).counted(counter.as_ref());
        let (mut from, mut to) = (&buffers["entries"], &buffers["merged"]);
        let all = |items: usize, pass: usize| Size::All { members: 1, groups: items.div_ceil(PASSES[pass].width as usize) };
        let args = Args::default();
        r.run(pass::KEY_ITEMS, &[("entries", from)], all(entries, pass::KEY_ITEMS), args);
        r.run(pass::SORT_BLOCKS, &[("entries", from)], Size::All { members: 1, groups: entries / BLOCK as usize }, args);
        let mut width = BLOCK;
        while width < crowd.span {
            let own = [("runs", from), ("merged", to)];
            r.run(pass::MERGE_RUNS, &own, all(entries, pass::MERGE_RUNS), Args { extra: width, ..args });
            (from, to) = (to, from);
            width *= 2;
        }
        let own = [("entries", from), ("cell_starts", &buffers["starts"]), ("areas", &buffers["weights"])];
        r.run(pass::FIND_CELLS, &own, all(2 * (crowd.cells as usize + 1), pass::FIND_CELLS), args);
        for (pass, items, lanes) in passes {
            r.run(*pass, &own, all(items * lanes, *pass), args);
        }
        r.submit(times);
        gpu.download(&buffers[name], count)
    }

    fn try_shares(&mut self, s: &Sighting, spread: f64, outliers: f64) -> Result<Vec<Share>, GpuError> {
        let mut shares = vec![Share::default(); s.places.len()];
        if s.points.is_empty() || s.places.is_empty() {
            return Ok(shares);
        }
        let Mixing { volume, reach, thin } = Mixing::new(s.points, s.places.len(), spread);
        // Against the peak (1 − w) π / (2πσ²)^(3/2) of a place; the thinned ones stand for `thin` places each.
        let peak = (1.0 - outliers) * thin as f64 * (std::f64::consts::TAU * spread * spread).powf(-1.5);
        let floor = outliers / volume / peak;
        let (some_points, some_places) = (s.points.len().div_ceil(thin), s.places.len().div_ceil(thin));
        let passes = [
            (pass::SEE_PLACES, s.cameras.len() * s.places.len(), 1),
            (pass::SUM_AREAS, s.cameras.len(), PASSES[pass::SUM_AREAS].width as usize),
            (pass::SHARE_POINTS, some_points, LANES),
            (pass::SHARE_PLACES, some_places, LANES),
        ];
        let found: Vec<[f32; 4]> = self.compute(s, Task::Mix { reach, spread, floor, thin }, &passes, ("shares", some_places))?;
        let chosen = shares.iter_mut().zip(s.places).step_by(thin);
        for ((share, place), [x, y, z, p]) in chosen.zip(found) {
            // The pull is told from the place, so that single precision is precise where it matters.
            let (pull, p) = (glam::DVec3::new(x.into(), y.into(), z.into()), f64::from(p));
            *share = (thin as f64 * p, thin as f64 * (pull + p * place.position));
        }
        Ok(shares)
    }

    fn try_visible(&mut self, s: &Sighting) -> Result<Vec<Vec<bool>>, GpuError> {
        let (k, c) = (s.places.len(), s.cameras.len());
        if k * c == 0 {
            return Ok(vec![Vec::new(); c]);
        }
        let found: Vec<u32> = self.compute(s, Task::See, &[(pass::SEE_PLACES, k * c, 1)], ("weights", k * c))?;
        Ok(found.chunks(k).map(|own| own.iter().map(|seen| *seen != 0).collect()).collect())
    }

    fn try_read(&mut self, s: &Sighting) -> Result<Vec<bool>, GpuError> {
        let (k, c) = (s.places.len(), s.cameras.len());
        if k * c == 0 || s.points.is_empty() {
            return Ok(vec![false; k]);
        }
        let task = Task::Read { reach: PIXEL * s.spacing };
        let found: Vec<u32> = self.compute(s, task, &[(pass::READ_PLACES, k * c, LANES)], ("reads", k * c))?;
        Ok((0..k).map(|place| (0..c).any(|camera| found[camera * k + place] != 0)).collect())
    }

    fn try_rays(&mut self, s: &Sighting) -> Result<Rays, GpuError> {
        if s.points.is_empty() || s.places.is_empty() {
            return Ok(Rays::default());
        }
        let n = s.points.len();
        let found: Vec<u32> = self.compute(s, Task::Pierce, &[(pass::PIERCE_POINTS, n, LANES)], ("fates", n))?;
        let count = |least: u32| found.iter().filter(|fate| **fate >= least).count();
        Ok(Rays { met: count(1), through: count(THROUGH) })
    }
}

/// A device's error, with the way out.
fn failure(e: GpuError) -> Failure {
    Failure::of_device(e.to_string(), e.hint())
}

impl Correspond for Correspondence {
    fn shares(&mut self, s: &Sighting, spread: f64, outliers: f64) -> Result<Vec<Share>, Failure> {
        self.try_shares(s, spread, outliers).map_err(failure)
    }

    fn visible(&mut self, s: &Sighting) -> Result<Vec<Vec<bool>>, Failure> {
        self.try_visible(s).map_err(failure)
    }

    fn read(&mut self, s: &Sighting) -> Result<Vec<bool>, Failure> {
        self.try_read(s).map_err(failure)
    }

    fn rays(&mut self, s: &Sighting) -> Result<Rays, Failure> {
        self.try_rays(s).map_err(failure)
    }
}

//! How large the noise of single readings is, from frames that show the same thing.
//!
//! Neighbouring pixels of a depth image may share their noise (a camera smooths), so that their differences show too little of it. Frames
//! of a body at rest do not share it. Second differences over three of them cancel what a model misses, and a slow drift.

use crate::laboratory::{Reading, Readings};
use crate::linear::quantile;
use crate::noise::MEDIAN;
use palpate_model::observation::Sensor;
use std::collections::BTreeMap;
use std::ops::Range;

/// Readings, one after another in the image, that are looked up together in another frame: a few rows of a small image.
const BLOCK: usize = 48;
/// By how many readings a block may be further on in the next frame than the one before it: so many come and go at a silhouette.
const SLIP: isize = 8;
/// Fewest blocks of an image from which its noise is estimated.
const FEWEST: usize = 2;
/// Share of a block's mean square that its mean may have. Noise that a few neighbours share has some tenths at most, motion nearly all.
const COMMON: f64 = 0.4;

/// Noise of single depth readings over the stated one; 1 where it is smaller, or where no three frames in a row show the same. `still` are
/// the frames of every scene up to the next of which the simulated body rests.
///
/// A body that rests in the simulation may move in truth: then whole blocks of pixels differ together, and are left out. The
/// images with the least noise decide, as with neighbours.
pub fn still_ratio(readings: &Readings, still: &[Vec<usize>]) -> f64 {
    let mut images: BTreeMap<(usize, u32, usize), Range<usize>> = BTreeMap::new();
    for (i, r) in readings.rows.iter().enumerate() {
        if let Sensor::Camera(camera) = r.row.source.sensor {
            images.entry((r.scene, camera, r.row.frame)).or_insert(i..i).end = i + 1;
        }
    }
    let mut ratios = Vec::new();
    for (&(scene, camera, frame), middle) in &images {
        let rests = |f: usize| still.get(scene).is_some_and(|s| s.contains(&f));
        if frame == 0 || !rests(frame - 1) || !rests(frame) {
            continue;
        }
        let of = |f: usize| images.get(&(scene, camera, f)).map(|r| &readings.rows[r.clone()]);
        if let (Some(before), Some(after)) = (of(frame - 1), of(frame + 1)) {
            ratios.extend(image_ratio(before, &readings.rows[middle.clone()], after));
        }
    }
    if ratios.is_empty() { 1.0 } else { quantile(&mut ratios, 0.25).sqrt().max(1.0) }
}

/// Variance of an image's noise over the stated one, from its second difference to the images before and after it.
fn image_ratio(before: &[Reading], image: &[Reading], after: &[Reading]) -> Option<f64> {
    let mut squares = Vec::new();
    let mut blocks = 0;
    let mut offsets = [0, 0];
    for (n, block) in image.chunks_exact(BLOCK).enumerate() {
        let first = (n * BLOCK) as isize;
        for (offset, other) in offsets.iter_mut().zip([before, after]) {
            *offset = follow(block, other, first, *offset);
        }
        let at =
            |other: &[Reading], offset: isize, k: usize| other.get(usize::try_from(first + offset + k as isize).ok()?).copied();
        let variance = |r: &Reading| (r.row.noise * r.row.along_sight).powi(2);
        let difference = |(k, b): (usize, &Reading)| {
            let (a, c) = (at(before, offsets[0], k)?, at(after, offsets[1], k)?);
            let d = a.row.value? - 2.0 * b.row.value? + c.row.value?;
            Some(d / (variance(&a) + 4.0 * variance(b) + variance(&c)).sqrt())
        };
        let all: Vec<f64> = block.iter().enumerate().filter_map(difference).collect();
        let count = all.len() as f64;
        let (mean, square) = (all.iter().sum::<f64>() / count, all.iter().map(|d| d * d).sum::<f64>() / count);
        if 2 * all.len() >= BLOCK && mean * mean <= COMMON * square {
            blocks += 1;
            squares.extend(all.iter().map(|d| d * d));
        }
    }
    // Most of the image must be at rest.
    let enough = blocks >= FEWEST && 2 * blocks * BLOCK >= image.len();
    enough.then(|| quantile(&mut squares, 0.5) / MEDIAN)
}

/// How many places further on a block that begins at `first` is found in another image: where its points lie nearest on the body.
fn follow(block: &[Reading], other: &[Reading], first: isize, near: isize) -> isize {
    let away = |offset: isize| {
        let start = usize::try_from(first + offset).ok()?;
        let there = other.get(start..start + block.len())?;
        Some(block.iter().zip(there).map(|(a, b)| a.row.rest.distance(b.row.rest)).sum::<f64>())
    };
    // The offset of the block before first: where nothing is nearer, it stays.
    let order = (0..=SLIP).flat_map(|s| if s == 0 { vec![near] } else { vec![near - s, near + s] });
    let found = order.filter_map(|o| Some((o, away(o)?)));
    found
        .fold(None, |best: Option<(isize, f64)>, x| if best.is_some_and(|b| b.1 <= x.1) { best } else { Some(x) })
        .map_or(near, |b| b.0)
}

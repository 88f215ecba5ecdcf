//! What a fitted model predicts of data that it was not fitted to: blocks of time, and cameras, left out one after the other.
//!
//! Around the optimum of all data, leaving some out moves the numbers by one Gauss–Newton step (the infinitesimal jackknife; Giordano
//! et al., *A Swiss Army infinitesimal jackknife*, AISTATS 2019), so that no fold needs a fit of its own.

use crate::cells::{Cells, Table};
use crate::laboratory::Readings;
use crate::linear::{dot, least_squares};
use crate::null::extended;
use palpate_engine::Source;
use palpate_model::observation::Sensor;

/// Blocks of time.
const FOLDS: usize = 5;
/// Prior on the change of every number, relative to the weight of the data: keeps what only the fold left out determines.
const RIDGE: f64 = 1e-4;

/// Predicted residuals.
#[derive(Clone, Debug, PartialEq)]
pub struct Predicted {
    /// Residuals of every cell, predicted without its fold, in units of the noise `[m]`.
    pub y: Vec<f64>,
    /// Root mean square distance of single points, predicted likewise [m].
    pub rms: f64,
    /// Sum of squares that the right model would leave: noise, and what nothing outside a fold tells of the fields inside.
    pub floor: f64,
}

impl Predicted {
    /// Sum of squares.
    pub fn loss(&self) -> f64 {
        self.y.iter().map(|y| y * y).sum()
    }
}

/// Ways to leave data out: by time, or by region of the body in a recording of one instant; and by camera where several saw the body.
pub fn foldings(cells: &Cells) -> Vec<Vec<usize>> {
    let mut out = vec![cells.time_blocks(FOLDS)];
    if out[0].iter().all(|f| *f == out[0][0]) {
        out[0] = cells.keys.iter().map(|k| k.region % FOLDS).collect();
    }
    let mut sensors: Vec<Sensor> = cells.keys.iter().map(|k| k.stream.sensor).collect();
    let all = sensors.clone();
    sensors.sort_unstable();
    sensors.dedup();
    if sensors.len() > 1 {
        // Many markers make few folds.
        out.push(all.iter().map(|s| sensors.partition_point(|x| x < s) % FOLDS).collect());
    }
    out
}

/// Predicts every fold from the others, for a model's readings and their table. Fields of errors `[fields][m]` are fitted along with
/// their prior N(0, 1), as they are part of every model's error.
pub fn predict(cells: &Cells, readings: &Readings, table: &Table, fields: &[Vec<f64>], folds: &[usize]) -> Predicted {
    let q = readings.columns;
    let all: Vec<&Vec<f64>> = table.columns.iter().chain(fields).collect();
    let (own, n) = (table.columns.len(), fields.len());
    let mut floor = cells.len() as f64;
    let mut y = table.y.clone();
    let mut moved = vec![vec![0.0; all.len()]; folds.iter().max().map_or(0, |f| f + 1)];
    for (fold, step) in moved.iter_mut().enumerate() {
        let keep = |v: &[f64]| -> Vec<f64> { v.iter().zip(folds).map(|(v, f)| if *f == fold { 0.0 } else { *v }).collect() };
        let mut columns: Vec<Vec<f64>> = all.iter().map(|c| extended(&keep(c), n)).collect();
        (0..n).for_each(|k| columns[own + k][cells.len() + k] = 1.0);
        for (f, c) in fields.iter().zip(&columns[own..]) {
            let hidden: f64 = f.iter().zip(folds).map(|(f, x)| if *x == fold { f * f } else { 0.0 }).sum();
            floor += hidden / dot(c, c);
        }
        let chosen: Vec<&[f64]> = columns.iter().map(Vec::as_slice).collect();
        if !all.is_empty()
            && let Some(x) = least_squares(&chosen, &extended(&keep(&table.y), n), RIDGE)
        {
            *step = x;
        }
        for i in (0..cells.len()).filter(|i| folds[*i] == fold) {
            y[i] += all.iter().zip(step.iter()).map(|(c, s)| c[i] * s).sum::<f64>();
        }
    }
    let at = |row: usize| {
        let r = &readings.rows[row];
        let change = cells.of(row).map_or(0.0, |c| {
            let d = &readings.sensitivity[row * q..(row + 1) * q];
            d.iter().zip(&moved[folds[c]]).map(|(d, s)| d * s).sum()
        });
        r.row.value.map(|v| v + change)
    };
    Predicted { y, floor, rms: rms((0..readings.rows.len()).map(|i| (readings.rows[i].row.source, at(i)))) }
}

/// Root mean square distance of depth points and markers.
pub fn rms(values: impl Iterator<Item = (Source, Option<f64>)>) -> f64 {
    let (mut sum, mut n) = (0.0, 0.0);
    for (source, v) in values {
        if let Some(v) = v {
            sum += v * v;
            // A marker is one distance of three coordinates.
            n += source.share();
        }
    }
    (sum / f64::max(n, 1.0)).sqrt()
}

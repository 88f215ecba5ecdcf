//! A fitted model as the linear one that is judged: what moves its residuals, and how far before any reading.

use super::State;
use crate::cells::{Cells, Table};
use crate::judgement::density::{Blocks, Linear};
use crate::laboratory::{Field, Model, Readings};
use crate::linear::{dot, least_squares};
use faer::Mat;

/// Standard errors of a number, by its own data alone, that its prior spans where nothing is known beforehand: it is left to the data, and what
/// only one fold tells of is not predicted to be anything.
const WIDE: f64 = 100.0;

/// Ridge that keeps numbers apart of which the readings cannot tell: rounding of their squares, no more.
const SINGULAR: f64 = 1e-9;

/// One thing that moves residuals: its mean and standard deviation before any reading, in units of its column.
#[derive(Clone, Copy)]
struct Mover {
    mean: f64,
    sd: f64,
    known: bool,
}

/// Of every number of a model, by its own columns.
fn numbers(model: &Model, table: &Table) -> Vec<Mover> {
    let number = |(k, c): (usize, &Vec<f64>)| match model.numbers[k].known {
        Some((value, sd)) => Mover { mean: value - model.values[k], sd, known: true },
        None => wide(c),
    };
    table.columns.iter().enumerate().map(number).collect()
}

fn wide(column: &[f64]) -> Mover {
    let size = dot(column, column).sqrt();
    Mover { mean: 0.0, sd: if size > 0.0 { WIDE / size } else { 0.0 }, known: false }
}

fn field(f: &Field) -> Mover {
    Mover { mean: f.times.0, sd: f.times.1, known: true }
}

impl Mover {
    /// Takes its mean into residuals, and gives its column.
    fn apply(self, y: &mut [f64], column: &[f64]) -> Vec<f64> {
        y.iter_mut().zip(column).for_each(|(y, c)| *y += self.mean * c);
        column.iter().map(|c| -self.sd * c).collect()
    }
}

/// A model's residuals around its fit, in cells.
pub(super) fn around(cells: &Cells, blocks: &Blocks, state: &State) -> Linear {
    let mut out = Linear { y: state.table.y.clone(), ..Linear::default() };
    for (m, c) in numbers(&state.model, &state.table).into_iter().zip(&state.table.columns) {
        let column = m.apply(&mut out.y, c);
        out.moves.push(column);
        out.known.push(m.known);
    }
    out.unmet = vec![0.0; cells.len()];
    for (by, c) in state.unmet.iter().zip(&state.table.columns) {
        out.unmet.iter_mut().zip(c).for_each(|(u, c)| *u -= by * c);
    }
    for f in &state.fields {
        let change = cells.means(&f.change);
        let column = field(f).apply(&mut out.y, &change);
        out.moves.push(column);
        out.known.push(true);
        out.rough.extend(rough(f, &change, blocks));
    }
    out
}

/// By how much the cost's sensitivities would still move each number of a model, were all of them linear and without bounds: by nothing where its
/// fit has arrived. Numbers that are known beforehand stay: their optimum is not the readings' alone.
pub(super) fn unmet(model: &Model, readings: &Readings) -> Vec<f64> {
    let free: Vec<usize> = (0..readings.columns).filter(|k| model.numbers[*k].known.is_none()).collect();
    let mut columns: Vec<Vec<f64>> = vec![Vec::new(); free.len()];
    let mut y = Vec::new();
    for (i, r) in readings.rows.iter().enumerate() {
        let Some(value) = r.row.value else { continue };
        let root = r.row.weight.sqrt() / r.row.noise;
        y.push(root * value);
        columns.iter_mut().zip(&free).for_each(|(c, k)| c.push(root * readings.sensitivity[i * readings.columns + k]));
    }
    let chosen: Vec<&[f64]> = columns.iter().map(Vec::as_slice).collect();
    let mut out = vec![0.0; readings.columns];
    let moves = least_squares(&chosen, &y, SINGULAR).unwrap_or_default();
    free.into_iter().zip(moves).for_each(|(k, by)| out[k] = by);
    out
}

/// A model's numbers as all of it says: corrected by what errors of grid and step and of the sensors make of them, and standard errors that
/// hold noise, these errors and a discrepancy of this size; no error where nothing is read of a number.
pub(super) fn stated(state: &State, own: &Linear, blocks: &Blocks, size: f64) -> (Vec<f64>, Vec<Option<f64>>) {
    let (mean, factor) = own.posterior(blocks, size);
    let number = |(k, m): (usize, Mover)| {
        let share = (0..factor.ncols()).map(|j| factor[(k, j)].powi(2)).sum::<f64>().sqrt();
        (state.model.values[k] + m.mean + m.sd * mean[k], (m.sd > 0.0).then_some(m.sd * share))
    };
    numbers(&state.model, &state.table).into_iter().enumerate().map(number).unzip()
}

/// What of a field is not known, anew in every block: how much of it there is, and that an error of its size may be elsewhere in the block,
/// for one refinement tells of sizes more than of shapes.
fn rough(f: &Field, change: &[f64], blocks: &Blocks) -> Vec<Vec<f64>> {
    if f.rough == 0.0 {
        return Vec::new();
    }
    let times = |column: &[f64]| column.iter().map(|c| f.rough * c).collect();
    vec![times(change), times(&blocks.size(change))]
}

/// Residuals of a second recording, after the first one `taught` what it knows of the model's numbers and of the errors of grid and step, which
/// are the same ones there. Numbers that belong to the second recording were fitted to it, and are free.
pub(super) fn elsewhere(
    cells: &Cells,
    blocks: &Blocks,
    readings: &Readings,
    state: &State,
    taught: &(Vec<f64>, Mat<f64>),
) -> Linear {
    let table = cells.table(readings, None);
    let mut out = Linear { y: table.y.clone(), ..Linear::default() };
    let first = state.model.values.len();
    let mut shared: Vec<Vec<f64>> = Vec::new();
    for (m, c) in numbers(&state.model, &state.table).into_iter().zip(&table.columns) {
        shared.push(m.apply(&mut out.y, c));
    }
    let mut open: Vec<&Field> = state.held_out_finer.iter().collect();
    for f in &state.fields {
        let there = open.iter().position(|o| o.name == f.name && o.times == f.times).map(|at| open.remove(at));
        shared.push(there.map_or(vec![0.0; cells.len()], |o| field(o).apply(&mut out.y, &cells.means(&o.change))));
    }
    for f in open {
        let column = field(f).apply(&mut out.y, &cells.means(&f.change));
        out.moves.push(column);
        out.known.push(true);
    }
    for c in table.columns.iter().skip(first) {
        let column = wide(c).apply(&mut out.y, c);
        out.moves.push(column);
        out.known.push(false);
    }
    out.rough = state.held_out_finer.iter().flat_map(|f| rough(f, &cells.means(&f.change), blocks)).collect();
    out.taught(&shared, taught)
}

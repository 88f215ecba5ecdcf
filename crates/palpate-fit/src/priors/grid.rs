//! Hyperparameters that are tried: lengths from two neighbours to the whole body, deviations from 5 % to a factor of five.

use super::{FieldPrior, Hyper};
use palpate_model::params::fields::PriorKind;
use palpate_model::space::neighbours::Neighbours;

/// Number of lengths.
const LENGTHS: usize = 7;
/// Deviations of logarithms.
const DEVIATIONS: [f64; 6] = [0.05, 0.1, 0.2, 0.4, 0.8, 1.6];

/// Lengths and deviations of a prior that may be chosen; what is stated stands alone.
pub(super) fn tried(prior: &FieldPrior) -> (Vec<f64>, Vec<f64>) {
    let lengths = match (prior.kind, prior.length) {
        (PriorKind::EdgePreserving, _) => vec![0.0],
        (_, Some(length)) => vec![length],
        (_, None) => {
            let (low, high) = (2.0 * spacing(&prior.around), extent(&prior.around));
            let ratio = (high / low).max(1.0).powf(1.0 / (LENGTHS - 1) as f64);
            (0..LENGTHS).map(|k| low * ratio.powi(k as i32)).collect()
        }
    };
    (lengths, prior.deviation.map_or(DEVIATIONS.to_vec(), |d| vec![d]))
}

/// Those that a search begins with.
pub(super) fn first(prior: &FieldPrior) -> Hyper {
    let (lengths, deviations) = tried(prior);
    Hyper { length: lengths[lengths.len() / 2], deviation: deviations[deviations.len() / 2] }
}

/// Median distance of neighbours.
fn spacing(around: &Neighbours) -> f64 {
    let mut all: Vec<f64> = around.links.iter().map(|l| l.distance).collect();
    all.sort_by(f64::total_cmp);
    all.get(all.len() / 2).copied().unwrap_or(1.0)
}

/// About the longest way between two values along links: from the value farthest from the first to the one farthest from that.
fn extent(around: &Neighbours) -> f64 {
    let farthest = |from: usize| {
        let ways = ways(around, from);
        (0..ways.len())
            .filter(|k| ways[*k].is_finite())
            .map(|k| (k, ways[k]))
            .max_by(|a, b| a.1.total_cmp(&b.1))
            .unwrap_or((0, 1.0))
    };
    farthest(farthest(0).0).1
}

/// Shortest ways from a value to all others along links (Dijkstra).
fn ways(around: &Neighbours, from: usize) -> Vec<f64> {
    use std::cmp::Reverse;
    use std::collections::BinaryHeap;
    let n = around.volume.len();
    let mut beside = vec![Vec::new(); n];
    for l in &around.links {
        beside[l.a as usize].push((l.b as usize, l.distance));
        beside[l.b as usize].push((l.a as usize, l.distance));
    }
    let mut ways = vec![f64::INFINITY; n];
    ways[from] = 0.0;
    // Positive numbers are in the order of their bits.
    let mut open = BinaryHeap::from([(Reverse(0u64), from)]);
    while let Some((Reverse(bits), at)) = open.pop() {
        if f64::from_bits(bits) > ways[at] {
            continue;
        }
        for (next, distance) in &beside[at] {
            let way = ways[at] + distance;
            if way < ways[*next] {
                ways[*next] = way;
                open.push((Reverse(way.to_bits()), *next));
            }
        }
    }
    ways
}

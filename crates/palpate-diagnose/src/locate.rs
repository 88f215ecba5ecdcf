//! Where and when residuals carry more than the null explains: blocks by false-discovery rate, joined and put into words.

use crate::cells::Cells;
use crate::laboratory::Setting;
use crate::null::Block;
use glam::DVec3;
use statrs::distribution::{ContinuousCDF, Normal};

/// False-discovery rate of blocks (Benjamini & Hochberg, *J. R. Stat. Soc. B* 57, 1995).
const RATE: f64 = 0.01;

/// A place where something is missing.
#[derive(Clone, Debug, PartialEq)]
pub struct Place {
    /// Scene.
    pub scene: usize,
    /// First and last time [s].
    pub time: (f64, f64),
    /// In words.
    pub region: String,
    /// Share of the whole excess.
    pub share: f64,
    /// Smallest adjusted p-value of its blocks.
    pub p_value: f64,
}

/// Places of a model's excess, the largest share first.
pub fn locate(cells: &Cells, blocks: &[Block], setting: &Setting) -> Vec<Place> {
    let normal = Normal::standard();
    let p: Vec<f64> = blocks.iter().map(|b| 2.0 * normal.sf(b.z.abs())).collect();
    let mut order: Vec<usize> = (0..p.len()).collect();
    order.sort_by(|a, b| p[*a].total_cmp(&p[*b]));
    // Adjusted p-values: running minimum of p n / rank from the largest down.
    let mut adjusted = vec![1.0; p.len()];
    let mut least: f64 = 1.0;
    for (rank, &i) in order.iter().enumerate().rev() {
        least = least.min(p[i] * p.len() as f64 / (rank + 1) as f64);
        adjusted[i] = least;
    }
    let excess: Vec<f64> = blocks.iter().map(|b| (b.z * b.z - 1.0).max(0.0)).collect();
    let total: f64 = excess.iter().sum::<f64>().max(1e-300);
    let mut open: Vec<usize> = order.into_iter().filter(|i| adjusted[*i] < RATE).collect();
    // Regions closer than twice the distance of nearest neighbours touch each other.
    let centers = &cells.regions.centers;
    let nearest = |r: usize| {
        let others = (0..centers.len()).filter(|o| *o != r).map(|o| centers[o].distance(centers[r]));
        others.fold(f64::INFINITY, f64::min)
    };
    let reach = 1.6 * (0..centers.len()).map(nearest).sum::<f64>() / centers.len().max(1) as f64;
    let touch = |a: usize, b: usize| {
        let (a, b) = (&blocks[a], &blocks[b]);
        a.scene == b.scene
            && a.time.abs_diff(b.time) <= 1
            && (a.region == b.region || centers[a.region].distance(centers[b.region]) < reach)
    };
    let mut out = Vec::new();
    while let Some(seed) = open.first().copied() {
        open.remove(0);
        let mut members = vec![seed];
        let mut k = 0;
        while k < members.len() {
            let at = members[k];
            let (near, far): (Vec<usize>, Vec<usize>) = open.into_iter().partition(|o| touch(at, *o));
            members.extend(near);
            open = far;
            k += 1;
        }
        let times = members.iter().flat_map(|b| &blocks[*b].cells).map(|c| cells.times[*c]);
        let (from, to) = times.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), t| (a.min(t), b.max(t)));
        let mut regions: Vec<usize> = members.iter().map(|b| blocks[*b].region).collect();
        regions.sort_unstable();
        regions.dedup();
        let scene = blocks[seed].scene;
        let places: Vec<DVec3> = regions.iter().map(|r| centers[*r]).collect();
        out.push(Place {
            scene,
            time: (from, to),
            region: words(&places, centers.len(), (from, to), scene, setting),
            share: members.iter().map(|b| excess[*b]).sum::<f64>() / total,
            p_value: members.iter().map(|b| adjusted[*b]).fold(1.0, f64::min),
        });
    }
    out.sort_by(|a, b| b.share.total_cmp(&a.share));
    out
}

/// The axes that a vector points along, "+x, -z": components of at least a third of the largest, the largest first; "nowhere" for zero.
pub fn direction(v: DVec3) -> String {
    let mut axes: Vec<(f64, &str)> = v.to_array().into_iter().zip(["x", "y", "z"]).collect();
    axes.sort_by(|a, b| b.0.abs().total_cmp(&a.0.abs()));
    let least = axes[0].0.abs() / 3.0;
    let sign = |c: f64| if c > 0.0 { "+" } else { "-" };
    let named: Vec<String> =
        axes.iter().filter(|(c, _)| c.abs() >= least && *c != 0.0).map(|(c, a)| format!("{}{a}", sign(*c))).collect();
    if named.is_empty() { "nowhere".into() } else { named.join(", ") }
}

/// "lower side, x < 0.02 m, while touching the ground, from 0.31 s".
fn words(places: &[DVec3], of: usize, time: (f64, f64), scene: usize, setting: &Setting) -> String {
    let mut parts = Vec::new();
    let (low, high) = setting.bounds;
    let (center, half) = (0.5 * (low + high), 0.5 * (high - low));
    if 10 * places.len() >= 9 * of {
        parts.push("whole surface".to_string());
    } else {
        let side = |a: DVec3| {
            places.iter().map(|p| (*p - center).dot(a)).fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), s| (l.min(s), h.max(s)))
        };
        let up = setting.up;
        let reach = (half * up).abs().element_sum();
        let (l, h) = side(up);
        if h < 0.1 * reach {
            parts.push("lower side".into());
        } else if l > -0.1 * reach {
            parts.push("upper side".into());
        }
        for (axis, name) in [DVec3::X, DVec3::Y, DVec3::Z].into_iter().zip(["x", "y", "z"]) {
            if axis.dot(up).abs() > 0.9 {
                continue;
            }
            let (l, h) = side(axis);
            let (at, reach) = (center.dot(axis), half.dot(axis));
            if h < 0.35 * reach {
                parts.push(format!("{name} < {:.3} m", at + h + 0.15 * reach));
            } else if l > -0.35 * reach {
                parts.push(format!("{name} > {:.3} m", at + l - 0.15 * reach));
            }
        }
        if parts.is_empty() {
            parts.push(format!("{} of {of} regions of the surface", places.len()));
        }
    }
    if let Some(contact) = setting.contact.get(scene).filter(|c| !c.is_empty()) {
        let overlap: f64 = contact.iter().map(|c| (c.1.min(time.1) - c.0.max(time.0)).max(0.0)).sum();
        let span = (time.1 - time.0).max(1e-12);
        if overlap > 0.8 * span {
            parts.push("while touching the ground".into());
        } else if time.1 < contact[0].0 {
            parts.push("before the ground is touched".into());
        } else if time.0 >= contact[0].0 {
            parts.push("after the first contact".into());
        }
    }
    parts.push(format!("from {:.3} s", time.0));
    parts.join(", ")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::laboratory::Laboratory;
    use crate::tests::bench::Bench;

    /// Words for places [cm] on a ball of 5 cm about the origin that touches the ground from 0.5 s to 0.8 s, out of 20 regions.
    fn said(places: &[[f64; 3]], time: (f64, f64)) -> String {
        let setting = Bench::new(1, &[], false).setting().clone();
        let places: Vec<DVec3> = places.iter().map(|p| 0.01 * DVec3::from_array(*p)).collect();
        words(&places, 20, time, 0, &setting)
    }

    #[test]
    fn places_are_put_into_words() {
        let low = [[3.0, 0.0, -4.0], [-3.0, 0.0, -4.0], [0.0, 4.0, -3.0], [0.0, -4.0, -3.0]];
        assert_eq!(said(&low, (0.55, 0.78)), "lower side, while touching the ground, from 0.550 s");
        let high = low.map(|p| p.map(|x| -x));
        assert_eq!(said(&high, (0.1, 0.4)), "upper side, before the ground is touched, from 0.100 s");
        // Regions have a size: 0.15 of the radius beside their middles.
        let right = [[4.5, 0.0, 2.0], [4.0, 2.0, -2.0], [4.0, -2.0, 0.0]];
        assert_eq!(said(&right, (0.6, 1.0)), "x > 0.033 m, after the first contact, from 0.600 s");
        let left = [[0.0, -4.5, 2.0], [2.0, -4.0, -2.0], [-2.0, -4.0, 0.0]];
        assert_eq!(said(&left, (0.6, 1.0)), "y < -0.033 m, after the first contact, from 0.600 s");
        let around = [[5.0, 0.0, 0.0], [-5.0, 0.0, 0.0], [0.0, 5.0, 3.0], [0.0, -5.0, -3.0]];
        // Neither before nor after the contact, and not during most of it.
        assert_eq!(said(&around, (0.2, 0.9)), "4 of 20 regions of the surface, from 0.200 s");
        assert_eq!(said(&[[5.0, 0.0, 0.0]; 18], (0.0, 1.0)), "whole surface, from 0.000 s");
    }

    #[test]
    fn directions_name_the_axes_that_count() {
        assert_eq!(direction(DVec3::new(2.0, 0.1, -1.0)), "+x, -z");
        assert_eq!(direction(DVec3::new(0.0, -1.0, 0.2)), "-y");
        assert_eq!(direction(DVec3::ZERO), "nowhere");
    }
}

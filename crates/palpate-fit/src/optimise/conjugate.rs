//! A damped Gauss–Newton step by conjugate gradients, from products with the matrix alone (Steihaug 1983; Toint 1981).
//!
//! Every iterate lowers the model, so that the iteration may end early: at the longest step, or when the residual is small enough for
//! the step to count (forcing terms of Eisenstat & Walker 1996 grow tighter as the gradient falls). A bound that is met holds its
//! parameter for the rest of the step, and the iteration starts anew on the others.

use super::metric::Metric;
use super::{Search, Stop};
use crate::dense::dot;

/// Most products for one step.
const MOST_PRODUCTS: usize = 200;
/// Largest residual of the linear system, relative to the gradient.
const LOOSEST: f64 = 0.1;

/// The damped quadratic model at a point.
pub(super) struct Model<'a> {
    /// The point `[q]`.
    pub z: &'a [f64],
    /// Gradient of the cost there `[q]`.
    pub gradient: &'a [f64],
    /// Added to the diagonal.
    pub damping: f64,
    /// Longest step along any axis.
    pub longest: f64,
    /// Length of the gradient at the start of the search.
    pub steepest: f64,
    /// How steps are measured.
    pub metric: &'a Metric,
}

/// A step `[q]` that lowers the model within the box and the longest step, and the decrease that the undamped model promises.
pub(super) fn step(search: &mut Search, model: &Model) -> Result<(Vec<f64>, f64), Stop> {
    let (z, g, q) = (model.z, model.gradient, model.z.len());
    // With a prior what the data do not see moves along with its neighbours.
    let moves = |g: f64| g == 0.0 && !matches!(model.metric, Metric::Plain);
    let mut free: Vec<bool> = search.projected_gradient(z, g).iter().zip(g).map(|(p, g)| *p != 0.0 || moves(*g)).collect();
    let (mut p, mut hp) = (vec![0.0; q], vec![0.0; q]);
    let mut r = g.to_vec();
    let mut direction: Option<(Vec<f64>, f64)> = None;
    // M⁻¹ r among those that no bound holds.
    let conditioned = |r: &[f64], free: &[bool]| match model.metric {
        Metric::Plain => r.to_vec(),
        metric => metric.solve(&r.iter().zip(free).map(|(r, f)| if *f { *r } else { 0.0 }).collect::<Vec<_>>()),
    };
    let length = inner(&r, &conditioned(&r, &free), &free).sqrt();
    let small = length * LOOSEST.min((length / model.steepest.max(f64::MIN_POSITIVE)).sqrt());
    for _ in 0..MOST_PRODUCTS {
        let s = conditioned(&r, &free);
        let rr = inner(&r, &s, &free);
        if rr.sqrt() <= small {
            break;
        }
        let mut d: Vec<f64> = (0..q).map(|i| if free[i] { -s[i] } else { 0.0 }).collect();
        if let Some((last, before)) = &direction {
            d.iter_mut().zip(last).for_each(|(d, l)| *d += rr / before * l);
        }
        let hd = search.product(z, &d)?;
        let md = model.metric.times(&d);
        let curvature = dot(&d, &hd) + model.damping * dot(&d, &md);
        let wanted = if curvature > 0.0 { -inner(&r, &d, &free) / curvature } else { f64::INFINITY };
        let (room, end) = room(search, model, &p, &d);
        let t = wanted.min(room);
        if !t.is_finite() {
            break;
        }
        for i in 0..q {
            p[i] += t * d[i];
            hp[i] += t * hd[i];
            r[i] += t * (hd[i] + model.damping * md[i]);
        }
        direction = Some((d, rr));
        match end {
            _ if wanted < room => {}
            End::Longest => break,
            End::Bound(i) => {
                free[i] = false;
                direction = None;
            }
        }
    }
    let promised = -dot(g, &p) - 0.5 * dot(&p, &hp);
    Ok((p, promised))
}

fn inner(a: &[f64], b: &[f64], free: &[bool]) -> f64 {
    a.iter().zip(b).zip(free).filter(|(_, f)| **f).map(|((a, b), _)| a * b).sum()
}

/// What ends a way.
enum End {
    /// The longest step.
    Longest,
    /// The bound of a parameter.
    Bound(usize),
}

/// How far the step `p` can go along `d`, and what stops it there.
fn room(search: &Search, model: &Model, p: &[f64], d: &[f64]) -> (f64, End) {
    let (mut least, mut end) = (f64::INFINITY, End::Longest);
    for (i, d) in d.iter().enumerate().filter(|(_, d)| **d != 0.0) {
        let bound = if *d < 0.0 { search.lower[i] } else { search.upper[i] } - model.z[i];
        let (to_bound, to_longest) = ((bound - p[i]) / d, (d.signum() * model.longest - p[i]) / d);
        if to_bound.min(to_longest) < least {
            least = to_bound.min(to_longest).max(0.0);
            end = if to_bound <= to_longest { End::Bound(i) } else { End::Longest };
        }
    }
    (least, end)
}

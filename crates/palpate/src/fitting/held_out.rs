//! Frames that a fit does not see: how far it is from them, and how far is who knows less.

use crate::engine::Backend;
use crate::error::Error;
use crate::experiment::Experiment;
use crate::fitting::total;
use crate::residuals::ResidualSummary;
use glam::DVec3;
use palpate_engine::Stop;
use palpate_model::observation::Observation;
use palpate_model::params::ParamKey;

/// Distances from the frames that a fit sees, or from those that it does not [m].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Distances {
    /// Number of frames, over all scenes.
    pub frames: usize,
    /// Root mean square distance of the readings from the simulation with the values found.
    pub rms: f64,
    /// The same from the body at rest; `None` where readings have no place of their own in it (depth).
    pub rest: Option<f64>,
    /// The same from a body that does not move: every point stays in the middle of where the fit saw it.
    pub unmoved: Option<f64>,
}

/// What a fit makes of the frames that it saw, and of those that it did not.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HeldOut {
    /// Those that it saw.
    pub train: Distances,
    /// Those that it did not see.
    pub test: Distances,
}

impl HeldOut {
    /// In a sentence, without its end.
    pub fn sentence(&self) -> String {
        let mm = |x: f64| format!("{:.3} mm", 1e3 * x);
        let against = |d: &Distances| {
            let known = [(d.unmoved, "does not move"), (d.rest, "stays at rest")];
            let all = known.iter().filter_map(|(x, what)| x.map(|x| format!("{} of a body that {what}", mm(x))));
            all.collect::<Vec<_>>().join(", ")
        };
        let one = |d: &Distances, what: &str| {
            let more = against(d);
            format!(
                "{} from the {} frames {what}{}",
                mm(d.rms),
                d.frames,
                if more.is_empty() { more } else { format!(" ({more})") }
            )
        };
        format!("{}; {}", one(&self.train, "of the fit"), one(&self.test, "that it did not see"))
    }
}

/// Sums over readings of one part of the frames.
#[derive(Clone, Copy, Debug, Default)]
struct Sums {
    count: usize,
    squares: f64,
}

impl Sums {
    fn add(&mut self, distance: DVec3) {
        self.count += 1;
        self.squares += distance.length_squared();
    }

    fn rms(self) -> Option<f64> {
        (self.count > 0).then(|| (self.squares / self.count as f64).sqrt())
    }
}

/// Compares the values found, θ `[P]` of every scene, with the frames that the fit did not see; `None` where it saw all, or where none are left.
/// `after` is what remained of those that it saw.
///
/// # Errors
/// A simulation of the others fails.
pub(crate) fn held_out(
    experiments: &[Experiment],
    theta: &[Vec<f64>],
    after: &[ResidualSummary],
    backend: Backend,
) -> Result<Option<HeldOut>, Error> {
    let others: Vec<Option<Experiment>> = experiments.iter().map(Experiment::of_other_frames).collect::<Result<_, _>>()?;
    let mut tested = Vec::new();
    let (mut rest, mut unmoved) = ([Sums::default(); 2], [Sums::default(); 2]);
    let mut frames = [0; 2];
    for ((e, other), theta) in experiments.iter().zip(&others).zip(theta) {
        let Some(other) = other else { continue };
        let mut theta = theta.clone();
        let plan = other.plan();
        if let Some(first) = plan.times.first() {
            // A sequence of other states begins at another time.
            theta[plan.layout.index(ParamKey::TimeStart)] = *first;
        }
        tested.push(ResidualSummary::new(other, backend, &theta, &Stop::default())?);
        let middles = middles(&e.plan().observation);
        for (part, of) in [e, other].into_iter().enumerate() {
            let (o, nodes) = (&of.plan().observation, &of.plan().body.nodes);
            frames[part] += o.frames.len();
            for m in o.frames.iter().flat_map(|f| &f.markers) {
                let site = &o.markers[m.site as usize];
                rest[part].add(m.position - site.stencil.get().at(nodes) - site.stalk);
                if let Some(middle) = middles[m.site as usize] {
                    unmoved[part].add(m.position - middle);
                }
            }
        }
    }
    if tested.is_empty() {
        return Ok(None);
    }
    let distances = |part: usize, all: &[ResidualSummary]| Distances {
        frames: frames[part],
        rms: total(all, |r| r.rms),
        rest: rest[part].rms(),
        unmoved: unmoved[part].rms(),
    };
    let seen: Vec<ResidualSummary> = others.iter().zip(after).filter(|(o, _)| o.is_some()).map(|(_, r)| r.clone()).collect();
    Ok(Some(HeldOut { train: distances(0, &seen), test: distances(1, &tested) }))
}

/// Mean position of every site over the frames of an observation [m].
fn middles(o: &Observation) -> Vec<Option<DVec3>> {
    let mut sums = vec![(DVec3::ZERO, 0usize); o.markers.len()];
    for m in o.frames.iter().flat_map(|f| &f.markers) {
        let sum = &mut sums[m.site as usize];
        *sum = (sum.0 + m.position, sum.1 + 1);
    }
    sums.into_iter().map(|(sum, n)| (n > 0).then(|| sum / n as f64)).collect()
}

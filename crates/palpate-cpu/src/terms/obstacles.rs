//! Contact with rigid obstacles that move: the law of planes, with the obstacle's signed distance as the gap.
//!
//! As there, the pressure is the mean over the last part of the way from the old gap to the new one. Each gap is taken where the obstacle is at
//! its own time. The pressure acts along the distance's gradient at the new place. That is the gradient of a potential, so the tangent is
//! symmetric; it has a part from the obstacle's curvature, which Newton's method leaves out where it would make the matrix indefinite.

use super::{Context, Curvature, Forces, PastChange, PastGradient, Term};
use crate::linear::matrix::Matrix;
use glam::{DMat3, DVec3};
use palpate_model::effects::Site;
use palpate_model::effects::obstacle::{OFFSET, STIFFNESS};
use palpate_model::mechanics::contact;
use palpate_model::mechanics::distance_grid::{Distance, DistanceGrid};
use palpate_model::mechanics::motion::Pose;
use palpate_model::params::coefficients::{Coefficients, Sought};
use palpate_model::plan::{Physics, Plan};
use palpate_model::space::body::Body;
use palpate_model::space::stencil::Stencil;

/// The obstacles of a member.
pub struct Obstacles<'a> {
    c: Context<'a>,
    all: Vec<Now<'a>>,
}

/// An obstacle within a solve.
struct Now<'a> {
    /// Number of the effect.
    effect: usize,
    distance: &'a DistanceGrid,
    /// Where it is in the new and in the old state, its offset included.
    poses: [Pose; 2],
    stiffness: f64,
}

/// A gap in the world, with derivatives by place and time.
#[derive(Clone, Copy)]
struct Gap {
    value: f64,
    normal: DVec3,
    hessian: DMat3,
    /// ∂gap/∂t [m/s] and ∂normal/∂t [1/s] at a fixed place.
    rate: f64,
    turning: DVec3,
}

/// A patch that feels an obstacle: sums over the instants of [`contact::instants`].
struct Touch<'s> {
    patch: usize,
    place: Stencil<'s>,
    area: f64,
    /// Pressure [Pa] for a stiffness of 1 Pa/m, and its derivatives by the new and the old gap.
    pressure: f64,
    slopes: [f64; 2],
    energy: f64,
    /// New and old.
    gaps: [Gap; 2],
}

impl Now<'_> {
    fn gap(&self, pose: &Pose, x: DVec3) -> Gap {
        let (r, away) = (pose.rotation, x - pose.translation);
        let Distance { value, gradient, hessian } = self.distance.at(r.transpose() * away);
        let local = pose.rotation_rate.transpose() * away - r.transpose() * pose.velocity;
        Gap {
            value,
            normal: r * gradient,
            hessian: r * hessian * r.transpose(),
            rate: gradient.dot(local),
            turning: pose.rotation_rate * gradient + r * (hessian * local),
        }
    }
}

impl<'a> Now<'a> {
    /// Those of a member, in the new and the old state at `times` [s].
    fn all(plan: &'a Plan, physics: &Physics, times: [f64; 2]) -> Vec<Now<'a>> {
        let mut all = Vec::new();
        for (effect, (law, _)) in plan.layout.effects().enumerate() {
            let moving = plan.moving.get(effect).and_then(Option::as_ref);
            let (Site::Obstacle, Some(moving)) = (&law.site, moving) else { continue };
            let Some(shape) = &moving.shape else { continue };
            let values = &physics.effects[effect];
            let offset = DVec3::from_slice(&values[OFFSET..OFFSET + 3]);
            let poses = times.map(|time| {
                let pose = moving.motion.pose(time);
                Pose { translation: pose.translation + offset, ..pose }
            });
            all.push(Now { effect, distance: &shape.distance, poses, stiffness: values[STIFFNESS] });
        }
        all
    }

    /// Patches that feel it in a solve with weight `theta` of the new state, from the old displacement in `u` to the new one before it.
    fn touches<'s>(&'s self, body: &'s Body, theta: f64, [u1, u0]: [&'s [DVec3]; 2]) -> impl Iterator<Item = Touch<'s>> {
        let width = contact::WIDTH * body.length;
        let (instants, along) = (contact::instants(theta), contact::acts_along(theta));
        body.pieces().enumerate().filter_map(move |(number, (patch, place))| {
            let at = |u: &[DVec3], pose| self.gap(pose, patch.point + place.at(u));
            let new = at(u1, &self.poses[0]);
            let old = if along { at(u0, &self.poses[1]) } else { new };
            if new.value.min(old.value) >= width {
                return None;
            }
            let (area, gaps) = (patch.area, [new, old]);
            let mut t = Touch { patch: number, place, area, pressure: 0.0, slopes: [0.0; 2], energy: 0.0, gaps };
            for (weight, at) in instants.into_iter().filter(|i| i.0 > 0.0) {
                let gap = new.value + (1.0 - at) * (old.value - new.value);
                let (pressure, slope) = contact::pressure(gap, 1.0, width);
                t.pressure += weight * pressure;
                t.slopes[0] += weight * at * slope;
                t.slopes[1] += weight * (1.0 - at) * slope;
                t.energy += weight / at * contact::energy(gap, 1.0, width);
            }
            (t.energy > 0.0).then_some(t)
        })
    }
}

/// Forces of a scene's obstacles on a body at rest with displacement `u` `[N]` [m] at `time` [s], one for each obstacle [N].
pub fn forces(plan: &Plan, physics: &Physics, time: f64, u: &[DVec3]) -> Vec<DVec3> {
    let of = |now: &Now| now.touches(&plan.body, 1.0, [u; 2]).map(|t| t.force(now.stiffness)).sum();
    Now::all(plan, physics, [time; 2]).iter().map(of).collect()
}

impl<'a> Obstacles<'a> {
    /// Those that a member has; `None` without any.
    pub fn new(c: Context<'a>) -> Option<Obstacles<'a>> {
        let all = Now::all(c.plan, c.physics(), [c.time, c.time - c.length()]);
        (!all.is_empty()).then_some(Obstacles { c, all })
    }

    /// Patches that feel an obstacle.
    fn touches<'s>(&'s self, now: &'s Now<'a>, u1: &'s [DVec3]) -> impl Iterator<Item = Touch<'s>> {
        now.touches(&self.c.plan.body, self.c.weights.new, [u1, self.c.past.u])
    }

    fn force(&self, u1: &[DVec3], out: &mut [DVec3]) {
        for now in &self.all {
            for t in self.touches(now, u1) {
                t.place.spread(-t.force(now.stiffness), out);
            }
        }
    }
}

impl Touch<'_> {
    /// Force on the patch [N].
    fn force(&self, stiffness: f64) -> DVec3 {
        stiffness * self.area * self.pressure * self.gaps[0].normal
    }

    /// Change of the force on the patch over −stiffness · area, for changes of the new and old gap and of the new normal.
    fn change(&self, [new, old]: [f64; 2], normal: DVec3) -> DVec3 {
        (self.slopes[0] * new + self.slopes[1] * old) * self.gaps[0].normal + self.pressure * normal
    }

    /// That for a shift of the obstacle.
    fn shifted(&self, d: DVec3) -> DVec3 {
        let [new, old] = &self.gaps;
        self.change([-new.normal.dot(d), -old.normal.dot(d)], -(new.hessian * d))
    }

    /// That for a later time.
    fn later(&self) -> DVec3 {
        let [new, old] = &self.gaps;
        self.change([new.rate, old.rate], new.turning)
    }
}

impl Term for Obstacles<'_> {
    fn residual(&mut self, u1: &[DVec3], out: &mut [DVec3]) {
        self.force(u1, out);
    }

    fn potential(&self, u1: &[DVec3]) -> f64 {
        let of = |now: &Now| self.touches(now, u1).map(|t| now.stiffness * t.area * t.energy).sum::<f64>();
        self.all.iter().map(of).sum()
    }

    fn tangent(&self, u1: &[DVec3], curvature: Curvature, matrix: &mut Matrix) {
        for now in self.all.iter().filter(|o| o.stiffness != 0.0) {
            for t in self.touches(now, u1) {
                let n = t.gaps[0].normal;
                let mut block = DMat3::from_cols(n * n.x, n * n.y, n * n.z) * -t.slopes[0];
                if curvature.keeps() {
                    block -= t.gaps[0].hessian * t.pressure;
                }
                let (block, w) = (block * (now.stiffness * t.area), t.place.value);
                for (b, place) in self.c.places.patches.of(t.patch).iter().enumerate() {
                    matrix.values[*place as usize] += block * (w[b / w.len()] * w[b % w.len()]);
                }
            }
        }
    }

    fn by_past(&self, u1: &[DVec3], change: &PastChange, out: &mut [DVec3]) {
        if !contact::acts_along(self.c.weights.new) {
            return;
        }
        for now in &self.all {
            for t in self.touches(now, u1) {
                let [new, old] = &t.gaps;
                let f = t.slopes[1] * old.normal.dot(t.place.at(change.u)) * new.normal;
                t.place.spread(-now.stiffness * t.area * f, out);
            }
        }
    }

    fn by_past_transposed(&self, u1: &[DVec3], z: &[DVec3], out: &mut PastGradient) {
        if !contact::acts_along(self.c.weights.new) {
            return;
        }
        for now in &self.all {
            for t in self.touches(now, u1) {
                let [new, old] = &t.gaps;
                let f = t.slopes[1] * new.normal.dot(t.place.at(z)) * old.normal;
                t.place.spread(-now.stiffness * t.area * f, &mut out.u);
            }
        }
    }

    fn by_coefficients(&self, u1: &[DVec3], rates: &Coefficients, out: &mut [DVec3]) {
        for now in &self.all {
            let (numbers, start) = (&rates.physics.effects[now.effect], rates.physics.start);
            let offset = DVec3::from_slice(&numbers[OFFSET..OFFSET + 3]);
            if start == 0.0 && numbers.iter().all(|r| *r == 0.0) {
                continue;
            }
            for t in self.touches(now, u1) {
                let moved = now.stiffness * (t.shifted(offset) + start * t.later());
                t.place.spread(-t.area * (moved + numbers[STIFFNESS] * t.pressure * t.gaps[0].normal), out);
            }
        }
    }

    fn by_coefficients_transposed(&self, u1: &[DVec3], z: &[DVec3], sought: &Sought, gradient: &mut Coefficients) {
        for now in &self.all {
            if !sought.effects[now.effect] && !sought.start {
                continue;
            }
            for t in self.touches(now, u1) {
                let w = -t.area * t.place.at(z);
                gradient.physics.start += now.stiffness * w.dot(t.later());
                let numbers = &mut gradient.physics.effects[now.effect];
                numbers[STIFFNESS] += t.pressure * w.dot(t.gaps[0].normal);
                for a in 0..3 {
                    numbers[OFFSET + a] += now.stiffness * w.dot(t.shifted(DVec3::AXES[a]));
                }
            }
        }
    }

    fn forces(&self, u1: &[DVec3], out: &mut Forces) {
        self.force(u1, &mut out.supports);
    }
}

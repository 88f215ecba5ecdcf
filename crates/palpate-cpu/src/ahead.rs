//! States of a sequence of equilibria that are found side by side, ahead of being asked for.
//!
//! All states of a window start from the last one that is known, and take Newton's steps together, each with its own exact tangent, by
//! conjugate gradients behind one factor ([`crate::kept`]). A state counts only if the way from state to state would lead there: Newton's first step
//! from its predecessor p to it, d = y − p, must leave at most half of the forces out of balance, ‖r(p) + H(p) d‖ ≤ ½ ‖r(p)‖ in the norm of
//! the factor's inverse. The first one that does not, is not stable, or is not found, ends the window; `quasi_static` goes on alone from there.

use crate::kept::{Kept, MOST, side_by_side};
use crate::linear::matrix::Matrix;
use crate::linear::side_by_side::{Column, GROUP, Solved, solve};
use crate::linear::vector::{Nodes, add_scaled, dot, is_finite};
use crate::newton::{self, Effort};
use crate::quasi_static::probe;
use crate::simulate::{Start, equation, with_matrix};
use crate::terms::Equation;
use crate::terms::products::Products;
use crate::world::{Gradient, Member, Shared};
use glam::DVec3;
use palpate_model::plan::scheme::Stage;
use rayon::prelude::*;
use std::collections::VecDeque;

/// States of a window at most: groups for two threads. Further ahead the common guess is too far.
const WINDOW: usize = 2 * GROUP;
/// Newton's steps in a window: from a guess that leads somewhere, each squares the error.
const STEPS: usize = 8;
/// Part of the forces that Newton's first step from the predecessor may leave.
const LED: f64 = 0.5;

/// Accuracy of the solve that finds negative curvature. A direction with some keeps its part of the residual until it is found; of this right-hand side
/// the softest ones have the largest parts.
const PROBED: f64 = 1e-2;

/// A member's states ahead.
#[derive(Debug, Default)]
pub(crate) struct Ahead {
    kept: Option<Kept>,
    /// States found, from that of stage `number` on.
    found: VecDeque<Nodes>,
    number: usize,
    /// The state before the first of them.
    from: Nodes,
    /// States found by the last window; none before the first.
    last: Option<usize>,
}

impl Ahead {
    /// From a start whose tangent may have been factorised.
    pub(crate) fn new(kept: Option<Kept>) -> Ahead {
        Ahead { kept, ..Ahead::default() }
    }
}

/// Hands the factor that served last on to the way back, at the end of the way forward.
pub(crate) fn hand_on(member: &mut Member, stage: &Stage, gradient: &mut Gradient) {
    if stage.step + 1 == member.viewed.recording.steps {
        gradient.kept = member.ahead.kept.take();
    }
}

/// The state after `now`, if it is found side by side with those after it.
pub(crate) fn next(shared: &Shared, member: &mut Member, stage: &Stage, now: &[DVec3]) -> Option<Nodes> {
    let mut ahead = std::mem::take(&mut member.ahead);
    if ahead.found.is_empty() || ahead.number != stage.number || ahead.from != now {
        // Twice as many as were found last time: where states lie far apart, few are tried.
        let most = ahead.last.map_or(WINDOW, |n| (2 * n).clamp(1, WINDOW));
        let all = shared.plan.stages();
        let stages = all.iter().skip(stage.number).take_while(|s| member.takes(s)).take(most).cloned().collect::<Vec<_>>();
        let mut effort = member.effort;
        let found =
            with_matrix(member, |member, matrix| window(shared, member, &stages, now, matrix, &mut ahead.kept, &mut effort));
        member.effort = effort;
        ahead.last = Some(found.len());
        (ahead.found, ahead.number) = (found.into(), stage.number);
    }
    let next = ahead.found.pop_front();
    if let Some(u) = &next {
        ahead.number += 1;
        ahead.from.clone_from(u);
    }
    member.ahead = ahead;
    next
}

/// A state on its way.
struct Way {
    u: Nodes,
    residual: Nodes,
    norm: f64,
    /// What the residual is measured against.
    scale: f64,
    forcing: f64,
    iterations: usize,
    end: Option<End>,
}

#[derive(Clone, Copy, PartialEq)]
enum End {
    Found,
    Lost,
}

impl Way {
    /// What the residual is measured by, and against.
    fn measure(&mut self, e: &mut Equation, kept: &Kept) {
        self.residual = e.residual(&self.u);
        self.norm = kept.diagonal.norm(&self.residual);
        self.scale = e.scale(&self.u, |f| kept.diagonal.norm(f));
    }

    fn look(&mut self, kept: &Kept, shared: &Shared) {
        let small = self.norm <= shared.plan.solver.tolerance * self.scale;
        if !is_finite(&self.residual) {
            self.end = Some(End::Lost);
        } else if small || self.norm <= newton::rounding(&shared.plan.body.nodes, kept.means().iter().copied(), &self.u) {
            self.end = Some(End::Found);
        }
    }

    /// What Newton's direction solves.
    fn direction<'a>(&self, operator: &'a Products, shared: &Shared) -> Option<Column<'a>> {
        let absolute = newton::slack(shared.plan.solver.tolerance, self.scale);
        let rhs = self.residual.iter().map(|r| -*r).collect();
        Some(Column { operator: operator.as_ref(), rhs, relative: self.forcing, absolute })
    }

    /// Takes a step of Newton's method.
    fn step(&mut self, e: &mut Equation, kept: &Kept, shared: &Shared, solved: Solved) {
        let Ok((d, iterations)) = solved else {
            self.end = Some(End::Lost);
            return;
        };
        let (residual, after) = newton::line_search(e, &kept.diagonal, &mut self.u, &self.residual, self.norm, &d);
        self.iterations += iterations;
        self.forcing = newton::forcing(after, self.norm);
        (self.residual, self.norm) = (residual, after);
        self.look(kept, shared);
    }
}

/// The states of these stages from the one before, as many in a row as are found.
fn window(
    shared: &Shared,
    member: &Member,
    stages: &[Stage],
    now: &[DVec3],
    matrix: &mut Matrix,
    kept: &mut Option<Kept>,
    effort: &mut Effort,
) -> Vec<Nodes> {
    let still = Start::still(now.len());
    let mut equations: Vec<Equation> = stages.iter().map(|s| equation(shared, member, Some(s), &still)).collect();
    let Some(mut own) = kept.take().or_else(|| Kept::new(shared, &mut equations[0], now, matrix)) else {
        return Vec::new();
    };
    equations.truncate(side_by_side(shared, &equations[0], now, &own, stages.len()));
    let mut ways: Vec<Way> = equations.par_iter_mut().map(|e| begin(e, now, &own, shared)).collect();
    for step in 0..STEPS {
        if ways.iter().all(|w| w.end.is_some()) {
            break;
        }
        let middle = ways.len() / 2;
        // After the first step it is known about where the states are.
        if step == 1
            && !own.serves(ways.len())
            && let Some(new) = Kept::new(shared, &mut equations[middle], &ways[middle].u, matrix)
        {
            own = new;
            (&mut ways, &mut equations).into_par_iter().for_each(|(w, e)| w.measure(e, &own));
        }
        effort.newton += ways.iter().filter(|w| w.end.is_none()).count();
        let operators = tangents(&equations, &ways, |w| w.end.is_none());
        let columns: Vec<Column> = ways.iter().zip(&operators).filter_map(|(w, o)| w.direction(o.as_ref()?, shared)).collect();
        let mut solved = solve(&own.factor, &columns, MOST).into_iter();
        drop(columns);
        drop(operators);
        let steps: Vec<Option<Solved>> = ways.iter().map(|w| w.end.is_none().then(|| solved.next().expect("one each"))).collect();
        (&mut ways, &mut equations, steps).into_par_iter().for_each(|(w, e, s)| {
            if let Some(s) = s {
                w.step(e, &own, shared, s);
            }
        });
    }
    let found = ways.iter().take_while(|w| w.end == Some(End::Found)).count();
    ways.truncate(found);
    let iterations: Vec<usize> = ways.iter().map(|w| w.iterations).collect();
    effort.linear += iterations.iter().sum::<usize>();
    own.served(&iterations);
    let sound = stable(&equations, &ways, &own).min(led(&mut equations, &ways, now, &own, shared));
    ways.truncate(sound);
    // Where it led nowhere the next window has one of its own.
    *kept = (sound > 0).then_some(own);
    ways.into_iter().map(|w| w.u).collect()
}

fn begin(e: &mut Equation, now: &[DVec3], kept: &Kept, shared: &Shared) -> Way {
    let mut way =
        Way { u: now.to_vec(), residual: Vec::new(), norm: 0.0, scale: 0.0, forcing: newton::FIRST, iterations: 0, end: None };
    way.measure(e, kept);
    way.look(kept, shared);
    way
}

/// Exact tangents of those states for which `some` says so.
fn tangents<'b>(equations: &'b [Equation], ways: &[Way], some: impl Fn(&Way) -> bool + Sync) -> Vec<Option<Products<'b>>> {
    equations.par_iter().zip(ways).map(|(e, w)| some(w).then(|| e.products(&w.u))).collect()
}

/// How many of these states in a row are stable.
fn stable(equations: &[Equation], ways: &[Way], kept: &Kept) -> usize {
    let operators = tangents(equations, ways, |_| true);
    let rhs = probe(kept.means().len());
    let columns: Vec<Column> = operators.iter().flatten().map(|o| probed(o, &rhs)).collect();
    solve(&kept.factor, &columns, MOST).iter().take_while(|s| s.is_ok()).count()
}

fn probed<'a>(operator: &'a Products, probe: &Nodes) -> Column<'a> {
    Column { operator: operator.as_ref(), rhs: probe.clone(), relative: PROBED, absolute: 0.0 }
}

/// How many of these states in a row Newton's method leads to from the one before.
fn led(equations: &mut [Equation], ways: &[Way], now: &[DVec3], kept: &Kept, shared: &Shared) -> usize {
    let pairs: Vec<[Nodes; 2]> = equations[..ways.len()]
        .par_iter_mut()
        .enumerate()
        .map(|(j, e)| {
            let before = if j == 0 { now } else { &ways[j - 1].u };
            let residual = e.residual(before);
            let mut way = ways[j].u.clone();
            add_scaled(&mut way, -1.0, before);
            let mut left = residual.clone();
            e.products(before).multiply(&way, &mut left);
            add_scaled(&mut left, 1.0, &residual);
            [residual, left]
        })
        .collect();
    let norm = |v: &Nodes, moved: &Nodes| dot(v, moved).max(0.0).sqrt();
    let sizes: Vec<[f64; 2]> = pairs
        .par_chunks(GROUP)
        .flat_map_iter(|group| {
            let mut moved: Vec<[Nodes; 2]> = group.to_vec();
            kept.factor.solve(&mut moved.iter_mut().flatten().map(Vec::as_mut_slice).collect::<Vec<_>>());
            let each = |([r, l], [mr, ml]): (&[Nodes; 2], &[Nodes; 2])| [norm(r, mr), norm(l, ml)];
            group.iter().zip(&moved).map(each).collect::<Vec<_>>()
        })
        .collect();
    let leads = |(j, [all, left]): (usize, &[f64; 2])| {
        // Where nothing changed the residual is what the last solve left.
        let still = kept.diagonal.norm(&pairs[j][0]) <= shared.plan.solver.tolerance * ways[j].scale;
        still || *left <= LED * all
    };
    sizes.iter().enumerate().take_while(|x| leads((x.0, x.1))).count()
}

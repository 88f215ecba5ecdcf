//! What a tracker is made of, each part by itself: draws of a covariance, directions that readings determine, and the mixture as the gradient of a
//! likelihood.

use super::draws::certainty;
use super::mixture::Mixture;
use super::pull::{ByCost, ByMixture, Pulls};
use super::*;
use crate::costs::tests::{Noise, seen};
use faer::Mat;
use faer::linalg::solvers::Solve;

/// A block with depth points, markers and displacements, softened so that its readings tell of many directions.
fn tracker() -> (Tracker, Nodes) {
    let plan = seen();
    let mut noise = Noise(5);
    let u =
        plan.body.nodes.iter().map(|x| 2e-3 * DVec3::new((20.0 * x.y).sin(), x.x * 5.0, 0.1) + 1e-4 * noise.vector()).collect();
    (Tracker::new(&plan), u)
}

fn draws(count: usize, nodes: usize) -> Vec<Nodes> {
    // Uniform numbers of variance one; what is checked here holds for any.
    let mut noise = Noise(7);
    (0..count).map(|_| (0..nodes).map(|_| 3f64.sqrt() * noise.vector()).collect()).collect()
}

/// Who belongs to whom at a displacement.
fn mixture(tracker: &Tracker, look: Look, u: &[DVec3], spread: f64, outliers: f64) -> Mixture {
    let places = tracker.places.at(&tracker.world.shared.plan.body, u);
    Mixture::new(&sighting(look, &places, tracker.places.spacing), spread, outliers)
}

/// The columns of an operator.
fn dense(n: usize, f: impl Fn(&[DVec3]) -> Nodes) -> Mat<f64> {
    let mut m = Mat::zeros(3 * n, 3 * n);
    for j in 0..3 * n {
        let mut e = zeros(n);
        e[j / 3][j % 3] = 1.0;
        f(&e).iter().enumerate().for_each(|(i, v)| (0..3).for_each(|c| m[(3 * i + c, j)] = v[c]));
    }
    m
}

#[test]
fn draws_and_determined_directions_are_those_of_dense_algebra() {
    let (tracker, u) = tracker();
    let n = u.len();
    let pose = Pose { displacement: zeros(n), velocity: zeros(n) };
    let (shared, member) = (&tracker.world.shared, &tracker.world.members[0]);
    let problem = Problem { frame: 1, prior: Prior::Step(&pose, 0.02), temperature: 1e-2 };
    let past = past(&problem);
    let start = begun(&problem, &past, n);
    let mut equation = prior(shared, member, &problem, &start);
    let residual = equation.residual(&u);
    let pulls = ByCost::new(shared, member, 1, &u);
    let draws = draws(3, n);
    with_stiffness(shared, &equation, &u, |k| {
        let found = certainty(k, problem.temperature, &pulls, &residual, &draws, 0.0);
        let stiffness = dense(n, |v| {
            let mut y = zeros(n);
            k.matrix.multiply(v, &mut y);
            y
        });
        let data = dense(n, |v| pulls.product(v).iter().map(|x| problem.temperature * *x).collect());
        let total = (&stiffness + &data).partial_piv_lu();
        // γ = tr((K + B)⁻¹ B).
        let gamma: f64 = {
            let m = total.solve(&data);
            (0..3 * n).map(|i| m[(i, i)]).sum()
        };
        // What Lanczos' method leaves out counts less than a fiftieth for every direction.
        assert!(gamma > 20.0 && (found.determined / gamma - 1.0).abs() < 0.02, "{} {gamma}", found.determined);
        let flat = |v: &[DVec3]| Mat::from_fn(3 * n, 1, |i, _| v[i / 3][i % 3]);
        let x = stiffness.partial_piv_lu().solve(&flat(&residual));
        let excess = 0.5 * (0..3 * n).map(|i| x[(i, 0)] * flat(&residual)[(i, 0)]).sum::<f64>();
        assert!((found.excess / excess - 1.0).abs() < 1e-9);
        for (k, draw) in draws.iter().enumerate() {
            // A draw L⁻ᵀ ξ of the prior has xᵀKx/η = ξᵀξ; the posterior's has xᵀ(K + B)x/η = ξᵀξ but for what was left out.
            let norm = |m: &Mat<f64>, x: &[DVec3]| {
                let (x, y) = (flat(x), m * flat(x));
                (0..3 * n).map(|i| x[(i, 0)] * y[(i, 0)]).sum::<f64>() / problem.temperature
            };
            let whole = dot(draw, draw);
            assert!((norm(&stiffness, &found.prior[k]) / whole - 1.0).abs() < 1e-9);
            let posterior = norm(&(&stiffness + &data), &found.posterior[k]);
            assert!((posterior / whole - 1.0).abs() < 0.02, "{posterior} {whole}");
        }
        Ok(())
    })
    .unwrap();
}

#[test]
fn the_mixture_pulls_as_the_gradient_of_its_likelihood() {
    let (tracker, u) = tracker();
    let (shared, member) = (&tracker.world.shared, &tracker.world.members[0]);
    let (body, look) = (&shared.plan.body, member.look(shared, 1));
    // With the spread of the mixture as the noise of a reading, what the shares weigh is the likelihood's own.
    let spread = look.observation.noise(palpate_model::observation::ReadingKind::Depth) * 4.0;
    let mixture = |u: &[DVec3]| mixture(&tracker, look, u, spread, 0.1);
    let slope = |u: &[DVec3]| {
        let pulls = ByMixture::new(body, &mixture(u).shares, look, u);
        pulls.gradient().iter().map(|g| *g / 16.0).collect::<Nodes>()
    };
    let (gradient, mut noise) = (slope(&u), Noise(9));
    let direction: Nodes = u.iter().map(|_| noise.vector()).collect();
    let at = |s: f64| {
        let mut moved = u.clone();
        add_scaled(&mut moved, s, &direction);
        mixture(&moved).likelihood
    };
    let d = 1e-7;
    let difference = (at(d) - at(-d)) / (2.0 * d);
    let exact = -dot(&gradient, &direction);
    // Points enter and leave the reach of a Gaussian, where e⁻⁸ of its peak is left; weights by visibility do not move here.
    assert!((difference / exact - 1.0).abs() < 2e-3, "{difference} {exact}");
}

#[test]
fn the_bound_that_shares_make_is_a_quadratic_with_its_own_derivatives() {
    let (tracker, u) = tracker();
    let (shared, member) = (&tracker.world.shared, &tracker.world.members[0]);
    let (body, look) = (&shared.plan.body, member.look(shared, 1));
    let pulls = ByMixture::new(body, &mixture(&tracker, look, &u, 0.01, 0.05).shares, look, &u);
    let mut noise = Noise(4);
    let direction: Nodes = u.iter().map(|_| 1e-3 * noise.vector()).collect();
    let mut moved = u.clone();
    add_scaled(&mut moved, 1.0, &direction);
    let model = dot(&pulls.gradient(), &direction) + 0.5 * dot(&direction, &pulls.product(&direction));
    let change = pulls.value(&moved) - pulls.value(&u);
    assert!(model.abs() > 1e-3 && (change - model).abs() < 1e-9 * pulls.value(&u).abs(), "{change} {model}");
}

#[test]
fn a_body_that_is_held_stays_without_readings() {
    let (mut tracker, u) = tracker();
    let mut observation = (*tracker.world.shared.plan.observation).clone();
    observation.frames[1].points.clear();
    observation.frames[1].markers.clear();
    observation.frames[1].displacements.clear();
    tracker = Tracker::new(&Plan { observation: observation.into(), ..tracker.world.shared.plan.clone() });
    let pose = Pose { displacement: u.clone(), velocity: zeros(u.len()) };
    let problem = Problem { frame: 1, prior: Prior::Held(&pose, 0.02), temperature: 1e-6 };
    let mut at = u.clone();
    at.iter_mut().for_each(|v| v.x += 1e-4);
    for _ in 0..6 {
        tracker.approach(&problem, Pull::Surface { band: 0.01 }, &mut at).unwrap();
    }
    let away = at.iter().zip(&u).map(|(a, b)| (*a - *b).length()).fold(0.0, f64::max);
    assert!(away < 1e-8, "{away}");
}

//! Element matrices against their definition by pointwise quadrature, closed-form patch and bending energies, spectra.

use super::enhanced::REGULARISATION;
use super::*;
use crate::cutcells::corotation::{V24, multiply};
use crate::cutcells::grid::{SIGNS, shape_gradients};
use crate::cutcells::held::FreePart;
use crate::mechanics::lame::lame;
use crate::mechanics::rotation::tests::Noise;
use glam::{DMat3, DVec3};

const ALL: [Element; 3] = [Element::Enhanced, Element::Trilinear, Element::Corner];
const H: f64 = 0.04;
const NODES: [f64; 3] = [-0.774_596_669_241_483_4, 0.0, 0.774_596_669_241_483_4];

/// Lagrange polynomials of the Gauss points.
fn lagrange(x: f64) -> [f64; 3] {
    let g = NODES[2];
    [(x * x - g * x) / (2.0 * g * g), 1.0 - x * x / (g * g), (x * x + g * x) / (2.0 * g * g)]
}

/// Weights that integrate degree ≤ 2 over an interval of [−1, 1], relative to the cell's edge 2.
fn interval(low: f64, high: f64) -> [f64; 3] {
    // Two Gauss points in the interval: no cancellation however short it is.
    let (middle, half) = (0.5 * (low + high), 0.5 * (high - low));
    let offset = half / 3f64.sqrt();
    let (a, b) = (lagrange(middle - offset), lagrange(middle + offset));
    [0, 1, 2].map(|k| 0.5 * half * (a[k] + b[k]))
}

/// Weights of the box `low..high` in [−1, 1]³.
fn slab(low: [f64; 3], high: [f64; 3]) -> ([f64; 27], f64) {
    let w = [0, 1, 2].map(|a| interval(low[a], high[a]));
    let fraction = (0..3).map(|a| 0.5 * (high[a] - low[a])).product();
    (std::array::from_fn(|q| w[0][q % 3] * w[1][q / 3 % 3] * w[2][q / 9]), fraction)
}

fn full() -> ([f64; 27], f64) {
    slab([-1.0; 3], [1.0; 3])
}

/// Weights of a cloud of points behind a random plane: a measure inside the cell, though not a uniform one.
fn planar(noise: &mut Noise) -> ([f64; 27], f64) {
    let (n, d, mut w) = (noise.vector(1.0), noise.uniform(-0.3, 0.6), [0.0; 27]);
    let mut fraction = 0.0;
    for _ in 0..300 {
        let p = noise.vector(1.0);
        if n.dot(p) < d {
            fraction += 1.0 / 300.0;
            let l = [p.x, p.y, p.z].map(lagrange);
            for q in 0..27 {
                w[q] += l[0][q % 3] * l[1][q / 3 % 3] * l[2][q / 9] / 300.0;
            }
        }
    }
    (w, fraction)
}

fn cuts() -> Vec<([f64; 27], f64)> {
    let mut noise = Noise(21);
    let mut all = vec![full(), slab([-1.0; 3], [-0.2, 1.0, 1.0]), slab([-1.0, -0.5, 0.3], [0.1, 1.0, 0.8])];
    all.extend((0..20).map(|_| planar(&mut noise)).filter(|c| c.1 > 0.02));
    all
}

fn point(q: usize) -> DVec3 {
    DVec3::new(NODES[q % 3], NODES[q / 3 % 3], NODES[q / 9])
}

fn energy(k: &M24, u: &V24) -> f64 {
    0.5 * u.iter().zip(multiply(k, u)).map(|(a, b)| a * b).sum::<f64>()
}

/// Corner values of a field given at rest positions relative to the centre.
fn field(f: impl Fn(DVec3) -> DVec3) -> V24 {
    std::array::from_fn(|i| f(DVec3::from_array(SIGNS[i / 3]) * (0.5 * H))[i % 3])
}

/// Modes that an element adds are free of their mean, so its energy is at least that of the mean strain: what a law of the mean strain puts in
/// the place of the linear one's takes away no more than the element has.
#[test]
fn a_matrix_without_the_linear_energy_of_the_mean_strain_is_positive_semi_definite() {
    for (w, f) in cuts() {
        let gradient = FreePart { weights: w, fraction: f }.mean_gradient(H);
        let centre: [DVec3; 8] = std::array::from_fn(|i| DVec3::from_array(SIGNS[i]) * (0.25 / H));
        for element in ALL {
            for nu in [0.0, 0.3, 0.49] {
                let m = CellMatrices::new(element, H, &w, f, nu);
                let least = |gradient: &[DVec3; 8]| {
                    let mut left = m.k.clone();
                    take_mean_strain(&mut left, gradient, f * H.powi(3), lame(1.0, nu));
                    let values = eigenvalues(&left);
                    values[0] / eigenvalues(&m.k)[23]
                };
                assert!(least(&gradient) > -1e-12, "{element:?} nu {nu} fraction {f}: {}", least(&gradient));
                // The strain at the centre of the cell is no mean of what a cut cell holds.
                assert!(f == 1.0 || least(&centre) < -1e-3, "{element:?} nu {nu} fraction {f}: {}", least(&centre));
            }
        }
    }
}

/// Subtracts V BᵀCB, with B ε the strain by the corners.
fn take_mean_strain(k: &mut M24, gradient: &[DVec3; 8], volume: f64, (lambda, mu): (f64, f64)) {
    for (i, g) in gradient.iter().enumerate() {
        for (j, h) in gradient.iter().enumerate() {
            for a in 0..3 {
                for b in 0..3 {
                    let same = if a == b { mu * g.dot(*h) } else { 0.0 };
                    k[24 * (3 * i + a) + 3 * j + b] -= volume * (lambda * g[a] * h[b] + mu * g[b] * h[a] + same);
                }
            }
        }
    }
}

/// Eigenvalues in increasing order, by cyclic Jacobi rotations.
fn eigenvalues(m: &M24) -> Vec<f64> {
    let mut a: Vec<Vec<f64>> = m.chunks(24).map(<[f64]>::to_vec).collect();
    for _ in 0..12 {
        for p in 0..24 {
            for q in p + 1..24 {
                if a[p][q] == 0.0 {
                    continue;
                }
                let tau = (a[q][q] - a[p][p]) / (2.0 * a[p][q]);
                let t = tau.signum() / (tau.abs() + (1.0 + tau * tau).sqrt());
                let (c, s) = (1.0 / (1.0 + t * t).sqrt(), t / (1.0 + t * t).sqrt());
                for i in 0..24 {
                    (a[i][p], a[i][q]) = (c * a[i][p] - s * a[i][q], s * a[i][p] + c * a[i][q]);
                }
                for i in 0..24 {
                    (a[p][i], a[q][i]) = (c * a[p][i] - s * a[q][i], s * a[p][i] + c * a[q][i]);
                }
            }
        }
    }
    let mut values: Vec<f64> = (0..24).map(|i| a[i][i]).collect();
    values.sort_by(f64::total_cmp);
    values
}

#[test]
fn affine_displacement_has_exact_energy_and_forces() {
    let mut noise = Noise(22);
    for (w, f) in cuts() {
        for element in ALL {
            for nu in [-0.2, 0.0, 0.3, 0.49] {
                let m = CellMatrices::new(element, H, &w, f, nu);
                let g = DMat3::from_cols(noise.vector(1.0), noise.vector(1.0), noise.vector(1.0));
                let strain = (g + g.transpose()) * 0.5;
                let (lambda, mu) = lame(1.0, nu);
                let trace = strain.x_axis.x + strain.y_axis.y + strain.z_axis.z;
                let stress = strain * (2.0 * mu) + DMat3::from_diagonal(DVec3::splat(lambda * trace));
                let force = multiply(&m.k, &field(|x| g * x));
                // ∫ σ ∇N_i: a patch of cut cells in constant stress is in equilibrium.
                let exact: V24 = std::array::from_fn(|i| {
                    let mean: DVec3 = (0..27).map(|q| shape_gradients((point(q) + DVec3::ONE) * 0.5)[i / 3] * w[q]).sum();
                    (stress * mean)[i % 3] * H * H
                });
                let size = exact.iter().map(|x| x.abs()).fold(0.0, f64::max);
                for i in 0..24 {
                    assert!((force[i] - exact[i]).abs() < 1e-11 * size, "{element:?} nu {nu} fraction {f}");
                }
            }
        }
    }
}

#[test]
fn trilinear_matches_pointwise_quadrature() {
    for (w, f) in cuts() {
        let m = CellMatrices::new(Element::Trilinear, H, &w, f, 0.3);
        let (lambda, mu) = lame(1.0, 0.3);
        let mut k = [0.0; 576];
        for q in 0..27 {
            let g = shape_gradients((point(q) + DVec3::ONE) * 0.5);
            for r in 0..24 {
                for c in 0..24 {
                    let (a, b) = (g[r / 3], g[c / 3]);
                    let same = if r % 3 == c % 3 { mu * a.dot(b) } else { 0.0 };
                    k[24 * r + c] += H * w[q] * (lambda * a[r % 3] * b[c % 3] + mu * b[r % 3] * a[c % 3] + same);
                }
            }
        }
        for i in 0..576 {
            assert!((k[i] - m.k[i]).abs() < 1e-13 * H);
        }
    }
}

/// Strain (xx, yy, zz, xy, yz, zx; tensor components) of a displacement gradient.
fn strain(g: DMat3) -> [f64; 6] {
    let (x, y, z) = (g.x_axis, g.y_axis, g.z_axis);
    [x.x, y.y, z.z, 0.5 * (x.y + y.x), 0.5 * (y.z + z.y), 0.5 * (z.x + x.z)]
}

/// Energy-minimal incompatible modes by elimination, everything integrated point by point.
fn enhanced_by_definition(w: &[f64; 27], f: f64, nu: f64) -> M24 {
    let centre: DVec3 = (0..27).map(|q| point(q) * w[q]).sum::<DVec3>() / f;
    let floor = REGULARISATION * f * (1.0 - f) / 3.0;
    let (lambda, mu) = lame(1.0, nu);
    let kappa = lambda + 2.0 / 3.0 * mu;
    // Columns: 24 corner displacements (in units that make the cell's half edge 1), then (direction, component).
    let strains: Vec<Vec<[f64; 6]>> = (0..27)
        .map(|q| {
            let x = point(q);
            let g = shape_gradients((x + DVec3::ONE) * 0.5);
            let unit = |c: usize| DVec3::from_array(std::array::from_fn(|a| f64::from(u8::from(a == c))));
            let outer = |u: DVec3, v: DVec3| DMat3::from_cols(u * v.x, u * v.y, u * v.z);
            let corner = (0..24).map(|i| strain(outer(unit(i % 3), g[i / 3] * 0.5)));
            let bubble = (0..9).map(|e| strain(outer(unit(e % 3), unit(e / 3) * (x - centre)[e / 3])));
            corner.chain(bubble).collect()
        })
        .collect();
    let trace = |e: &[f64; 6]| e[0] + e[1] + e[2];
    let mut gram = DMat3::from_diagonal(DVec3::splat(floor));
    for q in 0..27 {
        let d = point(q) - centre;
        gram += DMat3::from_cols(d * d.x, d * d.y, d * d.z) * w[q];
    }
    let projected: Vec<(f64, DVec3)> = (0..33)
        .map(|i| {
            let mean = (0..27).map(|q| w[q] * trace(&strains[q][i])).sum();
            (mean, (0..27).map(|q| (point(q) - centre) * (w[q] * trace(&strains[q][i]))).sum())
        })
        .collect();
    let mut a = vec![vec![0.0; 33]; 33];
    for i in 0..33 {
        for j in 0..33 {
            let mut shear = 0.0;
            for q in 0..27 {
                let (s, t) = (&strains[q][i], &strains[q][j]);
                let inner: f64 = (0..6).map(|c| s[c] * t[c] * if c < 3 { 1.0 } else { 2.0 }).sum();
                shear += w[q] * (inner - trace(s) * trace(t) / 3.0);
            }
            let bulk = projected[i].0 * projected[j].0 / f + projected[i].1.dot(gram.inverse() * projected[j].1);
            a[i][j] = 2.0 * mu * shear + kappa * bulk;
        }
    }
    for e in 0..9 {
        let normal = e / 3 == e % 3;
        a[24 + e][24 + e] += floor * if normal { 2.0 * mu * 2.0 / 3.0 + kappa } else { mu };
    }
    for p in (24..33).rev() {
        for i in 0..p {
            let factor = a[i][p] / a[p][p];
            for j in 0..p {
                a[i][j] -= factor * a[p][j];
            }
        }
    }
    std::array::from_fn(|i| 4.0 * H * a[i / 24][i % 24])
}

#[test]
fn enhanced_matches_its_definition() {
    for (w, f) in cuts() {
        for nu in [0.0, 0.3, 0.49] {
            let (m, exact) = (CellMatrices::new(Element::Enhanced, H, &w, f, nu), enhanced_by_definition(&w, f, nu));
            let size = exact.iter().map(|x| x.abs()).fold(0.0, f64::max);
            for i in 0..576 {
                assert!((m.k[i] - exact[i]).abs() < 1e-10 * size, "nu {nu} fraction {f}");
            }
        }
    }
}

#[test]
fn pure_bending_is_exact_when_enhanced_and_too_stiff_otherwise() {
    let (w, f) = full();
    // Second moment of a square cross-section times length: ∫ z² over the cell.
    let inertia = H.powi(5) / 12.0;
    for nu in [0.0, 0.3, 0.49] {
        let (lambda, mu) = lame(1.0, nu);
        let along = field(|x| DVec3::new(x.x * x.z, 0.0, 0.0));
        let across = field(|x| DVec3::new(0.0, x.y * x.z, 0.0));
        for element in ALL {
            let k = CellMatrices::new(element, H, &w, f, nu).k;
            // Anticlastic bending across is the cell's own choice: minimise over its amplitude.
            let (a, b) = (energy(&k, &along), energy(&k, &across));
            let sum: V24 = std::array::from_fn(|i| along[i] + across[i]);
            let c = energy(&k, &sum) - a - b;
            let bending = a - c * c / (4.0 * b);
            let plate = 0.5 * inertia / (1.0 - nu * nu);
            match element {
                Element::Enhanced => {
                    assert!((bending / (0.5 * inertia) - 1.0).abs() < 1e-10, "nu {nu}: {}", bending / (0.5 * inertia));
                    assert!((a / plate - 1.0).abs() < 1e-10, "bending without curvature across is a plate's");
                }
                // Parasitic shear μ x² and no thinning; the corner rule sees x² = z² = 1 instead of 1/3.
                Element::Trilinear => assert!((a / (0.5 * inertia * (lambda + 3.0 * mu)) - 1.0).abs() < 1e-10),
                Element::Corner => assert!((a / (1.5 * inertia * (lambda + 3.0 * mu)) - 1.0).abs() < 1e-10),
            }
        }
    }
}

#[test]
fn six_rigid_motions_and_nothing_else_are_free() {
    let mut shapes = cuts();
    for s in [1e-1, 1e-2, 1e-4, 1e-6f64] {
        shapes.push(slab([-1.0; 3], [1.0, 1.0, -1.0 + 2.0 * s]));
        let edge = -1.0 + 2.0 * s.sqrt();
        shapes.push(slab([-1.0; 3], [1.0, edge, edge]));
        shapes.push(slab([-1.0; 3], [-1.0 + 2.0 * s.cbrt(); 3]));
    }
    for (w, f) in shapes {
        for element in ALL {
            for nu in [0.0, 0.3, 0.49, 0.4999] {
                let k = CellMatrices::new(element, H, &w, f, nu).k;
                let size = k.iter().map(|x| x.abs()).fold(0.0, f64::max);
                for r in 0..6 {
                    let e = DVec3::from_array(std::array::from_fn(|a| f64::from(u8::from(a == r % 3))));
                    let u = field(|x| if r < 3 { e } else { e.cross(x) / H });
                    assert!(multiply(&k, &u).iter().all(|f| f.abs() < 1e-13 * size), "{element:?} fraction {f}");
                }
                let values = eigenvalues(&k);
                // Rounding of K is 1e-16 per entry.
                assert!(values[0] > -1e-14 * size, "{element:?} fraction {f} nu {nu}: {}", values[0] / size);
                assert!(values[5] < 1e-14 * size, "{element:?} fraction {f} nu {nu}: {}", values[5] / size);
                // A thin plate of thickness f bends at f² of its stretching stiffness, and size grows with κ.
                let softest = 0.02 * f * f * (1.0 - 2.0 * nu);
                // Below 1e-15 rounding decides (only f = 1e-6 close to incompressibility).
                if softest > 1e-15 {
                    assert!(values[6] > softest * size, "{element:?} fraction {f} nu {nu}: {}", values[6] / size);
                }
            }
        }
    }
}

#[test]
fn cut_geometry_down_to_slivers_stays_semi_definite() {
    let mut noise = Noise(23);
    let mut smallest = 1.0f64;
    for n in 0..120 {
        // Planes that cut off a corner's tip, an edge or a face's layer, from 10 % of the cell's edge down to 1e-6.
        let axes = [[1.0, 1.0, 1.0], [1.0, 1.0, 0.0], [1.0, 0.0, 0.0]][n % 3];
        let normal = (DVec3::from_array(axes) + noise.vector(0.3) * DVec3::from_array(axes)).normalize();
        let depth = H * 10f64.powf(noise.uniform(-6.0, -1.0));
        let distance = |p: DVec3| normal.dot(p) - depth;
        let lattice = crate::cutcells::cut::Lattice { distance: &distance, h: H, subdivisions: 2 };
        let cut = crate::cutcells::cut::cut_cell(&lattice, [0; 3], [0; 3]);
        if cut.fraction < 1e-6 {
            continue;
        }
        smallest = smallest.min(cut.fraction);
        for element in ALL {
            for nu in [0.0, 0.3, 0.49] {
                let k = CellMatrices::new(element, H, &cut.weights, cut.fraction, nu).k;
                let size = k.iter().map(|x| x.abs()).fold(0.0, f64::max);
                let values = eigenvalues(&k);
                // Weights of a cut are exact to a few roundings, and so is K.
                assert!(values[0] > -1e-14 * size, "{element:?} fraction {:e} nu {nu}", cut.fraction);
                assert!(values[5] < 1e-14 * size, "{element:?} fraction {:e} nu {nu}", cut.fraction);
                // Measured: 1e-14 at fraction 1e-6; rounding leaves 1e-15.
                assert!(values[6] > 2e-15 * size, "{element:?} fraction {:e} nu {nu}", cut.fraction);
            }
        }
    }
    assert!(smallest < 1e-5, "slivers were reached");
}

#[test]
fn poisson_derivative_matches_differences() {
    for (w, f) in cuts() {
        for element in ALL {
            for nu in [-0.2, 0.0, 0.3, 0.45] {
                let d = 1e-5;
                let m = CellMatrices::new(element, H, &w, f, nu);
                let up = CellMatrices::new(element, H, &w, f, nu + d);
                let down = CellMatrices::new(element, H, &w, f, nu - d);
                let size = m.k_nu.iter().map(|x| x.abs()).fold(0.0, f64::max);
                for i in 0..576 {
                    let difference = (up.k[i] - down.k[i]) / (2.0 * d);
                    // Truncation d² · K‴ ~ (d / (½ − ν))² · 10 = 4e-7.
                    assert!((difference - m.k_nu[i]).abs() < 1e-6 * size, "{element:?} nu {nu}");
                    assert_eq!(m.k[i], m.k[i % 24 * 24 + i / 24]);
                    assert_eq!(m.k_nu[i], m.k_nu[i % 24 * 24 + i / 24]);
                }
            }
        }
    }
}

#[test]
fn only_dilatations_stiffen_towards_incompressibility() {
    for (n, (w, f)) in cuts().into_iter().enumerate() {
        let stiff = |element| {
            let k = |nu| eigenvalues(&CellMatrices::new(element, H, &w, f, nu).k);
            let (a, b) = (k(0.499), k(0.4999));
            // κ grows tenfold between the two; a mode that does not lock keeps its eigenvalue.
            (6..24).filter(|&i| b[i] > 2.0 * a[i]).count()
        };
        if n == 0 {
            assert_eq!(stiff(Element::Enhanced), 1);
            assert!(stiff(Element::Trilinear) >= 7, "full integration locks");
        }
        assert!(stiff(Element::Enhanced) <= 4, "fraction {f}");
    }
}

//! What keeps a star from moving otherwise than its F says: ½ γ μ_i V_i Σ_j ω_ij |y_j − y_i − F_i d_ij|²/|d_ij|², the control of zero-energy modes of
//! peridynamics (Silling 2017). It is zero for affine fields and turns with the body.

use super::graph::Star;
use glam::DVec3;

/// The penalty's matrices over γ μ_i, star by star: the energy is ½ γ μ_i Σ_ab A_ab u_a·u_b.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Penalty {
    /// γ.
    pub factor: f64,
    /// Start of each star's entries.
    starts: Vec<u32>,
    /// A [m] `[n · n]`, row by row, star after star.
    entries: Vec<f64>,
}

impl Penalty {
    /// Of stars whose points have these volumes [m³].
    pub fn new(factor: f64, stars: &[Star], points: &[DVec3], volume: &[f64]) -> Penalty {
        let mut all = Penalty { factor, starts: vec![0], entries: Vec::new() };
        for (star, v) in stars.iter().zip(volume) {
            let n = star.nodes.len();
            let x = points[star.nodes[0] as usize];
            let first = all.entries.len();
            all.entries.resize(first + n * n, 0.0);
            for (k, weight) in star.kernel.iter().enumerate() {
                let arm = points[star.nodes[k + 1] as usize] - x;
                let mut row: Vec<f64> = star.gradient.iter().map(|g| -g.dot(arm)).collect();
                row[0] -= 1.0;
                row[k + 1] += 1.0;
                let scale = v * weight / arm.length_squared();
                for (a, ra) in row.iter().enumerate() {
                    row.iter().enumerate().for_each(|(b, rb)| all.entries[first + n * a + b] += scale * ra * rb);
                }
            }
            all.starts.push(all.entries.len() as u32);
        }
        all
    }

    /// A of a star [m] `[n · n]`.
    pub fn of(&self, star: usize) -> &[f64] {
        &self.entries[self.starts[star] as usize..self.starts[star + 1] as usize]
    }
}

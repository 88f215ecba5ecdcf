//! Stencils: places of the body as weighted sums over nodes. With node positions x_i, `x = Σ w_i x_i` is the place and
//! `F = Σ x_i ⊗ g_i` the deformation gradient there.
//!
//! Surface patches, point masses and markers are stencils without or with gradients; a quadrature point of a tetrahedron has 4 nodes, of a
//! hexahedron 8, a point with its neighbours as many as it has. Nobody who uses one asks what it is a part of.

use glam::{DMat3, DVec3};

/// Many stencils, in compressed rows.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Stencils {
    /// Start of each stencil's entries, `[S + 1]`; empty without any.
    rows: Vec<u32>,
    /// Nodes.
    nodes: Vec<u32>,
    /// Weights of the nodes.
    value: Vec<f64>,
    /// Gradient weights g [1/m]; empty where no stencil has any.
    gradient: Vec<DVec3>,
}

/// One stencil.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stencil<'a> {
    /// Nodes.
    pub nodes: &'a [u32],
    /// Weights w of the nodes; they sum to one.
    pub value: &'a [f64],
    /// Gradient weights g of the nodes [1/m]; they sum to zero. Empty where nobody asks for a gradient.
    pub gradient: &'a [DVec3],
}

/// A stencil by itself.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct StencilBuf {
    /// Nodes.
    pub nodes: Vec<u32>,
    /// Weights of the nodes; they sum to one.
    pub value: Vec<f64>,
    /// Gradient weights of the nodes [1/m]; they sum to zero.
    pub gradient: Vec<DVec3>,
}

impl StencilBuf {
    /// The stencil.
    pub fn get(&self) -> Stencil<'_> {
        Stencil { nodes: &self.nodes, value: &self.value, gradient: &self.gradient }
    }
}

impl Stencils {
    /// None yet, with memory for so many with gradients, of so many nodes each.
    pub fn with_capacity(count: usize, nodes: usize) -> Stencils {
        let all = count * nodes;
        Stencils {
            rows: Vec::with_capacity(count + 1),
            nodes: Vec::with_capacity(all),
            value: Vec::with_capacity(all),
            gradient: Vec::with_capacity(all),
        }
    }

    /// Adds a stencil without gradient; returns its number.
    pub fn push(&mut self, nodes: &[u32], value: &[f64]) -> usize {
        self.push_with_gradient(nodes, value, &[])
    }

    /// Adds a stencil with its gradient, or all or none of them have one.
    pub fn push_with_gradient(&mut self, nodes: &[u32], value: &[f64], gradient: &[DVec3]) -> usize {
        if self.rows.is_empty() {
            self.rows.push(0);
        }
        self.nodes.extend_from_slice(nodes);
        self.value.extend_from_slice(value);
        self.gradient.extend_from_slice(gradient);
        debug_assert!(self.nodes.len() == self.value.len() && [0, self.nodes.len()].contains(&self.gradient.len()));
        self.rows.push(self.nodes.len() as u32);
        self.rows.len() - 2
    }

    /// Number of stencils S.
    pub fn len(&self) -> usize {
        self.rows.len().saturating_sub(1)
    }

    /// True without stencils.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Stencil `s`.
    #[inline(always)]
    pub fn get(&self, s: usize) -> Stencil<'_> {
        let range = self.rows[s] as usize..self.rows[s + 1] as usize;
        let gradient = if self.gradient.is_empty() { &[][..] } else { &self.gradient[range.clone()] };
        Stencil { nodes: &self.nodes[range.clone()], value: &self.value[range], gradient }
    }

    /// All of them.
    pub fn iter(&self) -> impl Iterator<Item = Stencil<'_>> + Clone {
        (0..self.len()).map(|s| self.get(s))
    }

    /// Weights of all stencils, for tests that spoil them.
    pub fn values_mut(&mut self) -> &mut [f64] {
        &mut self.value
    }
}

impl Stencil<'_> {
    /// Σ w v of a vector per node.
    #[inline(always)]
    pub fn at(&self, v: &[DVec3]) -> DVec3 {
        self.nodes.iter().zip(self.value).map(|(n, w)| *w * v[*n as usize]).sum()
    }

    /// Σ v ⊗ g: with displacements the displacement gradient H, with positions F.
    pub fn gradient_of(&self, v: &[DVec3]) -> DMat3 {
        let mut f = DMat3::ZERO;
        for (n, g) in self.nodes.iter().zip(self.gradient) {
            let x = v[*n as usize];
            f += DMat3::from_cols(x * g.x, x * g.y, x * g.z);
        }
        f
    }

    /// Adds w f to the nodes: the transpose of [`Stencil::at`].
    #[inline(always)]
    pub fn spread(&self, f: DVec3, out: &mut [DVec3]) {
        for (n, w) in self.nodes.iter().zip(self.value) {
            out[*n as usize] += *w * f;
        }
    }

    /// Adds P g to the nodes: the transpose of [`Stencil::gradient_of`].
    pub fn spread_gradient(&self, p: DMat3, out: &mut [DVec3]) {
        for (n, g) in self.nodes.iter().zip(self.gradient) {
            out[*n as usize] += p * *g;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sums_and_their_transposes() {
        let mut all = Stencils::default();
        let g = [DVec3::X, DVec3::new(-1.0, 2.0, 0.5), DVec3::new(0.0, -2.0, -0.5)];
        assert_eq!(all.push_with_gradient(&[2, 0, 1], &[0.5, 0.2, 0.3], &g), 0);
        assert_eq!(all.push_with_gradient(&[1, 2], &[0.4, 0.6], &[DVec3::Y, -DVec3::Y]), 1);
        assert_eq!((all.len(), all.iter().count()), (2, 2));
        let v = [DVec3::new(0.1, -0.4, 0.7), DVec3::new(0.3, 0.2, -0.5), DVec3::new(-0.6, 0.9, 0.8)];
        let (f, p) = (DVec3::new(1.0, 2.0, 3.0), DMat3::from_cols_array(&[1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 10.0]));
        for s in all.iter() {
            let (mut to, mut back) = ([DVec3::ZERO; 3], [DVec3::ZERO; 3]);
            s.spread(f, &mut to);
            s.spread_gradient(p, &mut back);
            let dot = |a: &[DVec3]| a.iter().zip(&v).map(|(a, b)| a.dot(*b)).sum::<f64>();
            assert!((dot(&to) - f.dot(s.at(&v))).abs() < 1e-14);
            let h = s.gradient_of(&v);
            let both = (0..3).map(|c| p.col(c).dot(h.col(c))).sum::<f64>();
            assert!((dot(&back) - both).abs() < 1e-13);
        }
    }
}

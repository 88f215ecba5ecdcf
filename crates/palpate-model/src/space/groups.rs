//! Small groups of neighbouring nodes, which move almost rigidly in what is slow about a body: bending and stretching of the whole.
//! The second level of the preconditioners solves for their rigid motions.

use super::body::Body;
use super::pattern::BlockRows;
use glam::DVec3;
use std::cmp::Reverse;
use std::collections::BTreeMap;

/// A group of fewer nodes joins a neighbour: it may have no rotation of its own.
const SMALLEST: usize = 8;

/// A partition of the nodes; depends on the geometry only.
#[derive(Clone, Debug)]
pub struct Groups {
    /// Group of each node, shape `[N]`.
    pub of_node: Vec<u32>,
    /// Nodes of each group, increasing.
    pub nodes: Vec<Vec<u32>>,
    /// Mean place of a group's nodes at rest [m].
    pub centers: Vec<DVec3>,
    /// Edge of the cubes that the groups are [m].
    pub size: f64,
}

impl Groups {
    /// Groups the nodes of a body into cubes of `across` nodes.
    pub fn new(body: &Body, blocks: &BlockRows, across: i64) -> Groups {
        let n = body.nodes.len();
        let h = body.length;
        let mut cubes: BTreeMap<[i64; 3], u32> = BTreeMap::new();
        let mut of_node: Vec<u32> = body
            .nodes
            .iter()
            .map(|x| {
                let cube = (*x / h).round().as_i64vec3().to_array().map(|c| c.div_euclid(across));
                let next = cubes.len() as u32;
                *cubes.entry(cube).or_insert(next)
            })
            .collect();
        let mut sizes = vec![0usize; cubes.len()];
        of_node.iter().for_each(|&g| sizes[g as usize] += 1);
        // Small groups, in order, join the biggest group that they touch.
        for g in 0..sizes.len() as u32 {
            if sizes[g as usize] >= SMALLEST {
                continue;
            }
            let touching = (0..n)
                .filter(|&i| of_node[i] == g)
                .flat_map(|i| blocks.columns[blocks.rows[i]..blocks.rows[i + 1]].iter().map(|&j| of_node[j as usize]));
            let best = touching.filter(|&o| o != g).max_by_key(|&o| (sizes[o as usize], Reverse(o)));
            if let Some(o) = best {
                of_node.iter_mut().filter(|x| **x == g).for_each(|x| *x = o);
                sizes[o as usize] += sizes[g as usize];
                sizes[g as usize] = 0;
            }
        }
        let mut number = vec![u32::MAX; sizes.len()];
        let mut nodes: Vec<Vec<u32>> = Vec::new();
        for (i, g) in of_node.iter_mut().enumerate() {
            let slot = &mut number[*g as usize];
            if *slot == u32::MAX {
                *slot = nodes.len() as u32;
                nodes.push(Vec::new());
            }
            *g = *slot;
            nodes[*slot as usize].push(i as u32);
        }
        let centers = nodes.iter().map(|g| g.iter().map(|&i| body.nodes[i as usize]).sum::<DVec3>() / g.len() as f64).collect();
        Groups { of_node, nodes, centers, size: across as f64 * h }
    }

    /// Number of groups.
    pub fn len(&self) -> usize {
        self.nodes.len()
    }

    /// True without groups.
    pub fn is_empty(&self) -> bool {
        self.nodes.is_empty()
    }

    /// Arm of every node from its group's centre at displacements u [m], over the groups' size.
    pub fn arms(&self, body: &Body, u: &[DVec3]) -> Vec<DVec3> {
        let center = |g: &Vec<u32>| g.iter().map(|&i| u[i as usize]).sum::<DVec3>() / g.len() as f64;
        let moved: Vec<DVec3> = self.nodes.iter().zip(&self.centers).map(|(g, c)| *c + center(g)).collect();
        (0..u.len()).map(|i| (body.nodes[i] + u[i] - moved[self.of_node[i] as usize]) / self.size).collect()
    }
}

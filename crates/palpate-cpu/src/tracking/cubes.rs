//! Places sorted into cubes: whoever asks for those near a point looks into 27 of them.

use glam::DVec3;

/// Things sorted into cubes.
pub struct Cubes {
    low: DVec3,
    edge: f64,
    size: [usize; 3],
    starts: Vec<u32>,
    order: Vec<u32>,
}

/// Most cubes along an axis.
const MOST: f64 = 128.0;

impl Cubes {
    /// Sorts places into cubes of at least this edge [m].
    pub fn new(places: &[DVec3], edge: f64) -> Cubes {
        let low = places.iter().copied().fold(DVec3::INFINITY, DVec3::min);
        let high = places.iter().copied().fold(DVec3::NEG_INFINITY, DVec3::max);
        let extent = if places.is_empty() { DVec3::ZERO } else { high - low };
        let edge = edge.max(extent.max_element() / MOST);
        let size = [0, 1, 2].map(|a| (extent[a] / edge) as usize + 1);
        let mut cubes = Cubes { low, edge, size, starts: vec![0; size[0] * size[1] * size[2] + 1], order: vec![0; places.len()] };
        let of: Vec<usize> = places.iter().map(|p| cubes.index(cubes.cube(*p).map(|c| c as usize))).collect();
        of.iter().for_each(|c| cubes.starts[c + 1] += 1);
        (1..cubes.starts.len()).for_each(|c| cubes.starts[c] += cubes.starts[c - 1]);
        let mut next = cubes.starts.clone();
        for (p, c) in of.iter().enumerate() {
            cubes.order[next[*c] as usize] = p as u32;
            next[*c] += 1;
        }
        cubes
    }

    fn cube(&self, p: DVec3) -> [i64; 3] {
        ((p - self.low) / self.edge).floor().as_i64vec3().to_array()
    }

    fn index(&self, c: [usize; 3]) -> usize {
        c[0] + self.size[0] * (c[1] + self.size[1] * c[2])
    }

    /// Everything in the 27 cubes around a place, always in the same order.
    pub fn near(&self, p: DVec3, mut found: impl FnMut(usize)) {
        let c = self.cube(p);
        let range = |a: usize| (c[a] - 1).max(0)..=(c[a] + 1).min(self.size[a] as i64 - 1);
        for z in range(2) {
            for y in range(1) {
                for x in range(0) {
                    let i = self.index([x as usize, y as usize, z as usize]);
                    self.order[self.starts[i] as usize..self.starts[i + 1] as usize].iter().for_each(|k| found(*k as usize));
                }
            }
        }
    }
}

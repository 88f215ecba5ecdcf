//! Nearest points of a cloud, by cubes.

use glam::DVec3;

/// Points sorted into cubes.
#[derive(Debug)]
pub struct Near {
    points: Vec<DVec3>,
    low: DVec3,
    edge: f64,
    /// Cubes along each axis.
    size: [usize; 3],
    /// Start of each cube's entries in `items`, one more than there are cubes.
    starts: Vec<u32>,
    items: Vec<u32>,
}

impl Near {
    /// Sorts points into cubes of about this edge [m]; larger ones where that would be more cubes than eight a point.
    pub fn new(points: &[DVec3], edge: f64) -> Near {
        let low = points.iter().copied().fold(DVec3::INFINITY, DVec3::min);
        let high = points.iter().copied().fold(DVec3::NEG_INFINITY, DVec3::max);
        let (low, extent) = if points.is_empty() { (DVec3::ZERO, DVec3::ZERO) } else { (low, high - low) };
        let along = |edge: f64| (extent / edge).to_array().map(|n| n.floor() as usize + 1);
        let mut edge = edge.max(1e-12 * extent.max_element()).max(f64::MIN_POSITIVE);
        let most = 8.0 * points.len().max(8) as f64;
        while along(edge).iter().map(|n| *n as f64).product::<f64>() > most {
            edge *= 1.5;
        }
        let size = along(edge);
        let starts = vec![0; size.iter().product::<usize>() + 1];
        let mut all = Near { points: points.to_vec(), low, edge, size, starts, items: Vec::new() };
        let of: Vec<usize> = points.iter().map(|x| all.number(all.cube(*x))).collect();
        of.iter().for_each(|c| all.starts[c + 1] += 1);
        (1..all.starts.len()).for_each(|c| all.starts[c] += all.starts[c - 1]);
        let mut next = all.starts.clone();
        all.items = vec![0; points.len()];
        for (p, c) in (0u32..).zip(of) {
            all.items[next[c] as usize] = p;
            next[c] += 1;
        }
        all
    }

    fn cube(&self, x: DVec3) -> [usize; 3] {
        let at = (x - self.low) / self.edge;
        std::array::from_fn(|a| (at[a].max(0.0) as usize).min(self.size[a] - 1))
    }

    fn number(&self, [i, j, k]: [usize; 3]) -> usize {
        i + self.size[0] * (j + self.size[1] * k)
    }

    /// Hands every point within a radius [m] to `visit`, with its squared distance.
    pub fn within(&self, center: DVec3, radius: f64, mut visit: impl FnMut(u32, f64)) {
        let [lo, hi] = [center - radius, center + radius].map(|x| self.cube(x));
        for k in lo[2]..=hi[2] {
            for j in lo[1]..=hi[1] {
                for i in lo[0]..=hi[0] {
                    let c = self.number([i, j, k]);
                    for p in &self.items[self.starts[c] as usize..self.starts[c + 1] as usize] {
                        let square = self.points[*p as usize].distance_squared(center);
                        if square <= radius * radius {
                            visit(*p, square);
                        }
                    }
                }
            }
        }
    }

    /// The nearest points with their distances [m], nearest first, the lower number first where they are equally far: as many as asked, or all;
    /// none of a place that is no number.
    pub fn nearest(&self, center: DVec3, count: usize) -> Vec<(f64, u32)> {
        let count = count.min(self.points.len());
        let mut radius = self.edge;
        loop {
            let mut found = Vec::new();
            self.within(center, radius, |p, square| found.push((square, p)));
            if found.len() >= count || !radius.is_finite() {
                found.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
                found.truncate(count);
                return found.into_iter().map(|(square, p)| (square.sqrt(), p)).collect();
            }
            radius *= 1.5;
        }
    }
}

/// Median distance of a cloud's points to their third neighbour [m]: about its spacing. A corner of a lattice has three neighbours that near.
pub fn spacing(points: &[DVec3]) -> f64 {
    let low = points.iter().copied().fold(DVec3::INFINITY, DVec3::min);
    let high = points.iter().copied().fold(DVec3::NEG_INFINITY, DVec3::max);
    if points.len() < 4 {
        return (high - low).max_element().max(0.0);
    }
    let near = Near::new(points, (high - low).length() / (points.len() as f64).cbrt());
    let mut third: Vec<f64> = points.iter().filter_map(|x| near.nearest(*x, 4).last().map(|n| n.0)).collect();
    third.sort_unstable_by(f64::total_cmp);
    third[third.len() / 2]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cubes_find_what_a_search_of_all_points_finds() {
        let at = |n: usize| (DVec3::new(0.7548776662, 0.5698402910, 0.4301597090) * n as f64).fract();
        let points: Vec<DVec3> = (0..300).map(at).collect();
        let near = Near::new(&points, 0.1);
        for center in [DVec3::splat(0.4), DVec3::new(-0.3, 0.5, 1.2), points[17]] {
            let mut all: Vec<(f64, u32)> = (0u32..).zip(&points).map(|(p, x)| (x.distance(center), p)).collect();
            all.sort_unstable_by(|a, b| a.0.total_cmp(&b.0));
            let found = near.nearest(center, 9);
            assert!(found.iter().zip(&all).all(|(a, b)| a.1 == b.1 && (a.0 - b.0).abs() < 1e-14) && found.len() == 9);
        }
        assert_eq!(near.nearest(DVec3::ZERO, 999).len(), 300);
        let lattice: Vec<DVec3> =
            (0..64).map(|n| DVec3::new((n % 4) as f64, (n / 4 % 4) as f64, (n / 16) as f64) * 0.01).collect();
        assert!((spacing(&lattice) - 0.01).abs() < 1e-12);
    }
}

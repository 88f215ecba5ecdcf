//! Some of many places, far from each other.

use glam::DVec3;

/// Farthest-point sampling: `count` of the places `[N]` from `first` on, each the one farthest from those before.
pub fn spread(places: &[DVec3], first: usize, count: usize) -> Vec<usize> {
    let mut distance = vec![f64::INFINITY; places.len()];
    let mut chosen = Vec::new();
    let mut next = first;
    while chosen.len() < count.min(places.len()) {
        chosen.push(next);
        for (d, p) in distance.iter_mut().zip(places) {
            *d = d.min((*p - places[next]).length_squared());
        }
        next = (0..places.len()).max_by(|a, b| distance[*a].total_cmp(&distance[*b]).then(b.cmp(a))).unwrap_or(0);
    }
    chosen
}

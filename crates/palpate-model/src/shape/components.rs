//! Parts of a mesh that share no vertex.

fn root(parent: &mut [u32], mut v: u32) -> u32 {
    while parent[v as usize] != v {
        parent[v as usize] = parent[parent[v as usize] as usize];
        v = parent[v as usize];
    }
    v
}

/// Number of the part of each element, by first appearance, and how many there are, of elements on so many vertices.
pub(crate) fn components<const N: usize>(elements: &[[u32; N]], vertices: usize) -> (Vec<usize>, usize) {
    let mut parent: Vec<u32> = (0..vertices as u32).collect();
    for e in elements {
        for v in &e[1..] {
            let (a, b) = (root(&mut parent, e[0]), root(&mut parent, *v));
            parent[a.max(b) as usize] = a.min(b);
        }
    }
    let (mut numbers, mut count) = (vec![usize::MAX; vertices], 0);
    let of = elements.iter().map(|e| {
        let number = &mut numbers[root(&mut parent, e[0]) as usize];
        if *number == usize::MAX {
            *number = count;
            count += 1;
        }
        *number
    });
    let of: Vec<usize> = of.collect();
    (of, count)
}

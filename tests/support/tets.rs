//! Boxes of linear tetrahedra.

use glam::DVec3;
use palpate_model::scene::BodySource;
use palpate_model::space::points::TetMesh;

/// A box as `count` cubes of six tetrahedra each along the axes, their edges `edge` [m], from `min` on.
pub fn mesh(min: DVec3, edge: f64, count: [usize; 3]) -> TetMesh {
    let [a, b, c] = count.map(|n| n + 1);
    let mut mesh = TetMesh::default();
    for n in 0..a * b * c {
        mesh.nodes.push(min + edge * DVec3::new((n % a) as f64, (n / a % b) as f64, (n / (a * b)) as f64));
    }
    for n in 0..count.iter().product() {
        let (i, j, k) = (n % count[0], n / count[0] % count[1], n / (count[0] * count[1]));
        let corner = |bits: usize| (i + (bits & 1) + a * (j + (bits >> 1 & 1) + b * (k + (bits >> 2)))) as u32;
        for way in [[1, 3], [1, 5], [2, 3], [2, 6], [4, 5], [4, 6]] {
            mesh.tets.push([corner(0), corner(way[0]), corner(way[1]), corner(7)]);
        }
    }
    mesh.checked().unwrap_or_else(|e| panic!("{e}"))
}

/// The same as a body of a scene.
pub fn bar(min: DVec3, edge: f64, count: [usize; 3]) -> BodySource {
    let mesh = mesh(min, edge, count);
    BodySource::Tetrahedra { path: "in-code.msh".into(), surface: mesh.surface(), mesh }
}

/// A mesh as a Gmsh file (MSH 4.1, ASCII): one block of nodes and one of tetrahedra, counted from 1.
pub fn msh(mesh: &TetMesh) -> String {
    let (n, m) = (mesh.nodes.len(), mesh.tets.len());
    let tags: String = (1..=n).map(|tag| format!("{tag}\n")).collect();
    let places: String = mesh.nodes.iter().map(|x| format!("{} {} {}\n", x.x, x.y, x.z)).collect();
    let tet = |(e, t): (usize, &[u32; 4])| format!("{} {} {} {} {}\n", e + 1, t[0] + 1, t[1] + 1, t[2] + 1, t[3] + 1);
    let tets: String = mesh.tets.iter().enumerate().map(tet).collect();
    format!(
        "$MeshFormat\n4.1 0 8\n$EndMeshFormat\n$Nodes\n1 {n} 1 {n}\n3 1 0 {n}\n{tags}{places}$EndNodes\n\
         $Elements\n1 {m} 1 {m}\n3 1 4 {m}\n{tets}$EndElements\n"
    )
}

//! What the numbers of element types in Gmsh's and VTK's files mean.

/// What an element is to a mesh of tetrahedra.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Kind {
    /// A tetrahedron; its first four nodes are the corners.
    Tetrahedron,
    /// Another volume element, by its plural.
    Other(&'static str),
    /// A point, line or face: it only says what its groups hold.
    Part,
}

const HEXAHEDRA: Kind = Kind::Other("hexahedra");
const PRISMS: Kind = Kind::Other("prisms");
const PYRAMIDS: Kind = Kind::Other("pyramids");

/// Most nodes of an element that Gmsh has.
pub(super) const MOST_NODES: usize = 125;

/// Gmsh's element types (manual, section "Node ordering"): kind and number of nodes.
pub(super) fn gmsh(number: i64) -> Option<(Kind, usize)> {
    Some(match number {
        1 => (Kind::Part, 2),
        2 => (Kind::Part, 3),
        3 => (Kind::Part, 4),
        4 => (Kind::Tetrahedron, 4),
        5 => (HEXAHEDRA, 8),
        6 => (PRISMS, 6),
        7 => (PYRAMIDS, 5),
        8 => (Kind::Part, 3),
        9 => (Kind::Part, 6),
        10 => (Kind::Part, 9),
        11 => (Kind::Tetrahedron, 10),
        12 => (HEXAHEDRA, 27),
        13 => (PRISMS, 18),
        14 => (PYRAMIDS, 14),
        15 => (Kind::Part, 1),
        16 => (Kind::Part, 8),
        17 => (HEXAHEDRA, 20),
        18 => (PRISMS, 15),
        19 => (PYRAMIDS, 13),
        20 => (Kind::Part, 9),
        21 => (Kind::Part, 10),
        22 => (Kind::Part, 12),
        23 | 24 => (Kind::Part, 15),
        25 => (Kind::Part, 21),
        26 => (Kind::Part, 4),
        27 => (Kind::Part, 5),
        28 => (Kind::Part, 6),
        29 => (Kind::Tetrahedron, 20),
        30 => (Kind::Tetrahedron, 35),
        31 => (Kind::Tetrahedron, 56),
        92 => (HEXAHEDRA, 64),
        93 => (HEXAHEDRA, 125),
        _ => return None,
    })
}

/// VTK's cell types (`vtkCellType.h`).
pub(super) fn vtk(number: i64) -> Option<Kind> {
    Some(match number {
        10 | 24 | 71 | 78 => Kind::Tetrahedron,
        11 | 12 | 25 | 29 | 33 | 72 | 79 => HEXAHEDRA,
        13 | 26 | 31 | 32 | 73 | 80 => PRISMS,
        14 | 27 | 37 | 74 | 81 => PYRAMIDS,
        15 | 16 | 41 | 42 => Kind::Other("polyhedra"),
        0..=9 | 21..=23 | 28 | 30 | 34..=36 | 68..=70 | 75..=77 => Kind::Part,
        _ => return None,
    })
}

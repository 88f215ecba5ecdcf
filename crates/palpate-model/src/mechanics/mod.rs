//! Small laws and the geometry they need: contact pressure, Lamé parameters, rotations, normals, rigid motions, paths, planes.

pub mod contact;
pub mod distance_grid;
pub mod lame;
pub mod motion;
pub mod normal;
pub mod path;
pub mod plane;
pub mod rotation;
pub mod series;
pub mod splat;

//! Small laws and the geometry they need: contact pressure, Lamé parameters, rotations, rigid motions, planes.

pub mod contact;
pub mod lame;
pub mod motion;
pub mod plane;
pub mod rotation;

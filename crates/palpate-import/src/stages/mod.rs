//! From what was read to what is written: units and axes, masks, thinning, the moment of release, the body.

pub mod body;
pub mod clouds;
pub mod crop;
pub mod masks;
pub mod plane;
pub mod points;
pub mod release;
pub mod settle;
pub mod thin;

//! What mechanics says must come out: motion in free space, beams, contact.

mod beam;
mod clamps;
mod contact;
mod cut;
mod damping;
mod effects_contact;
mod effects_loads;
mod effects_materials;
mod free;
mod materials;
mod order;
mod tets;

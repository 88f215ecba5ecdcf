//! What an import leaves: a recording, a scene, and in both a mark at everything that was guessed.

pub mod mark;
pub mod scene;

//! palpate fits the physics of soft bodies to measured motion.

mod embed;
mod interrupt;
pub mod render;
pub use embed::Embedding;
pub use interrupt::Interrupt;

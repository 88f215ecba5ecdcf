//! Pictures of deformed surfaces: pinhole cameras, a z-buffer, shading, and the sensor that turns exact depth into a reading.

mod camera;
mod raster;
mod sensor;
mod shade;
mod text;

pub use camera::{CameraError, Pinhole};
pub use raster::{DepthImage, rasterise};
pub use sensor::{DepthReading, Sensor};
pub use shade::{Picture, residual_colour, shade, shade_on};
pub use text::{Anchor, FONT, text_width};

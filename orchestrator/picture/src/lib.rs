//! Pictures and videos of a recorded run, without a browser: the swarm seen from above, as the page that [`view`] serves draws it.
//!
//! A [`stage::Stage`] is what holds for the whole run; it makes a [`scene::Scene`] of each frame: numbers in metres.
//! [`layout`] turns a scene into a [`drawing::Drawing`], shapes in pixels, which [`svg`] and
//! [`pdf`] write and [`raster`] paints. [`video`]
//! encodes pictures that follow each other.
//!
//! The rasteriser is tiny-skia, which is also that of resvg: shapes are painted without the way through the text of an SVG file,
//! which a frame of a video could not afford. Letters come from a font in the program, because servers often have none.

pub mod colours;
pub mod drawing;
pub mod font;
mod gif;
pub mod layout;
mod legend;
pub mod pdf;
pub mod raster;
pub mod scene;
pub mod span;
pub mod stage;
pub mod svg;
pub mod video;

#[cfg(test)]
mod tests;

//! Letters of pictures that are painted, from a font in the program: a server may have none.

use std::collections::BTreeMap;
use tiny_skia::{Path, PathBuilder};
use ttf_parser::{Face, GlyphId, OutlineBuilder};

/// Noto Sans, reduced to the letters of European languages; `font/OFL.txt` is its license.
pub(crate) const FONT: &[u8] = include_bytes!("../font/NotoSans-subset.ttf");

/// A font, and the outlines of letters that were used.
pub struct Font {
    face: Option<Face<'static>>,
    outlines: BTreeMap<u16, Option<Path>>,
}

impl Default for Font {
    fn default() -> Self {
        Self { face: Face::parse(FONT, 0).ok(), outlines: BTreeMap::new() }
    }
}

impl Font {
    /// Width of a text whose letters have a size of 1.
    #[must_use]
    pub fn width(&self, text: &str) -> f32 {
        text.chars().map(|letter| self.advance(self.glyph(letter))).sum()
    }

    /// Gives the outline of each letter in units of 1/`units_per_em` with y upwards, and where it begins on a line of size 1.
    pub fn outlines(&mut self, text: &str, mut take: impl FnMut(&Path, f32)) {
        let mut at = 0.0;
        for letter in text.chars() {
            let glyph = self.glyph(letter);
            let Self { face, outlines } = self;
            let outline = outlines.entry(glyph.0).or_insert_with(|| {
                let mut path = Outline(PathBuilder::new());
                face.as_ref()?.outline_glyph(glyph, &mut path)?;
                path.0.finish()
            });
            if let Some(outline) = outline {
                take(outline, at);
            }
            at += self.advance(glyph);
        }
    }

    /// Units of outlines in the size of a letter.
    #[must_use]
    pub fn units_per_em(&self) -> f32 {
        self.face.as_ref().map_or(1000.0, |face| f32::from(face.units_per_em()))
    }

    /// Left, lower, right and upper edge of all letters, in units of outlines.
    #[must_use]
    pub(crate) fn bounds(&self) -> [f32; 4] {
        let edges = self.face.as_ref().map(Face::global_bounding_box);
        edges.map_or([0.0; 4], |edges| {
            [edges.x_min, edges.y_min, edges.x_max, edges.y_max].map(f32::from)
        })
    }

    /// How far letters reach above and below their line, in units of outlines.
    #[must_use]
    pub(crate) fn ascent_descent(&self) -> [f32; 2] {
        self.face
            .as_ref()
            .map_or([0.0; 2], |face| [face.ascender(), face.descender()].map(f32::from))
    }

    /// The glyph of a letter; one that the font does not have is a box.
    pub(crate) fn glyph(&self, letter: char) -> GlyphId {
        self.face.as_ref().and_then(|face| face.glyph_index(letter)).unwrap_or_default()
    }

    fn advance(&self, glyph: GlyphId) -> f32 {
        let units = self.face.as_ref().and_then(|face| face.glyph_hor_advance(glyph));
        f32::from(units.unwrap_or_default()) / self.units_per_em()
    }
}

/// Makes a path of an outline.
struct Outline(PathBuilder);

impl OutlineBuilder for Outline {
    fn move_to(&mut self, x: f32, y: f32) {
        self.0.move_to(x, y);
    }

    fn line_to(&mut self, x: f32, y: f32) {
        self.0.line_to(x, y);
    }

    fn quad_to(&mut self, x1: f32, y1: f32, x: f32, y: f32) {
        self.0.quad_to(x1, y1, x, y);
    }

    fn curve_to(&mut self, x1: f32, y1: f32, x2: f32, y2: f32, x: f32, y: f32) {
        self.0.cubic_to(x1, y1, x2, y2, x, y);
    }

    fn close(&mut self) {
        self.0.close();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn letters_of_titles_and_axes_have_outlines() {
        let mut font = Font::default();
        for letter in "azAZ09−–·×…°µäßŁλЖ().,:".chars() {
            let mut n = 0;
            font.outlines(&letter.to_string(), |_, _| n += 1);
            assert!(n == 1 && font.glyph(letter) != GlyphId(0), "{letter}");
        }
    }

    #[test]
    fn digits_are_equally_wide() {
        let font = Font::default();
        assert!((font.width("1111") - font.width("0000")).abs() < 1e-6);
        assert!((0.4..0.7).contains(&font.width("0")));
    }
}

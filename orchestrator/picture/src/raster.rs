//! Pictures as pixels.

use crate::colours::Colour;
use crate::drawing::{Anchor, Drawing, Shape, Text};
use crate::font::Font;
use flate2::write::ZlibEncoder;
use flate2::{Compression, Crc};
use std::io::Write as _;
use tiny_skia::{
    FillRule, LineJoin, Paint, Pixmap, PixmapMut, PixmapPaint, Stroke, StrokeDash, Transform,
};

/// Paints pictures of one size that follow each other.
pub struct Canvas {
    font: Font,
    /// Everything that does not move.
    fixed: Pixmap,
    /// The plane without the swarm.
    fixed_plane: Pixmap,
    plane: Pixmap,
    picture: Pixmap,
    is_begun: bool,
}

impl Canvas {
    /// For pictures of this size and with this plane; `None` if one of them is empty, or too large to hold.
    #[must_use]
    pub fn new(drawing: &Drawing) -> Option<Self> {
        let [width, height] = drawing.size;
        let plane = Pixmap::new(drawing.plane.width, drawing.plane.height)?;
        let picture = Pixmap::new(width, height)?;
        Some(Self {
            font: Font::default(),
            fixed: picture.clone(),
            fixed_plane: plane.clone(),
            plane,
            picture,
            is_begun: false,
        })
    }

    /// Paints a picture of the size with which this began.
    ///
    /// * `is_fixed`: `site` and `frame` are as in the picture before.
    pub fn paint(&mut self, drawing: &Drawing, is_fixed: bool) -> &Pixmap {
        let (left, top) = (drawing.plane.left as f32, drawing.plane.top as f32);
        let on_plane = Transform::from_translate(-left, -top);
        if !(is_fixed && self.is_begun) {
            let background = skia(drawing.background);
            self.fixed_plane.fill(background);
            shapes(&mut self.fixed_plane.as_mut(), &mut self.font, &drawing.site, on_plane);
            self.fixed.fill(background);
            shapes(&mut self.fixed.as_mut(), &mut self.font, &drawing.frame, Transform::identity());
            self.is_begun = true;
        }
        self.plane.data_mut().copy_from_slice(self.fixed_plane.data());
        shapes(&mut self.plane.as_mut(), &mut self.font, &drawing.swarm, on_plane);
        self.picture.data_mut().copy_from_slice(self.fixed.data());
        let place = [drawing.plane.left as i32, drawing.plane.top as i32];
        let paint =
            PixmapPaint { blend_mode: tiny_skia::BlendMode::Source, ..PixmapPaint::default() };
        let identity = Transform::identity();
        self.picture.draw_pixmap(place[0], place[1], self.plane.as_ref(), &paint, identity, None);
        shapes(&mut self.picture.as_mut(), &mut self.font, &drawing.title, identity);
        &self.picture
    }
}

/// A picture without transparent pixels as a PNG file of eight bits a colour (ISO/IEC 15948). Its rows are not filtered, which
/// suits areas of one colour.
#[must_use]
pub fn png(picture: &Pixmap) -> Vec<u8> {
    let row_bytes = 4 * picture.width() as usize;
    let compressed = deflated(|to| {
        picture.data().chunks_exact(row_bytes).try_for_each(|row| {
            let colours = row.chunks_exact(4).flat_map(|pixel| &pixel[..3]).copied();
            let unfiltered: Vec<u8> = std::iter::once(0).chain(colours).collect();
            to.write_all(&unfiltered)
        })
    });
    let [width, height] = [picture.width(), picture.height()].map(u32::to_be_bytes);
    // Eight bits of red, green and blue; the one compression, the one set of filters, rows in order.
    let header = [&width[..], &height, &[8, 2, 0, 0, 0]].concat();
    let mut file = b"\x89PNG\r\n\x1a\n".to_vec();
    chunk(&mut file, b"IHDR", &header);
    chunk(&mut file, b"IDAT", &compressed);
    chunk(&mut file, b"IEND", &[]);
    file
}

/// What is written, compressed as zlib does (RFC 1950).
pub(crate) fn deflated(
    write: impl FnOnce(&mut ZlibEncoder<Vec<u8>>) -> std::io::Result<()>,
) -> Vec<u8> {
    let mut compressed = ZlibEncoder::new(Vec::new(), Compression::default());
    let written = write(&mut compressed);
    debug_assert!(written.is_ok(), "memory takes everything");
    compressed.finish().unwrap_or_default()
}

fn chunk(file: &mut Vec<u8>, name: &[u8; 4], content: &[u8]) {
    let mut crc = Crc::new();
    crc.update(name);
    crc.update(content);
    file.extend((content.len() as u32).to_be_bytes());
    file.extend(name);
    file.extend(content);
    file.extend(crc.sum().to_be_bytes());
}

fn skia(colour: Colour) -> tiny_skia::Color {
    let [red, green, blue] = colour.rgb;
    tiny_skia::Color::from_rgba8(red, green, blue, (colour.opacity * 255.0).round() as u8)
}

fn paint(colour: Colour, is_smooth: bool) -> Paint<'static> {
    let mut paint = Paint { anti_alias: is_smooth, ..Paint::default() };
    paint.set_color(skia(colour));
    paint
}

fn shapes(pixmap: &mut PixmapMut<'_>, font: &mut Font, shapes: &[Shape], transform: Transform) {
    for shape in shapes {
        match shape {
            Shape::Fill { path, colour, is_crisp, .. } => {
                let paint = paint(*colour, !is_crisp);
                pixmap.fill_path(path, &paint, FillRule::Winding, transform, None);
            }
            Shape::Line { path, colour, width, dash, .. } => {
                let dash = dash.and_then(|dash| StrokeDash::new(dash.to_vec(), 0.0));
                let stroke =
                    Stroke { width: *width, dash, line_join: LineJoin::Round, ..Stroke::default() };
                pixmap.stroke_path(path, &paint(*colour, true), &stroke, transform, None);
            }
            Shape::Text(text) => self::text(pixmap, font, text, transform),
        }
    }
}

fn text(pixmap: &mut PixmapMut<'_>, font: &mut Font, text: &Text, transform: Transform) {
    let Text { at: [x, y], size, .. } = *text;
    let shift = match text.anchor {
        Anchor::Start => 0.0,
        Anchor::Middle => -0.5,
        Anchor::End => -1.0,
    };
    let begin = shift * font.width(&text.text);
    let scale = size / font.units_per_em();
    let rotation = if text.is_upright { -90.0 } else { 0.0 };
    let line = transform.pre_translate(x, y).pre_concat(Transform::from_rotate(rotation));
    if let Some(halo) = text.halo {
        let paint = paint(halo, true);
        let stroke = Stroke { width: 3.0 / scale, line_join: LineJoin::Round, ..Stroke::default() };
        font.outlines(&text.text, |outline, at| {
            let letter = line.pre_translate((begin + at) * size, 0.0).pre_scale(scale, -scale);
            pixmap.stroke_path(outline, &paint, &stroke, letter, None);
        });
    }
    let paint = paint(text.colour, true);
    font.outlines(&text.text, |outline, at| {
        let letter = line.pre_translate((begin + at) * size, 0.0).pre_scale(scale, -scale);
        pixmap.fill_path(outline, &paint, FillRule::Winding, letter, None);
    });
}

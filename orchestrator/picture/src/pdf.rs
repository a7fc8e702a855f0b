//! Pictures as PDF files (ISO 32000-1), with letters as text in an embedded font: a journal's checks ask for that, and words
//! can be searched.

use crate::colours::Colour;
use crate::drawing::{Anchor, Drawing, Shape, Text};
use crate::font::{FONT, Font};
use pdf_writer::types::{
    CidFontType, FontFlags, LineJoinStyle, SystemInfo, TextRenderingMode, UnicodeCmap,
};
use pdf_writer::{Content, Filter, Finish as _, Name, Pdf, Rect, Ref, Str, TextStr};
use std::collections::{BTreeMap, BTreeSet};
use tiny_skia::{Path, PathSegment, Point};

/// What the font is called in the file.
const FONT_NAME: Name<'_> = Name(b"F");
/// Its name: letters of a subset stand before it.
const BASE_FONT: Name<'_> = Name(b"MURMUR+NotoSans-Regular");
const SYSTEM: SystemInfo<'_> =
    SystemInfo { registry: Str(b"Adobe"), ordering: Str(b"Identity"), supplement: 0 };

// Objects of the file.
const CATALOG: Ref = Ref::new(1);
const PAGES: Ref = Ref::new(2);
const PAGE: Ref = Ref::new(3);
const CONTENT: Ref = Ref::new(4);
const TYPE0: Ref = Ref::new(5);
const CID: Ref = Ref::new(6);
const DESCRIPTOR: Ref = Ref::new(7);
const FONT_FILE: Ref = Ref::new(8);
const CMAP: Ref = Ref::new(9);
const INFO: Ref = Ref::new(10);
/// The first of the graphics states.
const STATES: i32 = 20;

/// A picture as the bytes of a file; its units are points, 1/72 inch.
#[must_use]
pub fn pdf(drawing: &Drawing) -> Vec<u8> {
    let [width, height] = drawing.size.map(|length| length as f32);
    let mut page = Page {
        content: Content::new(),
        font: Font::default(),
        letters: BTreeMap::new(),
        opacities: BTreeSet::new(),
    };
    // From the left upper corner, as the shapes are.
    page.content.transform([1.0, 0.0, 0.0, -1.0, 0.0, height]);
    page.colour(drawing.background, false);
    page.content.rect(0.0, 0.0, width, height).fill_nonzero();
    page.content.save_state();
    let plane = drawing.plane;
    let [left, top] = [plane.left, plane.top].map(|edge| edge as f32);
    page.content.rect(left, top, plane.width as f32, plane.height as f32);
    page.content.clip_nonzero().end_path();
    drawing.site.iter().chain(&drawing.swarm).for_each(|shape| page.shape(shape));
    page.content.restore_state();
    drawing.frame.iter().chain(&drawing.title).for_each(|shape| page.shape(shape));
    page.file(drawing, [width, height])
}

/// A page that is being drawn.
struct Page {
    content: Content,
    font: Font,
    /// Letters that occur, by glyph.
    letters: BTreeMap<u16, char>,
    /// Opacities that occur, in thousandths.
    opacities: BTreeSet<u16>,
}

/// The name of the graphics state with an opacity.
fn state(opacity: u16) -> Vec<u8> {
    format!("O{opacity}").into_bytes()
}

impl Page {
    /// Sets the colour of what follows.
    fn colour(&mut self, colour: Colour, is_line: bool) {
        let [red, green, blue] = colour.rgb.map(|part| f32::from(part) / 255.0);
        if is_line {
            self.content.set_stroke_rgb(red, green, blue);
        } else {
            self.content.set_fill_rgb(red, green, blue);
        }
        let opacity = (colour.opacity.clamp(0.0, 1.0) * 1000.0).round() as u16;
        self.opacities.insert(opacity);
        self.content.set_parameters(Name(&state(opacity)));
    }

    fn shape(&mut self, shape: &Shape) {
        match shape {
            Shape::Fill { path, colour, .. } => {
                self.colour(*colour, false);
                self.path(path);
                self.content.fill_nonzero();
            }
            Shape::Line { path, colour, width, dash, .. } => {
                self.colour(*colour, true);
                self.content.set_line_width(*width).set_line_join(LineJoinStyle::RoundJoin);
                self.content.set_dash_pattern(dash.iter().flatten().copied(), 0.0);
                self.path(path);
                self.content.stroke();
            }
            Shape::Text(text) => self.text(text),
        }
    }

    fn path(&mut self, path: &Path) {
        let mut at = Point::zero();
        for segment in path.segments() {
            match segment {
                PathSegment::MoveTo(to) => {
                    self.content.move_to(to.x, to.y);
                    at = to;
                }
                PathSegment::LineTo(to) => {
                    self.content.line_to(to.x, to.y);
                    at = to;
                }
                PathSegment::QuadTo(by, to) => {
                    // The cubic with the same points.
                    let between = |a: Point, b: Point| {
                        [a.x + 2.0 / 3.0 * (b.x - a.x), a.y + 2.0 / 3.0 * (b.y - a.y)]
                    };
                    let ([x1, y1], [x2, y2]) = (between(at, by), between(to, by));
                    self.content.cubic_to(x1, y1, x2, y2, to.x, to.y);
                    at = to;
                }
                PathSegment::CubicTo(by, then_by, to) => {
                    self.content.cubic_to(by.x, by.y, then_by.x, then_by.y, to.x, to.y);
                    at = to;
                }
                PathSegment::Close => {
                    self.content.close_path();
                }
            }
        }
    }

    fn text(&mut self, text: &Text) {
        let Text { at: [x, y], size, .. } = *text;
        let shift = match text.anchor {
            Anchor::Start => 0.0,
            Anchor::Middle => -0.5,
            Anchor::End => -1.0,
        };
        let begin = shift * size * self.font.width(&text.text);
        let mut glyphs = Vec::new();
        for letter in text.text.chars() {
            let glyph = self.font.glyph(letter).0;
            self.letters.insert(glyph, letter);
            glyphs.extend(glyph.to_be_bytes());
        }
        // Letters stand upright on a page whose y runs downwards.
        let matrix = if text.is_upright {
            [0.0, -1.0, -1.0, 0.0, x, y - begin]
        } else {
            [1.0, 0.0, 0.0, -1.0, x + begin, y]
        };
        if let Some(halo) = text.halo {
            self.colour(halo, true);
            self.content.set_line_width(2.0).set_line_join(LineJoinStyle::RoundJoin);
            self.content.set_dash_pattern([], 0.0);
            self.letters_at(matrix, size, TextRenderingMode::Stroke, &glyphs);
        }
        self.colour(text.colour, false);
        self.letters_at(matrix, size, TextRenderingMode::Fill, &glyphs);
    }

    fn letters_at(&mut self, matrix: [f32; 6], size: f32, mode: TextRenderingMode, glyphs: &[u8]) {
        self.content.begin_text();
        self.content.set_font(FONT_NAME, size).set_text_rendering_mode(mode);
        self.content.set_text_matrix(matrix).show(Str(glyphs));
        self.content.end_text();
    }

    /// The file with the page.
    fn file(self, drawing: &Drawing, [width, height]: [f32; 2]) -> Vec<u8> {
        let Self { content, font, letters, opacities } = self;
        let states: Vec<(u16, Ref)> = opacities.into_iter().zip((STATES..).map(Ref::new)).collect();
        let mut file = Pdf::new();
        file.catalog(CATALOG).pages(PAGES);
        file.document_info(INFO)
            .title(TextStr(&drawing.name))
            .subject(TextStr(&drawing.alternative))
            .producer(TextStr(concat!("murmuration ", env!("CARGO_PKG_VERSION"))));
        file.pages(PAGES).kids([PAGE]).count(1);
        let mut page = file.page(PAGE);
        page.media_box(Rect::new(0.0, 0.0, width, height)).parent(PAGES).contents(CONTENT);
        let mut resources = page.resources();
        resources.fonts().pair(FONT_NAME, TYPE0);
        let mut by_name = resources.ext_g_states();
        for (opacity, at) in &states {
            by_name.pair(Name(&state(*opacity)), *at);
        }
        by_name.finish();
        resources.finish();
        page.finish();
        for (opacity, at) in states {
            let opacity = f32::from(opacity) / 1000.0;
            file.ext_graphics(at).stroking_alpha(opacity).non_stroking_alpha(opacity);
        }
        let drawn = deflated(&content.finish());
        file.stream(CONTENT, &drawn).filter(Filter::FlateDecode);
        font_objects(&mut file, &font, &letters);
        file.finish()
    }
}

/// Writes the font: all of it, since it is small, with the letters that its glyphs are.
fn font_objects(file: &mut Pdf, font: &Font, letters: &BTreeMap<u16, char>) {
    let per_mille = 1000.0 / font.units_per_em();
    file.type0_font(TYPE0)
        .base_font(BASE_FONT)
        .encoding_predefined(Name(b"Identity-H"))
        .descendant_font(CID)
        .to_unicode(CMAP);
    let mut cid = file.cid_font(CID);
    cid.subtype(CidFontType::Type2).base_font(BASE_FONT).system_info(SYSTEM);
    cid.font_descriptor(DESCRIPTOR).default_width(0.0);
    cid.cid_to_gid_map_predefined(Name(b"Identity"));
    let mut widths = cid.widths();
    for (&glyph, &letter) in letters {
        widths.consecutive(glyph, [1000.0 * font.width(letter.encode_utf8(&mut [0; 4]))]);
    }
    widths.finish();
    cid.finish();
    let [left, bottom, right, top] = font.bounds().map(|edge| per_mille * edge);
    let [ascent, descent] = font.ascent_descent().map(|height| per_mille * height);
    file.font_descriptor(DESCRIPTOR)
        .name(BASE_FONT)
        .flags(FontFlags::NON_SYMBOLIC)
        .bbox(Rect::new(left, bottom, right, top))
        .italic_angle(0.0)
        .ascent(ascent)
        .descent(descent)
        .cap_height(ascent)
        .stem_v(80.0)
        .font_file2(FONT_FILE);
    let outlines = deflated(FONT);
    file.stream(FONT_FILE, &outlines)
        .filter(Filter::FlateDecode)
        .pair(Name(b"Length1"), FONT.len() as i32);
    let mut map: UnicodeCmap<u16> = UnicodeCmap::new(Name(b"Letters"), SYSTEM);
    for (&glyph, &letter) in letters {
        map.pair(glyph, letter);
    }
    file.cmap(CMAP, &map.finish());
}

fn deflated(bytes: &[u8]) -> Vec<u8> {
    crate::raster::deflated(|to| std::io::Write::write_all(to, bytes))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::drawing::Plane;
    use flate2::read::ZlibDecoder;
    use std::io::Read as _;
    use tiny_skia::PathBuilder;

    fn inflated(file: &[u8]) -> Vec<String> {
        let mut texts = Vec::new();
        for (at, _) in file.windows(7).enumerate().filter(|(_, bytes)| *bytes == b"stream\n") {
            let mut text = Vec::new();
            if ZlibDecoder::new(&file[at + 7..]).read_to_end(&mut text).is_ok() {
                texts.push(String::from_utf8_lossy(&text).into_owned());
            }
        }
        texts
    }

    #[test]
    fn a_picture_is_a_page_with_its_text_in_an_embedded_font() {
        let mut path = PathBuilder::new();
        path.move_to(1.0, 2.0);
        path.quad_to(4.0, 2.0, 4.0, 5.0);
        let text = |is_upright| {
            Shape::Text(Text {
                at: [50.0, 20.0],
                anchor: Anchor::Middle,
                size: 8.0,
                text: "µ 1".to_owned(),
                colour: Colour::of(0x00_72b2).with_opacity(0.5),
                halo: None,
                is_upright,
            })
        };
        let drawing = Drawing {
            size: [100, 60],
            background: Colour::of(0xff_ffff),
            plane: Plane { left: 0, top: 0, width: 100, height: 60 },
            site: Vec::new(),
            swarm: Vec::new(),
            frame: vec![
                Shape::Line {
                    path: path.finish().unwrap(),
                    colour: Colour::of(0),
                    width: 1.0,
                    dash: None,
                    robot: None,
                },
                text(false),
            ],
            title: vec![text(true)],
            name: "A picture".to_owned(),
            alternative: "What it shows.".to_owned(),
        };
        let file = pdf(&drawing);
        assert_eq!(file, pdf(&drawing));
        assert!(file.starts_with(b"%PDF-1.7") && file.ends_with(b"%%EOF"));
        let texts = inflated(&file);
        let content = &texts[0];
        // A quadratic curve is the cubic with the same points.
        assert!(content.contains("1 2 m\n3 2 4 3 4 5 c\nS"), "{content}");
        assert!(content.contains("/O500 gs") && content.contains("/F 8 Tf"), "{content}");
        // Half of the width lies on either side of the middle.
        let half = 4.0 * Font::default().width("µ 1");
        assert!(content.contains(&format!("1 0 0 -1 {} 20 Tm", 50.0 - half)), "{content}");
        assert!(content.contains(&format!("0 -1 -1 0 50 {} Tm", 20.0 + half)), "{content}");
        let all = String::from_utf8_lossy(&file);
        assert!(all.contains("/FontFile2") && all.contains("<00B5>"), "letters are known by name");
    }
}

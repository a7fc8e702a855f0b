//! Pictures as an animated GIF.

use crate::colours::Theme;
use gif::{Encoder, EncodingError, Frame, Repeat};
use std::borrow::Cow;
use std::collections::BTreeMap;
use std::io::Write;

/// The colour of the palette that leaves a pixel as it was.
const UNCHANGED: u8 = 255;

/// Encodes pictures of one size with the colours of a theme.
pub(crate) struct GifWriter<W: Write> {
    encoder: Encoder<W>,
    size: [usize; 2],
    palette: Vec<[u8; 3]>,
    /// The nearest colour of the palette, of colours that came up.
    nearest: BTreeMap<[u8; 3], u8>,
    /// The picture before, as colours of the palette; empty before the first.
    before: Vec<u8>,
    now: Vec<u8>,
}

impl<W: Write> GifWriter<W> {
    pub(crate) fn new(
        out: W,
        [width, height]: [u16; 2],
        theme: &Theme,
    ) -> Result<Self, EncodingError> {
        let palette = theme.palette();
        let colours: Vec<u8> = palette.iter().flatten().copied().collect();
        let mut encoder = Encoder::new(out, width, height, &colours)?;
        encoder.set_repeat(Repeat::Infinite)?;
        Ok(Self {
            encoder,
            size: [width, height].map(usize::from),
            palette,
            nearest: BTreeMap::new(),
            before: Vec::new(),
            now: Vec::new(),
        })
    }

    /// Adds a picture that is shown for `delay` hundredths of a second. `rgba`: opaque pixels.
    pub(crate) fn add(&mut self, rgba: &[u8], delay: u16) -> Result<(), EncodingError> {
        let mut now = std::mem::take(&mut self.now);
        now.clear();
        let mut last = ([0; 3], self.nearest([0; 3]));
        now.extend(rgba.chunks_exact(4).map(|pixel| {
            let colour = [pixel[0], pixel[1], pixel[2]];
            if colour != last.0 {
                last = (colour, self.nearest(colour));
            }
            last.1
        }));
        let [width, height] = self.size;
        let ([left, top, right, bottom], transparent) = if self.before.is_empty() {
            ([0, 0, width, height], None)
        } else {
            (changed(&self.before, &now, width), Some(UNCHANGED))
        };
        let mut buffer = Vec::with_capacity((right - left) * (bottom - top));
        for row in top..bottom {
            let pixels = row * width + left..row * width + right;
            if self.before.is_empty() {
                buffer.extend_from_slice(&now[pixels]);
            } else {
                let pairs = now[pixels.clone()].iter().zip(&self.before[pixels]);
                buffer.extend(
                    pairs.map(|(now, before)| if now == before { UNCHANGED } else { *now }),
                );
            }
        }
        let frame = Frame {
            delay,
            left: left as u16,
            top: top as u16,
            width: (right - left) as u16,
            height: (bottom - top) as u16,
            transparent,
            buffer: Cow::Owned(buffer),
            ..Frame::default()
        };
        self.encoder.write_frame(&frame)?;
        self.now = std::mem::replace(&mut self.before, now);
        Ok(())
    }

    pub(crate) fn finish(self) -> Result<W, EncodingError> {
        self.encoder.into_inner()
    }

    fn nearest(&mut self, colour: [u8; 3]) -> u8 {
        let palette = &self.palette;
        *self.nearest.entry(colour).or_insert_with(|| {
            let distance = |other: &[u8; 3]| -> i32 {
                (0..3).map(|i| (i32::from(other[i]) - i32::from(colour[i])).pow(2)).sum()
            };
            let nearest = palette.iter().enumerate().min_by_key(|(_, other)| distance(other));
            nearest.map_or(0, |(index, _)| index as u8)
        })
    }
}

/// The rectangle in which two pictures differ: left, top, right and bottom edge. One pixel if they do not.
fn changed(before: &[u8], now: &[u8], width: usize) -> [usize; 4] {
    let mut edges = [width, usize::MAX, 0, 0];
    for (row, (before, now)) in before.chunks(width).zip(now.chunks(width)).enumerate() {
        if before == now {
            continue;
        }
        let differs = |(before, now): (&u8, &u8)| before != now;
        let first = before.iter().zip(now).position(differs).unwrap_or_default();
        let last = before.iter().zip(now).rposition(differs).unwrap_or_default();
        edges = [edges[0].min(first), edges[1].min(row), edges[2].max(last + 1), row + 1];
    }
    if edges[1] == usize::MAX { [0, 0, 1, 1] } else { edges }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_rectangle_that_changed_holds_every_pixel_that_did() {
        let before = [0; 12];
        let mut now = before;
        assert_eq!(changed(&before, &now, 4), [0, 0, 1, 1]);
        now[5] = 1;
        now[10] = 1;
        assert_eq!(changed(&before, &now, 4), [1, 1, 3, 3]);
    }

    #[test]
    fn a_palette_leaves_room_for_unchanged_pixels() {
        for is_dark in [false, true] {
            let palette = Theme::new(is_dark).palette();
            assert!((150..=255).contains(&palette.len()), "{}", palette.len());
        }
    }
}

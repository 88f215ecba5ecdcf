//! Text and lines on pictures, without a browser and without fonts of the system.

use crate::render::shade::Picture;
use ab_glyph::{Font, FontRef, PxScale, ScaleFont, point};

/// The font of all pictures: DejaVu Sans, its Latin and Greek letters and signs.
pub const FONT: &[u8] = include_bytes!("../../assets/report/vendor/DejaVuSans.ttf");

/// Where a text stands around its place.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Anchor {
    /// It begins there.
    Start,
    /// Its middle is there.
    Middle,
    /// It ends there.
    End,
}

fn font() -> FontRef<'static> {
    FontRef::try_from_slice(FONT).expect("the font that is part of the program can be read")
}

/// Width of a text [pixels] whose letters are `size` pixels high.
pub fn text_width(text: &str, size: f64) -> f64 {
    let font = font();
    let scaled = font.as_scaled(PxScale::from(size as f32));
    text.chars().map(|c| f64::from(scaled.h_advance(scaled.glyph_id(c)))).sum()
}

impl Picture {
    /// Writes a text of `size` pixels whose middle height is at `row`.
    pub fn text(&mut self, column: f64, row: f64, size: f64, anchor: Anchor, colour: [u8; 3], text: &str) {
        if !(column.is_finite() && row.is_finite()) {
            return;
        }
        let font = font();
        let scaled = font.as_scaled(PxScale::from(size as f32));
        let shift = match anchor {
            Anchor::Start => 0.0,
            Anchor::Middle => 0.5,
            Anchor::End => 1.0,
        };
        let mut x = (column - shift * text_width(text, size)) as f32;
        // Capitals reach from the base line up to some 0.7 of the ascent.
        let base = row as f32 + 0.35 * scaled.ascent();
        for c in text.chars() {
            let id = scaled.glyph_id(c);
            let glyph = id.with_scale_and_position(PxScale::from(size as f32), point(x, base));
            if let Some(outline) = font.outline_glyph(glyph) {
                let corner = outline.px_bounds().min;
                outline.draw(|dx, dy, cover| {
                    self.blend(i64::from(dx) + corner.x as i64, i64::from(dy) + corner.y as i64, colour, f64::from(cover));
                });
            }
            x += scaled.h_advance(id);
        }
    }

    /// Mixes a colour into a pixel, as far as it lies in the picture.
    pub fn blend(&mut self, x: i64, y: i64, colour: [u8; 3], share: f64) {
        if x < 0 || y < 0 || x >= self.width as i64 || y >= self.height as i64 {
            return;
        }
        let share = share.clamp(0.0, 1.0);
        let pixel = &mut self.rgb[y as usize * self.width + x as usize];
        for (old, new) in pixel.iter_mut().zip(colour) {
            *old = (f64::from(*old) * (1.0 - share) + f64::from(new) * share).round() as u8;
        }
    }

    /// A line between two places (column, row), so many pixels wide, with soft edges; `share` of its colour covers what is there.
    pub fn line(&mut self, a: (f64, f64), b: (f64, f64), width: f64, colour: [u8; 3], share: f64) {
        if ![a.0, a.1, b.0, b.1].iter().all(|x| x.is_finite()) {
            return;
        }
        let pad = 0.5 * width + 1.0;
        let range = |p: f64, q: f64, n: usize| {
            let (lo, hi) = ((p.min(q) - pad).floor().max(0.0), (p.max(q) + pad).ceil().min(n as f64 - 1.0));
            lo as i64..=hi as i64
        };
        let (dx, dy) = (b.0 - a.0, b.1 - a.1);
        let length2 = (dx * dx + dy * dy).max(1e-12);
        let steep = dy.abs() > dx.abs();
        // Row by row (or column by column) only as far as the line is wide there.
        let (long, (from, to), (other_from, slope)) = match steep {
            true => (range(a.1, b.1, self.height), (a.1, b.1), (a.0, dx / dy)),
            false => (range(a.0, b.0, self.width), (a.0, b.0), (a.1, if dx == 0.0 { 0.0 } else { dy / dx })),
        };
        for k in long {
            let along = (k as f64).clamp(from.min(to), from.max(to));
            let middle = other_from + (along - from) * slope;
            let reach = pad * 1.5;
            for m in (middle - reach).floor() as i64..=(middle + reach).ceil() as i64 {
                let (x, y) = if steep { (m, k) } else { (k, m) };
                let (px, py) = (x as f64 - a.0, y as f64 - a.1);
                let t = ((px * dx + py * dy) / length2).clamp(0.0, 1.0);
                let distance = ((px - t * dx).powi(2) + (py - t * dy).powi(2)).sqrt();
                self.blend(x, y, colour, share * (0.5 * width + 0.5 - distance).clamp(0.0, 1.0));
            }
        }
    }

    /// A disc around (column, row) with soft edge.
    pub fn disc(&mut self, column: f64, row: f64, radius: f64, colour: [u8; 3]) {
        if !(column.is_finite() && row.is_finite() && column.abs() < 1e6 && row.abs() < 1e6) {
            return;
        }
        for y in (row - radius - 1.0).floor() as i64..=(row + radius + 1.0).ceil() as i64 {
            for x in (column - radius - 1.0).floor() as i64..=(column + radius + 1.0).ceil() as i64 {
                let distance = (x as f64 - column).hypot(y as f64 - row);
                self.blend(x, y, colour, radius + 0.5 - distance);
            }
        }
    }

    /// Fills a rectangle from (x, y) on.
    pub fn fill(&mut self, (x, y): (usize, usize), (width, height): (usize, usize), colour: [u8; 3]) {
        for row in y..(y + height).min(self.height) {
            for column in x..(x + width).min(self.width) {
                self.rgb[row * self.width + column] = colour;
            }
        }
    }

    /// Copies another picture into this one, its corner at (x, y).
    pub fn paste(&mut self, other: &Picture, (x, y): (usize, usize)) {
        for row in 0..other.height.min(self.height.saturating_sub(y)) {
            for column in 0..other.width.min(self.width.saturating_sub(x)) {
                self.rgb[(y + row) * self.width + x + column] = other.rgb[row * other.width + column];
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn letters_lines_and_discs_darken_what_they_cover_and_nothing_else() {
        let mut p = Picture::blank(60, 30);
        let white = p.rgb[0];
        p.text(30.0, 15.0, 14.0, Anchor::Middle, [0; 3], "Ωµ 3");
        let touched: Vec<usize> = (0..p.rgb.len()).filter(|i| p.rgb[*i] != white).collect();
        assert!(touched.len() > 40, "{}", touched.len());
        let width = text_width("Ωµ 3", 14.0);
        assert!(touched.iter().all(|i| ((i % 60) as f64 - 30.0).abs() <= 0.5 * width + 1.5), "within its width");
        assert!(touched.iter().all(|i| ((i / 60) as f64 - 15.0).abs() <= 9.0), "around its row");
        let mut p = Picture::blank(40, 40);
        p.line((5.0, 5.0), (35.0, 20.0), 2.0, [0; 3], 1.0);
        assert_eq!((p.rgb[12 * 40 + 20][0] < 130, p.rgb[30 * 40 + 20]), (true, white));
        // Nothing happens beyond the edges, nor at places that are no numbers.
        p.disc(-3.0, 100.0, 5.0, [0; 3]);
        p.line((f64::NAN, 0.0), (1.0, 1.0), 1.0, [0; 3], 1.0);
        p.text(-500.0, 1.0, 12.0, Anchor::Start, [0; 3], "out");
    }
}

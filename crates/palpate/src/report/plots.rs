//! Charts as SVG and as pictures: what pages show where no program runs, and what `palpate pictures` writes.

use crate::render::{FONT, Picture};
use crate::report::quantity::digits;
use crate::results::report::{Chart, Role, Series, Style};
use plotters::coord::Shift;
use plotters::coord::ranged1d::{DefaultFormatting, KeyPointHint, Ranged};
use plotters::prelude::*;
use std::ops::Range;
use std::sync::Once;

/// Size of a chart [pixels].
pub const SIZE: (u32, u32) = (720, 320);
/// Height of a line of the legend [pixels].
const LEGEND: u32 = 20;

/// Colours of both motions, of what was measured, of noise, and of searches: told apart by who sees no red or no green, and none of them
/// yellow (Okabe & Ito, Color universal design, 2008).
pub const BEFORE: [u8; 3] = [213, 94, 0];
/// Of the second motion.
pub const AFTER: [u8; 3] = [0, 90, 200];
/// Of measurements.
pub const MEASURED: [u8; 3] = [30, 30, 30];
/// Of what noise would leave.
pub const NOISE: [u8; 3] = [110, 110, 110];
/// Of searches that are not the best.
pub const SEARCH: [u8; 3] = [120, 160, 185];

fn colour_of(role: Role) -> RGBColor {
    let [r, g, b] = match role {
        Role::Before => BEFORE,
        Role::After => AFTER,
        Role::Measured => MEASURED,
        Role::Noise => NOISE,
        Role::Search => SEARCH,
    };
    RGBColor(r, g, b)
}

/// Points of a series.
fn points(s: &Series) -> impl Iterator<Item = (f64, f64)> {
    s.x.numbers().zip(s.y.numbers())
}

impl Chart {
    /// Points that can be drawn: finite, and above zero on a logarithmic axis, as their logarithm.
    fn drawn(&self) -> Vec<Vec<(f64, f64)>> {
        let one = |(x, y): (f64, f64)| {
            let y = if self.logarithmic { y.log10() } else { y };
            (x.is_finite() && y.is_finite()).then_some((x, y))
        };
        self.series.iter().map(|s| points(s).filter_map(one).collect()).collect()
    }

    /// The chart as SVG; `None` when there is nothing to draw.
    pub fn svg(&self) -> Option<String> {
        let mut svg = String::new();
        {
            let area = SVGBackend::with_string(&mut svg, SIZE).into_drawing_area();
            self.draw(&area, 1.0)?;
            area.present().ok()?;
        }
        // The size it has is a proposal; where the page is narrower, it becomes smaller.
        let title = self.words.replace('&', "&amp;").replace('<', "&lt;").replace('"', "&quot;");
        Some(svg.replacen("<svg ", &format!("<svg role=\"img\" aria-label=\"{title}\" "), 1))
    }

    /// The chart as a picture, twice as large.
    pub fn picture(&self) -> Option<Picture> {
        let (w, h) = (2 * SIZE.0, 2 * SIZE.1);
        let mut buffer = vec![255u8; (w * h * 3) as usize];
        {
            let area = BitMapBackend::with_buffer(&mut buffer, (w, h)).into_drawing_area();
            self.draw(&area, 2.0)?;
            area.present().ok()?;
        }
        let rgb = buffer.chunks_exact(3).map(|c| [c[0], c[1], c[2]]).collect();
        Some(Picture { width: w as usize, height: h as usize, rgb })
    }

    /// Draws it, lines and letters `zoom` times as large.
    fn draw<DB: DrawingBackend>(&self, area: &DrawingArea<DB, Shift>, zoom: f64) -> Option<()> {
        static FONTS: Once = Once::new();
        // Text is measured, and drawn in pictures, with the font that the program brings along.
        FONTS.call_once(|| {
            let _ = plotters::style::register_font("sans-serif", FontStyle::Normal, FONT);
        });
        let all = self.drawn();
        let x = padded(extent(all.iter().flatten().map(|p| p.0))?, 0.02, None);
        let columns = self.series.iter().any(|s| s.style == Style::Columns);
        let zero = (!self.logarithmic).then_some(0.0).filter(|_| columns);
        let y = padded(extent(all.iter().flatten().map(|p| p.1))?, 0.06, zero);
        let px = |n: f64| (n * zoom).round() as u32;
        area.fill(&WHITE).ok()?;
        let (legend, plot) = area.split_vertically(px(f64::from(self.legend_lines() * LEGEND) + 8.0));
        self.legend(&legend, zoom)?;
        let (mut across, upwards) = (ticks(&x, 9, false), ticks(&y, 6, self.logarithmic));
        if self.x == "iteration" {
            // Nothing happens between two of them.
            across.retain(|v| (v - v.round()).abs() < 1e-9);
        }
        let mut chart = ChartBuilder::on(&plot)
            .margin_top(px(6.0))
            .margin_right(px(24.0))
            .margin_bottom(px(4.0))
            .x_label_area_size(px(40.0))
            .y_label_area_size(px(72.0))
            .build_cartesian_2d(Axis { range: x, ticks: across }, Axis { range: y, ticks: upwards })
            .ok()?;
        let font = ("sans-serif", 13.0 * zoom).into_font().color(&RGBColor(40, 40, 40));
        let logarithmic = self.logarithmic;
        chart
            .configure_mesh()
            .x_desc(&self.x)
            .y_desc(&self.y)
            .light_line_style(TRANSPARENT)
            .bold_line_style(RGBColor(225, 225, 225))
            .axis_style(RGBColor(110, 110, 110))
            .label_style(font.clone())
            .axis_desc_style(font)
            .x_label_formatter(&|v| label(*v))
            .y_label_formatter(&move |v| if logarithmic { label(10f64.powf(*v)) } else { label(*v) })
            .draw()
            .ok()?;
        for (s, points) in self.series.iter().zip(all) {
            let colour = colour_of(s.role);
            let line = colour.stroke_width(px(2.0));
            match s.style {
                Style::Line => drop(chart.draw_series(LineSeries::new(points, line)).ok()?),
                Style::Dashed => {
                    let dashes = DashedLineSeries::new(points, px(7.0), px(5.0), line);
                    chart.draw_series(dashes).ok()?;
                }
                Style::Dots => {
                    let dot = |p| Circle::new(p, px(2.5), colour.filled());
                    chart.draw_series(points.into_iter().map(dot)).ok()?;
                }
                Style::Columns => {
                    let half = 0.5 * points.windows(2).map(|w| w[1].0 - w[0].0).next().unwrap_or(1.0);
                    let column = |(x, y): (f64, f64)| Rectangle::new([(x - half, 0.0), (x + half, y)], colour.mix(0.45).filled());
                    chart.draw_series(points.into_iter().map(column)).ok()?;
                }
            }
        }
        Some(())
    }

    /// Labels with their places in the legend [pixels]: side by side, in as many lines as it takes.
    fn legend_places(&self) -> Vec<(usize, f64, u32)> {
        let (mut x, mut line, mut out) = (72.0, 0, Vec::new());
        for (k, s) in self.series.iter().enumerate().filter(|(_, s)| !s.label.is_empty()) {
            let width = 40.0 + crate::render::text_width(&s.label, 15.0);
            if x > 72.0 && x + width > f64::from(SIZE.0) - 8.0 {
                (x, line) = (72.0, line + 1);
            }
            out.push((k, x, line));
            x += width;
        }
        out
    }

    fn legend_lines(&self) -> u32 {
        self.legend_places().last().map_or(0, |p| p.2 + 1)
    }

    fn legend<DB: DrawingBackend>(&self, area: &DrawingArea<DB, Shift>, zoom: f64) -> Option<()> {
        let at = |v: f64| (v * zoom).round() as i32;
        for (k, x, line) in self.legend_places() {
            let s = &self.series[k];
            let colour = colour_of(s.role);
            let y = f64::from(line * LEGEND) + 13.0;
            let stroke = colour.stroke_width((2.0 * zoom) as u32);
            match s.style {
                Style::Dots => area.draw(&Circle::new((at(x + 11.0), at(y)), (2.5 * zoom) as i32, colour.filled())).ok()?,
                Style::Columns => {
                    let corners = [(at(x), at(y - 5.0)), (at(x + 22.0), at(y + 5.0))];
                    area.draw(&Rectangle::new(corners, colour.mix(0.45).filled())).ok()?;
                }
                Style::Line => area.draw(&PathElement::new([(at(x), at(y)), (at(x + 22.0), at(y))], stroke)).ok()?,
                Style::Dashed => {
                    for dash in [0.0, 8.5, 17.0] {
                        area.draw(&PathElement::new([(at(x + dash), at(y)), (at(x + dash + 5.0), at(y))], stroke)).ok()?;
                    }
                }
            }
            let font = ("sans-serif", 13.0 * zoom).into_font().color(&RGBColor(40, 40, 40));
            area.draw(&Text::new(s.label.clone(), (at(x + 27.0), at(y - 7.0)), font)).ok()?;
        }
        Some(())
    }
}

/// A linear axis with ticks of its own: those of plotters crowd or miss where a logarithm is drawn.
struct Axis {
    range: Range<f64>,
    ticks: Vec<f64>,
}

impl Ranged for Axis {
    type FormatOption = DefaultFormatting;
    type ValueType = f64;

    fn map(&self, value: &f64, (from, to): (i32, i32)) -> i32 {
        let share = (value - self.range.start) / (self.range.end - self.range.start);
        from + (share * f64::from(to - from)).round() as i32
    }

    fn key_points<Hint: KeyPointHint>(&self, hint: Hint) -> Vec<f64> {
        if hint.weight().allow_light_points() { Vec::new() } else { self.ticks.clone() }
    }

    fn range(&self) -> Range<f64> {
        self.range.clone()
    }
}

fn extent(values: impl Iterator<Item = f64>) -> Option<Range<f64>> {
    let (lo, hi) = values.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), v| (a.min(v), b.max(v)));
    (lo <= hi).then_some(lo..hi)
}

/// A range with room at its ends; one without width gets some, and one that begins at `fixed` begins there.
fn padded(r: Range<f64>, share: f64, fixed: Option<f64>) -> Range<f64> {
    let width = r.end - r.start;
    let pad = if width > 1e-12 * r.end.abs().max(r.start.abs()) { share * width } else { 0.5 * r.end.abs().max(1e-3) };
    fixed.map_or(r.start - pad, |f| f.min(r.start))..r.end + pad
}

/// Round numbers in a range, about so many. On a logarithmic axis powers of ten; with few of these, twice and five times them as well.
fn ticks(r: &Range<f64>, count: usize, logarithmic: bool) -> Vec<f64> {
    let within = |v: &f64| *v >= r.start && *v <= r.end;
    if logarithmic {
        let decades = (r.start.floor() as i32..=r.end.ceil() as i32).map(f64::from);
        let every = ((r.end - r.start) / count as f64).ceil().max(1.0) as i32;
        let whole: Vec<f64> = decades.clone().filter(within).collect();
        if whole.len() > 2 {
            return whole.into_iter().filter(|d| (*d as i32) % every == 0).collect();
        }
        let more: Vec<f64> = decades.flat_map(|d| [d, d + 2f64.log10(), d + 5f64.log10()]).filter(within).collect();
        if more.len() > 2 {
            return more;
        }
        // Less than a factor of five from end to end: round values on the way, at their logarithms.
        let values = ticks(&(10f64.powf(r.start)..10f64.powf(r.end)), count, false);
        return values.into_iter().filter(|v| *v > 0.0).map(f64::log10).collect();
    }
    let step = crate::report::quantity::round_up((r.end - r.start) / count as f64);
    let (first, last) = ((r.start / step).ceil() as i64, (r.end / step).floor() as i64);
    (first..=last).map(|k| k as f64 * step).collect()
}

/// A tick's number, short and without the zeros that rounding leaves.
fn label(v: f64) -> String {
    if v == 0.0 || v.abs() < 1e-15 {
        return "0".into();
    }
    let (factor, sign) = match v.abs() {
        a if !(1e-3..1e6).contains(&a) => {
            let power = a.log10().floor() as i32;
            let raised: String = power
                .to_string()
                .chars()
                .map(|c| c.to_digit(10).map_or('⁻', |d| "⁰¹²³⁴⁵⁶⁷⁸⁹".chars().nth(d as usize).unwrap_or('?')))
                .collect();
            (10f64.powi(-power), format!("·10{raised}"))
        }
        _ => (1.0, String::new()),
    };
    let text = digits(v * factor, 4);
    let text = if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.') } else { &text };
    format!("{}{sign}", text.replace('-', "−"))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn chart(points: Vec<(f64, f64)>, logarithmic: bool) -> Chart {
        let series = vec![Series::new("run 1 & <best>", Role::After, Style::Line, points)];
        let words = "cost \"of\" <all>".into();
        Chart { words, x: "iteration".into(), y: "cost".into(), logarithmic, series, ..Chart::default() }
    }

    #[test]
    fn a_chart_becomes_svg_and_a_picture_and_nothing_becomes_nothing() {
        let c = chart(vec![(0.0, 10.0), (1.0, 0.1), (2.0, f64::INFINITY)], true);
        let svg = c.svg().unwrap();
        assert!(svg.starts_with("<svg role=\"img\"") && svg.contains("iteration") && svg.contains("polyline"), "{svg}");
        assert!(!svg.contains("NaN") && !svg.contains("inf") && !svg.contains("<best>") && !svg.contains("<all>"), "{svg}");
        let p = c.picture().unwrap();
        assert!(p.rgb.contains(&AFTER) && p.width == 2 * SIZE.0 as usize);
        assert!(chart(vec![(0.0, 3.0)], false).svg().is_some(), "a single point has no extent, but a picture");
        assert!(chart(vec![], false).svg().is_none() && chart(vec![(0.0, 0.0)], true).svg().is_none());
    }

    #[test]
    fn axes_have_a_few_round_ticks_whatever_their_range() {
        for (from, to) in [(0.3, 0.9), (7.0, 11.0), (1.0, 1.1), (1e-3, 1e6), (2.0, 30.0)] {
            let all = ticks(&(f64::log10(from)..f64::log10(to)), 6, true);
            assert!((2..=12).contains(&all.len()), "{from} to {to}: {all:?}");
            let all = ticks(&(from..to), 6, false);
            assert!((2..=7).contains(&all.len()), "{from} to {to}: {all:?}");
        }
        let written = [0.0, -0.25, 1500.0, 2e6, 1e-4].map(label);
        assert_eq!(written, ["0", "−0.25", "1500", "2·10⁶", "1·10⁻⁴"]);
    }
}

//! Curves as SVG.

use plotters::coord::ranged1d::ValueFormatter;
use plotters::prelude::*;
use std::ops::Range;

/// A labelled curve.
pub struct Curve {
    /// Label in the legend; empty for none.
    pub label: String,
    /// Points (x, y); those that are not finite are left out.
    pub points: Vec<(f64, f64)>,
}

const SIZE: (u32, u32) = (640, 280);

fn extent(curves: &[Curve], pick: impl Fn(&(f64, f64)) -> f64) -> Option<Range<f64>> {
    let values = curves.iter().flat_map(|c| &c.points).filter(|p| p.0.is_finite() && p.1.is_finite()).map(pick);
    let (lo, hi) = values.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), v| (a.min(v), b.max(v)));
    // A range without width cannot be drawn.
    let pad = if hi > lo { 0.0 } else { 0.5 * hi.abs().max(1e-3) };
    (lo <= hi).then_some(lo - pad..hi + pad)
}

/// Curves over a common axis; `None` when there is nothing to draw.
pub fn curves(curves: &[Curve], x_label: &str, y_label: &str, logarithmic: bool) -> Option<String> {
    let x = extent(curves, |p| p.0)?;
    let y = extent(curves, |p| p.1)?;
    let mut svg = String::new();
    {
        let area = SVGBackend::with_string(&mut svg, SIZE).into_drawing_area();
        if logarithmic {
            let low = curves.iter().flat_map(|c| &c.points).map(|p| p.1).filter(|v| *v > 0.0).fold(f64::INFINITY, f64::min);
            // A cost of 0 lies off every logarithmic axis.
            let low = if low.is_finite() { low } else { return None };
            let range = (low / 1.3..y.end.max(low) * 1.3).log_scale();
            draw(&area, curves, x, range, x_label, y_label, low / 1.3).ok()?;
        } else {
            let top = y.end.max(0.0) * 1.08;
            let range = y.start.min(0.0) * 1.08..top;
            draw(&area, curves, x, range, x_label, y_label, f64::NEG_INFINITY).ok()?;
        }
    }
    Some(svg)
}

/// A tick's number, without the zeros that rounding leaves.
fn tick(v: f64) -> String {
    if v == 0.0 || (1e-3..1e6).contains(&v.abs()) { format!("{}", (v * 1e6).round() / 1e6) } else { format!("{v:.1e}") }
}

fn draw<'a, Y>(
    area: &DrawingArea<SVGBackend<'a>, plotters::coord::Shift>,
    curves: &[Curve],
    x: Range<f64>,
    y: Y,
    x_label: &str,
    y_label: &str,
    lowest: f64,
) -> Result<(), Box<dyn std::error::Error + 'a>>
where
    Y: plotters::coord::ranged1d::AsRangedCoord<Value = f64>,
    Y::CoordDescType: ValueFormatter<f64>,
{
    let mut chart = ChartBuilder::on(area)
        .margin(8)
        .margin_right(28)
        .x_label_area_size(36)
        .y_label_area_size(64)
        .build_cartesian_2d(x, y)
        .map_err(|e| e.to_string())?;
    chart
        .configure_mesh()
        .x_desc(x_label)
        .y_desc(y_label)
        .light_line_style(TRANSPARENT)
        .label_style(("sans-serif", 14))
        .x_label_formatter(&|v| tick(*v))
        .y_label_formatter(&|v| tick(*v))
        .draw()
        .map_err(|e| e.to_string())?;
    for (i, c) in curves.iter().enumerate() {
        let color = Palette99::pick(i).to_rgba();
        let points = c.points.iter().copied().filter(|p| p.0.is_finite() && p.1.is_finite()).map(|p| (p.0, p.1.max(lowest)));
        let series = chart.draw_series(LineSeries::new(points, color.stroke_width(2))).map_err(|e| e.to_string())?;
        if !c.label.is_empty() {
            series.label(c.label.clone()).legend(move |(x, y)| PathElement::new([(x, y), (x + 16, y)], color.stroke_width(2)));
        }
    }
    if curves.iter().any(|c| !c.label.is_empty()) {
        chart
            .configure_series_labels()
            .position(SeriesLabelPosition::MiddleRight)
            .background_style(WHITE.mix(0.8))
            .draw()
            .map_err(|e| e.to_string())?;
    }
    area.present().map_err(|e| e.to_string())?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn curves_become_svg_and_nothing_becomes_nothing() {
        let c = |points: Vec<(f64, f64)>| [Curve { label: "run 1".into(), points }];
        let svg = curves(&c(vec![(0.0, 10.0), (1.0, 0.1), (2.0, f64::INFINITY)]), "iteration", "cost", true).unwrap();
        assert!(svg.starts_with("<svg") && svg.contains("iteration") && svg.contains("run 1") && svg.contains("polyline"));
        assert!(!svg.contains("NaN") && !svg.contains("inf"));
        assert!(curves(&c(vec![(0.0, 3.0)]), "t", "mm", false).is_some(), "a single point has no extent, but a picture");
        assert!(curves(&c(vec![]), "t", "mm", false).is_none() && curves(&c(vec![(0.0, 0.0)]), "t", "J", true).is_none());
    }
}

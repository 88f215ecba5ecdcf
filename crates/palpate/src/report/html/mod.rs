//! Reports: pages that need nothing else, neither files nor the network.

mod diagnosis;
mod fit;

pub use diagnosis::{DiagnosisInput, diagnosis_html};
pub use fit::{ReportInput, fit_html};

use super::pictures::FramePicture;
use super::plots::{Curve, curves};
use crate::residuals::ResidualSummary;
use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use maud::{DOCTYPE, Markup, PreEscaped, html};

const STYLE: &str = include_str!("style.css");

/// A whole page with a title, which is its first heading too.
fn page(title: &str, body: &Markup) -> String {
    let page = html! {
        (DOCTYPE)
        html lang="en" {
            head {
                meta charset="utf-8";
                title { (title) }
                style { (PreEscaped(STYLE)) }
            }
            body {
                h1 { (title) }
                (body)
            }
        }
    };
    page.into_string()
}

/// Heads of a table's columns: those of numbers stand right.
fn heads(columns: &[(&str, Column)]) -> Markup {
    html! {
        tr {
            @for (name, kind) in columns {
                @match kind {
                    Column::Text => th { (name) },
                    Column::Number => th.n { (name) },
                }
            }
        }
    }
}

/// What a column of a table holds.
#[derive(Clone, Copy)]
enum Column {
    Text,
    Number,
}

/// A unit beside a number; nothing for a number without one.
fn unit(unit: &str) -> &str {
    if unit == "1" { "" } else { unit }
}

/// Pictures side by side with a caption.
fn figure<'a>(pictures: impl IntoIterator<Item = &'a FramePicture>, caption: &str) -> Markup {
    html! {
        figure.pair {
            @for p in pictures {
                img alt="" src={ "data:image/png;base64," (STANDARD.encode(p.picture.png())) };
            }
            figcaption { (caption) }
        }
    }
}

/// Curves as a picture; `None` where there is nothing to draw. The drawing escapes what it is given.
fn plot(lines: &[Curve], x_label: &str, y_label: &str, logarithmic: bool) -> Option<Markup> {
    curves(lines, x_label, y_label, logarithmic).map(PreEscaped)
}

/// Residuals against time [s], in millimetres.
fn over_time(label: &str, r: &ResidualSummary) -> Curve {
    Curve { label: label.into(), points: r.frames.iter().map(|f| (f.time, f.rms * 1e3)).collect() }
}

/// What to type to get the same, and what the last line of a page says of the computation.
fn reproduce(command: &str, backend: &str, effort: &str) -> Markup {
    html! {
        h2 { "Reproduce" }
        pre { (command) }
        p { "palpate " (env!("CARGO_PKG_VERSION")) ", backend " (backend) ", " (effort) "." }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_a_user_named_cannot_break_a_page() {
        let name = "<script>alert(\"x\")</script> & co";
        let page = page(name, &reproduce(name, "cpu", "1.0 s"));
        assert!(page.starts_with("<!DOCTYPE html><html lang=\"en\">") && page.ends_with("</body></html>"));
        assert!(!page.contains("<script"), "{page}");
        assert_eq!(page.matches("&lt;script&gt;alert(&quot;x&quot;)&lt;/script&gt; &amp; co").count(), 3);
        let line = Curve { label: name.into(), points: vec![(0.0, 1.0), (1.0, 2.0)] };
        let drawing = plot(&[line], "t", "mm", false).expect("there is something to draw").into_string();
        assert!(drawing.starts_with("<svg") && !drawing.contains("<script"), "{drawing}");
    }
}

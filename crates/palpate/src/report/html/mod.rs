//! Reports: pages that need nothing else, neither files nor the network. What they show in space and as charts lies in them as data
//! ([`ReportData`]); the programs beside it draw that, and where none runs, and on paper, pictures stand in their place.

mod diagnosis;
mod fit;
mod map;
mod scene;

pub(crate) use diagnosis::title as diagnosis_title;
pub use diagnosis::{DiagnosisInput, diagnosis_html};
pub(super) use fit::title as fit_title;
pub use fit::{ReportInput, fit_html};

use crate::error::Error;
use crate::results;
use crate::results::report::{Chart, ReportData};
use maud::{DOCTYPE, Markup, PreEscaped, html};
use palpate_io::{InputError, read_text};
use std::path::Path;

const STYLE: &str = include_str!("../../../assets/report/style.css");
const CHART_STYLE: &str = include_str!("../../../assets/report/vendor/uPlot.min.css");
/// Libraries first, what uses them behind.
const PROGRAMS: [&str; 7] = [
    include_str!("../../../assets/report/vendor/uPlot.iife.min.js"),
    include_str!("../../../assets/report/vendor/three.min.js"),
    include_str!("../../../assets/report/data.js"),
    include_str!("../../../assets/report/charts.js"),
    include_str!("../../../assets/report/space.js"),
    include_str!("../../../assets/report/viewer.js"),
    include_str!("../../../assets/report/page.js"),
];
/// Nothing is loaded from anywhere, whatever a library or a text in the page might ask for.
const POLICY: &str = "default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; img-src data: blob:";

/// What stands before and behind the data in a page.
const DATA: (&str, &str) = ("<script type=\"application/json\" id=\"report-data\">", "</script>");

/// The data as they stand in a page: within the text of a script no `<` may stand.
fn block(data: &ReportData) -> String {
    results::line(data).replace('<', "\\u003c")
}

/// What the page in a file shows.
///
/// # Errors
/// The file cannot be read, or holds no such data of a version that is understood.
pub fn read_report(path: &Path) -> Result<ReportData, Error> {
    let text = read_text(path)?;
    let found = text.split_once(DATA.0).and_then(|(_, rest)| rest.split_once(DATA.1));
    let (data, _) = found.ok_or_else(|| {
        InputError::file(
            path,
            "is no report with data inside: one that `palpate fit` or `palpate diagnose` of this version wrote is needed",
        )
    })?;
    Ok(results::parse(data, path)?)
}

/// A whole page with a title, which is its first heading too; what is worth knowing first stands below it.
fn page(title: &str, first: &Markup, body: &Markup, data: &ReportData) -> String {
    let page = html! {
        (DOCTYPE)
        html lang="en" {
            head {
                meta charset="utf-8";
                meta name="viewport" content="width=device-width, initial-scale=1";
                meta name="color-scheme" content="light dark";
                meta http-equiv="Content-Security-Policy" content=(POLICY);
                title { (title) }
                style { (PreEscaped(CHART_STYLE)) (PreEscaped(STYLE)) }
            }
            body {
                a.skip href="#first" { "To the result" }
                header {
                    h1 { (title) }
                    button #theme type="button" hidden { "Dark" }
                }
                main #first {
                    (first)
                    (body)
                }
                (PreEscaped(DATA.0)) (PreEscaped(block(data))) (PreEscaped(DATA.1))
                @for program in PROGRAMS {
                    script { (PreEscaped(program)) }
                }
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
                    Column::Text => th scope="col" { (name) },
                    Column::Number => th.n scope="col" { (name) },
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

/// A chart as a figure; nothing where there is nothing to draw. The drawing escapes what it is given.
fn chart(c: &Chart) -> Markup {
    html! {
        @if let Some(svg) = c.svg() {
            figure.chart data-chart=(c.key) {
                div.static { (PreEscaped(svg)) }
                figcaption { (c.title) }
            }
        }
    }
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
    use crate::results::report::{Role, Series, Style};

    #[test]
    fn what_a_user_named_cannot_break_a_page() {
        let name = "</script><script>alert(\"x\")</script> & co";
        let series = vec![Series::new(name, Role::After, Style::Line, [(0.0, 1.0), (1.0, 2.0)])];
        let named =
            Chart { key: "a-0".into(), title: name.into(), words: name.into(), x: name.into(), series, ..Chart::default() };
        let data = ReportData { title: name.into(), charts: vec![named.clone()], ..ReportData::default() };
        let page = page(name, &chart(&named), &reproduce(name, "cpu", "1.0 s"), &data);
        assert!(page.starts_with("<!DOCTYPE html><html lang=\"en\">") && page.ends_with("</body></html>"));
        // The page's own programs and its data, and nothing else, are scripts.
        assert_eq!(page.matches("<script").count(), PROGRAMS.len() + 1);
        assert!(!page.contains("<script>alert") && page.contains("&lt;script&gt;alert(&quot;x&quot;)&lt;/script&gt; &amp; co"));
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("report.html");
        std::fs::write(&path, page).unwrap();
        assert_eq!(read_report(&path).unwrap(), data, "what was put in comes out");
        std::fs::write(&path, "<html></html>").unwrap();
        assert!(read_report(&path).unwrap_err().to_string().contains("is no report with data inside"));
    }

    #[test]
    fn programs_hold_nothing_that_ends_a_script() {
        assert!(PROGRAMS.iter().all(|p| !p.to_lowercase().contains("</script")));
    }
}

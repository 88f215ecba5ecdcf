//! Figures in the sentences and mixed tables of pages, written from what `bench/` holds: the page has to contain each of them.

use crate::bench::page::SHOWN;
use crate::table::stored;
use serde_json::Value;
use std::path::Path;

/// A page, the figures as it writes them, and the file that they come from.
pub struct Figure {
    /// The page.
    pub page: &'static str,
    /// What stands there.
    pub text: String,
    /// Its source.
    pub source: String,
}

/// A number of a row; none where there is no such key.
fn number(row: &Value, key: &str) -> f64 {
    row[key].as_f64().unwrap_or(f64::NAN)
}

fn largest(rows: &[Value], key: &str) -> f64 {
    rows.iter().map(|r| number(r, key).abs()).fold(f64::NAN, f64::max)
}

/// In per cent, with the sign that pages write.
fn signed(x: f64) -> String {
    let text = format!("{x:.1} %");
    if text == "-0.0 %" { "0.0 %".into() } else { text.replace('-', "−") }
}

fn rows(of: &Value, key: &str) -> Vec<Value> {
    of[key].as_array().cloned().unwrap_or_default()
}

/// Rows of the study of finer cells with a penalty and a noise.
fn finer(all: &[Value], ghost: f64, noise: f64) -> Vec<Value> {
    all.iter().filter(|r| number(r, "ghost") == ghost && number(r, "noise") == noise).cloned().collect()
}

/// The cells of a row of the table of finer cells: what was not measured is a dash.
fn across(rows: &[Value]) -> String {
    let cell = |size: f64| {
        let found = rows.iter().find(|r| number(r, "cell") == size);
        found.map_or("–".into(), |r| signed(number(r, "mean_percent")))
    };
    [0.03, 0.024, 0.02, 0.016].map(cell).join(" | ")
}

/// Milliseconds of a step, a cost and an adjoint.
fn times(run: &Value, name: &str) -> String {
    let line = rows(run, "lines").into_iter().find(|l| l["name"] == name).unwrap_or_default();
    let ms = |key: &str| 1e3 * number(&line[key], "median");
    let short = |x: f64| if x < 9.95 { format!("{x:.1}") } else { format!("{x:.0}") };
    format!("{} / {} / {} ms", short(ms("forward")), short(ms("cost")), short(ms("adjoint")))
}

/// Every figure that is compared.
///
/// # Errors
/// A file of `bench/` is no JSON.
pub fn all(root: &Path) -> Result<Vec<Figure>, String> {
    let mut out = Vec::new();
    let mut add = |page, source: &str, text: String| out.push(Figure { page, text, source: format!("bench/{source}.json") });
    let (readme, method) = ("README.md", "docs/method.md");

    let torus: Value = stored(root, "paper-torus")?;
    for row in rows(&torus, "lines") {
        let [hit, of, off, n] = ["converged", "starts", "mean_error_percent", "evaluations"].map(|k| number(&row, k));
        add(readme, "paper-torus", format!("| {hit} of {of}, {off:.2} % off, {n} evaluations |"));
    }

    let study = rows(&stored(root, "paper-finer")?, "finer");
    let noisy = finer(&study, 0.02, 0.1);
    let off: Vec<String> = noisy.iter().map(|r| format!("{:.1}", number(r, "mean_percent").abs())).collect();
    add(readme, "paper-finer", format!("{} % off", off.join(" / ")));
    for (ghost, noise) in [(0.02, 0.02), (0.02, 0.1), (0.002, 0.02)] {
        add(method, "paper-finer", format!("| {} |", across(&finer(&study, ghost, noise))));
    }

    let several = rows(&stored(root, "paper-gravity")?, "several");
    if let [seen, few] = &several[..] {
        add(
            readme,
            "paper-gravity",
            format!("{} of {} end as well as the best", number(seen, "arrived"), number(seen, "starts")),
        );
        add(method, "paper-gravity", format!("gravity is found to {:.2} %", number(seen, "gravity_error_percent")));
        add(method, "paper-gravity", format!("(correlation {:.2})", number(few, "correlation")).replace('-', "−"));
    }

    let planes = rows(&stored(root, "paper-ball")?, "lines");
    let [hit, of] = ["converged", "starts"].map(|k| planes.iter().map(|r| number(r, k)).sum::<f64>());
    add(readme, "paper-ball", format!("{hit} of {of}, at most {:.1} % off", largest(&planes, "mean_error_percent")));

    let gradients = rows(&stored(root, "paper-gradient")?, "gradients");
    let costs = gradients.iter().map(|r| number(r, "adjoint_cost"));
    let (least, most) = (costs.clone().fold(f64::NAN, f64::min), costs.fold(f64::NAN, f64::max));
    let exact = largest(&gradients, "central_percent");
    let text = format!("within {exact:.3} % of central differences, {least:.1} to {most:.1} times the cost's time");
    add(readme, "paper-gradient", text);

    let run: Value = stored(root, SHOWN)?;
    add(readme, SHOWN, times(&run, "dragon"));
    add(readme, SHOWN, times(&run, "dragon, effects absent"));
    Ok(out)
}

/// Figures that their page does not have.
pub fn check(root: &Path, found: &mut Vec<String>) {
    let figures = match all(root) {
        Ok(figures) => figures,
        Err(e) => return found.push(e),
    };
    for f in figures {
        if !std::fs::read_to_string(root.join(f.page)).is_ok_and(|text| text.contains(&f.text)) {
            found.push(format!("{}: does not say \"{}\", which is what {} holds", f.page, f.text, f.source));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pages_say_what_was_measured_and_a_wrong_figure_is_found() {
        let figures = all(&crate::table::root()).unwrap();
        assert!(figures.len() >= 12 && figures.iter().all(|f| !f.text.contains("NaN")), "{}", figures.len());
        let mut found = Vec::new();
        check(&crate::table::root(), &mut found);
        assert_eq!(found, Vec::<String>::new());
        // Elsewhere there are neither pages nor measurements: nothing is found right.
        check(&std::env::temp_dir().join("palpate-no-such-folder"), &mut found);
        assert!(found.iter().any(|f| f.contains("does not say")), "{found:?}");
    }
}

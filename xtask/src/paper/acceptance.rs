//! What was promised of a study, beside what its last rows say: the table of its page.

use super::cases::{Figures, Row};
use Bound::{Around, AtLeast, AtMost, Below, Between};
use Figure::{Of, Over};

/// Where a line's number comes from.
pub enum Figure {
    /// The figure of this name.
    Of(&'static str),
    /// The first over the second.
    Over(&'static str, &'static str),
}

impl Figure {
    fn of(&self, figures: &Figures) -> Option<f64> {
        match self {
            Of(name) => figures.get(*name).copied(),
            Over(a, b) => Some(figures.get(*a)? / figures.get(*b)?),
        }
    }
}

/// A limit, by its power of ten where it is small.
fn bound(x: f64) -> String {
    if x != 0.0 && x.abs() < 1e-3 { format!("{x:e}") } else { x.to_string() }
}

/// What is aimed at.
pub enum Bound {
    /// Less than this.
    Below(f64),
    /// No more than this.
    AtMost(f64),
    /// No less than this.
    AtLeast(f64),
    /// A middle, and how far on either side.
    Around(f64, f64),
    /// From the first to the second.
    Between(f64, f64),
}

impl Bound {
    fn holds(&self, x: f64) -> bool {
        match *self {
            Below(most) => x < most,
            AtMost(most) => x <= most,
            AtLeast(least) => x >= least,
            Around(middle, by) => (x - middle).abs() <= by,
            Between(low, high) => (low..=high).contains(&x),
        }
    }

    fn text(&self) -> String {
        match self {
            Below(most) => format!("< {}", bound(*most)),
            AtMost(most) => format!("≤ {}", bound(*most)),
            AtLeast(least) => format!("≥ {least}"),
            Around(middle, by) => format!("{middle} ± {by}"),
            Between(low, high) => format!("{low} to {high}"),
        }
    }
}

/// Acceptance, what is looked at, case, figure, the paper's own number, and what is aimed at.
pub type Aim = (&'static str, &'static str, &'static str, Figure, &'static str, Bound);

/// A figure with three decimals, or by its power of ten where these would not tell it from nothing.
fn number(x: f64) -> String {
    if x != 0.0 && x.abs() < 0.01 { format!("{x:.1e}") } else { format!("{x:.3}") }
}

/// The table in Markdown; cases without a row stand with a dash.
pub fn markdown(aims: &[Aim], rows: &[Row]) -> String {
    let mut out = String::from("| | | paper | aim | here | | measured |\n|---|---|---|---|---|---|---|\n");
    for (id, what, case, figure, paper, bound) in aims {
        let row = rows.iter().rev().find(|r| r.case == *case);
        let (here, met, measured) = match row.and_then(|r| Some((r, figure.of(&r.figures)?))) {
            Some((r, x)) => {
                let word = if bound.holds(x) { "met" } else { "missed" };
                (number(x), word, format!("{}, {}, {:.0} s", r.made.date, r.made.commit, r.seconds))
            }
            None => ("–".into(), "–", "–".into()),
        };
        out += &format!("| {id} | {what} | {paper} | {} | {here} | {met} | {measured} |\n", bound.text());
    }
    out
}

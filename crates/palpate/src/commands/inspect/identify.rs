//! What `palpate inspect --identify` says.

use super::Lines;
use crate::results::inspection::Identification;
use palpate_engine::number;
use palpate_model::params::unit_behind;

/// What the recording would determine, and which second motion would help.
pub(super) fn identified(found: &Identification) -> Lines {
    let unit = |u: &str| unit_behind(u);
    let mut lines = Lines::new();
    for n in &found.numbers {
        let relative = n.relative.map_or(String::new(), |r| format!(" ({:.2} %)", 100.0 * r));
        let with = if n.with.is_empty() { String::new() } else { format!("; not told apart from {}", n.with.join(", ")) };
        let (value, error) = (number(n.value), number(n.error));
        let text = match (n.determined, n.gain) {
            (true, None) => format!("{} = {value}{}: expected ± {error}{}{relative}{with}", n.path, unit(&n.unit), unit(&n.unit)),
            (true, Some(gain)) => {
                let percent = n.relative.map_or(error, |r| format!("{:.1} %", 100.0 * r));
                format!("{}: expected ± {percent}, {:.0} % less variance than the prior alone has", n.path, 100.0 * gain)
            }
            (false, _) => format!("{}: undetermined by this recording{with}", n.path),
        };
        lines.push(("identify", text));
    }
    for m in found.motions.iter().take(3) {
        let gains = found.numbers.iter().zip(&m.errors).filter(|(n, e)| **e < 0.5 * n.error);
        let gains: Vec<String> = gains.take(3).map(|(n, e)| format!("{} to ± {}{}", n.path, number(*e), unit(&n.unit))).collect();
        let gains = if gains.is_empty() { "no number to less than half its error".into() } else { gains.join(", ") };
        lines.push(("next", format!("{}: {:.1} nats more; brings {gains}", m.motion, m.information)));
    }
    lines.extend(found.warnings.iter().map(|w| ("left out", w.clone())));
    lines
}

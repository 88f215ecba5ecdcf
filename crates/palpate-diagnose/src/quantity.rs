//! Measured numbers as people write them.

/// Digits after which a number without a standard error is cut.
const DIGITS: i32 = 4;
/// Most digits of a number whose standard error is tiny.
const MOST: i32 = 7;

/// A distance [m] in millimetres.
pub fn millimetres(x: f64) -> String {
    format!("{:.3} mm", x * 1e3)
}

/// Decimal exponent of the first digit.
fn exponent(x: f64) -> i32 {
    if x == 0.0 || !x.is_finite() { 0 } else { x.abs().log10().floor() as i32 }
}

/// A value with its standard error: two digits of the error, and the value as far as that, though at least two digits of it (a value
/// below its error is no zero); without an error four digits.
///
/// ```
/// # use palpate_diagnose::stated;
/// assert_eq!(stated(0.0040, Some(1.91e-5)), "0.004000 ± 0.000019");
/// assert_eq!(stated(20690.3, Some(91.2)), "20690 ± 91");
/// assert_eq!(stated(2.5e-5, Some(3.14e-6)), "(2.50 ± 0.31)e-5");
/// assert_eq!(stated(8.2e4, Some(4.4e6)), "8.2e4 ± 4.4e6");
/// assert_eq!(stated(0.62, None), "0.6200");
/// ```
pub fn stated(value: f64, error: Option<f64>) -> String {
    let error = error.filter(|e| e.is_finite() && *e > 0.0);
    let largest = value.abs().max(error.unwrap_or(0.0));
    let top = exponent(largest);
    let finest = top + 1 - MOST;
    // Last digits of the value and of its error.
    let last = match error {
        Some(e) if value == 0.0 => [(exponent(e) - 1).max(finest); 2],
        Some(e) => [exponent(e).min(exponent(value)) - 1, exponent(e) - 1].map(|digit| digit.max(finest)),
        None => [top + 1 - DIGITS; 2],
    };
    // Numbers far from one are written with a common power of ten, unless the value would begin with zeros.
    let power = if (-3..6).contains(&top) { 0 } else { top };
    if let Some(e) = error
        && power != 0
        && value != 0.0
        && exponent(value) < exponent(e)
    {
        return format!("{value:.1e} ± {e:.1e}");
    }
    let scale = 10f64.powi(-power);
    let digits = |x: f64, last: i32| format!("{:.*}", (power - last).max(0) as usize, x * scale);
    let value = digits(value, last[0]);
    match (error.map(|e| digits(e, last[1])), power) {
        (Some(e), 0) => format!("{value} ± {e}"),
        (Some(e), p) => format!("({value} ± {e})e{p}"),
        (None, 0) => value,
        (None, p) => format!("{value}e{p}"),
    }
}

#[cfg(test)]
mod tests {
    use super::stated;

    #[test]
    fn numbers_are_as_long_as_their_errors_allow() {
        let cases = [
            (47296.0, Some(42.16), "47296 ± 42"),
            (-9.8066, Some(0.012), "-9.807 ± 0.012"),
            (0.0, Some(0.5), "0.00 ± 0.50"),
            (1.0, Some(250.0), "1.0 ± 250"),
            (12_300.0, Some(2.9e7), "1.2e4 ± 2.9e7"),
            (2.5e6, Some(4.41e6), "(2.5 ± 4.4)e6"),
            (-0.04, Some(12.0), "-0.040 ± 12"),
            (1e-12, Some(0.5), "0.0000000 ± 0.50"),
            (2.5e7, Some(1.2e6), "(2.50 ± 0.12)e7"),
            (1.234_567_89, Some(1e-12), "1.234568 ± 0.000000"),
            (3.0, Some(f64::NAN), "3.000"),
            (0.0, None, "0.000"),
            (1.5e-9, None, "1.500e-9"),
        ];
        for (value, error, text) in cases {
            assert_eq!(stated(value, error), text);
        }
    }
}

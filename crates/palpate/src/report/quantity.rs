//! Numbers as people write them: `274 ± 27 kPa`, `0.43 mm`, with SI prefixes and as many digits as the error leaves.

use palpate_diagnose::stated;

/// Prefixes by the power of ten that they stand for.
const PREFIXES: [(i32, &str); 9] =
    [(-12, "p"), (-9, "n"), (-6, "µ"), (-3, "m"), (0, ""), (3, "k"), (6, "M"), (9, "G"), (12, "T")];

/// Units that take a prefix, alone or before what they are divided or multiplied by: `mm/s`, `kPa·s`, `kN/m³`.
const PREFIXED: [&str; 8] = ["Pa", "m", "s", "N", "Hz", "J", "W", "V"];

/// True where a prefix before the unit means what it says: not before a power (`m²`) nor before `kg`.
fn takes_prefix(unit: &str) -> bool {
    let first = unit.split(['/', '·', ' ']).next().unwrap_or("");
    PREFIXED.contains(&first)
}

/// Power of ten, a multiple of three, before a unit for numbers of this size.
fn power(size: f64, unit: &str) -> (i32, &'static str) {
    if !takes_prefix(unit) || size == 0.0 || !size.is_finite() {
        return (0, "");
    }
    let wanted = (size.log10().floor() as i32).div_euclid(3) * 3;
    PREFIXES.into_iter().min_by_key(|(p, _)| (p - wanted).abs()).expect("there are prefixes")
}

/// Factor from SI to the unit that numbers up to this size are written in, and that unit.
pub fn unit_for(size: f64, unit: &str) -> (f64, String) {
    let (power, prefix) = power(size.abs(), unit);
    let unit = if unit == "1" { "" } else { unit };
    (10f64.powi(-power), format!("{prefix}{unit}"))
}

/// A value with its standard error and unit.
///
/// ```
/// # use palpate::report::quantity;
/// assert_eq!(quantity(51186.2, Some(1253.4), "Pa"), "51.2 ± 1.3 kPa");
/// assert_eq!(quantity(2.737e5, None, "Pa"), "273.7 kPa");
/// assert_eq!(quantity(0.0054, Some(0.0002), "s"), "5.40 ± 0.20 ms");
/// assert_eq!(quantity(0.45, Some(0.01), "1"), "0.450 ± 0.010");
/// ```
pub fn quantity(value: f64, error: Option<f64>, unit: &str) -> String {
    let error = error.filter(|e| e.is_finite() && *e > 0.0);
    if !value.is_finite() {
        return "not known".into();
    }
    let (factor, unit) = unit_for(value.abs().max(error.unwrap_or(0.0)), unit);
    if value == 0.0 && error.is_none() {
        return format!("0 {unit}").trim_end().to_string();
    }
    let number = powers(&stated(value * factor, error.map(|e| e * factor)));
    if unit.is_empty() { number } else { format!("{number} {unit}") }
}

/// A size in two digits with its unit, as parts of an error are told.
pub fn size(x: f64, unit: &str) -> String {
    if !x.is_finite() {
        return "not known".into();
    }
    let (factor, unit) = unit_for(x, unit);
    let number =
        if (1e-3..1e6).contains(&(x * factor).abs()) { digits(x * factor, 2) } else { powers(&format!("{:.1e}", x * factor)) };
    if unit.is_empty() { number } else { format!("{number} {unit}") }
}

/// `1.2e-5` as 1.2·10⁻⁵.
fn powers(text: &str) -> String {
    let raise = |c: char| c.to_digit(10).and_then(|d| "⁰¹²³⁴⁵⁶⁷⁸⁹".chars().nth(d as usize)).unwrap_or('⁻');
    let mut out = String::new();
    let mut rest = text;
    while let Some(at) = rest.find('e') {
        let digits: String = rest[at + 1..].chars().take_while(|c| c.is_ascii_digit() || *c == '-').collect();
        out += &rest[..at];
        out += &format!("·10{}", digits.chars().map(raise).collect::<String>());
        rest = &rest[at + 1 + digits.len()..];
    }
    out + rest
}

/// A length in millimetres, with three digits.
pub fn millimetres(x: f64) -> String {
    if x.is_finite() { format!("{} mm", digits(x * 1e3, 3)) } else { "not known".into() }
}

/// A number with so many significant digits, without an exponent.
pub fn digits(x: f64, count: i32) -> String {
    if x == 0.0 || !x.is_finite() {
        return format!("{x}");
    }
    let behind = (count - 1 - x.abs().log10().floor() as i32).clamp(0, 12) as usize;
    format!("{x:.behind$}")
}

/// A round number near and not below: 1, 2 or 5 times a power of ten.
pub fn round_up(x: f64) -> f64 {
    if !(x > 0.0 && x.is_finite()) {
        return 1.0;
    }
    let power = 10f64.powf(x.log10().floor());
    // 1 + 1e-9: what is round but for its last bits stays.
    [1.0, 2.0, 5.0, 10.0].into_iter().map(|f| f * power).find(|r| *r * (1.0 + 1e-9) >= x).unwrap_or(10.0 * power)
}

/// What a path names, in words; the path itself of numbers without a name of their own.
pub fn name(path: &str) -> String {
    let known = [
        ("material.youngs_modulus", "Young’s modulus"),
        ("material.poisson_ratio", "Poisson’s ratio"),
        ("material.density", "density"),
        ("material.mass_damping", "mass damping"),
        ("material.stiffness_damping", "stiffness damping"),
        ("material.shear_viscosity", "shear viscosity"),
        ("material.bulk_viscosity", "bulk viscosity"),
        ("time.start", "time of release"),
        ("gravity.x", "gravity, x"),
        ("gravity.y", "gravity, y"),
        ("gravity.z", "gravity, z"),
    ];
    let (bare, scene) = path.split_once(" [").map_or((path, String::new()), |(p, s)| (p, format!(" [{s}")));
    known.iter().find(|(p, _)| *p == bare).map_or_else(|| path.to_string(), |(_, n)| format!("{n}{scene}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantities_have_prefixes_and_the_digits_of_their_errors() {
        for (value, error, unit, text) in [
            (51186.2, Some(1253.4), "Pa", "51.2 ± 1.3 kPa"),
            (2.737e5, None, "Pa", "273.7 kPa"),
            (274_000.0, Some(27_000.0), "Pa", "274 ± 27 kPa"),
            (0.0054, Some(0.0002), "s", "5.40 ± 0.20 ms"),
            (0.45, Some(0.01), "1", "0.450 ± 0.010"),
            (0.000_43, None, "m", "430.0 µm"),
            (0.0123, None, "m", "12.30 mm"),
            (-9.81, Some(0.02), "m/s²", "-9.810 ± 0.020 m/s²"),
            (1070.0, Some(20.0), "kg/m³", "1070 ± 20 kg/m³"),
            (f64::NAN, None, "Pa", "not known"),
            (0.0, None, "Pa", "0 Pa"),
        ] {
            assert_eq!(quantity(value, error, unit), text);
        }
        assert_eq!(
            (size(128.8, "Pa"), size(2365.0, "Pa"), size(2e-7, "1")),
            ("129 Pa".into(), "2.4 kPa".into(), "2.0·10⁻⁷".into())
        );
        assert_eq!(powers("(2.50 ± 0.31)e-5"), "(2.50 ± 0.31)·10⁻⁵");
    }

    #[test]
    fn round_numbers_are_not_below() {
        for (x, r) in [(0.0031, 0.005), (1.0, 1.0), (2.0, 2.0), (5.1, 10.0), (f64::NAN, 1.0)] {
            assert!((round_up(x) / r - 1.0).abs() < 1e-12, "{x}");
        }
        assert_eq!((digits(1.234_56, 3), digits(123.4, 3), digits(0.0, 3)), ("1.23".into(), "123".into(), "0".into()));
        assert_eq!(name("material.youngs_modulus [scene 2]"), "Young’s modulus [scene 2]");
    }
}

//! `[material]`: what the body is made of.

use crate::document::Table;
use crate::error::{InputError, number};
use palpate_model::materials::curve::{Curve, MOST_CORNERS};
use palpate_model::materials::principal_stretch::PrincipalStretch;
use palpate_model::materials::viscosity::Viscosity;
use palpate_model::materials::{self, Model};
use palpate_model::scene::{Inertia, Material};

/// The material, and the curves of one that has some.
pub(super) fn material(root: &Table, warnings: &mut Vec<String>) -> Result<(Material, PrincipalStretch), InputError> {
    let t = root.optional_table("material")?.ok_or_else(|| root.missing("material", "a table [material]"))?;
    let models: Vec<(&str, &'static Model)> = materials::ALL.iter().map(|m| (m.name, m)).collect();
    let model = t.optional_choice("model", &models)?.unwrap_or(&materials::ALL[0]);
    let positive = |key: &str| t.f64_where(key, |x| x > 0.0, "is not allowed: must be > 0");
    let zero_up = |key: &str| t.f64_where(key, |x| x >= 0.0, "is not allowed: must be ≥ 0");
    let inertia = match (positive("density")?, positive("mass")?) {
        (Some(d), None) => Inertia::Density(d),
        (None, Some(m)) => Inertia::Mass(m),
        (None, None) => return Err(t.missing("density", "density (kg/m³) or mass (kg)")),
        (Some(_), Some(_)) => return Err(t.error("mass", "density and mass exclude each other; give one")),
    };
    let youngs_modulus = positive("youngs_modulus")?.ok_or_else(|| t.missing("youngs_modulus", "a number > 0 (Pa)"))?;
    let poisson_ratio = t
        .f64_where("poisson_ratio", |x| x > -1.0 && x < 0.5, "is not allowed: must lie in (-1, 0.5)")?
        .ok_or_else(|| t.missing("poisson_ratio", "a number in (-1, 0.5)"))?;
    if !(10.0..=1e12).contains(&youngs_modulus) {
        let e = t.error(
            "youngs_modulus",
            format!("{} Pa is unusual (jelly 1e3, rubber 1e6, steel 2e11); is it in Pa?", number(youngs_modulus)),
        );
        warnings.push(e.to_string());
    }
    if let Inertia::Density(d) = inertia
        && !(10.0..=30000.0).contains(&d)
    {
        let e = t.error("density", format!("{} kg/m³ is unusual (water 1000); is it in kg/m³? 1 g/cm³ is 1000 kg/m³", number(d)));
        warnings.push(e.to_string());
    }
    let material = Material {
        model,
        inertia,
        youngs_modulus,
        poisson_ratio,
        mass_damping: zero_up("mass_damping")?.unwrap_or(0.0),
        stiffness_damping: zero_up("stiffness_damping")?.unwrap_or(0.0),
        viscosity: viscosity(&t)?,
    };
    let curves = PrincipalStretch {
        stretch: curve(&t, model, "stretch_curve", "stretches")?,
        volume: curve(&t, model, "volume_curve", "ratios")?,
    };
    Ok((material, curves))
}

fn viscosity(material: &Table) -> Result<Option<Viscosity>, InputError> {
    let Some(t) = material.optional_table("viscosity")? else { return Ok(None) };
    let coefficient = t.f64_where("coefficient", |x| x >= 0.0, "is not allowed: must be ≥ 0 (Pa·s^h)")?;
    let exponent = t.f64_where("exponent", |x| (0.1..=3.0).contains(&x), "is not allowed: must lie in [0.1, 3]")?;
    Ok(Some(Viscosity {
        coefficient: coefficient.ok_or_else(|| t.missing("coefficient", "a number ≥ 0 (Pa·s^h)"))?,
        exponent: exponent.unwrap_or(1.0),
    }))
}

/// A curve by its corners, which stand under `corners`, and factors, which are 1 where they are not given.
fn curve(material: &Table, model: &Model, key: &str, corners: &str) -> Result<Curve, InputError> {
    let Some(t) = material.optional_table(key)? else { return Ok(Curve::default()) };
    if !model.has_curves {
        let with: Vec<&str> = materials::ALL.iter().filter(|m| m.has_curves).map(|m| m.name).collect();
        return Err(material.error(key, format!("{} has no curves; set model = \"{}\"", model.name, with.join("\" or \""))));
    }
    let wanted = format!("an array of 1 to {MOST_CORNERS} increasing numbers > 0, without 1");
    let stretches = t.optional_list(corners)?.filter(|v| !v.is_empty()).ok_or_else(|| t.missing(corners, &wanted))?;
    let factors = t.optional_list("factors")?.unwrap_or_else(|| vec![1.0; stretches.len()]);
    Curve::new(stretches, factors).map_err(|e| material.error(key, e))
}

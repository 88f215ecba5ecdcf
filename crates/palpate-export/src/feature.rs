//! What a specimen may have, and what each format makes of it: the table behind warnings, heads of files and documentation.

use crate::formats::Format;
use crate::specimen::{Clock, Specimen};
use crate::{ExportError, formats};

/// Something that a specimen may have.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Feature {
    /// Young's modulus and Poisson's ratio.
    Elasticity,
    /// A modulus that varies over the body.
    Moduli,
    /// Density.
    Density,
    /// A density that varies over the body.
    Densities,
    /// Rayleigh α.
    MassDamping,
    /// Rayleigh β.
    StiffnessDamping,
    /// What clamps hold.
    Clamps,
    /// Planes that the body cannot enter.
    Planes,
    /// Point masses.
    Masses,
    /// Gravity.
    Gravity,
    /// A shape at the start that is not the stress-free one.
    StartShape,
    /// A velocity at the start.
    StartVelocity,
    /// An angular velocity at the start.
    StartSpin,
    /// Step and duration of a motion.
    Clock,
}

/// What a format makes of a feature.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Carried {
    /// It is written as this.
    As(&'static str),
    /// It is left out, for this reason.
    Not(&'static str),
}

impl Feature {
    /// All, in the order of the table.
    pub const ALL: [Feature; 14] = [
        Feature::Elasticity,
        Feature::Moduli,
        Feature::Density,
        Feature::Densities,
        Feature::MassDamping,
        Feature::StiffnessDamping,
        Feature::Clamps,
        Feature::Planes,
        Feature::Masses,
        Feature::Gravity,
        Feature::StartShape,
        Feature::StartVelocity,
        Feature::StartSpin,
        Feature::Clock,
    ];

    /// Its keys in a scene.
    pub fn keys(self) -> &'static str {
        match self {
            Feature::Elasticity => "material.youngs_modulus and poisson_ratio",
            Feature::Moduli => "field on material.youngs_modulus",
            Feature::Density => "material.density",
            Feature::Densities => "field on material.density",
            Feature::MassDamping => "material.mass_damping",
            Feature::StiffnessDamping => "material.stiffness_damping",
            Feature::Clamps => "clamp",
            Feature::Planes => "plane",
            Feature::Masses => "mass",
            Feature::Gravity => "world.gravity",
            Feature::StartShape => "initial.state",
            Feature::StartVelocity => "initial.velocity",
            Feature::StartSpin => "initial.angular_velocity",
            Feature::Clock => "time",
        }
    }

    /// True where a specimen has it.
    pub fn is_in(self, s: &Specimen) -> bool {
        match self {
            Feature::Elasticity | Feature::Density => true,
            Feature::Moduli => s.moduli.is_some(),
            Feature::Densities => s.densities.is_some(),
            Feature::MassDamping => s.material.mass_damping != 0.0,
            Feature::StiffnessDamping => s.material.stiffness_damping != 0.0,
            Feature::Clamps => !s.held.is_empty(),
            Feature::Planes => !s.planes.is_empty(),
            Feature::Masses => !s.masses.is_empty(),
            Feature::Gravity => s.gravity.length() > 0.0,
            Feature::StartShape => s.start.is_some(),
            Feature::StartVelocity => s.spin.is_some_and(|v| v.velocity.length() > 0.0),
            Feature::StartSpin => s.spin.is_some_and(|v| v.angular.length() > 0.0),
            Feature::Clock => s.clock != Clock::Static,
        }
    }
}

/// What of a specimen a format does not hold, or holds as something else, a line each.
///
/// # Errors
/// The modulus varies, and the format has one number for it: a body of another stiffness would be written.
pub(crate) fn lost(s: &Specimen, format: &'static Format) -> Result<Vec<String>, ExportError> {
    let mut lines = Vec::new();
    for feature in Feature::ALL.into_iter().filter(|f| f.is_in(s)) {
        let Carried::Not(why) = (format.carries)(feature, s.mesh.is_quadratic()) else { continue };
        let soft = matches!((format.carries)(Feature::Elasticity, s.mesh.is_quadratic()), Carried::As(_));
        if feature == Feature::Moduli && soft {
            let able = formats::ALL.iter().filter(|f| matches!((f.carries)(feature, false), Carried::As(_)));
            let names: Vec<&str> = able.map(|f| f.name).collect();
            return Err(ExportError::Refused {
                name: feature.keys().into(),
                format: format.name,
                why: why.into(),
                instead: format!("formats that hold it: {}", names.join(", ")),
            });
        }
        lines.push(format!("{} is left out: {why}", feature.keys()));
    }
    if let Some((law, same)) = (format.law)(s.material.model).filter(|l| !l.1) {
        debug_assert!(!same);
        lines.push(format!("material.model \"{}\" becomes {law}: equal at small strains", s.material.model));
    }
    lines.extend(s.beyond.iter().map(|(key, what)| format!("{key} ({what}) is left out: no format has it")));
    Ok(lines)
}

/// The table of what each format makes of each feature, as Markdown.
pub fn markdown() -> String {
    let mut out = String::from("| of the scene |");
    formats::ALL.iter().for_each(|f| out += &format!(" `{}` |", f.name));
    out += "\n|---|";
    formats::ALL.iter().for_each(|_| out += "---|");
    let cell = |c: Carried| match c {
        Carried::As(text) => text.to_string(),
        Carried::Not(_) => "–".to_string(),
    };
    for feature in Feature::ALL {
        out += &format!("\n| {} |", feature.keys());
        for f in formats::ALL {
            let (linear, quadratic) = (cell((f.carries)(feature, false)), cell((f.carries)(feature, true)));
            let both = if linear == quadratic || !f.has_quadratic { linear } else { format!("{quadratic}; linear: {linear}") };
            out += &format!(" {both} |");
        }
    }
    out + "\n"
}

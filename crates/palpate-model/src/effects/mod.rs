//! The library of effects: every law that a scene's `[[effect]]` can name, one file and one line of [`ALL`] each.
//!
//! An effect has named parameters with unit, bounds and the value at which it is absent. Where it acts is its [`Site`]; backends
//! loop over sites and know no effect by name. From the table follow the scene's keys, the fit parameters, the tests of
//! derivatives and the hypotheses of `diagnose`.

pub mod attachment;
pub mod cell;
pub mod driven;
pub mod field;
pub mod file_load;
pub mod handle;
pub mod impulse;
pub mod jet;
pub mod law;
pub mod moving;
pub mod obstacle;
pub mod reading;
pub mod sensors;

mod adhesion;
mod air_drag;
mod camera_pose;
mod contact_dissipation;
mod contact_stiffness;
mod coulomb_friction;
mod depth_along_ray;
mod depth_bias;
mod depth_bias_part;
mod depth_scale;
mod marker_offset;
mod point_mass;
mod push;
mod second_plane;
mod slack;
mod tether;
mod time_offset;
mod uniform_force;
mod wind;

mod clamp_edge;
mod clamp_slip;
mod compliant_clamp;
mod creep;
mod density_gradient;
mod density_inclusion;
mod inclusion;
mod power_law_viscosity;
mod rest_shape;
mod stiffness_gradient;
mod stiffness_modes;
mod strain_stiffening;
mod structural_damping;
mod transverse_anisotropy;
mod two_part_stiffness;

use crate::mechanics::path::Path;
use crate::params::Transform;
use crate::params::changes::HOLD;
use cell::Cell;
use driven::Drive;
use field::Field;
use law::{Asks, Point};
use moving::Moving;
use reading::Reading;
use std::sync::Arc;

/// An effect: what it is called, what it needs, where it acts.
pub struct Law {
    /// Name in scene files, `kind = "…"`.
    pub kind: &'static str,
    /// What it competes with.
    pub family: Family,
    /// One plain sentence for reports, without full stop: "the ground holds the body back by friction".
    pub sentence: &'static str,
    /// Parameters, in the order of the law's input.
    pub params: &'static [EffectParam],
    /// How a diagnosis tries it.
    pub trial: Trial,
    /// Where it acts.
    pub site: Site,
}

/// Families of effects.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Family {
    /// Between the body and planes.
    Contact,
    /// Forces on the body.
    Load,
    /// What the body is made of.
    Material,
    /// Rest shape, state at the start, supports.
    Shape,
    /// How it was measured.
    Measurement,
    /// A free force field: a bound, never an explanation.
    Slack,
}

/// One number of an effect; the components of a vector are three entries with `axis` 0 to 2.
#[derive(Clone, Copy, Debug)]
pub struct EffectParam {
    /// Key in the scene file.
    pub key: &'static str,
    /// Component of a vector, `None` for a number.
    pub axis: Option<u8>,
    /// SI unit, `1` for none.
    pub unit: &'static str,
    /// How optimisers see it.
    pub transform: Transform,
    /// Smallest allowed value.
    pub lower: f64,
    /// Largest allowed value.
    pub upper: f64,
    /// A size at which the effect matters.
    pub typical: f64,
    /// Value when the scene does not say it; for amplitudes the value at which the effect is absent.
    pub default: Unstated,
    /// One sentence for `--help` and reports.
    pub doc: &'static str,
}

/// Value of a parameter that the scene does not state.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Unstated {
    /// An amplitude: the effect is absent at this value.
    Absent(f64),
    /// A number of minor importance that a diagnosis leaves alone.
    Fixed(f64),
    /// The same, for the size of a place [m]: a diagnosis makes it as small as the grid allows.
    Sharp(f64),
    /// This component of the body's centre of mass [m].
    Center,
    /// The same, for a point that others are counted from: a diagnosis leaves it there.
    Reference,
    /// The same, for a place that only makes sense on the body: a diagnosis looks for it in the box around the rest shape.
    OnBody,
    /// Must be stated (a diagnosis starts it at this value).
    Stated(f64),
    /// The number, counted from 0, of one thing among several; 0 where it is not stated. It cannot be fitted.
    Choice(Numbered),
}

/// What an effect can choose one of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Numbered {
    /// A camera of the recording.
    Camera,
    /// A marker of the recording.
    Marker,
    /// One of endlessly many draws of chance.
    Seed,
}

/// How a diagnosis tries an effect.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Trial {
    /// Its amplitudes have a derivative at "absent" that tells whether it helps.
    Score,
    /// The same, but from some size on it holds the body fast and more of it changes nothing, which no derivative shows: fits start from
    /// its typical size as well.
    Saturates,
    /// Flat or not smooth at "absent", or it acts at an unknown place: short fits from spread starts.
    Starts,
    /// The same, from planes that the measured body does not cross and the simulated one does (`normal` and `distance` from its centre).
    Walls,
    /// Not tried by itself.
    Never,
}

/// Where a law acts.
pub enum Site {
    /// Every node of the body; `measure` is its volume.
    Nodes(&'static dyn Point),
    /// Every surface patch.
    Surface(&'static dyn Point),
    /// Every surface patch and every plane of the scene.
    Contact(&'static dyn Point),
    /// Points of the body that a file says something about; `measure` is 1.
    Driven(&'static dyn Point),
    /// Every surface patch that an obstacle may touch, which a file moves.
    Obstacle,
    /// Every surface patch that a jet may blow on, of which a file moves the nozzle.
    Jet,
    /// Every reading of a depth camera.
    Readings(&'static dyn Reading),
    /// The times of frames: they are ahead by parameter 0.
    Clock,
    /// One marker, parameter 0: parameters 1 to 3 add to its stalk.
    Marker,
    /// Every cell's Young's modulus: a factor.
    Modulus(&'static dyn Field<1>),
    /// Every node's density: a factor.
    Density(&'static dyn Field<1>),
    /// Young's modulus of the whole body as a function of time: a factor.
    Aging(&'static dyn Field<1>),
    /// Energy and dissipation of every cell.
    Cells(&'static dyn Cell),
    /// The stress-free shape: displacement of every node from the shape given.
    Rest(&'static dyn Field<3>),
    /// Every clamp: numbers as in [`crate::params::changes::HOLD`].
    Clamps(&'static dyn Field<HOLD>),
    /// What every clamp holds: how far its edges are shifted along the body [m].
    Edges(&'static dyn Field<1>),
}

/// All effects, in the order in which reports list them.
pub static ALL: &[Law] = &[
    coulomb_friction::LAW,
    adhesion::LAW,
    second_plane::LAW,
    contact_stiffness::LAW,
    contact_dissipation::LAW,
    push::LAW,
    uniform_force::LAW,
    point_mass::LAW,
    tether::LAW,
    air_drag::LAW,
    wind::LAW,
    impulse::LAW,
    handle::LAW,
    file_load::LAW,
    attachment::LAW,
    jet::LAW,
    obstacle::LAW,
    stiffness_gradient::LAW,
    two_part_stiffness::LAW,
    inclusion::LAW,
    stiffness_modes::LAW,
    creep::LAW,
    strain_stiffening::LAW,
    transverse_anisotropy::LAW,
    power_law_viscosity::LAW,
    structural_damping::LAW,
    density_gradient::LAW,
    density_inclusion::LAW,
    rest_shape::LAW,
    compliant_clamp::LAW,
    clamp_slip::LAW,
    clamp_edge::LAW,
    camera_pose::LAW,
    time_offset::LAW,
    depth_bias::LAW,
    depth_scale::LAW,
    depth_bias_part::LAW,
    depth_along_ray::LAW,
    marker_offset::LAW,
    slack::LAW,
];

/// Place in [`ALL`] of a kind.
pub fn find(kind: &str) -> Option<usize> {
    ALL.iter().position(|l| l.kind == kind)
}

/// A number that is not a component of a vector.
const fn number(
    key: &'static str,
    unit: &'static str,
    [lower, upper, typical]: [f64; 3],
    default: Unstated,
    doc: &'static str,
) -> EffectParam {
    EffectParam { key, axis: None, unit, transform: Transform::Linear, lower, upper, typical, default, doc }
}

/// One component of a direction, of which the length does not count; x unless stated.
const fn direction(key: &'static str, axis: u8, doc: &'static str) -> EffectParam {
    let default = Unstated::Stated(if axis == 0 { 1.0 } else { 0.0 });
    let p = component(key, axis, "1", 1.0, doc);
    EffectParam { default, lower: -1e3, upper: 1e3, ..p }
}

impl EffectParam {
    /// True for a component of a vector of which only the direction counts.
    pub fn is_direction(&self) -> bool {
        self.axis.is_some() && self.unit == "1" && matches!(self.default, Unstated::Stated(_))
    }
}

/// One coordinate of a place; the body's centre of mass unless stated.
const fn place(key: &'static str, axis: u8, doc: &'static str) -> EffectParam {
    EffectParam { default: Unstated::OnBody, ..component(key, axis, "m", 0.02, doc) }
}

/// One component of a vector of any sign that is zero when absent.
const fn component(key: &'static str, axis: u8, unit: &'static str, typical: f64, doc: &'static str) -> EffectParam {
    EffectParam {
        key,
        axis: Some(axis),
        unit,
        transform: Transform::Linear,
        lower: f64::NEG_INFINITY,
        upper: f64::INFINITY,
        typical,
        default: Unstated::Absent(0.0),
        doc,
    }
}

impl Law {
    /// True where every amplitude has the value at which the effect is absent: it does nothing then, whatever its other numbers are.
    pub fn is_absent(&self, values: &[f64]) -> bool {
        let at_rest = |(p, v): (&EffectParam, &f64)| if let Unstated::Absent(a) = p.default { Some(*v == a) } else { None };
        let mut amplitudes = self.params.iter().zip(values).filter_map(at_rest).peekable();
        amplitudes.peek().is_some() && amplitudes.all(|at_rest| at_rest)
    }

    /// What a law of points needs beside its numbers.
    pub fn asks(&self) -> Asks {
        match self.site {
            Site::Nodes(point) | Site::Surface(point) | Site::Contact(point) | Site::Driven(point) => point.asks(),
            _ => Asks::Nothing,
        }
    }

    /// True of a law of points whose force depends on neither state.
    pub fn is_load(&self) -> bool {
        match self.site {
            Site::Nodes(point) | Site::Surface(point) | Site::Contact(point) | Site::Driven(point) => point.is_load(),
            _ => false,
        }
    }

    /// Name of the tables of a scene file that state it.
    pub fn table(&self) -> &'static str {
        match self.kind {
            file_load::KIND => "load",
            attachment::KIND => "attach",
            jet::KIND => "load",
            obstacle::KIND => "obstacle",
            _ => "effect",
        }
    }

    /// True of laws of rigid things that a file moves.
    pub fn moves(&self) -> bool {
        matches!(self.site, Site::Obstacle | Site::Jet)
    }

    /// True where bodies of tetrahedra cannot have it: it moves the edge of what is held within a cell, and of them whole faces are held.
    pub fn needs_cells(&self) -> bool {
        matches!(self.site, Site::Edges(_))
    }
}

/// An effect of a scene.
#[derive(Clone, Debug, PartialEq)]
pub struct Effect {
    /// Place of its law in [`ALL`].
    pub law: usize,
    /// Values of its parameters in the order of [`Law::params`]; `None` = the body's centre of mass, known once the body is.
    pub values: Vec<Option<f64>>,
    /// What it follows, of laws that ask for a path.
    pub path: Option<Arc<Path>>,
    /// What drives its points, of laws that ask for a series.
    pub drive: Option<Arc<Drive>>,
    /// What moves, of obstacles and jets.
    pub moving: Option<Arc<Moving>>,
}

impl Effect {
    /// An effect with every parameter at its default; what it follows or moves stays at the origin, and what drives it is zero.
    pub fn absent(law: usize) -> Effect {
        let follows = ALL[law].asks() == Asks::Path;
        let path = follows.then(|| Arc::new(Path { times: vec![0.0], points: vec![glam::DVec3::ZERO] }));
        let drive = (ALL[law].asks() == Asks::Series).then(|| Arc::new(Drive::still()));
        let moving = ALL[law].moves().then(|| Arc::new(Moving { axis: glam::DVec3::Z, ..Moving::default() }));
        Effect { law, values: ALL[law].params.iter().map(|p| p.default.value()).collect(), path, drive, moving }
    }

    /// Its law.
    pub fn law(&self) -> &'static Law {
        &ALL[self.law]
    }

    /// Value of parameter `slot`, for a body with this centre of mass [m].
    pub fn value(&self, slot: usize, center: glam::DVec3) -> f64 {
        self.values[slot].unwrap_or_else(|| center[usize::from(self.law().params[slot].axis.unwrap_or(0))])
    }
}

/// Checks that everything that effects choose by number exists among so many cameras and markers.
///
/// # Errors
/// Key in the scene (`effect.0.camera`) and what is allowed.
pub fn check_choices(effects: &[Effect], cameras: usize, markers: usize) -> Result<(), (String, String)> {
    for (i, effect) in effects.iter().enumerate() {
        for (p, value) in effect.law().params.iter().zip(&effect.values) {
            let Unstated::Choice(of) = p.default else { continue };
            let (count, noun) = match of {
                Numbered::Camera => (cameras, "camera"),
                Numbered::Marker => (markers, "marker"),
                Numbered::Seed => continue,
            };
            let number = value.unwrap_or(0.0);
            if number >= count as f64 {
                let message = match count {
                    0 => format!("there is no {noun} that the effect could concern"),
                    1 => format!("there is no {noun} number {number}; the only one is 0"),
                    _ => format!("there is no {noun} number {number}; they are 0 to {}", count - 1),
                };
                return Err((format!("effect.{i}.{}", p.key), message));
            }
        }
    }
    Ok(())
}

impl Unstated {
    /// The value, unless it is the body's centre.
    pub fn value(self) -> Option<f64> {
        match self {
            Unstated::Absent(v) | Unstated::Fixed(v) | Unstated::Sharp(v) | Unstated::Stated(v) => Some(v),
            Unstated::Choice(_) => Some(0.0),
            Unstated::Center | Unstated::Reference | Unstated::OnBody => None,
        }
    }
}

#[cfg(test)]
mod field_tests;
#[cfg(test)]
mod force_tests;
#[cfg(test)]
mod sensor_tests;
#[cfg(test)]
mod table_tests;
#[cfg(test)]
mod tests;

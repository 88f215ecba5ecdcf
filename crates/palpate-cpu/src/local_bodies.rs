//! Bodies that the tests of local derivatives go through: clamped by a clamp that moves, in contact, with a point mass, of every kind.

use glam::{DAffine3, DVec3};
use palpate_model::effects::law::Asks;
use palpate_model::effects::{ALL, Effect, Site, find};
use palpate_model::materials;
use palpate_model::materials::curve::Curve;
use palpate_model::materials::principal_stretch::PrincipalStretch;
use palpate_model::materials::viscosity::Viscosity;
use palpate_model::mechanics::motion::RigidMotion;
use palpate_model::mechanics::path::Path;
use palpate_model::observation::Observation;
use palpate_model::params::fields::{Basis, FieldSpec, Scale, Varied};
use palpate_model::plan::Plan;
use palpate_model::plan::build::build_plan;
use palpate_model::scene::*;
use palpate_model::space::points::TetMesh;
use palpate_model::space::stars::StarSpec;
use std::sync::Arc;

/// Every effect that changes the body, its material or its clamps, at a size that matters.
pub fn altering() -> Vec<Effect> {
    let alters = |site: &Site| {
        let of_body = matches!(site, Site::Modulus(_) | Site::Density(_) | Site::Aging(_) | Site::Rest(_) | Site::Cells(_));
        of_body || matches!(site, Site::Clamps(_) | Site::Edges(_))
    };
    let make = |law: usize| {
        let mut effect = Effect::absent(law);
        for (value, p) in effect.values.iter_mut().zip(ALL[law].params) {
            // Cell laws three times stronger, to show beside the linear material at these strains.
            let size = if matches!(ALL[law].site, Site::Cells(_)) { 3.0 } else { 0.3 };
            *value = value.map(|v| (v + size * p.typical).clamp(p.lower, p.upper));
        }
        effect
    };
    (0..ALL.len()).filter(|l| alters(&ALL[*l].site)).map(make).collect()
}

/// Every effect that acts by a path, a course in time or turning normals.
pub fn leading() -> Vec<Effect> {
    let make = |kind: &str, values: &[f64], points: [DVec3; 3]| {
        let mut effect = Effect::absent(find(kind).unwrap());
        effect.values.iter_mut().zip(values).for_each(|(v, x)| *v = Some(*x));
        let path = Path { times: vec![-1.0, 0.06, 1.0], points: points.to_vec() };
        effect.path = (effect.law().asks() == Asks::Path).then(|| Arc::new(path));
        effect
    };
    let none = [DVec3::ZERO; 3];
    vec![
        make("impulse", &[0.02, -0.01, 0.03, 0.01, 0.0, 0.06, 0.02, 0.02, 0.12], none),
        make("wind", &[3.0, -2.0, 1.0, 1.0, 2.0, 0.0, 3.0, 0.5, 0.1, 4.0, 0.6, 0.1, 20.0], none),
        make("handle", &[20.0, 0.03, 0.01, 0.05, 0.02], [DVec3::ZERO, DVec3::new(0.04, 0.0, 0.06), DVec3::Z]),
        // Moving, and some millimetres within the ball.
        make("push", &[1.3, 0.03], [DVec3::X, DVec3::new(0.075, 0.002, 0.05), DVec3::new(-0.5, 0.2, 0.0)]),
    ]
}

/// The box of the ball as cubes of six tetrahedra each, so many along every edge.
pub fn tetrahedra(count: usize) -> BodySource {
    let (low, edge, side) = (DVec3::new(-0.047, -0.049, -0.005), 0.1 / count as f64, count + 1);
    let at = |i: usize, j: usize, k: usize| (i + side * (j + side * k)) as u32;
    let mut mesh = TetMesh::default();
    for n in 0..side * side * side {
        mesh.nodes.push(low + edge * DVec3::new((n % side) as f64, (n / side % side) as f64, (n / (side * side)) as f64));
    }
    for n in 0..count * count * count {
        let (i, j, k) = (n % count, n / count % count, n / (count * count));
        let c = |bits: usize| at(i + (bits & 1), j + (bits >> 1 & 1), k + (bits >> 2));
        for way in [[1, 3], [1, 5], [2, 3], [2, 6], [4, 5], [4, 6]] {
            mesh.tets.push([c(0), c(way[0]), c(way[1]), c(7)]);
        }
    }
    let mesh = mesh.checked().unwrap();
    BodySource::Tetrahedra { path: "in-code.msh".into(), surface: mesh.surface(), mesh }
}

/// Points in the box of the ball, moved off a lattice of so many along every edge, with more neighbours than tetrahedra have nodes.
pub fn cloud(count: usize) -> BodySource {
    let (low, edge) = (DVec3::new(-0.047, -0.049, -0.005), 0.1 / count as f64);
    let moved = |n: usize| (DVec3::new(0.819, 0.671, 0.549) * (n as f64 + 1.0)).fract() * 0.4 + 0.3;
    let at = |n: usize| DVec3::new((n % count) as f64, (n / count % count) as f64, (n / (count * count)) as f64);
    let points = (0..count.pow(3)).map(|n| low + edge * (at(n) + moved(n))).collect();
    let hull = BodySource::Analytic(Analytic::Box { min: low, max: low + 0.1 });
    let stars = StarSpec { neighbours: 11, residual_penalty: 0.5, ..StarSpec::default() };
    BodySource::Cloud(Box::new(Cloud { path: "in-code.npy".into(), points, hull, stars }))
}

/// The ball.
pub fn ball() -> BodySource {
    BodySource::Analytic(Analytic::Ball { radius: 0.05, center: DVec3::new(0.003, 0.001, 0.045) })
}

/// What a body is made of.
pub struct Made {
    pub source: BodySource,
    pub effects: Vec<Effect>,
    /// Its elements, where they are tetrahedra.
    pub tetrahedron: Tetrahedron,
    pub fields: Vec<FieldSpec>,
    pub viscosity: Option<Viscosity>,
    pub curves: Option<PrincipalStretch>,
}

impl Made {
    /// A body of the linear material.
    pub fn of(source: BodySource, effects: Vec<Effect>) -> Made {
        Made { source, effects, tetrahedron: Tetrahedron::default(), fields: Vec::new(), viscosity: None, curves: None }
    }

    /// Its plan. At random displacements springs as stiff as those of held nodes would drown all other forces in their rounding.
    pub fn plan(self) -> Plan {
        let mut p = build_plan(&self.scene(), Observation::default(), &[]).unwrap_or_else(|e| panic!("{e}"));
        p.clamps.iter_mut().flat_map(|c| &mut c.nodes).for_each(|n| n.1 *= 1e-8);
        p
    }

    pub fn scene(self) -> Scene {
        let motion = RigidMotion {
            times: vec![-1.0, 0.0, 1.0],
            translations: vec![DVec3::ZERO, DVec3::new(0.003, 0.001, 0.0), DVec3::new(0.01, 0.0, 0.02)],
            rotations: vec![glam::DQuat::IDENTITY, glam::DQuat::from_rotation_z(0.1), glam::DQuat::from_rotation_y(0.4)],
        };
        Scene {
            path: "in-code.toml".into(),
            title: String::new(),
            object: Object { source: self.source, pose: DAffine3::IDENTITY, resolution: Resolution::CellSize(0.03) },
            material: Material {
                model: match self.curves {
                    Some(_) => materials::find("principal-stretch").unwrap(),
                    None => &materials::ALL[0],
                },
                inertia: Inertia::Density(1000.0),
                youngs_modulus: 5000.0,
                poisson_ratio: 0.4,
                mass_damping: 0.3,
                stiffness_damping: 0.004,
                viscosity: self.viscosity,
            },
            gravity: DVec3::new(0.4, -0.3, -9.0),
            clamps: vec![Clamp { motion: Some(motion), ..Clamp::still(DVec3::new(-1.0, -1.0, 0.07), DVec3::ONE) }],
            planes: vec![Plane { point: DVec3::ZERO, normal: DVec3::new(0.1, 0.05, 1.0).normalize(), stiffness: None }],
            masses: vec![PointMass { point: DVec3::new(0.0, 0.02, 0.07), mass: 0.02 }],
            effects: self.effects,
            fields: self.fields,
            curves: self.curves.unwrap_or_default(),
            initial: Initial {
                velocity: DVec3::ZERO,
                angular_velocity: DVec3::ZERO,
                pivot: None,
                state: InitialShape::StaticEquilibrium,
            },
            time: Time { step: 0.01, steps: 3, start: 0.05, ..Time::weighted(0.55) },
            solver: Solver { tetrahedron: self.tetrahedron, ..Solver::default() },
            observation: None,
            targets: Vec::new(),
            synthesis: Synthesis::default(),
            tracking: palpate_model::scene::Tracking::default(),
            fit: None,
        }
    }
}

/// The ball with effects.
pub fn plan(effects: Vec<Effect>) -> Plan {
    Made::of(ball(), effects).plan()
}

/// A body of a material with curves.
pub fn curved(source: BodySource, effects: Vec<Effect>) -> Plan {
    let stretch = Curve::new(vec![0.85, 1.1, 1.2], vec![2.0, 0.6, 1.7]).unwrap();
    let curves = PrincipalStretch { stretch, volume: Curve::new(vec![0.9], vec![2.5]).unwrap() };
    Made { curves: Some(curves), ..Made::of(source, effects) }.plan()
}

/// A body that flows as well.
pub fn flowing(source: BodySource, exponent: f64, effects: Vec<Effect>) -> Plan {
    Made { viscosity: Some(Viscosity { coefficient: 40.0, exponent }), ..Made::of(source, effects) }.plan()
}

/// Stiffness and damping by cells, and density by nodes.
pub fn fields() -> Vec<FieldSpec> {
    let of = |varied, basis| FieldSpec { varied, basis, scale: Scale::Log, values: None, prior: None };
    vec![of(Varied::Modulus, Basis::Cells), of(Varied::Density, Basis::Nodes), of(Varied::Damping, Basis::Cells)]
}

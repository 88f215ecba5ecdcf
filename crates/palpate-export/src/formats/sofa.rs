//! SOFA scenes in XML (release 24.06 and later): corotated linear tetrahedra, the law of palpate's own default material.

use super::{Format, file};
use crate::feature::{Carried, Feature};
use crate::specimen::{Clock, Specimen};
use crate::text::{escaped, num, rows, vector, xml_head};
use crate::{ExportError, File};

/// The scene.
pub const FORMAT: Format = Format {
    name: "sofa",
    what: "scene of SOFA 24.06",
    ending: "scn",
    has_quadratic: false,
    carries,
    law: |model| Some(("corotated linear", model == "corotated-linear")),
    write,
};

/// Plugins, as the components' own examples name them, and what is needed of each.
const PLUGINS: [(&str, &str); 9] = [
    ("Sofa.Component.AnimationLoop", "DefaultAnimationLoop"),
    ("Sofa.Component.Constraint.Projective", "FixedProjectiveConstraint"),
    ("Sofa.Component.LinearSolver.Direct", "SparseLDLSolver"),
    ("Sofa.Component.Mass", "DiagonalMass"),
    ("Sofa.Component.MechanicalLoad", "PlaneForceField"),
    ("Sofa.Component.ODESolver.Backward", "EulerImplicitSolver"),
    ("Sofa.Component.SolidMechanics.FEM.Elastic", "TetrahedronFEMForceField"),
    ("Sofa.Component.StateContainer", "MechanicalObject"),
    ("Sofa.Component.Topology.Container.Dynamic", "TetrahedronSetTopologyContainer"),
];

fn carries(feature: Feature, _: bool) -> Carried {
    match feature {
        Feature::Elasticity => Carried::As("`TetrahedronFEMForceField`"),
        Feature::Moduli => Carried::As("`youngModulus` of every element"),
        Feature::Density | Feature::Densities => Carried::As("`vertexMass`"),
        Feature::MassDamping => Carried::As("`rayleighMass`"),
        Feature::StiffnessDamping => Carried::As("`rayleighStiffness`"),
        Feature::Clamps => Carried::As("`FixedProjectiveConstraint`"),
        Feature::Planes => Carried::As("`PlaneForceField`"),
        Feature::Masses => Carried::As("`vertexMass` of the nearest node"),
        Feature::Gravity => Carried::As("`gravity`"),
        Feature::StartShape => Carried::As("`position` beside `rest_position`"),
        Feature::StartVelocity | Feature::StartSpin => Carried::As("`velocity`"),
        Feature::Clock => Carried::As("`dt`"),
    }
}

fn write(s: &Specimen, lost: &[String]) -> Result<Vec<File>, ExportError> {
    let step = match s.clock {
        Clock::Motion { step, .. } => step,
        Clock::Static => s.passage(),
    };
    let corners = &s.mesh.nodes[..s.mesh.corners];
    let list = |at: &dyn Fn(glam::DVec3) -> glam::DVec3| rows(corners.iter().map(|x| vector(at(*x), " ")), 5, "  ", "\n        ");
    let rest = list(&|x| x);
    let mut out = format!("<?xml version=\"1.0\"?>\n{}", xml_head(s, lost));
    out += &format!("<Node name=\"root\" dt=\"{}\" gravity=\"{}\">\n", num(step), vector(s.gravity, " "));
    for (plugin, component) in PLUGINS {
        out += &format!("  <RequiredPlugin name=\"{plugin}\"/> <!-- {component} -->\n");
    }
    let m = &s.material;
    out += &format!(
        "  <DefaultAnimationLoop/>\n  <Node name=\"{}\">\n    <EulerImplicitSolver rayleighMass=\"{}\" rayleighStiffness=\"{}\"/>\n",
        escaped(&s.name),
        num(m.mass_damping),
        num(m.stiffness_damping)
    );
    out += "    <SparseLDLSolver template=\"CompressedRowSparseMatrixMat3x3d\"/>\n";
    let tets = rows(s.mesh.tets.iter().map(|t| t.map(|n| n.to_string()).join(" ")), 6, "  ", "\n        ");
    out += &format!(
        "    <TetrahedronSetTopologyContainer name=\"topology\"\n      position=\"{rest}\"\n      tetrahedra=\"{tets}\"/>\n"
    );
    out += "    <MechanicalObject name=\"state\" template=\"Vec3\"";
    if s.start.is_some() {
        out += &format!("\n      rest_position=\"{rest}\"\n      position=\"{}\"", list(&|x| s.start_of(x)));
    }
    if let Some(v) = s.spin {
        out += &format!("\n      velocity=\"{}\"", list(&|x| v.at(s.start_of(x))));
    }
    let moduli = match &s.moduli {
        Some(all) => rows(all.iter().map(|e| num(*e)), 12, " ", "\n        "),
        None => num(m.youngs_modulus),
    };
    out += &format!(
        "/>\n    <TetrahedronFEMForceField name=\"elasticity\" template=\"Vec3\" method=\"large\" poissonRatio=\"{}\"\n      \
         youngModulus=\"{moduli}\"/>\n",
        num(m.poisson_ratio)
    );
    let masses = rows(s.corner_masses().into_iter().map(num), 12, " ", "\n        ");
    out += &format!("    <DiagonalMass vertexMass=\"{masses}\"/>\n");
    for (i, h) in s.held.iter().enumerate() {
        let own = h.nodes.iter().filter(|n| (**n as usize) < s.mesh.corners);
        out += &format!("    <FixedProjectiveConstraint name=\"clamp-{i}\" indices=\"{}\"/>\n", rows(own, 20, " ", "\n        "));
    }
    // A plane pushes at nodes there; each stands for its share of the surface.
    let on_surface: std::collections::BTreeSet<u32> = s.mesh.faces.iter().flat_map(|f| f.1).collect();
    let share = s.mesh.area() / on_surface.len().max(1) as f64;
    for (i, g) in s.planes.iter().enumerate() {
        out += &format!(
            "    <PlaneForceField name=\"plane-{i}\" normal=\"{}\" d=\"{}\" stiffness=\"{}\" damping=\"0\"/>\n",
            vector(g.normal, " "),
            num(g.height),
            num(g.stiffness * share)
        );
    }
    Ok(vec![file(s, &FORMAT, out + "  </Node>\n</Node>\n")])
}

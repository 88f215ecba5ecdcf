//! FEBio's `febio_spec` 4.0: elements by material, node sets, one step. Sections stand in the order in which `pyfebio` writes and reads them.

use super::{Format, file};
use crate::feature::{Carried, Feature};
use crate::specimen::{Clock, Specimen};
use crate::text::{num, rows, vector, xml_head};
use crate::{ExportError, File};

/// The file.
pub const FORMAT: Format = Format {
    name: "febio",
    what: "febio_spec 4.0",
    ending: "feb",
    has_quadratic: true,
    carries,
    law: |model| Some((law(model).0, law(model).1)),
    write,
};

/// Steps of a static problem: large rotations are followed.
const INCREMENTS: usize = 10;

/// FEBio's law, and whether it is the scene's. Its neo-Hookean law is the one with a logarithmic volume term; its isotropic elastic one is
/// St. Venant and Kirchhoff's.
fn law(model: &str) -> (&'static str, bool) {
    match model {
        "neo-hookean-log" => ("neo-Hookean", true),
        "neo-hookean" | "stable-neo-hookean" => ("neo-Hookean", false),
        _ => ("isotropic elastic", false),
    }
}

fn carries(feature: Feature, _: bool) -> Carried {
    match feature {
        Feature::Elasticity => Carried::As("`E`, `v` of a `material`"),
        Feature::Moduli | Feature::Densities => Carried::As("a `material` for each 1 %"),
        Feature::Density => Carried::As("`density`"),
        Feature::MassDamping => Carried::As("`body_load` \"mass damping\""),
        Feature::StiffnessDamping => Carried::Not("its materials are elastic; a viscoelastic one has another law"),
        Feature::Clamps => Carried::As("`bc` \"zero displacement\""),
        Feature::Planes => Carried::Not("a contact plane needs a surface and a penalty of FEBio's own"),
        Feature::Masses => Carried::Not("it has no point masses"),
        Feature::Gravity => Carried::As("`body_load` \"const\", of opposite sign"),
        Feature::StartShape => Carried::Not("it has no displacements at the start: run a static step first"),
        Feature::StartVelocity => Carried::As("`ic` \"velocity\""),
        Feature::StartSpin => Carried::Not("a node set has one velocity"),
        Feature::Clock => Carried::As("`Control` DYNAMIC"),
    }
}

fn write(s: &Specimen, lost: &[String]) -> Result<Vec<File>, ExportError> {
    let parts = s.parts();
    let law = law(s.material.model).0;
    let mut out = format!("<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n{}<febio_spec version=\"4.0\">\n", xml_head(s, lost));
    out += "  <Module type=\"solid\"/>\n  <Globals><Constants><T>0</T><P>0</P><R>0</R><Fc>0</Fc></Constants></Globals>\n";
    out += &control(s);
    out += "  <Material>\n";
    for (k, (modulus, density, _)) in parts.iter().enumerate() {
        out += &format!(
            "    <material id=\"{0}\" name=\"m{0}\" type=\"{law}\"><density>{1}</density><E>{2}</E><v>{3}</v></material>\n",
            k + 1,
            num(*density),
            num(*modulus),
            num(s.material.poisson_ratio)
        );
    }
    out += "  </Material>\n  <Mesh>\n    <Nodes name=\"nodes\">\n";
    for (n, x) in s.mesh.nodes.iter().enumerate() {
        out += &format!("      <node id=\"{}\">{}</node>\n", n + 1, vector(*x, ","));
    }
    out += "    </Nodes>\n";
    let kind = if s.mesh.is_quadratic() { "tet10" } else { "tet4" };
    for (k, (_, _, tets)) in parts.iter().enumerate() {
        out += &format!("    <Elements type=\"{kind}\" name=\"part{}\">\n", k + 1);
        for e in tets {
            let nodes = rows(s.mesh.element(*e as usize).map(|n| n + 1), 10, ",", "");
            out += &format!("      <elem id=\"{}\">{nodes}</elem>\n", e + 1);
        }
        out += "    </Elements>\n";
    }
    out += &format!("    <NodeSet name=\"all\">{}</NodeSet>\n", rows(1..=s.mesh.nodes.len(), usize::MAX, ",", ""));
    for (i, h) in s.held.iter().enumerate() {
        out +=
            &format!("    <NodeSet name=\"clamp{i}\">{}</NodeSet>\n", rows(h.nodes.iter().map(|n| n + 1), usize::MAX, ",", ""));
    }
    out += "  </Mesh>\n  <MeshDomains>\n";
    (1..=parts.len()).for_each(|k| out += &format!("    <SolidDomain name=\"part{k}\" mat=\"m{k}\"/>\n"));
    out += "  </MeshDomains>\n";
    out += &loads(s);
    if let Some(v) = s.spin.filter(|v| v.velocity.length() > 0.0) {
        let value = vector(v.velocity, ",");
        out += &format!("  <Initial><ic type=\"velocity\" node_set=\"all\"><value>{value}</value></ic></Initial>\n");
    }
    if !s.held.is_empty() {
        out += "  <Boundary>\n";
        for i in 0..s.held.len() {
            out += &format!(
                "    <bc name=\"clamp{i}\" type=\"zero displacement\" node_set=\"clamp{i}\">\
                 <x_dof>1</x_dof><y_dof>1</y_dof><z_dof>1</z_dof></bc>\n"
            );
        }
        out += "  </Boundary>\n";
    }
    out +=
        "  <Output>\n    <plotfile type=\"febio\"><var type=\"displacement\"/><var type=\"stress\"/></plotfile>\n  </Output>\n";
    out += "</febio_spec>\n";
    Ok(vec![file(s, &FORMAT, out)])
}

/// Analysis, number of steps and their length.
fn control(s: &Specimen) -> String {
    let (analysis, steps, step) = match s.clock {
        Clock::Static => ("STATIC", INCREMENTS, 1.0 / INCREMENTS as f64),
        Clock::Motion { step, steps } => ("DYNAMIC", steps, step),
    };
    format!(
        "  <Control>\n    <analysis>{analysis}</analysis>\n    <time_steps>{steps}</time_steps>\n    <step_size>{}</step_size>\n    \
         <solver type=\"solid\"/>\n  </Control>\n",
        num(step)
    )
}

/// Gravity, whose ramp follows a static problem, and damping.
fn loads(s: &Specimen) -> String {
    let mut out = String::new();
    let ramp = s.clock == Clock::Static;
    if s.gravity.length() > 0.0 {
        let curve = if ramp { " lc=\"1\"" } else { "" };
        // FEBio's body force points against the acceleration.
        let [x, y, z] = (-s.gravity).to_array().map(num);
        out += &format!("    <body_load type=\"const\"><x{curve}>{x}</x><y{curve}>{y}</y><z{curve}>{z}</z></body_load>\n");
    }
    if s.material.mass_damping != 0.0 {
        out += &format!("    <body_load type=\"mass damping\"><C>{}</C></body_load>\n", num(s.material.mass_damping));
    }
    if out.is_empty() {
        return out;
    }
    let ramped = ramp && s.gravity.length() > 0.0;
    let data = "  <LoadData>\n    <load_controller id=\"1\" type=\"loadcurve\"><interpolate>LINEAR</interpolate>\
                <points><pt>0,0</pt><pt>1,1</pt></points></load_controller>\n  </LoadData>\n";
    format!("{}  <Loads>\n{out}  </Loads>\n", if ramped { data } else { "" })
}

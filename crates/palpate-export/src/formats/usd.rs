//! OpenUSD in text: a `TetMesh` with its rest shape, subsets of held points, a `PhysicsScene` and planes. USD has no schema of soft materials that
//! all programs share, so Young's modulus and its kin are custom attributes `palpate:*`, beside the density of `PhysicsMaterialAPI`.

use super::{Format, file};
use crate::feature::{Carried, Feature};
use crate::specimen::{Clock, Specimen};
use crate::text::{head, num, rows, vector};
use crate::{ExportError, File};
use glam::{DQuat, DVec3};

/// The stage.
pub const FORMAT: Format =
    Format { name: "usd", what: "OpenUSD, TetMesh", ending: "usda", has_quadratic: false, carries, law: |_| None, write };

fn carries(feature: Feature, _: bool) -> Carried {
    match feature {
        Feature::Elasticity => Carried::As("`palpate:youngsModulus`, `palpate:poissonsRatio`"),
        Feature::Moduli => Carried::As("`primvars:palpate:youngsModulus`"),
        Feature::Density => Carried::As("`physics:density`"),
        Feature::Densities => Carried::As("`primvars:palpate:density`"),
        Feature::MassDamping => Carried::As("`palpate:massDamping`"),
        Feature::StiffnessDamping => Carried::As("`palpate:stiffnessDamping`"),
        Feature::Clamps => Carried::As("`GeomSubset` of points"),
        Feature::Planes => Carried::As("`Plane` with `PhysicsCollisionAPI`"),
        Feature::Masses => Carried::As("`Xform` with `PhysicsMassAPI`"),
        Feature::Gravity => Carried::As("`PhysicsScene`"),
        Feature::StartShape => Carried::As("`points` beside `palpate:restPoints`"),
        Feature::StartVelocity | Feature::StartSpin => Carried::As("`velocities`"),
        Feature::Clock => Carried::As("`timeCodesPerSecond`, `endTimeCode`"),
    }
}

/// A text as USD quotes it.
fn quoted(text: &str) -> String {
    format!("\"{}\"", text.replace('\\', "\\\\").replace('"', "\\\""))
}

/// A vector in brackets.
fn tuple(x: DVec3) -> String {
    format!("({})", vector(x, ", "))
}

/// A list over lines.
fn list(items: impl IntoIterator<Item = String>, a_line: usize) -> String {
    format!("[{}]", rows(items, a_line, ", ", ",\n            "))
}

fn write(s: &Specimen, lost: &[String]) -> Result<Vec<File>, ExportError> {
    let name = s.name.replace('-', "_");
    let mut out = format!("#usda 1.0\n(\n    defaultPrim = {}\n    doc = {}\n", quoted(&name), quoted(&head(s, lost).join("; ")));
    out += "    kilogramsPerUnit = 1\n    metersPerUnit = 1\n";
    if let Clock::Motion { step, steps } = s.clock {
        out += &format!("    endTimeCode = {steps}\n    startTimeCode = 0\n    timeCodesPerSecond = {}\n", num(1.0 / step));
    }
    let up = if s.gravity.y.abs() > s.gravity.z.abs() { "Y" } else { "Z" };
    out += &format!("    upAxis = \"{up}\"\n)\n\ndef Xform \"{name}\"\n{{\n");
    let g = s.gravity.length();
    let down = if g > 0.0 { s.gravity / g } else { DVec3::ZERO };
    out += &format!(
        "    def PhysicsScene \"scene\"\n    {{\n        vector3f physics:gravityDirection = {}\n        \
         float physics:gravityMagnitude = {}\n    }}\n\n",
        tuple(down),
        num(g)
    );
    out += &mesh(s, &name);
    out += &material(s);
    for (i, p) in s.planes.iter().enumerate() {
        // A plane with axis Z has the normal z in its own frame.
        let turn = DQuat::from_rotation_arc(DVec3::Z, p.normal);
        let side = 10.0 * s.mesh.bounds().1.distance(s.mesh.bounds().0);
        out += &format!(
            "\n    def Plane \"plane_{i}\" (\n        prepend apiSchemas = [\"PhysicsCollisionAPI\"]\n    )\n    {{\n        \
             uniform token axis = \"Z\"\n        double length = {side}\n        double width = {side}\n        \
             custom double palpate:stiffness = {}\n        quatd xformOp:orient = ({}, {}, {}, {})\n        \
             double3 xformOp:translate = {}\n        uniform token[] xformOpOrder = [\"xformOp:translate\", \"xformOp:orient\"]\n    }}\n",
            num(p.stiffness),
            num(turn.w),
            num(turn.x),
            num(turn.y),
            num(turn.z),
            tuple(p.normal * p.height),
            side = num(side)
        );
    }
    for (i, m) in s.masses.iter().enumerate() {
        out += &format!(
            "\n    def Xform \"mass_{i}\" (\n        prepend apiSchemas = [\"PhysicsMassAPI\"]\n    )\n    {{\n        \
             float physics:mass = {}\n        double3 xformOp:translate = {}\n        \
             uniform token[] xformOpOrder = [\"xformOp:translate\"]\n    }}\n",
            num(m.mass),
            tuple(m.point)
        );
    }
    Ok(vec![file(s, &FORMAT, out + "}\n")])
}

/// The mesh with its subsets.
fn mesh(s: &Specimen, name: &str) -> String {
    let corners = &s.mesh.nodes[..s.mesh.corners];
    let all = |at: &dyn Fn(DVec3) -> DVec3| list(corners.iter().map(|x| tuple(at(*x))), 4);
    let start = |x: DVec3| s.start_of(x);
    let low = corners.iter().map(|x| start(*x)).fold(DVec3::INFINITY, DVec3::min);
    let high = corners.iter().map(|x| start(*x)).fold(DVec3::NEG_INFINITY, DVec3::max);
    let numbers = |t: &[u32]| format!("({})", rows(t, 4, ", ", ""));
    let mut out =
        String::from("    def TetMesh \"body\" (\n        prepend apiSchemas = [\"MaterialBindingAPI\"]\n    )\n    {\n");
    out += &format!("        float3[] extent = [{}, {}]\n", tuple(low), tuple(high));
    out += &format!("        rel material:binding:physics = </{name}/material>\n");
    out += &format!("        point3f[] points = {}\n", all(&start));
    if s.start.is_some() {
        out += &format!("        custom point3f[] palpate:restPoints = {}\n", all(&|x| x));
    }
    let tets = list(s.mesh.tets.iter().map(|t| numbers(t)), 6);
    let faces = list(s.mesh.faces.iter().map(|f| numbers(&f.1)), 8);
    out += &format!("        int3[] surfaceFaceVertexIndices = {faces}\n        int4[] tetVertexIndices = {tets}\n");
    if let Some(v) = s.spin {
        out += &format!("        vector3f[] velocities = {}\n", all(&|x| v.at(start(x))));
    }
    for (key, values) in [("youngsModulus", &s.moduli), ("density", &s.densities)] {
        if let Some(values) = values {
            let values = list(values.iter().map(|v| num(*v)), 12);
            out += &format!(
                "        float[] primvars:palpate:{key} = {values} (\n            interpolation = \"uniform\"\n        )\n"
            );
        }
    }
    for (i, h) in s.held.iter().enumerate() {
        let own = h.nodes.iter().filter(|n| (**n as usize) < s.mesh.corners);
        out += &format!(
            "\n        def GeomSubset \"clamp_{i}\"\n        {{\n            uniform token elementType = \"point\"\n            \
             uniform token familyName = \"held\"\n            int[] indices = {}\n        }}\n",
            list(own.map(|n| n.to_string()), 20)
        );
    }
    out + "    }\n\n"
}

/// The material.
fn material(s: &Specimen) -> String {
    let m = &s.material;
    format!(
        "    def Material \"material\" (\n        prepend apiSchemas = [\"PhysicsMaterialAPI\"]\n    )\n    {{\n        \
         float physics:density = {}\n        custom string palpate:model = {}\n        custom double palpate:youngsModulus = {}\n        \
         custom double palpate:poissonsRatio = {}\n        custom double palpate:massDamping = {}\n        \
         custom double palpate:stiffnessDamping = {}\n    }}\n",
        num(m.density),
        quoted(m.model),
        num(m.youngs_modulus),
        num(m.poisson_ratio),
        num(m.mass_damping),
        num(m.stiffness_damping)
    )
}

//! URDF: one rigid link with mass, inertia and surface. The format has no soft bodies, so what is fitted is left out, and the head says so.

use super::{Format, file};
use crate::feature::{Carried, Feature};
use crate::specimen::Specimen;
use crate::text::{escaped, num, vector, xml_head};
use crate::{ExportError, File};
use std::collections::BTreeMap;

/// The link.
pub const FORMAT: Format = Format {
    name: "urdf",
    what: "one rigid link: mass, inertia, surface",
    ending: "urdf",
    has_quadratic: false,
    carries,
    law: |_| None,
    write,
};

const RIGID: &str = "a link is rigid";

fn carries(feature: Feature, _: bool) -> Carried {
    match feature {
        Feature::Density | Feature::Densities => Carried::As("`inertial`"),
        Feature::Clamps => Carried::As("a fixed joint to `world`"),
        Feature::Elasticity | Feature::Moduli | Feature::MassDamping | Feature::StiffnessDamping => Carried::Not(RIGID),
        Feature::StartShape => Carried::Not(RIGID),
        Feature::Masses => Carried::As("`inertial`"),
        Feature::Planes | Feature::Gravity | Feature::Clock => Carried::Not("a robot description has no world"),
        Feature::StartVelocity | Feature::StartSpin => Carried::Not("a robot description has no state"),
    }
}

fn write(s: &Specimen, lost: &[String]) -> Result<Vec<File>, ExportError> {
    let (mass, center, inertia) = with_masses(s);
    let [x, y, z] = [inertia.x_axis, inertia.y_axis, inertia.z_axis];
    let mut out = format!("<?xml version=\"1.0\"?>\n{}<robot name=\"{}\">\n", xml_head(s, lost), escaped(&s.name));
    let surface = format!("{}.obj", s.name);
    out += &format!(
        "  <link name=\"body\">\n    <inertial>\n      <origin xyz=\"{}\"/>\n      <mass value=\"{}\"/>\n      \
         <inertia ixx=\"{}\" ixy=\"{}\" ixz=\"{}\" iyy=\"{}\" iyz=\"{}\" izz=\"{}\"/>\n    </inertial>\n",
        vector(center, " "),
        num(mass),
        num(x.x),
        num(x.y),
        num(x.z),
        num(y.y),
        num(y.z),
        num(z.z)
    );
    for part in ["visual", "collision"] {
        out += &format!("    <{part}><geometry><mesh filename=\"{}\"/></geometry></{part}>\n", escaped(&surface));
    }
    out += "  </link>\n";
    if !s.held.is_empty() {
        out += "  <link name=\"world\"/>\n  <joint name=\"clamp\" type=\"fixed\"><parent link=\"world\"/><child link=\"body\"/></joint>\n";
    }
    let mesh = File { name: surface, text: obj(s) };
    Ok(vec![file(s, &FORMAT, out + "</robot>\n"), mesh])
}

/// Mass, centre and inertia about it, point masses included.
fn with_masses(s: &Specimen) -> (f64, glam::DVec3, glam::DMat3) {
    let (body, middle, about) = s.mesh.inertia(|e| s.density(e));
    let points: f64 = s.masses.iter().map(|m| m.mass).sum();
    let mass = body + points;
    let center = (middle * body + s.masses.iter().map(|m| m.point * m.mass).sum::<glam::DVec3>()) / mass;
    // Steiner: m (r² I − r rᵀ) for each part away from the common centre.
    let moved = |m: f64, at: glam::DVec3| {
        let r = at - center;
        let outer = glam::DMat3::from_cols(r * r.x, r * r.y, r * r.z);
        (glam::DMat3::from_diagonal(glam::DVec3::splat(r.length_squared())) - outer) * m
    };
    let all = s.masses.iter().fold(about + moved(body, middle), |sum, m| sum + moved(m.mass, m.point));
    (mass, center, all)
}

/// The surface as Wavefront OBJ.
fn obj(s: &Specimen) -> String {
    let mut number = BTreeMap::new();
    let (mut vertices, mut faces) = (String::new(), String::new());
    for (_, f) in &s.mesh.faces {
        let corner = f.map(|n| {
            let next = number.len() + 1;
            *number.entry(n).or_insert_with(|| {
                vertices += &format!("v {}\n", vector(s.mesh.nodes[n as usize], " "));
                next
            })
        });
        faces += &format!("f {} {} {}\n", corner[0], corner[1], corner[2]);
    }
    vertices + &faces
}

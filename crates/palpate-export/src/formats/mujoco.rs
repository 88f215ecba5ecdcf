//! MJCF with a flex (MuJoCo 4: the integrator `discrete` takes elasticity implicitly, and flexes may have quadratic cells).
//!
//! Bodies of quadratic elements become a flex of quadratic cells, which MuJoCo cuts at the mesh; of linear ones every node is a body. Bodies and
//! joints are written out instead of a `flexcomp`, which would give all nodes one mass and spread the mass of held ones over the others.

use super::{Format, file};
use crate::cells::Cells;
use crate::feature::{Carried, Feature};
use crate::specimen::{Clock, Specimen};
use crate::text::{escaped, num, rows, vector, xml_head};
use crate::{ExportError, File};
use glam::DVec3;

/// MJCF.
pub const FORMAT: Format = Format {
    name: "mujoco",
    what: "MJCF with a flex, MuJoCo 4",
    ending: "xml",
    has_quadratic: true,
    carries,
    law: |_| Some(("St. Venant and Kirchhoff's law", false)),
    write,
};

/// Skin of the flex, within which contacts act, over the edge of its elements.
const SKIN: f64 = 1e-3;
/// Least mass of a node over the mean: cells that the surface all but misses have nodes of almost none.
const LIGHTEST: f64 = 1e-6;
/// How far from a clamp's region a node may lie that it holds, over the side of a cell: a fifth of the way to the next plane of nodes.
const ON: f64 = 0.1;

fn carries(feature: Feature, quadratic: bool) -> Carried {
    match feature {
        Feature::Elasticity => Carried::As("`elasticity`"),
        Feature::Moduli => Carried::Not("a flex has one modulus"),
        Feature::Density | Feature::Densities => Carried::As("masses of nodes"),
        Feature::MassDamping => Carried::Not("MuJoCo allows the joints of a flex no damping"),
        Feature::StiffnessDamping => Carried::As("`elasticity damping`"),
        Feature::Clamps if quadratic => Carried::As("nodes of cells in the world"),
        Feature::Clamps => Carried::As("nodes in the world"),
        Feature::Planes => Carried::As("`geom` without friction, of MuJoCo's stiffness"),
        Feature::Masses => Carried::As("mass of the nearest node"),
        Feature::Gravity => Carried::As("`option gravity`"),
        Feature::StartShape | Feature::StartVelocity | Feature::StartSpin => Carried::As("`key`"),
        Feature::Clock => Carried::As("`timestep`"),
    }
}

/// The points that move: places at rest, masses [kg], and which are held.
struct Points {
    places: Vec<DVec3>,
    masses: Vec<f64>,
    held: Vec<bool>,
    /// A length beside which they lie [m].
    length: f64,
    /// Cells along each axis, of quadratic ones.
    cells: Option<String>,
}

fn points(s: &Specimen) -> Result<Points, ExportError> {
    let length = s.mesh.length();
    if !s.mesh.is_quadratic() {
        let mut held = vec![false; s.mesh.corners];
        s.held_nodes().iter().for_each(|n| held[*n as usize] = true);
        let places = s.mesh.nodes[..s.mesh.corners].to_vec();
        return Ok(Points { places, masses: s.corner_masses(), held, length, cells: None });
    }
    let cells = Cells::new(s, length);
    let places: Vec<DVec3> = (0..cells.len()).map(|n| cells.place(n)).collect();
    let near = ON * cells.largest();
    // Nodes that no part of the body reaches have nothing to move for.
    let mut held: Vec<bool> = cells.masses.iter().map(|m| *m == 0.0).collect();
    for (i, h) in s.held.iter().enumerate() {
        let inside = |x: &DVec3| h.region.distances(*x).iter().all(|d| *d <= near);
        let own: Vec<usize> = (0..places.len()).filter(|n| cells.masses[*n] > 0.0 && inside(&places[*n])).collect();
        if own.is_empty() {
            return Err(ExportError::Refused {
                name: format!("clamp.{i}"),
                format: FORMAT.name,
                why: "it holds no node of the cells, which are twice as large as tetrahedra".into(),
                instead: "give a smaller --edge-length, or --element linear, whose nodes are those of the tetrahedra".into(),
            });
        }
        own.into_iter().for_each(|n| held[n] = true);
    }
    let count = cells.count.to_array().map(|c| c.to_string()).join(" ");
    Ok(Points { places, masses: cells.masses, held, length, cells: Some(count) })
}

fn write(s: &Specimen, lost: &[String]) -> Result<Vec<File>, ExportError> {
    let p = points(s)?;
    let mean = p.masses.iter().sum::<f64>() / p.masses.iter().filter(|m| **m > 0.0).count().max(1) as f64;
    let step = match s.clock {
        Clock::Motion { step, .. } => step,
        Clock::Static => s.passage(),
    };
    let mut out = format!("<mujoco model=\"{}\">\n{}", escaped(&s.name), xml_head(s, lost));
    if s.clock == Clock::Static {
        out += "<!-- MuJoCo has no static solver: step until it rests; a step is the passage of a pressure wave -->\n";
    }
    out += &format!(
        "  <option timestep=\"{}\" gravity=\"{}\" integrator=\"discrete\"/>\n  <worldbody>\n",
        num(step),
        vector(s.gravity, " ")
    );
    let (low, high) = s.mesh.bounds();
    for (i, g) in s.planes.iter().enumerate() {
        out += &format!(
            "    <geom name=\"plane-{i}\" type=\"plane\" pos=\"{}\" zaxis=\"{}\" size=\"0 0 {}\" condim=\"1\"/>\n",
            vector(g.normal * g.height, " "),
            vector(g.normal, " "),
            num((high - low).max_element())
        );
    }
    let moving = || (0..p.places.len()).filter(|n| !p.held[*n]);
    for n in moving() {
        let mass = p.masses[n].max(LIGHTEST * mean);
        // Points do not turn; their inertia only has to be there.
        let inertia = num((mass * p.length * p.length).max(1e-12));
        out += &format!(
            "    <body name=\"n{n}\" pos=\"{}\"><inertial pos=\"0 0 0\" mass=\"{}\" diaginertia=\"{inertia} {inertia} {inertia}\"/>",
            vector(p.places[n], " "),
            num(mass)
        );
        for axis in ["1 0 0", "0 1 0", "0 0 1"] {
            out += &format!("<joint type=\"slide\" axis=\"{axis}\"/>");
        }
        out += "</body>\n";
    }
    out += &format!("  </worldbody>\n  <deformable>\n{}  </deformable>\n{}</mujoco>\n", flex(s, &p), start(s, &p));
    Ok(vec![file(s, &FORMAT, out)])
}

/// The flex: its mesh, and the bodies that carry it.
fn flex(s: &Specimen, p: &Points) -> String {
    let bodies = rows((0..p.places.len()).map(|n| if p.held[n] { "world".into() } else { format!("n{n}") }), 20, " ", "\n      ");
    let corners = &s.mesh.nodes[..s.mesh.corners];
    let (carried, places) = match &p.cells {
        // The mesh hangs on the nodes of cells; it belongs to no body of its own. Nodes in the world stand where they are, others at their bodies.
        Some(count) => {
            let world = rows(corners.iter().map(|_| "world"), 20, " ", "\n      ");
            let place = |n: usize| if p.held[n] { vector(p.places[n], " ") } else { "0 0 0".into() };
            let nodes = rows((0..p.places.len()).map(place), 5, " ", "\n      ");
            let all = rows(corners.iter().map(|x| vector(*x, " ")), 5, " ", "\n      ");
            let cells = format!("dof=\"quadratic\" cellcount=\"{count}\"\n      node=\"{bodies}\"\n      nodecoord=\"{nodes}\"");
            (format!("{cells}\n      body=\"{world}\""), all)
        }
        // Vertices stand at their bodies; held ones in the world.
        None => {
            let place = |n: usize| if p.held[n] { vector(corners[n], " ") } else { "0 0 0".into() };
            (format!("body=\"{bodies}\""), rows((0..corners.len()).map(place), 5, " ", "\n      "))
        }
    };
    let tets = rows(s.mesh.tets.iter().map(|t| t.map(|n| n.to_string()).join(" ")), 6, " ", "\n      ");
    let m = &s.material;
    format!(
        "    <flex name=\"{}\" dim=\"3\" radius=\"{}\" {carried}\n      vertex=\"{places}\"\n      element=\"{tets}\">\n      \
         <contact selfcollide=\"none\" condim=\"1\"/>\n      <elasticity young=\"{}\" poisson=\"{}\" damping=\"{}\"/>\n    </flex>\n",
        escaped(&s.name),
        num(SKIN * p.length),
        num(m.youngs_modulus),
        num(m.poisson_ratio),
        num(m.stiffness_damping)
    )
}

/// The state at the start, where it is not rest.
fn start(s: &Specimen, p: &Points) -> String {
    if s.start.is_none() && s.spin.is_none() {
        return String::new();
    }
    let of = |at: &dyn Fn(DVec3) -> DVec3| {
        rows((0..p.places.len()).filter(|n| !p.held[*n]).map(|n| vector(at(p.places[n]), " ")), 5, " ", "\n      ")
    };
    let places = of(&|x| s.start_of(x) - x);
    let velocities = of(&|x| s.spin.map_or(DVec3::ZERO, |v| v.at(s.start_of(x))));
    format!("  <keyframe>\n    <key name=\"start\" qpos=\"{places}\"\n      qvel=\"{velocities}\"/>\n  </keyframe>\n")
}

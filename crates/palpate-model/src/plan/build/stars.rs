//! Bodies of clouds of points: what is made of them, and what they refuse.

use super::{PlanError, band_cells, error, tets};
use crate::cutcells::build::Parts;
use crate::cutcells::shadow::shadow;
use crate::effects::Site;
use crate::scene::{Cloud, InitialShape, Scene};
use crate::shape::Shape;
use crate::space::body::Body;
use glam::DVec3;

/// The body of a cloud's stars. `seen`: observed points are to be looked up.
pub(super) fn parts(scene: &Scene, cloud: &Cloud, shape: &dyn Shape, seen: bool) -> Result<Parts, PlanError> {
    tets::refuse_what_needs_cells(scene)?;
    refuse(scene)?;
    let points: Vec<DVec3> = cloud.points.iter().map(|x| scene.object.pose.transform_point3(*x)).collect();
    let mut body = Body::of_stars(&points, shape, &cloud.stars).map_err(|message| error("object.points", message))?;
    if seen {
        let (h, width) = (body.length, band_cells(scene) * body.length);
        body.band = shadow(&body, shape, h, width).map_err(|e| error("observation.band", e.to_string()))?;
    }
    Ok(Parts { body, merged: Vec::new() })
}

/// Stars are counted from the points given: nothing may change what is free of stress.
fn refuse(scene: &Scene) -> Result<(), PlanError> {
    if scene.initial.state == InitialShape::Given {
        let text = "\"static\" asks for the stress-free shape behind the one given, which stars are not turned to; use discretisation = \"cells\"";
        return Err(error("object.state", text.into()));
    }
    match scene.effects.iter().position(|e| matches!(e.law().site, Site::Rest(_))) {
        None => Ok(()),
        Some(i) => {
            let kind = scene.effects[i].law().kind;
            let text = format!(
                "\"{kind}\" changes the stress-free shape, which stars are not turned to; use discretisation = \"cells\""
            );
            Err(error(format!("effect.{i}.kind"), text))
        }
    }
}

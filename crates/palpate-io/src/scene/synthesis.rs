//! `[[handle]]`, `[[keyframe]]` and `[synthesize]`: motions that are made, not measured.

use super::path::path;
use crate::document::Table;
use crate::error::{InputError, number};
use glam::DVec3;
use palpate_model::effects::{self, Effect, handle};
use palpate_model::scene::{Handle, Keyframe, Synthesis, Time};

/// Radius of a handle's region that the scene does not state [m].
const RADIUS: f64 = 0.01;

/// Most knots of a handle: more than any motion has that is worth the time.
const MOST_KNOTS: u64 = 1000;

/// What a scene says of motions that are made. Handles with a path become effects, appended to `effects`.
pub(super) fn synthesis(root: &Table, time: &Time, effects: &mut Vec<Effect>) -> Result<Synthesis, InputError> {
    let mut out = Synthesis::default();
    let tables = root.tables("handle")?;
    for t in &tables {
        out.handles.push(one_handle(t, effects)?);
    }
    for t in root.tables("keyframe")? {
        out.keyframes.push(keyframe(&t, time)?);
    }
    let free = out.handles.iter().position(|h| h.follows.is_none());
    let settings = root.optional_table("synthesize")?;
    if let Some(t) = &settings {
        out.knots = t.optional_count("knots", 4..=MOST_KNOTS)?.map_or(out.knots, |n| n as usize);
        out.force = t.f64_where("force", |x| x > 0.0, "is not allowed: must be > 0 (N)")?;
        out.closed = t.optional_bool("loop")?.unwrap_or(false);
        out.gap = t.f64_where("gap", |x| x > 0.0, "is not allowed: must be > 0 (m)")?;
        out.iterations = t.optional_count("iterations", 0..=1_000_000)?.map_or(out.iterations, |n| n as usize);
    }
    if let (Some(i), true) = (free, out.keyframes.is_empty() && !out.closed) {
        return Err(
            tables[i].error("path", "is missing: a handle follows a path, or has [[keyframe]] tables to find its force for")
        );
    }
    if let (Some(_), None) = (free, out.force) {
        let at = settings.as_ref().unwrap_or(root);
        let key = if settings.is_some() { "force" } else { "synthesize" };
        return Err(at.error(
            key,
            "is missing; expected force, a number > 0 (N): the size of force that costs as much as a miss of one sigma",
        ));
    }
    if free.is_none() && (!out.keyframes.is_empty() || out.closed) {
        let what = if out.closed { "loop = true closes" } else { "[[keyframe]] leads" };
        return Err(root.error("keyframe", format!("{what} the motion by the forces of handles; give a [[handle]] without path")));
    }
    if out.closed && out.gap.is_none() && out.keyframes.is_empty() {
        let at = settings.as_ref().unwrap_or(root);
        return Err(at.error("gap", "is missing; expected a number > 0 (m): by how much the loop's ends may differ"));
    }
    Ok(out)
}

fn one_handle(t: &Table, all: &mut Vec<Effect>) -> Result<Handle, InputError> {
    let point = t.vec3("point")?;
    let radius = t.f64_where("radius", |x| x >= 1e-6, "is not allowed: must be ≥ 1e-6 (m)")?.unwrap_or(RADIUS);
    let stiffness = t.f64_where("stiffness", |x| x > 0.0 && x <= 1e9, "is not allowed: must lie in (0, 1e9] (N/m)")?;
    let Some(followed) = path(t, "path")? else {
        if stiffness.is_some() {
            return Err(t.error("stiffness", "belongs to a handle with a path; without one its force is found for the keyframes"));
        }
        return Ok(Handle { point, radius, follows: None });
    };
    let stiffness =
        stiffness.ok_or_else(|| t.missing("stiffness", "a number > 0 (N/m): how firmly the body is held to the path"))?;
    let law = effects::find(handle::KIND).expect("the law is in the table");
    let values = [stiffness, point.x, point.y, point.z, radius].map(Some).to_vec();
    all.push(Effect { values, path: Some(followed), ..Effect::absent(law) });
    Ok(Handle { point, radius, follows: Some(all.len() - 1) })
}

fn keyframe(t: &Table, clock: &Time) -> Result<Keyframe, InputError> {
    let time = t.optional_f64("time")?.ok_or_else(|| t.missing("time", "a time (s)"))?;
    let sigma = t.f64_where("sigma", |x| x > 0.0, "is not allowed: must be > 0 (m)")?;
    let sigma = sigma.ok_or_else(|| t.missing("sigma", "a length > 0 (m): a miss that counts as one"))?;
    let points = t.optional_points("points")?.ok_or_else(|| t.missing("points", "places at rest, [[x, y, z], …]"))?;
    let positions: Vec<DVec3> =
        t.optional_points("positions")?.ok_or_else(|| t.missing("positions", "where the points shall be, [[x, y, z], …]"))?;
    if points.is_empty() || points.len() != positions.len() {
        return Err(t.error("positions", format!("has {} places for {} points", positions.len(), points.len())));
    }
    let (first, length) = (clock.start, clock.open.unwrap_or(clock.step * clock.steps as f64));
    let last = first + length;
    // Times are rounded.
    let slack = 1e-9 * (1.0 + last.abs());
    if time <= first + slack || time > last + slack {
        let (from, to) = (number(first), number(last));
        let message = format!("{} s lies outside the motion, which begins at {from} s and ends at {to} s", number(time));
        return Err(t.error("time", message));
    }
    Ok(Keyframe { time, points, positions, sigma })
}

#[cfg(test)]
mod tests {
    use crate::scene::parse_scene;
    use crate::scene::tests::BASE;
    use glam::DVec3;

    fn error(tables: &str) -> String {
        parse_scene(&format!("{BASE}{tables}"), "scene.toml").expect_err(tables).to_string()
    }

    const FREE: &str = "[[handle]]\npoint = [0, 0, 0.05]\n";
    const HELD: &str = "stiffness = 3\npath = [[0, 0, 0, 0]]\n";
    const FITTED: &str = "[fit]\n[[fit.parameter]]\npath = \"effect.0.radius\"\n";
    const FRAME: &str = "[[keyframe]]\ntime = 0.5\nsigma = 1e-3\npoints = [[0, 0, 0.05]]\npositions = [[0, 0, 0.06]]\n";

    #[test]
    fn handles_with_a_path_are_effects_and_the_others_are_free() {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("p.csv"), "time,x,y,z\n0,0,0,0.05\n0.5,0,0,0.08\n").unwrap();
        let text = format!(
            "{FREE}{}{}{FRAME}[synthesize]\nforce = 3\nknots = 5\nloop = true\n",
            "[[handle]]\npoint = [0, 0.05, 0]\nstiffness = 40\npath = \"p.csv\"\n",
            "[[effect]]\nkind = \"push\"\nradius = 0.01\npath = [[0, 1, 0, 0], [1, 0, 0, 0]]\n"
        );
        let scene = parse_scene(&format!("{BASE}{text}"), folder.path().join("scene.toml")).unwrap().value;
        let s = &scene.synthesis;
        assert_eq!(s.handles.iter().map(|h| h.follows).collect::<Vec<_>>(), [None, Some(1)]);
        assert_eq!((s.knots, s.force, s.closed, s.keyframes.len(), s.keyframes[0].sigma), (5, Some(3.0), true, 1, 1e-3));
        assert_eq!(scene.effects.iter().map(|e| e.law().kind).collect::<Vec<_>>(), ["push", "handle"]);
        let path = scene.effects[1].path.as_ref().unwrap();
        assert_eq!((path.times.as_slice(), path.points[1]), (&[0.0, 0.5][..], DVec3::new(0.0, 0.0, 0.08)));
    }

    #[test]
    fn what_leads_nowhere_is_refused() {
        let file = tempfile::tempdir().unwrap();
        let csv = file.path().join("late.csv");
        std::fs::write(&csv, "time,x,y,z\n0.5,0,0,0\n0.5,0,0,1\n").unwrap();
        let late = format!("{FREE}path = \"{}\"\nstiffness = 3\n", csv.display());
        for (message, said) in [
            ("handle.0.path: is missing", error(FREE)),
            ("handle.0.point", error("[[handle]]\nradius = 0.01\n")),
            ("handle.0.stiffness", error(&format!("{FREE}path = [[0, 0, 0, 0]]\n"))),
            ("belongs to a handle with a path", error(&format!("{FREE}stiffness = 3\n{FRAME}"))),
            ("synthesize: is missing; expected force", error(&format!("{FREE}{FRAME}"))),
            ("synthesize.force: is missing", error(&format!("{FREE}{FRAME}[synthesize]\nknots = 5\n"))),
            ("give a [[handle]] without path", error(FRAME)),
            ("closes the motion by", error("[synthesize]\nloop = true\n")),
            ("synthesize.gap", error(&format!("{FREE}[synthesize]\nforce = 1\nloop = true\n"))),
            ("from 4 to 1000", error(&format!("{FREE}{FRAME}[synthesize]\nforce = 1\nknots = 3\n"))),
            ("did you mean \"force\"?", error(&format!("{FREE}{FRAME}[synthesize]\nforces = 1\n"))),
            ("keyframe.0.time: 1.7 s lies outside the motion", error(&FRAME.replace("0.5", "1.7"))),
            ("ends at 1.49994 s", error(&FRAME.replace("0.5", "1.7"))),
            ("0 s lies outside the motion", error(&FRAME.replace("time = 0.5", "time = 0"))),
            ("has 1 places for 2 points", error(&FRAME.replace("points = [", "points = [[0, 0, 0], "))),
            ("keyframe.0.sigma", error(&FRAME.replace("sigma = 1e-3\n", ""))),
            ("late.csv:3: time 0.5 does not come after", error(&late)),
            ("effect.0.path: missing", error("[[effect]]\nkind = \"push\"\n")),
            ("time 0 does not come after", error("[[effect]]\nkind = \"push\"\npath = [[0, 0, 0, 0], [0, 1, 0, 0]]\n")),
            ("four numbers each", error("[[effect]]\nkind = \"push\"\npath = [[0, 0, 0]]\n")),
            ("unknown key of \"wind\"", error("[[effect]]\nkind = \"wind\"\npath = [[0, 0, 0, 0]]\n")),
            ("this scene has no [[effect]] number 0", error(&format!("{FREE}{HELD}{FITTED}"))),
        ] {
            assert!(said.contains(message), "{message}: {said}");
        }
    }
}

//! No invocation loops longer than adapters allow: bounds are read off the shaders' own loops and evaluated at the largest sizes
//! that a build accepts. A loop whose header is not known here fails the test.

use crate::costs::{MOST_DIRECTIONS, MOST_LOOPS, POINTS_OF_STRIPE, Seen};
use crate::device::pipelines::PASSES;
use crate::device::pipelines::shared::{laws, pulls};
use crate::tracking::MOST_ITEMS;
use crate::world::KINDS;
use crate::world::{LOOPS, MOST_GROUPS, MOST_SYSTEMS, Most, columns};
use palpate_model::cutcells::{front, pullback};
use std::collections::HashMap;

/// Iterations of a loop by its header (variable names and indices left out), or `None` for a loop that nobody knows.
fn bound(header: &str, most: &Most, seen: &Seen) -> Option<f64> {
    let condition = header.split(';').nth(1).unwrap_or(header).trim();
    if let Some(number) = condition.split("< ").nth(1).and_then(|n| n.trim_end_matches(['u', ')', ' ']).parse().ok()) {
        return Some(number);
    }
    let has = |part: &str| header.contains(part);
    // What all rows of cubes hold together, or all sites of a node, by its mean: the loops around these sum to the whole.
    let mean = |whole: u64, parts: u64| Some(whole as f64 / parts as f64);
    match () {
        () if has("c.low.y") => return mean(seen.rows_of_cubes, seen.layers),
        () if has("row.x + 8u * stripe") => return mean(seen.points, 8 * seen.stripes * seen.rows_of_cubes).map(|n| n + 1.0),
        () if has("row.x + stripe") => return mean(seen.points, seen.stripes * seen.rows_of_cubes).map(|n| n + 1.0),
        // All places or points together, of nine rows of cubes, by eight lanes.
        () if has("i < run.y; i += 8u") => return mean(MOST_ITEMS as u64, 8 * 9).map(|n| n + 1.0),
        // A marker belongs to one site.
        () if has("mark_rows[") && !has("m += 64u") => return mean(seen.markers, seen.sites),
        () => {}
    }
    let count = match () {
        () if has("> 0u; s /= 2u") || has("> 0u; step >>= 1u") => 8,
        () if has("k < crowd.places; k += 64u") => (MOST_ITEMS as u64).div_ceil(64),
        () if has("star_ends[") => most.stars,
        () if has("end_of_star(") => most.star,
        () if has("elastic_rows[") => most.valence,
        () if has("pair_rows[") => most.pairs,
        () if has("held_rows[") => most.holders,
        () if has("stencil_rows[number") => seen.site,
        () if has("stencil_rows[") => most.stencil,
        () if has("block_rows[") => most.row,
        () if has("node_rows[") && !has("band_") => 8,
        () if has("place_rows[") => 8,
        // The new and the old state.
        () if has("instant < end") => 2,
        () if has("< instant_count") => palpate_model::mechanics::contact::INSTANTS as u64,
        () if has("hold_start") || has("patch_start") => most.supports,
        () if has("max(shape.planes, 1u)") || has("select(1u, shape.planes") => most.pressed.max(1),
        () if has("shape.planes") => most.planes,
        () if has("shape.obstacles") => most.obstacles,
        () if has("shape.jets") => most.jets,
        () if has("i < shape.patches; i += 64u") => most.patches.div_ceil(64),
        () if has("j < shape.patches") => most.patches,
        () if has("frame_rows[") => most.frame,
        () if has("framed_rows[") => most.framed,
        () if has("shape.masses") => most.masses,
        () if has("row < poses") => most.grips,
        () if has("row < matrices") => most.grips,
        () if has("shape.aging_rows") => most.aging,
        () if has("< PLANE_ROWS") => pulls::PLANE_ROWS.into(),
        () if has("effect.count + POINT_ROWS") => {
            palpate_model::effects::law::MOST as u64 + u64::from(pulls::POINT_ROWS + pulls::PLANE_ROWS)
        }
        () if has("< effect.count") => palpate_model::effects::law::MOST as u64,
        // Second derivatives of a law: pairs of x.
        () if has("k < pairs") => 6,
        () if has("first < call.extra * shape.members") => (columns(most.members) * most.members).div_ceil(64),
        () if has("q < call.extra") => columns(most.members),
        () if has("shape.members") => most.members,
        // Parts of a product, or of a residual.
        () if has("i < node_shares()") => most.nodes.div_ceil(64 * 256),
        () if has("group_slices[") => most.group.div_ceil(32),
        () if has("i < shape.slices; i +=") => (most.nodes.div_ceil(32) + most.groups).div_ceil(64),
        () if has("2u * shape.groups; g += 256u") => (2 * most.groups).div_ceil(256),
        () if has("group_rows[") && has("k += 4u") => most.group.div_ceil(4),
        () if has("group_rows[") => most.group.div_ceil(64),
        () if has("g < shape.groups; g += 4u") => most.groups.div_ceil(4),
        () if has("< shape.groups;") => most.groups.div_ceil(64),
        () if has("< TURNS") => 30,
        () if has("< KINDS") => KINDS as u64,
        // H, λ and μ.
        () if has("< MATERIAL_INPUTS") => 11,
        () if has("< inputs") => (palpate_model::effects::law::COMMON + palpate_model::effects::law::MOST) as u64,
        () if has("i = SCALARS; i < CELL_INPUTS") => palpate_model::effects::cell::MOST as u64,
        () if has("< CELL_INPUTS") => (palpate_model::effects::cell::ENERGY + palpate_model::effects::cell::MOST) as u64,
        () if has("< SCALARS") => palpate_model::effects::cell::ENERGY as u64,
        // Laws of cells that the host lets into a plan.
        () if has("< MOST_LAWS") => laws::MOST_LAWS.into(),
        () if has("< MOST;") => palpate_model::effects::law::MOST as u64,
        () if has("shape.chunk") => most.chunk,
        () if has("k < call.extra / 8u") => most.stay,
        () if has("slice += shape.crew") => most.nodes.div_ceil(32) + most.groups,
        () if has("own += shape.crew") => most.groups,
        // One alone finds itself, and who waits in vain waits for the last time.
        () if has("look < LOOKS") => 1,
        () if has("k <= MEETINGS") => 8,
        () if has("i < shape.nodes; i += 256u") => most.share(),
        () if has("c.low.z") => seen.layers,
        () if has("sight.stripes") => seen.stripes,
        () if has("band_node_rows[") => seen.corners,
        () if has("band_rows[") => seen.extension,
        () if has("fold_rows[") => seen.fold,
        () if has("node_site_rows[") => seen.sites,
        () if has("mark_rows[") => seen.markers.div_ceil(64),
        // Sums that up to 256 workgroups of 64 share.
        () if has("rows_of(shot); i += 64u * call.roster") => seen.rows.div_ceil(64 * 256),
        () if has("sight.nodes; node += 64u * call.roster") => seen.share(),
        () if has("i < call.mode; i += 64u") => 4,
        () if has("shot.point_count; i += 64u") => seen.points.div_ceil(64),
        () if has("rows_of(shots[s.look.shot])") => seen.rows.div_ceil(64),
        () if has("while left > a") => MOST_DIRECTIONS,
        () if has("< place_iterations") => pullback::ITERATIONS as u64,
        () if has("< sight.readings") => seen.readings,
        () if has("front_most + front_root") => (1 + front::MOST + front::ROOT) as u64,
        () => return None,
    };
    Some(count as f64)
}

/// Loops and calls of one function, each with the product of the loops around it.
#[derive(Default)]
struct Function {
    loops: Vec<Vec<String>>,
    calls: Vec<(Vec<String>, String)>,
}

/// Functions of a linked shader by name.
fn functions(text: &str) -> HashMap<String, Function> {
    let mut all: HashMap<String, Function> = HashMap::new();
    let mut name = String::new();
    // Loops around the current place, with the depth of braces that they opened at.
    let (mut depth, mut around): (i32, Vec<(i32, String)>) = (0, Vec::new());
    for line in text.lines().map(|l| l.split("//").next().unwrap_or("").trim()) {
        if let Some(rest) = line.split("fn ").nth(1).filter(|_| depth == 0) {
            name = rest.split('(').next().unwrap_or("").to_string();
            all.entry(name.clone()).or_default();
        }
        let header = line.starts_with("for ") || line.starts_with("while ") || line.starts_with("loop");
        let nest: Vec<String> = around.iter().map(|a| a.1.clone()).collect();
        if let Some(f) = all.get_mut(&name) {
            if header {
                f.loops.push([nest.clone(), vec![line.to_string()]].concat());
            }
            let words = line.split(|c: char| !(c.is_alphanumeric() || c == '_' || c == '('));
            let called = words.flat_map(|w| w.split_inclusive('(')).filter_map(|w| w.strip_suffix('(')).filter(|w| !w.is_empty());
            f.calls.extend(
                called
                    .filter(|w| depth > 0 && !["for", "if", "while", "switch"].contains(w))
                    .map(|w| (nest.clone(), w.to_string())),
            );
        }
        for c in line.chars() {
            match c {
                '{' => {
                    depth += 1;
                    if header && !around.iter().any(|a| a.0 == depth) && around.last().is_none_or(|a| a.0 < depth) {
                        around.push((depth, line.to_string()));
                    }
                }
                '}' => {
                    around.retain(|a| a.0 < depth);
                    depth -= 1;
                }
                _ => {}
            }
        }
    }
    all
}

fn iterations(all: &HashMap<String, Function>, name: &str, of: &dyn Fn(&str) -> f64) -> f64 {
    let Some(f) = all.get(name) else { return 0.0 };
    let times = |nest: &[String]| nest.iter().map(|h| of(h)).product::<f64>();
    let own: f64 = f.loops.iter().map(|nest| times(nest)).sum();
    own + f.calls.iter().filter(|c| c.1 != name).map(|(nest, callee)| times(nest) * iterations(all, callee, of)).sum::<f64>()
}

/// The largest value of one size that a build accepts, the others being what `set` makes of `with`.
fn largest<T: Copy>(with: T, set: impl Fn(&mut T, u64), fits: impl Fn(&T) -> bool) -> T {
    let at = |value: u64| {
        let mut own = with;
        set(&mut own, value);
        own
    };
    // Fits at the low end, not at the high one.
    let (mut low, mut high) = (1u64, 1u64 << 32);
    assert!(fits(&at(low)) && !fits(&at(high)));
    while high - low > 1 {
        let middle = u64::midpoint(low, high);
        if fits(&at(middle)) { low = middle } else { high = middle }
    }
    at(low)
}

fn built(most: &Most) -> bool {
    most.loops().iter().all(|l| l.1 <= LOOPS)
}

fn observed(seen: &Seen) -> bool {
    seen.loops().iter().all(|l| l.1 <= MOST_LOOPS)
}

/// A large body with everything: 40 patches and clamp cells on a cell, ten planes, ten point masses.
const BODY: Most = Most {
    members: MOST_SYSTEMS,
    nodes: 1000,
    row: 60,
    supports: 40,
    planes: 10,
    obstacles: 10,
    jets: 3,
    patches: 2000,
    frame: 20,
    framed: 200,
    pressed: 10,
    masses: 10,
    stencil: 8,
    valence: 60,
    pairs: 30,
    stars: 20,
    star: 12,
    holders: 2,
    grips: 20,
    aging: 4,
    groups: MOST_GROUPS as u64,
    group: 4096,
    chunk: 1,
    stay: 0,
    many: false,
};

/// 40 × 40 rows of cubes, a million points in stripes of 12,500, some markers.
const RECORDING: Seen = Seen {
    nodes: 1_000_000,
    layers: 40,
    rows_of_cubes: 1600,
    points: 1_000_000,
    stripes: 80,
    extension: 64,
    fold: 64,
    corners: 8,
    rows: 1_000_000,
    markers: 100,
    site: 30,
    sites: 30,
    readings: 12,
};

#[test]
fn no_invocation_can_loop_longer_than_every_adapter_allows() {
    // One size after another as large as a build accepts.
    let many = Most { many: true, ..BODY };
    let bodies = [
        largest(BODY, |m, n| m.nodes = n, built),
        largest(Most { masses: 0, ..BODY }, |m, n| m.nodes = n, built),
        largest(many, |m, n| m.nodes = n, built),
        largest(Most { nodes: 1_000_000, ..many }, |m, n| m.supports = n, built),
        largest(Most { nodes: 1_000_000, ..many }, |m, n| m.masses = n, built),
        largest(Most { nodes: 1_000_000, ..many }, |m, n| m.stencil = n, built),
        largest(Most { nodes: 1_000_000, ..many }, |m, n| m.valence = n, built),
        largest(Most { nodes: 1_000_000, ..many }, |m, n| m.pairs = n, built),
        largest(Most { nodes: 1_000_000, ..many }, |m, n| m.stars = n, built),
        largest(Most { nodes: 1_000_000, ..many }, |m, n| m.star = n, built),
        largest(Most { nodes: 1_000_000, ..many }, |m, n| m.holders = n, built),
        largest(Most { nodes: 1_000_000, ..many }, |m, n| m.planes = n, built),
        largest(Most { nodes: 1_000_000, ..many }, |m, n| (m.planes, m.pressed) = (n, n), built),
        largest(Most { nodes: 1_000_000, ..many }, |m, n| m.obstacles = n, built),
        largest(Most { nodes: 1_000_000, ..many }, |m, n| m.jets = n, built),
        largest(Most { nodes: 1_000_000, ..many }, |m, n| m.patches = n, built),
        largest(Most { nodes: 1_000_000, ..many }, |m, n| m.frame = n, built),
        largest(Most { nodes: 1_000_000, ..many }, |m, n| m.framed = n, built),
        largest(Most { nodes: 1_000_000, ..many }, |m, n| m.row = n, built),
        largest(Most { nodes: 1_000_000, ..many }, |m, n| m.grips = n, built),
        largest(Most { nodes: 1_000_000, ..many }, |m, n| m.aging = n, built),
        largest(Most { nodes: 512, masses: 0, ..BODY }, |m, n| m.chunk = n, built),
        largest(Most { nodes: 512, masses: 0, groups: 20, group: 30, ..many }, |m, n| m.stay = n, built),
    ];
    assert!(bodies[0].nodes > 25_000 && bodies[2].nodes > 1_000_000 && bodies[3].supports > 1000, "{bodies:?}");
    let recordings = [
        largest(RECORDING, |s, n| (s.points, s.rows, s.stripes) = (n, n, n.div_ceil(POINTS_OF_STRIPE as u64)), observed),
        largest(RECORDING, |s, n| s.rows = n, observed),
        largest(RECORDING, |s, n| s.nodes = n, observed),
        largest(RECORDING, |s, n| s.rows_of_cubes = n, observed),
        largest(RECORDING, |s, n| (s.layers, s.rows_of_cubes) = (n, n), observed),
        largest(RECORDING, |s, n| s.extension = n, observed),
        largest(RECORDING, |s, n| s.fold = n, observed),
        largest(RECORDING, |s, n| s.corners = n, observed),
        largest(Seen { nodes: 1000, ..RECORDING }, |s, n| s.markers = n, observed),
        largest(RECORDING, |s, n| s.site = n, observed),
        largest(RECORDING, |s, n| s.sites = n, observed),
        largest(RECORDING, |s, n| s.readings = n, observed),
    ];
    assert!(recordings[0].points > 3_900_000, "{:?}", recordings[0]);
    for most in bodies {
        check(&most, &RECORDING);
    }
    for seen in recordings {
        check(&Most { nodes: 1_000_000, ..many }, &seen);
    }
}

/// A kernel with its loops as they were written, where the linker put reads of arenas in their headers.
fn as_written(source: &str) -> String {
    let line = |line: &str| match line.split_once(" // ") {
        Some((_, header)) if header.starts_with("for ") || header.starts_with("while ") => format!("{header}\n"),
        _ => format!("{line}\n"),
    };
    source.lines().map(line).collect()
}

fn check(most: &Most, seen: &Seen) {
    for pass in &PASSES {
        for source in pass.sources {
            let all = functions(&as_written(source));
            let of = |header: &str| {
                bound(header, most, seen).unwrap_or_else(|| panic!("{}: how long is the loop `{header}`?", pass.name))
            };
            if most.many && ["iterate_cg", "look_cg"].contains(&pass.name) {
                continue;
            }
            let longest = iterations(&all, pass.name, &of);
            assert!(longest <= MOST_LOOPS as f64, "{}: {longest} iterations at {most:?}, {seen:?}", pass.name);
            if let Some((_, said)) = most.loops().iter().chain(&seen.loops()).find(|l| l.0 == pass.name) {
                // Host and shader round differently.
                assert!(
                    longest <= *said as f64 + 1.0,
                    "{}: the host says {said}, the shader {longest} at {most:?}, {seen:?}",
                    pass.name
                );
            }
        }
    }
}

#[test]
fn a_nested_loop_is_counted_as_often_as_it_runs() {
    let text = "fn inner() {\n    for (var j = 0u; j < 7u; j++) {\n        x += 1;\n    }\n}\nfn outer() {\n    for (var i = 0u; i < 5u; i++) {\n        inner();\n        for (var k = 0u; k < 3u; k++) {\n        }\n    }\n}";
    let number = |h: &str| {
        bound(
            h,
            &Most {
                members: 0,
                nodes: 0,
                row: 0,
                supports: 0,
                planes: 0,
                obstacles: 0,
                jets: 0,
                patches: 0,
                frame: 0,
                framed: 0,
                pressed: 0,
                masses: 0,
                stencil: 0,
                valence: 0,
                pairs: 0,
                stars: 0,
                star: 0,
                holders: 0,
                grips: 0,
                aging: 0,
                groups: 0,
                group: 0,
                chunk: 0,
                stay: 0,
                many: false,
            },
            &RECORDING,
        )
        .unwrap_or(0.0)
    };
    assert_eq!(iterations(&functions(text), "outer", &number), f64::from(5 + 5 * 7 + 5 * 3));
}

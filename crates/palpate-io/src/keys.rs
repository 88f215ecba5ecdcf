//! The keys of every table that palpate reads, as data: unknown keys are found by comparing with these lists.

/// Keys of one table and the tables under it.
pub(crate) struct Schema {
    /// Keys that hold values.
    pub keys: &'static [&'static str],
    /// Keys that hold tables or arrays of tables.
    pub tables: &'static [(&'static str, Schema)],
}

const fn table(keys: &'static [&'static str]) -> Schema {
    Schema { keys, tables: &[] }
}

impl Schema {
    /// Schema of the table under a key.
    pub fn child(&self, key: &str) -> Option<&Schema> {
        self.tables.iter().find(|(k, _)| *k == key).map(|(_, s)| s)
    }

    /// What to say about an unknown key: the nearest known one, or all of them.
    pub fn suggest(&self, key: &str) -> String {
        let known: Vec<&str> = self.keys.iter().copied().chain(self.tables.iter().map(|(k, _)| *k)).collect();
        suggest(key, &known)
    }
}

/// What to say about an unknown name: the nearest known one, or all of them.
pub(crate) fn suggest(name: &str, known: &[&str]) -> String {
    // Below a similarity of 0.75 a suggestion is a guess; then the whole list helps more.
    let nearest = known.iter().map(|k| (strsim::jaro_winkler(name, k), *k)).max_by(|a, b| a.0.total_cmp(&b.0));
    match nearest {
        Some((similarity, k)) if similarity > 0.75 => format!("did you mean \"{k}\"?"),
        _ if known.is_empty() => "none is known here".to_string(),
        _ => format!("known: {}", known.join(", ")),
    }
}

/// Format `scene/1`.
pub(crate) const SCENE: Schema = Schema {
    // The keys of an effect depend on its kind: its own reader checks them.
    keys: &["format", "title", "effect"],
    tables: &[
        (
            "object",
            Schema {
                keys: &[
                    "mesh",
                    "volume_mesh",
                    "points",
                    "state",
                    "pose",
                    "discretisation",
                    "cell_size",
                    "cells",
                    "edge_length",
                    "neighbours",
                    "weights",
                    "residual_penalty",
                    "volume",
                ],
                tables: &[(
                    "shape",
                    Schema {
                        keys: &[],
                        tables: &[
                            ("ball", table(&["radius", "center"])),
                            ("torus", table(&["major", "minor", "center", "axis"])),
                            ("box", table(&["min", "max"])),
                            ("cylinder", table(&["radius", "height", "center", "axis"])),
                        ],
                    },
                )],
            },
        ),
        (
            "material",
            Schema {
                keys: &["model", "density", "mass", "youngs_modulus", "poisson_ratio", "mass_damping", "stiffness_damping"],
                tables: &[
                    ("viscosity", table(&["coefficient", "exponent"])),
                    ("stretch_curve", table(&["stretches", "factors"])),
                    ("volume_curve", table(&["ratios", "factors"])),
                ],
            },
        ),
        ("world", table(&["gravity"])),
        ("clamp", Schema { keys: &["group", "frame", "motion"], tables: &[("box", table(&["min", "max"]))] }),
        ("plane", table(&["point", "normal", "stiffness"])),
        ("mass", table(&["point", "mass"])),
        (
            "field",
            Schema {
                keys: &["path", "basis", "scale", "blend", "file", "array"],
                tables: &[("regions", table(&["center", "radius", "value"])), ("prior", table(&["kind", "length", "deviation"]))],
            },
        ),
        ("initial", table(&["velocity", "angular_velocity", "pivot", "state"])),
        ("time", table(&["mode", "step", "duration", "steps", "start", "scheme", "theta"])),
        ("load", table(&["kind", "forces", "total", "index", "places", "times", "rate", "start", "factor"])),
        ("attach", table(&["points", "places", "track", "times", "rate", "start", "stiffness", "offset"])),
        ("solver", table(&["element", "linear", "tolerance", "newton_iterations", "ghost"])),
        (
            "observation",
            Schema {
                keys: &["recording", "file", "cost", "band", "pixel_stride"],
                tables: &[("frames", table(&["from", "to", "every"])), ("marker", table(&["name", "position", "surface"]))],
            },
        ),
        ("track", table(&["prior", "temperature", "outliers", "soft_start"])),
        ("target", table(&["time", "tolerance", "points", "positions", "file"])),
        ("handle", table(&["point", "radius", "stiffness", "path"])),
        ("keyframe", table(&["time", "points", "positions", "sigma"])),
        ("synthesize", table(&["knots", "force", "loop", "gap", "iterations"])),
        (
            "fit",
            Schema {
                keys: &["optimizer", "iterations", "starts", "seed", "threads", "warm_start"],
                tables: &[
                    ("parameter", table(&["path", "start", "bounds", "known", "per_scene"])),
                    ("frames", Schema { keys: &["test"], tables: &[("train", table(&["every", "count"]))] }),
                ],
            },
        ),
    ],
};

/// Format `recording/1`.
pub(crate) const RECORDING: Schema = Schema {
    keys: &["format", "title", "source", "units"],
    tables: &[
        (
            "camera",
            table(&[
                "name",
                "width",
                "height",
                "fx",
                "fy",
                "cx",
                "cy",
                "distortion",
                "world_from_camera",
                "depth_scale",
                "depth_offset",
                "noise_sigma",
                "noise_systematic",
            ]),
        ),
        ("frame", table(&["camera", "time", "depth", "mask"])),
        (
            "cloud",
            table(&[
                "file",
                "array",
                "time",
                "times",
                "rate",
                "start",
                "camera",
                "origin",
                "unit",
                "transform",
                "noise_sigma",
                "noise_systematic",
            ]),
        ),
        (
            "points",
            table(&[
                "file",
                "array",
                "times",
                "rate",
                "start",
                "rest",
                "unit",
                "transform",
                "tolerance",
                "noise_sigma",
                "noise_systematic",
            ]),
        ),
        (
            "displacements",
            table(&["file", "array", "times", "rate", "start", "nodes", "unit", "transform", "noise_sigma", "noise_systematic"]),
        ),
        (
            "markers",
            Schema {
                keys: &["file", "noise_sigma", "noise_systematic"],
                tables: &[("rest", table(&["name", "position", "surface"]))],
            },
        ),
    ],
};

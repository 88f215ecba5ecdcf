//! `palpate export`: a body with its material, its clamps and its world as files of other simulators.

use crate::cli::Console;
use crate::error::Error;
use crate::experiment::Experiment;
use crate::exporting::{ExportOptions, specimen};
use crate::options::out_folder;
use crate::results;
use crate::results::export::{ExportDocument, ExportedFormat};
use clap::{Args, ValueEnum};
use palpate_engine::number;
use palpate_export::{ExportError, Format, Specimen, export, find, formats};
use palpate_io::output::write_file;
use std::path::{Path, PathBuf};

const AFTER_HELP: &str = "\
Examples:
  palpate export beam.toml --format mujoco                out/beam-export/beam.xml
  palpate export found --format calculix,febio            what a fit has written into found/ (its model.toml)
  palpate export beam.toml --format usd --edge-length 0.01 --out for-usd

Formats:
  mujoco     MJCF with a flex of quadratic cells; of linear tetrahedra with --element linear
  calculix   input deck of CalculiX and Abaqus (.inp)
  febio      FEBio, febio_spec 4.0 (.feb)
  sofa       SOFA 24.06 (.scn): corotated linear tetrahedra
  usd        OpenUSD (.usda): TetMesh
  gmsh       MSH 2.2 (.msh): mesh, groups and fields
  urdf       one rigid link: mass, inertia, surface; URDF has no soft bodies

Cells are replaced by tetrahedra with the same volume; a body of tetrahedra is written as it is. Nodes in clamps are held. What a format has no place for is a warning, and stands in the file's head. A stiffness that varies is
refused by formats that have one number for it. What each program's elements cost is measured in docs/export.md.";

/// Write a body and its material for another simulator
#[derive(Clone, Debug, Args)]
#[command(after_help = AFTER_HELP)]
pub struct Arguments {
    /// Scene file, or output folder of a fit
    #[arg(value_name = "SCENE|FOLDER")]
    scene: PathBuf,
    /// Formats, separated by commas: mujoco, calculix, febio, sofa, usd, gmsh, urdf
    #[arg(long, value_name = "NAME", value_delimiter = ',', required = true, value_parser = format)]
    format: Vec<&'static Format>,
    /// Output folder [default: out/SCENE-export]
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Longest edge of the tetrahedra [m] [default: that of a cell]
    #[arg(long, value_name = "M", allow_negative_numbers = true)]
    edge_length: Option<f64>,
    /// Elements [default: quadratic where the format has them]
    #[arg(long, value_enum)]
    element: Option<Element>,
}

/// Elements that are written.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Element {
    /// Corners alone: too stiff in bending
    Linear,
    /// A node in the middle of every edge
    Quadratic,
}

/// The format of a name; of one that is unknown, those that there are.
fn format(name: &str) -> Result<&'static Format, String> {
    find(name).ok_or_else(|| {
        let names: Vec<&str> = formats().map(|f| f.name).collect();
        format!("is none of {}", names.join(", "))
    })
}

/// The scene that is meant: of a fit's folder, what it found.
fn scene_of(path: &Path) -> Result<PathBuf, Error> {
    if !path.is_dir() {
        return Ok(path.to_path_buf());
    }
    let one = path.join("model.toml");
    if one.is_file() {
        return Ok(one);
    }
    let several = path.join("model-1.toml").is_file();
    let help = if several {
        "it is that of a joint fit: name one of its model-N.toml"
    } else {
        "name a scene, or a fit's output folder"
    };
    Err(Error::Input(format!("{}: holds no model.toml; {help}", path.display())))
}

pub fn run(a: &Arguments, console: &mut Console) -> Result<i32, Error> {
    if let Some(edge) = a.edge_length.filter(|h| !(*h > 0.0 && h.is_finite())) {
        return Err(Error::option("edge-length", edge, "must be > 0 (m)"));
    }
    let path = scene_of(&a.scene)?;
    let experiment = Experiment::open_without_recording(&path)?;
    console.warn(experiment.warnings());
    let options = ExportOptions { edge_length: a.edge_length, quadratic: a.element.map(|e| e == Element::Quadratic) };
    let (whole, volume) = specimen(&experiment, &options)?;
    let folder = out_folder(&a.out, &named(a, &path), "-export");
    let mut document = ExportDocument {
        scene: path.display().to_string(),
        out: folder.display().to_string(),
        nodes: whole.mesh.nodes.len(),
        tetrahedra: whole.mesh.tets.len(),
        quadratic: whole.mesh.is_quadratic(),
        volume: whole.mesh.volume(),
        shape_volume: volume,
        mass: whole.mass(),
        held: whole.held.iter().map(|h| h.nodes.len()).collect(),
        formats: Vec::new(),
    };
    // Everything is made before the first file is written.
    let mut files = Vec::new();
    for format in &a.format {
        if a.element == Some(Element::Quadratic) && !format.has_quadratic {
            let able: Vec<&str> = formats().filter(|f| f.has_quadratic).map(|f| f.name).collect();
            let message = format!("{} has linear elements alone; quadratic ones have {}", format.name, able.join(", "));
            return Err(Error::option("element", "quadratic", message));
        }
        let done = if format.has_quadratic { export(&whole, format) } else { export(&linear(&whole), format) };
        let done = done.map_err(|e: ExportError| Error::Input(format!("{}: {e}", path.display())))?;
        document.formats.push(ExportedFormat {
            name: format.name.into(),
            files: done.files.iter().map(|f| f.name.clone()).collect(),
            left_out: done.lost,
        });
        files.extend(done.files);
    }
    let _lock = crate::folder::take(&folder, console)?;
    for file in &files {
        write_file(folder.join(&file.name), |w| w.write_all(file.text.as_bytes()))?;
    }
    for f in &document.formats {
        console.warn(&f.left_out.iter().map(|l| format!("{}: {l}", f.name)).collect::<Vec<_>>());
    }
    console.print(&if console.json() { results::line(&document) } else { sentence(&document) });
    Ok(0)
}

/// What the output folder is called after: the scene, or the folder of the fit, whose model.toml is called alike everywhere.
fn named(a: &Arguments, path: &Path) -> PathBuf {
    if a.scene.is_dir() { a.scene.file_name().map_or_else(|| path.to_path_buf(), PathBuf::from) } else { path.to_path_buf() }
}

/// The same specimen with linear elements.
fn linear<'a>(s: &Specimen<'a>) -> Specimen<'a> {
    let mut other = Specimen { mesh: s.mesh.linear(), ..s.clone() };
    let corners = other.mesh.corners;
    other.held.iter_mut().for_each(|h| h.nodes.retain(|n| (*n as usize) < corners));
    other
}

/// What was written, in a few lines.
fn sentence(d: &ExportDocument) -> String {
    let mut out = format!(
        "{}: {} {} tetrahedra, {} nodes{}, {} kg, {:.6e} m³ (the shape: {:.6e})",
        d.scene,
        d.tetrahedra,
        if d.quadratic { "quadratic" } else { "linear" },
        d.nodes,
        if d.held.is_empty() { String::new() } else { format!(" ({} held)", d.held.iter().sum::<usize>()) },
        number(d.mass),
        d.volume,
        d.shape_volume
    );
    for f in &d.formats {
        let files: Vec<String> = f.files.iter().map(|n| Path::new(&d.out).join(n).display().to_string()).collect();
        out += &format!("\n  {:<10} {}", f.name, files.join(", "));
    }
    out
}

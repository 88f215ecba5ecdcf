//! `palpate pictures`: what a report shows, as files and without a browser.

use crate::cli::Console;
use crate::error::Error;
use crate::options::count;
use crate::report::{chart_picture, chart_svg, pair, read_report};
use crate::results;
use crate::results::pictures::PicturesDocument;
use crate::results::report::{ReportData, SceneData, ShownMotion};
use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use clap::{Args, ValueEnum};
use glam::DVec3;
use image::codecs::gif::{GifEncoder, Repeat};
use image::{Delay, Frame, RgbaImage};
use palpate_io::InputError;
use palpate_io::output::write_file;
use palpate_io::vtk::{Elements, Values, write_pvd, write_vtu};
use std::io::Cursor;
use std::path::{Path, PathBuf};

const AFTER_HELP: &str = "\
Examples:
  palpate pictures out/first-fit                        charts and pictures in out/first-fit/pictures/
  palpate pictures out/first-fit --format gif           the motion, start values beside fitted, as a movie
  palpate pictures out/first-fit --format vtu           surfaces and readings with their residuals for ParaView
  palpate pictures why/report.html --format svg --all   charts alone, those of every marker among them

What is drawn lies in the report itself: nothing is simulated, and neither scene nor recording need be there.
Charts become svg or png, frames in space and camera overlays png. For the cells with stress and strain simulate the
scene that was found: palpate simulate OUT/model.toml --format vtu.";

/// Milliseconds that a frame of a movie stands.
const DELAY: u32 = 160;

/// Draw what a report shows: charts, frames, movies, files for ParaView
#[derive(Clone, Debug, Args)]
#[command(after_help = AFTER_HELP)]
pub struct Arguments {
    /// The folder of a fit or a diagnosis, or its report.html
    #[arg(value_name = "FOLDER")]
    report: PathBuf,
    /// Folder of the pictures [default: FOLDER/pictures]
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// What to draw, separated by commas
    #[arg(long, value_enum, value_delimiter = ',', default_value = "png,svg")]
    format: Vec<Format>,
    /// Width of one motion in space [pixels]
    #[arg(long, value_name = "N", default_value_t = 640, value_parser = count(64..=4096), allow_negative_numbers = true)]
    width: u64,
    /// Also charts that the report only shows to who asks for them
    #[arg(long)]
    all: bool,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Format {
    Png,
    Svg,
    Gif,
    Vtu,
}

/// Writes files and remembers their names.
struct Writer {
    folder: PathBuf,
    files: Vec<String>,
}

impl Writer {
    fn write(&mut self, name: String, bytes: &[u8]) -> Result<(), Error> {
        write_file(self.folder.join(&name), |w| w.write_all(bytes))?;
        self.files.push(name);
        Ok(())
    }
}

pub fn run(a: &Arguments, console: &mut Console) -> Result<i32, Error> {
    let report = if a.report.is_dir() { a.report.join("report.html") } else { a.report.clone() };
    let data = read_report(&report)?;
    let folder = a.out.clone().unwrap_or_else(|| report.parent().unwrap_or(Path::new(".")).join("pictures"));
    let _lock = crate::folder::take(&folder, console)?;
    let mut w = Writer { folder: folder.clone(), files: Vec::new() };
    let wants = |f: Format| a.format.contains(&f);
    for c in data.charts.iter().filter(|c| c.main || a.all) {
        if let Some(svg) = chart_svg(c).filter(|_| wants(Format::Svg)) {
            w.write(format!("{}.svg", c.key), svg.as_bytes())?;
        }
        if let Some(picture) = wants(Format::Png).then(|| chart_picture(c)).flatten() {
            w.write(format!("{}.png", c.key), &picture.png())?;
        }
    }
    for (s, scene) in data.scenes.iter().enumerate() {
        let mut track = console.progress(scene.shown.len() as u64, "drawing");
        if wants(Format::Png) || wants(Format::Gif) {
            space(&mut w, &data, s, a, &mut || track.on(1, ""))?;
        }
        if wants(Format::Png) {
            overlays(&mut w, scene, s, &report)?;
        }
        if wants(Format::Vtu) {
            grids(&mut w, &data, s)?;
        }
        track.finish();
    }
    if w.files.is_empty() {
        return Err(Error::Input(format!("{}: shows nothing that can be drawn like this", report.display())));
    }
    let document = PicturesDocument { report: report.display().to_string(), out: folder.display().to_string(), files: w.files };
    console.print(&match console.json() {
        true => results::line(&document),
        false => format!("{} files in {}: {}", document.files.len(), document.out, document.files.join(", ")),
    });
    Ok(0)
}

/// Every frame in space, and all of them as a movie.
fn space(w: &mut Writer, data: &ReportData, s: usize, a: &Arguments, drawn: &mut dyn FnMut()) -> Result<(), Error> {
    let scene = &data.scenes[s];
    let mut bytes = Cursor::new(Vec::new());
    // 10: colours are chosen with care enough, ten times as fast as at 1.
    let mut movie = GifEncoder::new_with_speed(&mut bytes, 10);
    let gif = a.format.contains(&Format::Gif) && !scene.shown.is_empty();
    let failed = |e: image::ImageError| Error::Failed(format!("a movie cannot be encoded: {e}"));
    if gif {
        movie.set_repeat(Repeat::Infinite).map_err(failed)?;
    }
    for k in 0..scene.shown.len() {
        let picture = pair(data, scene, k, a.width as usize);
        if a.format.contains(&Format::Png) {
            w.write(format!("space-{s}-{k:03}.png"), &picture.png())?;
        }
        if gif {
            let flat: Vec<u8> = picture.rgb.iter().flat_map(|c| [c[0], c[1], c[2], 255]).collect();
            let image =
                RgbaImage::from_raw(picture.width as u32, picture.height as u32, flat).expect("a picture holds its pixels");
            movie.encode_frame(Frame::from_parts(image, 0, 0, Delay::from_numer_denom_ms(DELAY, 1))).map_err(failed)?;
        }
        drawn();
    }
    drop(movie);
    if gif {
        w.write(format!("space-{s}.gif"), &bytes.into_inner())?;
    }
    Ok(())
}

/// What cameras saw.
fn overlays(w: &mut Writer, scene: &SceneData, s: usize, report: &Path) -> Result<(), Error> {
    for (k, o) in scene.overlays.iter().enumerate() {
        let png = STANDARD.decode(&o.png).map_err(|e| InputError::file(report, format!("holds a damaged picture: {e}")))?;
        w.write(format!("camera-{s}-{k}.png"), &png)?;
    }
    Ok(())
}

/// The surface and the readings of both motions, with their residuals, frame by frame.
fn grids(w: &mut Writer, data: &ReportData, s: usize) -> Result<(), Error> {
    let scene = &data.scenes[s];
    let triangles: Vec<[u32; 3]> = scene.triangles.0.chunks_exact(3).map(|t| [t[0], t[1], t[2]]).collect();
    for m in 0..2 {
        let name = ["first", "second"][m];
        let (mut surfaces, mut readings) = (Vec::new(), Vec::new());
        for (k, shown) in scene.shown.iter().enumerate() {
            let Some(motion) = &shown.motions[m] else { continue };
            let file = format!("surface-{s}-{name}-{k:03}.vtu");
            surface(&w.folder.join(&file), motion, &triangles)?;
            surfaces.push((shown.time, file));
            let file = format!("readings-{s}-{name}-{k:03}.vtu");
            measured(&w.folder.join(&file), motion)?;
            readings.push((shown.time, file));
        }
        for (what, series) in [("surface", surfaces), ("readings", readings)] {
            if !series.is_empty() {
                let file = format!("{what}-{s}-{name}.pvd");
                write_pvd(w.folder.join(&file), &series)?;
                w.files.extend(series.into_iter().map(|x| x.1).chain([file]));
            }
        }
    }
    Ok(())
}

fn surface(path: &Path, motion: &ShownMotion, triangles: &[[u32; 3]]) -> Result<(), Error> {
    let vertices = motion.vertices.vectors();
    let residual: Vec<f64> = motion.residual.numbers().collect();
    let arrays = match residual.len() == vertices.len() {
        true => vec![("residual", Values::Numbers(&residual))],
        false => Vec::new(),
    };
    Ok(write_vtu(path, &vertices, &Elements::triangles(triangles), &arrays, &[])?)
}

/// Depth points with their signed distance, then all else with its vector.
fn measured(path: &Path, motion: &ShownMotion) -> Result<(), Error> {
    let (points, places) = (motion.points.vectors(), motion.measured.vectors());
    let offset = |(m, s): (&DVec3, DVec3)| s - *m;
    let offsets: Vec<DVec3> = places.iter().zip(motion.simulated.vectors()).map(offset).collect();
    let residual: Vec<f64> = motion.distances.numbers().chain(offsets.iter().map(|o| o.length())).collect();
    let offsets: Vec<DVec3> = points.iter().map(|_| DVec3::ZERO).chain(offsets).collect();
    let all: Vec<DVec3> = points.into_iter().chain(places).collect();
    let arrays = [("residual", Values::Numbers(&residual)), ("offset", Values::Vectors(&offsets))];
    Ok(write_vtu(path, &all, &Elements::vertices(all.len()), &arrays, &[])?)
}

//! ROS 2 bags in MCAP: depth images (raw, or compressed as PNG) and the camera info beside them.

use super::Format;
use super::cdr::Cdr;
use crate::Watch;
use crate::budget::Budget;
use crate::capture::{Capture, DepthCamera, DepthFrame, Pixels};
use crate::error::{ImportError, read as read_bytes, refuse, refuse_option};
use crate::intrinsics::lens_of;
use crate::lens::Optics;
use crate::options::Options;
use crate::place::{Place, has_ending, head};
use image::{DynamicImage, ImageFormat};
use mcap::io::MessageReader;
use mcap::records::op;
use mcap::sans_io::LinearReaderOptions;
use palpate_io::lens::Lens;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// See the file's head.
pub const FORMAT: Format = Format {
    name: "ros2-mcap",
    what: "ROS 2 bag in MCAP",
    detect: |place| {
        let bag = |f: &&PathBuf| head(f, 8) == mcap::MAGIC;
        let other = |f: &&PathBuf| has_ending(f, &["db3", "bag"]);
        let found = place.with_ending(&["mcap", "db3", "bag"]).find(|f| bag(f) || other(f))?;
        Some(format!("{} is a bag", place.name(found)))
    },
    read,
};

/// Largest record of a compressed chunk [B], five times an image of twelve million floats: it takes memory before its bytes are there.
const LARGEST: usize = 1 << 28;

/// Images and infos of a bag, by topic.
struct Topics {
    budget: Budget,
    images: BTreeMap<String, Vec<Image>>,
    infos: BTreeMap<String, Info>,
    /// Topics of images that are no depth, with their encoding.
    others: BTreeMap<String, String>,
}

struct Image {
    stamp: u64,
    frame: String,
    size: [usize; 2],
    pixels: Pixels,
}

#[derive(Clone, Debug)]
struct Info {
    size: [usize; 2],
    model: String,
    d: Vec<f64>,
    k: [f64; 4],
    p: [f64; 4],
}

fn read(place: &Place, o: &Options, watch: &mut Watch) -> Result<Capture, ImportError> {
    let files: Vec<&PathBuf> = place.with_ending(&["mcap"]).collect();
    if files.is_empty() {
        return refuse(&place.path, "is a bag, and not in MCAP; convert it: ros2 bag convert, or rosbags-convert for ROS 1");
    }
    let mut topics = Topics { budget: Budget::new(), images: BTreeMap::new(), infos: BTreeMap::new(), others: BTreeMap::new() };
    for file in &files {
        let bytes = read_bytes(file)?;
        check(&bytes).or_else(|e| refuse(file, format!("is not a readable MCAP file: {e}")))?;
        let allowed = LinearReaderOptions::default().with_record_length_limit(bytes.len().max(LARGEST));
        for (k, message) in MessageReader::new_with_options(&bytes[..], allowed).enumerate() {
            let m = match message {
                Ok(m) => m,
                Err(e) => return refuse(file, format!("is not a readable MCAP file: {e}")),
            };
            if k % 64 == 0 {
                watch.at(k, k + 1000, "messages of the bag")?;
            }
            topics.take(file, &m, o)?;
        }
    }
    let topics_of_depth: Vec<&String> = topics.images.keys().collect();
    let topic = match (&o.pick, &topics_of_depth[..]) {
        (Some(p), known) => match known.iter().find(|t| *t == &p) {
            Some(t) => (*t).clone(),
            None => {
                let names: Vec<&str> = known.iter().map(|t| t.as_str()).collect();
                return refuse_option("pick", p, format!("is no topic with depth images; there are: {}", names.join(", ")));
            }
        },
        (None, [one]) => (*one).clone(),
        (None, []) => {
            let known: Vec<String> = topics.others.iter().map(|(t, e)| format!("{t} ({e})")).collect();
            let text = "holds no depth images (sensor_msgs/msg/Image of 16UC1 or 32FC1, or compressedDepth)";
            return refuse(&place.path, format!("{text}; its images are: {}", known.join(", ")));
        }
        (None, several) => {
            let names: Vec<&str> = several.iter().map(|t| t.as_str()).collect();
            return refuse_option("pick", "", format!("say which depth images: {}", names.join(", ")));
        }
    };
    let images = topics.images.remove(&topic).unwrap_or_default();
    camera(place, &topic, images, &topics)
}

/// Refuses records that reach beyond the file or their chunk: the crate subtracts their lengths from what is left without a look. Chunks that are
/// compressed are not looked into, since their stream has an end of its own.
fn check(bytes: &[u8]) -> Result<(), &'static str> {
    let mut rest = bytes.strip_prefix(mcap::MAGIC).ok_or("it does not begin like one")?;
    loop {
        let (code, content, behind) = record(rest).ok_or("it ends in the middle of a record (truncated?)")?;
        match code {
            op::FOOTER => return Ok(()),
            op::CHUNK if plain(content).is_some_and(|records| !is_filled(records)) => {
                return Err("a record reaches beyond its chunk");
            }
            _ => rest = behind,
        }
    }
}

/// Code and content of the first record, and what is behind it; `None` where it is not whole.
fn record(bytes: &[u8]) -> Option<(u8, &[u8], &[u8])> {
    let (code, rest) = bytes.split_first()?;
    let (length, rest) = rest.split_first_chunk()?;
    let (content, behind) = rest.split_at_checked(u64::from_le_bytes(*length).try_into().ok()?)?;
    Some((*code, content, behind))
}

/// The records of a chunk that is not compressed: its head has two times, a size, a checksum, the name of a compression, and another size.
fn plain(chunk: &[u8]) -> Option<&[u8]> {
    let (name, rest) = chunk.get(28..)?.split_first_chunk()?;
    let (size, rest) = rest.split_first_chunk()?;
    if u32::from_le_bytes(*name) > 0 { None } else { rest.get(..u64::from_le_bytes(*size).try_into().ok()?) }
}

/// True where records end where their bytes do.
fn is_filled(mut records: &[u8]) -> bool {
    while let Some((_, _, behind)) = record(records) {
        records = behind;
    }
    records.is_empty()
}

impl Topics {
    fn take(&mut self, file: &Path, m: &mcap::Message, o: &Options) -> Result<(), ImportError> {
        let Some(schema) = &m.channel.schema else { return Ok(()) };
        let topic = &m.channel.topic;
        let kind = schema.name.rsplit('/').next().unwrap_or("");
        if !schema.name.starts_with("sensor_msgs/") || !["Image", "CompressedImage", "CameraInfo"].contains(&kind) {
            return Ok(());
        }
        if m.channel.message_encoding != "cdr" {
            let text = format!("topic {topic} is encoded as \"{}\", expected cdr (ROS 2)", m.channel.message_encoding);
            return refuse(file, text);
        }
        let short = || format!("a message of {topic} ends too early, or is no {}", schema.name);
        if kind == "CameraInfo" {
            let Some(info) = info(&m.data) else { return refuse(file, short()) };
            match self.infos.get(topic) {
                // As texts: NaN differs from itself.
                Some(before) if format!("{before:?}") != format!("{info:?}") => {
                    refuse(file, format!("{topic} changes within the bag"))
                }
                _ => {
                    self.infos.insert(topic.clone(), info);
                    Ok(())
                }
            }
        } else {
            // A picked topic alone is decoded.
            if o.pick.as_ref().is_some_and(|p| p != topic) {
                return Ok(());
            }
            let read = if kind == "Image" { image(&m.data) } else { compressed(&m.data) };
            match read {
                None => refuse(file, short()),
                Some(Err(encoding)) => {
                    self.others.insert(topic.clone(), encoding);
                    Ok(())
                }
                Some(Ok(mut i)) => {
                    if i.stamp == 0 {
                        i.stamp = m.log_time;
                    }
                    i.pixels.take(file, &mut self.budget)?;
                    self.images.entry(topic.clone()).or_default().push(i);
                    Ok(())
                }
            }
        }
    }
}

/// A depth image, or the encoding of one that is none; `None` of a damaged message.
fn image(data: &[u8]) -> Option<Result<Image, String>> {
    let mut c = Cdr::new(data)?;
    let (stamp, frame) = c.header()?;
    let (height, width) = (c.u32()? as usize, c.u32()? as usize);
    let encoding = c.text()?;
    let big = c.u8()? != 0;
    let step = c.u32()? as usize;
    let bytes = c.bytes()?;
    let wide = match encoding.as_str() {
        "16UC1" | "mono16" => 2,
        "32FC1" => 4,
        _ => return Some(Err(encoding)),
    };
    if step < width.checked_mul(wide)? || bytes.len() < step.checked_mul(height)? || width * height == 0 {
        return None;
    }
    let rows = (0..height).map(|v| &bytes[v * step..v * step + width * wide]);
    let pixels = if wide == 2 {
        let one = |b: &[u8]| if big { u16::from_be_bytes([b[0], b[1]]) } else { u16::from_le_bytes([b[0], b[1]]) };
        Pixels::Counts(rows.flat_map(|r| r.chunks_exact(2).map(one)).collect())
    } else {
        let one = |b: &[u8]| {
            let b = [b[0], b[1], b[2], b[3]];
            if big { f32::from_be_bytes(b) } else { f32::from_le_bytes(b) }
        };
        Pixels::Lengths(rows.flat_map(|r| r.chunks_exact(4).map(one)).collect())
    };
    Some(Ok(Image { stamp, frame, size: [width, height], pixels }))
}

/// The same of `compressedDepth`: twelve bytes (a format and two parameters), then a PNG, of floats in steps of their inverse.
fn compressed(data: &[u8]) -> Option<Result<Image, String>> {
    let mut c = Cdr::new(data)?;
    let (stamp, frame) = c.header()?;
    let format = c.text()?;
    let bytes = c.bytes()?;
    if !format.contains("compressedDepth") {
        return Some(Err(format));
    }
    let (head, png) = bytes.split_at_checked(12)?;
    let DynamicImage::ImageLuma16(i) = image::load_from_memory_with_format(png, ImageFormat::Png).ok()? else { return None };
    let size = [i.width() as usize, i.height() as usize];
    let raw = i.into_raw();
    let pixels = if format.contains("32FC1") {
        let parameter = |at: usize| f32::from_le_bytes([head[at], head[at + 1], head[at + 2], head[at + 3]]);
        let (a, b) = (parameter(4), parameter(8));
        Pixels::Lengths(raw.into_iter().map(|n| if n > 0 { a / (f32::from(n) - b) } else { f32::NAN }).collect())
    } else {
        Pixels::Counts(raw)
    };
    Some(Ok(Image { stamp, frame, size, pixels }))
}

fn info(data: &[u8]) -> Option<Info> {
    let mut c = Cdr::new(data)?;
    c.header()?;
    let (height, width) = (c.u32()? as usize, c.u32()? as usize);
    let model = c.text()?;
    let d = c.numbers()?;
    let mut some = |n: usize| (0..n).map(|_| c.f64()).collect::<Option<Vec<f64>>>();
    let (k, _, p) = (some(9)?, some(9)?, some(12)?);
    Some(Info { size: [width, height], model, d, k: [k[0], k[4], k[2], k[5]], p: [p[0], p[5], p[2], p[6]] })
}

/// The info that belongs to a topic of images: in the same namespace, as image_transport has it.
fn info_of<'a>(topic: &str, infos: &'a BTreeMap<String, Info>) -> Option<(&'a String, &'a Info)> {
    let mut space = topic;
    while let Some((above, _)) = space.rsplit_once('/') {
        if let Some(found) = infos.get_key_value(&format!("{above}/camera_info")) {
            return Some(found);
        }
        space = above;
    }
    None
}

fn camera(place: &Place, topic: &str, images: Vec<Image>, topics: &Topics) -> Result<Capture, ImportError> {
    let Some((name, info)) = info_of(topic, &topics.infos) else {
        let known: Vec<&str> = topics.infos.keys().map(String::as_str).collect();
        return refuse(&place.path, format!("holds no camera_info beside {topic}; there are: {}", known.join(", ")));
    };
    let Some(first) = images.first() else { return refuse(&place.path, "holds no depth image") };
    let (zero, size) = (first.stamp, first.size);
    if info.size != size && info.size != [0, 0] {
        let text = format!("{name} is for {} × {} pixels, {topic} has {} × {}", info.size[0], info.size[1], size[0], size[1]);
        return refuse(&place.path, text);
    }
    // Rectified images have no distortion left, and the focal lengths of P.
    let rectified = topic.contains("rect");
    let [fx, fy, cx, cy] = if rectified { info.p } else { info.k };
    if !(fx > 0.0 && fy > 0.0 && [fx, fy, cx, cy].iter().all(|x| x.is_finite())) {
        return refuse(&place.path, format!("{name} states focal lengths {fx} and {fy} (pixels): the camera was not calibrated"));
    }
    let lens = if rectified {
        Lens::Brown([0.0; 5])
    } else {
        lens_of(&info.model, &info.d).or_else(|e| refuse(&place.path, format!("{name}: {e}")))?
    };
    let optics = Optics { focal: [fx, fy], center: [cx, cy], lens };
    crate::intrinsics::check_center(&place.path, name, &optics, Some(size))?;
    let frame = first.frame.clone();
    let mut frames: Vec<DepthFrame> = Vec::new();
    let mut images = images;
    images.sort_by_key(|i| i.stamp);
    for i in images {
        if i.size != size {
            return refuse(
                &place.path,
                format!("{topic} has images of {} × {} and of {} × {} pixels", size[0], size[1], i.size[0], i.size[1]),
            );
        }
        let time = (i.stamp as i128 - zero as i128) as f64 * 1e-9;
        if frames.last().is_some_and(|f| f.time == time) {
            return refuse(&place.path, format!("{topic} has two images stamped {} ns", i.stamp));
        }
        frames.push(DepthFrame { time, file: place.path.clone(), pixels: i.pixels, mask: None });
    }
    let counts = matches!(frames[0].pixels, Pixels::Counts(_));
    let mut losses = Vec::new();
    if !frame.is_empty() {
        losses.push(format!("transforms of the bag (tf) are not read: the world's axes are those of the frame {frame}, unless --camera-pose says more"));
    }
    Ok(Capture {
        title: place.title(),
        facts: vec![
            format!("depth images of {topic}, camera of {name}; 0 s is {zero} ns"),
            if rectified {
                "rectified images: P of the camera, no distortion".into()
            } else {
                format!("distortion model \"{}\"", info.model)
            },
        ],
        cameras: vec![DepthCamera {
            name: "cam0".into(),
            size,
            optics,
            // REP 118: whole numbers are millimetres, floats metres.
            scale: Some(if counts { 0.001 } else { 1.0 }),
            usual_scale: (0.001, "REP 118"),
            poses: Vec::new(),
            frames,
            made: false,
        }],
        losses,
        ..Capture::default()
    })
}

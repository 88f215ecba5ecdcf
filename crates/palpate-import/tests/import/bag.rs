//! ROS 2 bags in MCAP.

use super::truth::*;
use mcap::{Compression, WriteOptions, records::MessageHeader};
use palpate_import::Options;
use std::collections::BTreeMap;
use std::io::Cursor;

/// A message in little-endian CDR.
struct Cdr(Vec<u8>);

impl Cdr {
    fn new(stamp: u64) -> Cdr {
        let mut c = Cdr(vec![0, 1, 0, 0]);
        c.u32((stamp / 1_000_000_000) as u32).u32((stamp % 1_000_000_000) as u32).text("camera_depth_optical_frame");
        c
    }

    fn align(&mut self, n: usize) {
        while !(self.0.len() - 4).is_multiple_of(n) {
            self.0.push(0);
        }
    }

    fn u32(&mut self, x: u32) -> &mut Cdr {
        self.align(4);
        self.0.extend(x.to_le_bytes());
        self
    }

    fn f64(&mut self, x: f64) -> &mut Cdr {
        self.align(8);
        self.0.extend(x.to_le_bytes());
        self
    }

    fn text(&mut self, t: &str) -> &mut Cdr {
        self.u32(t.len() as u32 + 1);
        self.0.extend(t.as_bytes());
        self.0.push(0);
        self
    }

    fn bytes(&mut self, b: &[u8]) -> &mut Cdr {
        self.u32(b.len() as u32);
        self.0.extend(b);
        self
    }
}

fn info(stamp: u64, size: [usize; 2], k: [f64; 4], d: &[f64], model: &str) -> Vec<u8> {
    let mut c = Cdr::new(stamp);
    c.u32(size[1] as u32).u32(size[0] as u32).text(model).u32(d.len() as u32);
    d.iter().for_each(|x| _ = c.f64(*x));
    let [fx, fy, cx, cy] = k;
    [fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0].iter().for_each(|x| _ = c.f64(*x));
    [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0].iter().for_each(|x| _ = c.f64(*x));
    [fx, 0.0, cx, 0.0, 0.0, fy, cy, 0.0, 0.0, 0.0, 1.0, 0.0].iter().for_each(|x| _ = c.f64(*x));
    c.u32(0).u32(0);
    c.0
}

fn image(stamp: u64, encoding: &str, wide: usize, bytes: &[u8]) -> Vec<u8> {
    let mut c = Cdr::new(stamp);
    c.u32(SIZE[1] as u32).u32(SIZE[0] as u32).text(encoding);
    c.0.push(0);
    c.u32((SIZE[0] * wide) as u32).bytes(bytes);
    c.0
}

const ZERO: u64 = 1_700_000_000_123_456_789;

fn stamp(k: usize) -> u64 {
    ZERO + (time(k) * 1e9).round() as u64
}

/// Messages as topic, type, stamp and content.
type Messages = Vec<(&'static str, &'static str, u64, Vec<u8>)>;

fn bag(messages: &Messages, compression: Option<Compression>) -> Vec<u8> {
    let mut out = Cursor::new(Vec::new());
    let mut w = WriteOptions::new().compression(compression).profile("ros2").create(&mut out).unwrap();
    let mut channels = BTreeMap::new();
    for (i, (topic, kind, stamp, data)) in messages.iter().enumerate() {
        let id = *channels.entry(*topic).or_insert_with(|| {
            let schema = w.add_schema(kind, "ros2msg", b"").unwrap();
            w.add_channel(schema, topic, "cdr", &BTreeMap::new()).unwrap()
        });
        let header = MessageHeader { channel_id: id, sequence: i as u32, log_time: *stamp, publish_time: *stamp };
        w.write_to_known_channel(&header, data).unwrap();
    }
    w.finish().unwrap();
    drop(w);
    out.into_inner()
}

const INFO: &str = "sensor_msgs/msg/CameraInfo";
const IMAGE: &str = "sensor_msgs/msg/Image";
const DEPTH: &str = "/camera/depth/image_raw";

fn own_info(stamp: u64) -> Vec<u8> {
    info(stamp, SIZE, [FOCAL, FOCAL, CENTER[0], CENTER[1]], &[0.0; 5], "plumb_bob")
}

fn messages(encoding: &str) -> Messages {
    let mut all: Messages = Vec::new();
    for k in 0..FRAMES {
        all.push(("/camera/depth/camera_info", INFO, stamp(k), own_info(stamp(k))));
        let seen = counts(time(k), 0.001);
        let data = match encoding {
            "16UC1" => image(stamp(k), "16UC1", 2, &seen.iter().flat_map(|c| c.to_le_bytes()).collect::<Vec<u8>>()),
            "32FC1" => {
                let bytes: Vec<u8> = super::truth::image(time(k)).iter().flat_map(|z| (*z as f32).to_le_bytes()).collect();
                image(stamp(k), "32FC1", 4, &bytes)
            }
            _ => {
                let mut png = Cursor::new(Vec::new());
                let i = image::ImageBuffer::<image::Luma<u16>, _>::from_raw(SIZE[0] as u32, SIZE[1] as u32, seen).unwrap();
                i.write_to(&mut png, image::ImageFormat::Png).unwrap();
                let mut c = Cdr::new(stamp(k));
                c.text("16UC1; compressedDepth png").bytes(&[&[0; 12][..], &png.into_inner()].concat());
                c.0
            }
        };
        let kind = if encoding == "png" { "sensor_msgs/msg/CompressedImage" } else { IMAGE };
        all.push((DEPTH, kind, stamp(k), data));
        all.push(("/camera/color/image_raw", IMAGE, stamp(k), image(stamp(k), "rgb8", 3, &vec![0; 3 * SIZE[0] * SIZE[1]])));
        all.push(("/chatter", "std_msgs/msg/String", stamp(k), vec![0, 1, 0, 0, 0, 0, 0, 0]));
    }
    all
}

fn far() -> Options {
    Options { far: Some(0.9), ..Options::default() }
}

#[test]
fn bags_of_every_encoding_and_compression() {
    let cases = [("16UC1", None, 6e-4), ("32FC1", Some(Compression::Zstd), 6e-5), ("png", Some(Compression::Lz4), 6e-4)];
    // Half a count of a millimetre, or of a tenth of one for floats, along rays that slant by less than a third.
    for (encoding, compression, allowed) in cases {
        let bench = Bench::new();
        bench.write("bag/bag_0.mcap", bag(&messages(encoding), compression));
        bench.write("bag/metadata.yaml", "rosbag2_bagfile_information:\n");
        let (imported, r, _) = bench.good("bag", &far());
        assert_eq!((imported.format, imported.images), ("ros2-mcap", FRAMES), "{encoding}");
        let (off, n) = off_ball(&r);
        assert!(off < allowed && n > 1000, "{encoding}: {off} {n}");
        // Nanoseconds.
        assert!(r.frames.iter().enumerate().all(|(k, f)| (f.time - time(k)).abs() < 1e-9));
    }
}

#[test]
fn what_contradicts_itself_is_refused() {
    let good = messages("16UC1");
    let with = |change: &dyn Fn(&mut Messages)| {
        let mut m = good.clone();
        change(&mut m);
        bag(&m, None)
    };
    let replace_info = |data: Vec<u8>| with(&move |m| m.iter_mut().filter(|x| x.1 == INFO).for_each(|x| x.3 = data.clone()));
    let whole = bag(&good, None);
    let cases: [(&str, Vec<u8>, &[&str]); 9] = [
        ("no info", with(&|m| m.retain(|x| x.1 != INFO)), &["no camera_info", DEPTH]),
        ("another size", replace_info(info(0, [640, 480], [600.0, 600.0, 320.0, 240.0], &[], "")), &["640 × 480", "120 × 160"]),
        ("not calibrated", replace_info(info(0, SIZE, [0.0; 4], &[], "")), &["was not calibrated"]),
        ("NaN", replace_info(info(0, SIZE, [f64::NAN; 4], &[], "")), &["NaN"]),
        ("a lens", replace_info(info(0, SIZE, [150.0, 150.0, 60.0, 80.0], &[0.1; 7], "thin_prism")), &["thin_prism"]),
        (
            "a stamp twice",
            with(&|m| {
                let again = m.iter().find(|x| x.0 == DEPTH).unwrap().clone();
                m.push(again);
            }),
            &["two images stamped 1700000000123456789"],
        ),
        ("no depth", with(&|m| m.retain(|x| x.0 != DEPTH)), &["holds no depth images", "/camera/color/image_raw (rgb8)"]),
        ("a short message", with(&|m| m.iter_mut().filter(|x| x.0 == DEPTH).for_each(|x| x.3.truncate(99))), &["ends too early"]),
        ("truncated", whole[..whole.len() / 2].to_vec(), &["not a readable MCAP file: it ends in the middle of a record"]),
    ];
    for (name, bytes, words) in cases {
        let bench = Bench::new();
        bench.write("b.mcap", bytes);
        let e = bench.bad("b.mcap", &far());
        assert!(words.iter().all(|w| e.contains(w)), "{name}: {e}");
    }
    let bench = Bench::new();
    let two = with(&|m| {
        let more: Messages = m.iter().filter(|x| x.0 == DEPTH).map(|x| ("/other/depth", x.1, x.2, x.3.clone())).collect();
        m.extend(more);
    });
    bench.write("b.mcap", two);
    let e = bench.bad("b.mcap", &far());
    assert!(e.contains("--pick") && e.contains("/other/depth"), "{e}");
    bench.good("b.mcap", &Options { pick: Some(DEPTH.into()), ..far() });
    let bench = Bench::new();
    bench.write("b/b.db3", "SQLite format 3\0");
    let e = bench.bad("b", &far());
    assert!(e.contains("ros2 bag convert"), "{e}");
}

/// A bag with one chunk of Zstandard, in which a record of one byte says that it has so many.
fn announcing(length: u64) -> Vec<u8> {
    let record = [&[5][..], &length.to_le_bytes(), &[0]].concat();
    // RFC 8878: one frame that states its size, with one block as it is.
    let frame = [&0xFD2F_B528u32.to_le_bytes()[..], &[0x20, record.len() as u8], &[(record.len() << 3) as u8 | 1, 0, 0], &record];
    let records = frame.concat();
    let mut chunk = [0; 16].to_vec();
    chunk.extend((record.len() as u64).to_le_bytes());
    chunk.extend([0; 4]);
    chunk.extend(4u32.to_le_bytes());
    chunk.extend(b"zstd");
    chunk.extend((records.len() as u64).to_le_bytes());
    chunk.extend(records);
    let mut bytes = mcap::MAGIC.to_vec();
    for (code, content) in [(1, vec![0; 8]), (6, chunk), (2, vec![0; 20])] {
        bytes.push(code);
        bytes.extend((content.len() as u64).to_le_bytes());
        bytes.extend(content);
    }
    bytes
}

#[test]
fn no_memory_is_taken_for_what_a_record_only_announces() {
    for length in [1 << 33, 1 << 62, u64::MAX - 4, u64::MAX] {
        let bench = Bench::new();
        bench.write("b.mcap", announcing(length));
        let e = bench.bad("b.mcap", &far());
        assert!(e.contains("not a readable MCAP file") && e.contains("length"), "{length}: {e}");
    }
}

#[test]
fn a_record_that_reaches_beyond_its_chunk_is_refused() {
    let whole = bag(&messages("16UC1"), None);
    let chunk = whole.windows(9).position(|w| w[0] == 6 && w[8] == 0 && w[4..8] == [0; 4]).unwrap();
    // The chunk's head and its first record's code are before the length of that record.
    let length = chunk + 9 + 40 + 1;
    let mut longer = whole.clone();
    longer[length] += 1;
    let bench = Bench::new();
    bench.write("b.mcap", longer);
    let e = bench.bad("b.mcap", &far());
    assert!(e.contains("a record reaches beyond its chunk"), "{e}");
}

#[test]
fn damaged_bags_never_panic() {
    let whole = bag(&messages("png"), Some(Compression::Zstd));
    for k in 0..60 {
        let bench = Bench::new();
        let mut b = whole.clone();
        if k % 2 == 0 {
            b.truncate(b.len() * k / 60);
        } else {
            let at = (k * 104_729) % b.len();
            b[at] ^= 0x55;
            b[(at * 31) % whole.len()] ^= 0xAA;
        }
        bench.write("b.mcap", b);
        let _ = bench.import("b.mcap", &Options { format: Some("ros2-mcap".into()), ..far() });
    }
}

//! C3D files written by hand, whole and damaged.

use super::*;
use crate::read_recording;

/// Word and float of a processor, as bytes.
type Writers = (fn(u16) -> [u8; 2], fn(f32) -> [u8; 4]);

const INTEL: Writers = (u16::to_le_bytes, f32::to_le_bytes);
const MIPS: Writers = (u16::to_be_bytes, f32::to_be_bytes);
/// The VAX's F floating point: exponents count from two more, words are swapped.
const DEC: Writers = (u16::to_le_bytes, |x| {
    let [a, b, c, d] = (4.0 * x).to_le_bytes();
    [c, d, a, b]
});

fn entry(name: &str, group: i8, body: &[u8], word: fn(u16) -> [u8; 2]) -> Vec<u8> {
    let mut out = vec![name.len() as u8, group as u8];
    out.extend(name.as_bytes());
    out.extend(word(body.len() as u16 + 2));
    out.extend(body);
    out
}

/// Two points, three frames, one analog channel where `analog` is 1; the scale's sign tells integers from floats.
fn written(units: &str, scale: f32, analog: u16, (word, real): Writers, processor: u8, data: &[u8]) -> Vec<u8> {
    let mut file = vec![2, 0x50];
    [2, analog, 1, 3, 10].iter().for_each(|w| file.extend(word(*w)));
    file.extend(real(scale));
    file.extend(word(3));
    file.extend(word(analog));
    file.extend(real(50.0));
    file.resize(512, 0);
    // Type −1 is text, 2 integers, 4 floats.
    let parameter = |name: &str, kind: i8, dimensions: &[u8], data: &[u8]| {
        let body = [&[kind as u8, dimensions.len() as u8], dimensions, data, &[0]].concat();
        entry(name, 1, &body, word)
    };
    file.extend([1, 0x50, 1, processor]);
    file.extend(entry("POINT", -1, &[0], word));
    file.extend(parameter("USED", 2, &[], &word(2)));
    file.extend(parameter("SCALE", 4, &[], &real(scale)));
    file.extend(parameter("RATE", 4, &[], &real(50.0)));
    file.extend(parameter("FRAMES", 2, &[], &word(3)));
    file.extend(parameter("UNITS", -1, &[units.len() as u8], units.as_bytes()));
    file.extend(parameter("LABELS", -1, &[4, 2], b"tip base"));
    file.resize(1024, 0);
    file.extend(data);
    file.resize(file.len().next_multiple_of(512), 0);
    file
}

const ROWS: [[f32; 8]; 3] = [
    [100.0, 0.0, 20.0, 0.0, 1.0, 2.0, 3.0, 0.0],
    // Residual word −1: the first point was not seen.
    [0.0, 0.0, 0.0, -1.0, 1.0, 2.0, 4.0, 7.0],
    [110.0, 0.0, 20.0, 0.0, 1.0, 2.0, 5.0, 0.0],
];

fn floats(real: fn(f32) -> [u8; 4]) -> Vec<u8> {
    ROWS.iter().flatten().flat_map(|x| real(*x)).collect()
}

fn file(units: &str) -> Vec<u8> {
    written(units, -0.1, 0, INTEL, 84, &floats(INTEL.1))
}

fn read(bytes: &[u8]) -> Result<(Vec<String>, Vec<MarkerSample>), String> {
    read_c3d(Path::new("m.c3d"), bytes, &mut Vec::new()).map_err(|e| e.to_string())
}

fn check(bytes: &[u8]) {
    let (names, samples) = read(bytes).unwrap();
    assert_eq!(names, ["tip", "base"]);
    assert_eq!(samples.len(), 5, "an unseen point has no sample: {samples:?}");
    assert_eq!((samples[0].time, samples[4].time), (0.0, 0.04));
    assert_eq!((samples[2].marker, samples[3].marker), (1, 0));
    // Single precision in the file.
    assert!((samples[3].position - DVec3::new(0.11, 0.0, 0.02)).length() < 1e-8);
}

#[test]
fn points_come_in_metres_with_times_and_without_unseen_ones() {
    let mut warnings = Vec::new();
    read_c3d(Path::new("m.c3d"), &file("mm"), &mut warnings).unwrap();
    assert!(warnings.is_empty(), "{warnings:?}");
    check(&file("mm"));
    assert_eq!(read(&file("m")).unwrap().1[0].position.x, 100.0);
}

#[test]
fn integers_analog_channels_and_other_processors_are_read() {
    // Counts of half a millimetre, after each frame a word of an analog channel.
    let rows = ROWS.map(|r| std::array::from_fn::<u16, 9, _>(|k| r.get(k).map_or(999, |x| (2.0 * x) as i16 as u16)));
    for ((word, real), processor) in [(INTEL, 84), (DEC, 85), (MIPS, 86)] {
        let data: Vec<u8> = rows.iter().flatten().flat_map(|w| word(*w)).collect();
        check(&written("mm", 0.5, 1, (word, real), processor, &data));
        check(&written("mm", -0.5, 0, (word, real), processor, &floats(real)));
    }
}

#[test]
fn a_recording_may_name_a_c3d_file() {
    let folder = tempfile::tempdir().unwrap();
    let toml = "format = \"recording/1\"\n[markers]\nfile = \"m.c3d\"\nnoise_sigma = 0.001\n\
                [[markers.rest]]\nname = \"tip\"\nposition = [0.1, 0, 0.02]\n";
    std::fs::write(folder.path().join("recording.toml"), toml).unwrap();
    std::fs::write(folder.path().join("m.c3d"), file("mm")).unwrap();
    let m = read_recording(folder.path()).unwrap().markers.unwrap();
    assert_eq!((m.names, m.samples.len(), m.rest.len()), (vec!["tip".to_string(), "base".to_string()], 5, 1));
}

#[test]
fn faults_are_named() {
    let whole = file("mm");
    for (n, wanted) in [
        (0, "it does not begin like one"),
        (100, "100 bytes, its header alone has 512"),
        (512, "its parameters begin at block 2, beyond its end (truncated?)"),
        (700, "its data begin at block 3, beyond its end (truncated?)"),
        (1024, "its data begin at block 3, beyond its end (truncated?)"),
    ] {
        assert_eq!(read(&whole[..n]).unwrap_err(), format!("m.c3d: not a readable C3D file: {wanted}"));
    }
    for (at, byte, wanted) in [
        (0, 0, "its parameters begin at block 0, expected 2 or more"),
        (16, 0, "its data begin at block 0, expected one after block 2"),
        (16, 200, "its data begin at block 200, beyond its end (truncated?)"),
        (515, 80, "its processor is of type 80, expected 84, 85 or 86"),
        (2, 0, "holds no points"),
        (23, 0, "POINT:RATE is 50, its header says"),
    ] {
        let mut bytes = whole.clone();
        bytes[at] = byte;
        let e = read(&bytes).unwrap_err();
        assert!(e.contains(wanted), "{e}");
    }
    assert!(read(&file("ft")).unwrap_err().contains("POINT:UNITS is \"ft\", expected mm, cm or m"));
    // Last frame 200 in the header, three in the file.
    let mut short = whole;
    short[8..10].copy_from_slice(&200u16.to_le_bytes());
    let mut warnings = Vec::new();
    let (_, samples) = read_c3d(Path::new("m.c3d"), &short, &mut warnings).unwrap();
    assert!(samples.len() == 5 && warnings[0].contains("holds 3 frames, its header announces 200"), "{warnings:?}");
}

#[test]
fn no_damage_makes_the_reader_panic() {
    let whole = file("mm");
    let data: Vec<u8> = (0..27u16).flat_map(u16::to_le_bytes).collect();
    let (mut read_all_the_same, mut refused) = (0, 0);
    for file in [whole, written("mm", 0.5, 1, INTEL, 84, &data)] {
        // Every byte of header, parameters and data once with values at the ends of the ranges of words, bytes and signs.
        for at in 0..file.len() {
            for value in [0, 1, 2, 0x50, 0x7f, 0x80, 0xff] {
                let mut bytes = file.clone();
                bytes[at] = value;
                *if read(&bytes).is_ok() { &mut read_all_the_same } else { &mut refused } += 1;
                // The same cut off behind the damage.
                let _ = read(&bytes[..at]);
            }
        }
    }
    assert!(read_all_the_same > 1000 && refused > 100, "{read_all_the_same} read, {refused} refused");
}

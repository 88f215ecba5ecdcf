//! NPY and NPZ files made by hand: every layout that is read, and what is refused.

use super::*;

/// The bytes of an `.npy` file of version 1.0 with this description and data.
pub(crate) fn npy(descr: &str, fortran: bool, shape: &str, data: &[u8]) -> Vec<u8> {
    let order = if fortran { "True" } else { "False" };
    let mut header = format!("{{'descr': '{descr}', 'fortran_order': {order}, 'shape': {shape}, }}");
    while !(header.len() + 11).is_multiple_of(64) {
        header.push(' ');
    }
    header.push('\n');
    let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
    bytes.extend((header.len() as u16).to_le_bytes());
    bytes.extend(header.bytes());
    bytes.extend(data);
    bytes
}

fn read(bytes: &[u8]) -> Result<Array, String> {
    decode(Path::new("a.npy"), "", bytes, false).map_err(|e| e.to_string())
}

#[test]
fn both_precisions_byte_orders_and_orders_of_axes_are_read() {
    let values: Vec<f64> = (0..6).map(f64::from).collect();
    let right = Array { shape: vec![2, 3], values: values.clone() };
    let columns = [0.0, 3.0, 1.0, 4.0, 2.0, 5.0];
    for (fortran, stored) in [(false, &values[..]), (true, &columns[..])] {
        let single = |f: fn(f32) -> [u8; 4]| stored.iter().flat_map(|x| f(*x as f32)).collect::<Vec<u8>>();
        let double = |f: fn(f64) -> [u8; 8]| stored.iter().flat_map(|x| f(*x)).collect::<Vec<u8>>();
        for (descr, data) in [
            ("<f4", single(f32::to_le_bytes)),
            (">f4", single(f32::to_be_bytes)),
            ("<f8", double(f64::to_le_bytes)),
            (">f8", double(f64::to_be_bytes)),
        ] {
            assert_eq!(read(&npy(descr, fortran, "(2, 3)", &data)), Ok(right.clone()), "{descr} {fortran}");
        }
    }
}

#[test]
fn what_is_no_array_of_numbers_is_refused_with_its_reason() {
    let zeros = [0; 64];
    for (bytes, expected) in [
        (npy("<i8", false, "(2, 3)", &zeros), "holds '<i8', expected float32 or float64"),
        (npy("<c16", false, "(4,)", &zeros), "expected float32 or float64"),
        (npy("<f8", false, "(2, 5)", &zeros), "ends before its 10 numbers"),
        (npy("<f8", false, "(99999999999, 99999999999)", &zeros), "has a shape that no array has"),
        (npy("<f8", false, "(0, 99999999999, 99999999999)", &zeros), "has a shape that no array has"),
        (npy("<f8", false, "(99999999999999999999,)", &zeros), "has a shape that no array has"),
        // Of two shapes the last one counts, and its name may be written in other ways.
        (npy("<f8", false, "(8,), 'sh\\x61pe': (3, 6148914691236517206)", &zeros), "has a shape that no array has"),
        (npy("<f8", false, "(8,), \"shape\": (3, 6148914691236517206)", &zeros), "has a shape that no array has"),
        (npy("<f8", false, "(0xFFFFFFFF, 0xFFFFFFFF, 8)", &zeros), "its header is none that NumPy writes"),
        (npy("<f8", false, "(8,), u'a': -1", &zeros), "its header is none that NumPy writes"),
        (npy("<f8", false, &"{".repeat(40), &zeros), "its header is none that NumPy writes"),
        // Brackets that only look closed: they are within a string, or within one that a reader of short strings takes for another.
        (npy("<f8", false, &"{'}',".repeat(40), &zeros), "its header is none that NumPy writes"),
        (npy("<f8", false, &"{'\\'}',".repeat(40), &zeros), "its header is none that NumPy writes"),
        (npy("<f8", false, &"{''''}''',".repeat(40), &zeros), "its header is none that NumPy writes"),
        (b"\x93NUMPY\x01\x00".to_vec(), "is not a readable .npy file"),
        (b"not numpy at all".to_vec(), "is not a readable .npy file"),
    ] {
        let e = read(&bytes).unwrap_err();
        assert!(e.starts_with("a.npy: ") && e.contains(expected), "{e}");
    }
}

#[test]
fn structures_and_objects_are_called_what_they_are() {
    let field = |name: &str| format!("('{name}', '<f4', (100,))");
    let fields: Vec<String> = ["a", "b", "c", "d", "e", "f", "g", "h", "i", "j", "k"].map(field).to_vec();
    let mut header = npy("", false, "(2,)", &[0; 8800]);
    let at = header.windows(2).position(|w| w == b"''").unwrap();
    let descr = format!("[{}]", fields.join(", "));
    header.splice(at..at + 2, descr.bytes());
    let length = u16::from_le_bytes([header[8], header[9]]) + descr.len() as u16 - 2;
    header[8..10].copy_from_slice(&length.to_le_bytes());
    let e = read(&header).unwrap_err();
    assert!(e.contains("holds [('a', '<f4', (100,)),") && e.contains("expected float32"), "{e}");
    assert_eq!(read(&header[..header.len() - 1]).unwrap_err(), "a.npy: ends before its 2 numbers");
    let e = read(&npy("|O", false, "(4,)", b"pickled")).unwrap_err();
    assert!(e.contains("holds '|O', expected float32"), "{e}");
}

#[test]
fn archives_are_read_back_and_name_their_arrays() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.npz");
    let (a, b) = (Array { shape: vec![2, 1], values: vec![1.5, f64::NAN] }, Array { shape: vec![1], values: vec![-3.0] });
    write_npz(&path, &[("points", &a), ("times", &b)]).unwrap();
    let points = read_array(&path, Some("points")).unwrap();
    assert!(points.shape == a.shape && points.values[0] == 1.5 && points.values[1].is_nan());
    assert_eq!(read_array(&path, Some("times")).unwrap(), b);
    let e = read_array(&path, Some("point")).unwrap_err().to_string();
    assert!(e.contains("holds no array \"point\"; did you mean \"points\"?"), "{e}");
    let e = read_array(&path, None).unwrap_err().to_string();
    assert!(e.contains("holds 2 arrays") && e.contains("say which"), "{e}");
    write_npz(&path, &[("only", &b)]).unwrap();
    assert_eq!(read_array(&path, None).unwrap(), b);
    std::fs::write(&path, b"no archive").unwrap();
    assert!(read_array(&path, None).unwrap_err().to_string().contains("is not a readable .npz file"));
}

#[test]
fn archives_that_unfold_beyond_the_memory_are_refused() {
    assert_eq!(unfold(&[7; 1000][..], 1000).unwrap(), [7; 1000]);
    let e = unfold(std::io::repeat(0), 4_000_000).unwrap_err().to_string();
    assert_eq!(e, "an array has more than 4 MB, all that there is room for");
}

//! Files as `torch.save` lays them out, written by hand.

use std::io::Write;
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, ZipWriter};

/// What a dictionary holds.
pub enum Entry {
    /// A tensor of 64-bit whole numbers.
    Longs(Vec<i64>),
    /// A tensor of truth values.
    Bools(Vec<bool>),
    /// A tensor of single precision: every second number of its storage.
    Halved(Vec<f32>),
    /// A list of small whole numbers.
    List(Vec<u8>),
    /// Anything, as the opcodes that make it.
    Raw(Vec<u8>),
}

fn text(s: &str) -> Vec<u8> {
    [&b"X"[..], &(s.len() as u32).to_le_bytes(), s.as_bytes()].concat()
}

fn whole(x: usize) -> Vec<u8> {
    [&b"J"[..], &(x as u32).to_le_bytes()].concat()
}

/// The opcodes of a tensor of one axis over a storage of so many numbers.
fn tensor(kind: &str, key: usize, count: usize, length: usize, stride: usize) -> Vec<u8> {
    let mut p = b"ctorch._utils\n_rebuild_tensor_v2\n((".to_vec();
    p.extend(text("storage"));
    p.extend(format!("ctorch\n{kind}\n").bytes());
    p.extend(text(&key.to_string()));
    p.extend(text("cpu"));
    p.extend(whole(count));
    // The storage's tuple, by a persistent id; offset; length and stride as tuples of one; no gradient; no hooks; all of it, called.
    p.extend(b"tQK\x00");
    p.extend(whole(length));
    p.extend(b"\x85");
    p.extend(whole(stride));
    p.extend(b"\x85\x89ccollections\nOrderedDict\n)RtR");
    p
}

/// A file that holds a dictionary.
pub fn file(entries: &[(&str, Entry)], method: CompressionMethod) -> Vec<u8> {
    let (mut pickle, mut storages) = (b"\x80\x02}q\x00(".to_vec(), Vec::new());
    for (name, entry) in entries {
        pickle.extend(text(name));
        let key = storages.len();
        let (opcodes, bytes): (Vec<u8>, Vec<u8>) = match entry {
            Entry::Longs(v) => {
                (tensor("LongStorage", key, v.len(), v.len(), 1), v.iter().flat_map(|x| x.to_le_bytes()).collect())
            }
            Entry::Bools(v) => (tensor("BoolStorage", key, v.len(), v.len(), 1), v.iter().map(|x| u8::from(*x)).collect()),
            Entry::Halved(v) => {
                (tensor("FloatStorage", key, v.len(), v.len().div_ceil(2), 2), v.iter().flat_map(|x| x.to_le_bytes()).collect())
            }
            Entry::List(v) => ([&b"]("[..], &v.iter().flat_map(|x| [b'K', *x]).collect::<Vec<_>>(), b"e"].concat(), Vec::new()),
            Entry::Raw(v) => (v.clone(), Vec::new()),
        };
        pickle.extend(opcodes);
        storages.push(bytes);
    }
    pickle.extend(b"u.");
    let mut zip = ZipWriter::new(std::io::Cursor::new(Vec::new()));
    let mut put = |name: String, bytes: &[u8]| {
        zip.start_file(name, SimpleFileOptions::default().compression_method(method)).unwrap();
        zip.write_all(bytes).unwrap();
    };
    put("archive/data.pkl".into(), &pickle);
    put("archive/byteorder".into(), b"little");
    for (key, bytes) in storages.iter().enumerate() {
        put(format!("archive/data/{key}"), bytes);
    }
    put("archive/version".into(), b"3\n");
    zip.finish().unwrap().into_inner()
}

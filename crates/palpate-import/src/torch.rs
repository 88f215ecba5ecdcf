//! Files of PyTorch (`torch.save`): an archive with a pickle that describes tensors, and their numbers beside it.
//!
//! Crates that read them bring a whole framework along; a table of indices needs the layout alone (`torch/serialization.py`): `NAME/data.pkl`,
//! one entry `NAME/data/KEY` for each storage, and `NAME/byteorder`.

use crate::arrays::{Array, Numbers};
use crate::error::{ImportError, read, refuse};
use crate::pickle::{At, Pickle, Value};
use std::io::{Cursor, Read};
use std::path::Path;
use zip::{CompressionMethod, ZipArchive};

/// Longest pickle that is read [B]: it describes tensors and does not hold them.
const PICKLE: u64 = 256 << 20;

/// Numbers and letters of all entries together, over bytes of the file and beside them: what many entries share would fill any memory.
const SHARED: (usize, usize) = (4, 1 << 20);

/// The entries of a dictionary by their names: tensors, numbers and lists of numbers as arrays; of others, what they are.
pub type Entries = Vec<(String, Result<Array, String>)>;

type Archive = ZipArchive<Cursor<Vec<u8>>>;

/// Reads a file that holds a dictionary of tensors.
pub fn read_torch(path: &Path) -> Result<Entries, ImportError> {
    let bytes = read(path)?;
    if !bytes.starts_with(b"PK") {
        let old = bytes.starts_with(b"\x80\x02\x8a\x0al\xfc\x9cF\xf9 j\xa8P\x19.");
        let what = if old { "is of PyTorch before 1.6; load it and save it again" } else { "is no file of torch.save" };
        return refuse(path, what);
    }
    let mut left = bytes.len().saturating_mul(SHARED.0).saturating_add(SHARED.1);
    let wrong = |e: String| refuse(path, e);
    let mut archive = match ZipArchive::new(Cursor::new(bytes)) {
        Ok(a) => a,
        Err(e) => return wrong(format!("is not a readable file of torch.save: {e}")),
    };
    let names: Vec<String> = archive.file_names().filter_map(|n| n.ok().map(|n| n.to_string())).collect();
    let Some(head) = names.iter().find_map(|n| n.strip_suffix("data.pkl")).map(str::to_string) else {
        return refuse(path, "is no file of torch.save: there is no data.pkl in it");
    };
    let order = entry(&mut archive, &format!("{head}byteorder"), 16).unwrap_or_else(|_| b"little".to_vec());
    if order != b"little" {
        return refuse(path, "holds numbers with the highest byte first, which is not read");
    }
    let described = entry(&mut archive, &format!("{head}data.pkl"), PICKLE).and_then(|b| Pickle::read(&b));
    let pickle = match described {
        Ok(p) => p,
        Err(e) => return wrong(e),
    };
    let Value::Dict(all) = pickle.top() else {
        return refuse(path, format!("holds {}, expected a dictionary of tensors", pickle.top().kind()));
    };
    let mut reader = Reader { archive: &mut archive, head, pickle: &pickle };
    let mut out = Entries::new();
    for (key, value) in all {
        if let Value::Text(name) = pickle.at(*key) {
            let array = reader.array(*value).map(|(shape, numbers)| Array { name: name.clone(), shape, numbers });
            let size = array.as_ref().map_or_else(String::len, |a| a.shape.iter().product());
            let Some(rest) = left.checked_sub(name.len().saturating_add(size)) else {
                return refuse(path, "has entries that share so much that they fill the memory");
            };
            left = rest;
            out.push((name.clone(), array));
        }
    }
    Ok(out)
}

/// The bytes of an entry, at most so many.
fn entry(archive: &mut Archive, name: &str, most: u64) -> Result<Vec<u8>, String> {
    let file = archive.by_name(name).map_err(|e| format!("{name} cannot be read: {e}"))?;
    // An archive that announces more than it holds would unfold without end.
    if file.compression() != CompressionMethod::Stored {
        return Err(format!("{name} is compressed, which torch.save does not do"));
    }
    let mut content = Vec::new();
    file.take(most.saturating_add(1)).read_to_end(&mut content).map_err(|e| format!("{name} cannot be read: {e}"))?;
    match content.len() as u64 > most {
        true => Err(format!("{name} is longer than the {most} bytes that it may have")),
        false => Ok(content),
    }
}

/// How the numbers of a storage are written: the class that PyTorch names, bytes of one, and how they are read.
type Kind = (&'static str, usize, fn(&[u8]) -> Numbers);

const KINDS: [Kind; 8] = [
    ("torch.FloatStorage", 4, |b| Numbers::Real(each(b, f32::from_le_bytes).map(f64::from).collect())),
    ("torch.DoubleStorage", 8, |b| Numbers::Real(each(b, f64::from_le_bytes).collect())),
    ("torch.LongStorage", 8, |b| Numbers::Whole(each(b, i64::from_le_bytes).collect())),
    ("torch.IntStorage", 4, |b| Numbers::Whole(each(b, i32::from_le_bytes).map(i64::from).collect())),
    ("torch.ShortStorage", 2, |b| Numbers::Whole(each(b, i16::from_le_bytes).map(i64::from).collect())),
    ("torch.CharStorage", 1, |b| Numbers::Whole(each(b, i8::from_le_bytes).map(i64::from).collect())),
    ("torch.ByteStorage", 1, |b| Numbers::Whole(b.iter().map(|x| i64::from(*x)).collect())),
    ("torch.BoolStorage", 1, |b| Numbers::Whole(b.iter().map(|x| i64::from(*x != 0)).collect())),
];

fn each<const N: usize, T>(bytes: &[u8], of: fn([u8; N]) -> T) -> impl Iterator<Item = T> {
    bytes.as_chunks::<N>().0.iter().map(move |b| of(*b))
}

struct Reader<'a> {
    archive: &'a mut Archive,
    head: String,
    pickle: &'a Pickle,
}

impl Reader<'_> {
    /// A value as shape and numbers.
    fn array(&mut self, mut at: At) -> Result<(Vec<usize>, Numbers), String> {
        let p = self.pickle;
        // A parameter of a network is a tensor with a wrapping around it.
        if let Value::Call { name, arguments } = p.at(at)
            && *p.at(*name) == Value::Name("torch._utils._rebuild_parameter".into())
            && let Some([tensor, ..]) = p.list(*arguments)
        {
            at = *tensor;
        }
        match p.at(at) {
            Value::Whole(x) => Ok((vec![1], Numbers::Whole(vec![*x]))),
            Value::Real(x) => Ok((vec![1], Numbers::Real(vec![*x]))),
            Value::List(all) => {
                let whole = |v: &At| match p.at(*v) {
                    Value::Whole(x) => Some(*x),
                    Value::Bool(x) => Some(i64::from(*x)),
                    _ => None,
                };
                let numbers: Option<Vec<i64>> = all.iter().map(whole).collect();
                let numbers = numbers.ok_or("is a list of other things than whole numbers")?;
                Ok((vec![numbers.len()], Numbers::Whole(numbers)))
            }
            Value::Call { name, arguments } => {
                let (Value::Name(name), Some(arguments)) = (p.at(*name), p.list(*arguments)) else {
                    return Err("is no tensor".into());
                };
                match (name.as_str(), arguments) {
                    ("torch._utils._rebuild_tensor_v2", [storage, offset, size, stride, ..]) => {
                        self.tensor(*storage, [*offset, *size, *stride])
                    }
                    (other, _) => Err(format!("is made by {other}, which is not read; save tensors or lists of whole numbers")),
                }
            }
            other => Err(format!("is {}", other.kind())),
        }
    }

    /// A tensor: its storage, where in it the tensor begins, lengths and strides along its axes.
    fn tensor(&mut self, storage: At, [offset, size, stride]: [At; 3]) -> Result<(Vec<usize>, Numbers), String> {
        let p = self.pickle;
        let whole = |at: At| match p.at(at) {
            Value::Whole(x) => usize::try_from(*x).map_err(|_| format!("has a negative length or stride, {x}")),
            other => Err(format!("has {} for a length or stride", other.kind())),
        };
        let numbers =
            |at: At| p.list(at).ok_or("has no list of lengths")?.iter().map(|x| whole(*x)).collect::<Result<Vec<_>, String>>();
        let (offset, size, stride) = (whole(offset)?, numbers(size)?, numbers(stride)?);
        let Value::Elsewhere(by) = p.at(storage) else { return Err("has no storage".into()) };
        let Some([_, kind, key, _, count, ..]) = p.list(*by) else {
            return Err("has a storage that is described in another way".into());
        };
        let (Value::Name(kind), Value::Text(key)) = (p.at(*kind), p.at(*key)) else {
            return Err("has a storage without kind or name".into());
        };
        let (_, width, read) = KINDS.iter().find(|k| k.0 == kind).ok_or_else(|| {
            let known: Vec<&str> = KINDS.iter().map(|k| k.0).collect();
            format!("is a {kind}, which is not read; allowed: {}", known.join(", "))
        })?;
        let count = whole(*count)?;
        if size.len() != stride.len() {
            return Err("has other strides than axes".into());
        }
        // As many numbers at most as the storage has: a stride of 0 would announce any number of them.
        let len = size.iter().try_fold(1usize, |n, s| n.checked_mul(*s)).filter(|n| *n <= count);
        let len = len.ok_or_else(|| format!("has shape {size:?}, more than the {count} numbers of its storage"))?;
        let reach = size.iter().zip(&stride).try_fold(offset, |at, (n, s)| at.checked_add(n.saturating_sub(1).checked_mul(*s)?));
        if len > 0 && reach.is_none_or(|r| r >= count) {
            return Err(format!("reaches beyond the {count} numbers of its storage"));
        }
        let bytes = count.checked_mul(*width).ok_or("has a storage that is too long")?;
        let content = entry(self.archive, &format!("{}data/{key}", self.head), bytes as u64)?;
        if content.len() != bytes {
            return Err(format!("has a storage of {} bytes, expected {bytes}", content.len()));
        }
        let place = |k: usize| {
            let (mut k, mut at) = (k, offset);
            for (n, s) in size.iter().zip(&stride).rev() {
                at += k % n * s;
                k /= n;
            }
            at
        };
        let numbers = match read(&content) {
            Numbers::Whole(all) => Numbers::Whole((0..len).map(|k| all[place(k)]).collect()),
            Numbers::Real(all) => Numbers::Real((0..len).map(|k| all[place(k)]).collect()),
            Numbers::Counts(all) => Numbers::Counts((0..len).map(|k| all[place(k)]).collect()),
        };
        Ok((size, numbers))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Write;

    /// A storage of half a million truth values, and so many entries with all of it.
    fn shared(entries: usize) -> Result<Entries, ImportError> {
        const COUNT: usize = 500_000;
        let mut pickle = b"\x80\x02}(X\x01\x00\x00\x00actorch._utils\n_rebuild_tensor_v2\n((".to_vec();
        pickle.extend(b"X\x01\x00\x00\x00sctorch\nBoolStorage\nX\x01\x00\x00\x000X\x03\x00\x00\x00cpuJ");
        pickle.extend((COUNT as u32).to_le_bytes());
        pickle.extend(b"tQK\x00J");
        pickle.extend((COUNT as u32).to_le_bytes());
        pickle.extend(b"\x85K\x01\x85\x89NtRq\x00");
        (1..entries).for_each(|_| pickle.extend(b"X\x01\x00\x00\x00bh\x00"));
        pickle.extend(b"u.");
        let path = std::env::temp_dir().join(format!("palpate-torch-{entries}-{}", std::process::id()));
        let mut archive = zip::ZipWriter::new(std::fs::File::create(&path).unwrap());
        for (name, content) in [("a/data.pkl", pickle), ("a/data/0", vec![1; COUNT])] {
            let stored = zip::write::SimpleFileOptions::default().compression_method(CompressionMethod::Stored);
            archive.start_file(name, stored).unwrap();
            archive.write_all(&content).unwrap();
        }
        archive.finish().unwrap();
        let found = read_torch(&path);
        std::fs::remove_file(&path).unwrap();
        found
    }

    #[test]
    fn entries_share_numbers_until_they_would_fill_the_memory() {
        let few = shared(3).unwrap();
        assert!(few.len() == 3 && few.iter().all(|e| e.1.as_ref().is_ok_and(|a| a.shape == [500_000])));
        assert!(shared(20).unwrap_err().to_string().contains("share so much"));
    }
}

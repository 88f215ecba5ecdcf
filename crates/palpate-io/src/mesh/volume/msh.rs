//! Gmsh's MSH files (manual, section "MSH file format"): what versions 2 and 4.1 have in common.

use super::bytes::{Bytes, Coding, Fault};
use super::{Raw, msh2, msh4};
use std::collections::{BTreeMap, HashMap};

/// What a reader of either version carries along.
#[derive(Default)]
pub(super) struct Msh {
    pub raw: Raw,
    /// Place of a node in the mesh by its tag.
    number: HashMap<u64, u32>,
    /// Names of physical groups by dimension and tag.
    names: BTreeMap<(i64, i64), String>,
    /// Physical groups of geometric entities by dimension and tag (version 4.1).
    pub entities: HashMap<(i64, i64), Vec<i64>>,
    /// Bytes of a size in binary files.
    pub width: usize,
    /// Sections that were there.
    pub seen: [bool; 2],
}

impl Msh {
    /// Takes a node with its tag.
    pub fn node(&mut self, tag: u64, place: [f64; 3]) {
        self.number.insert(tag, self.raw.nodes.len() as u32);
        self.raw.nodes.push(place.into());
    }

    /// Number of a node in the mesh.
    pub fn find(&self, tag: u64, file: &Bytes) -> Result<u32, Fault> {
        self.number.get(&tag).copied().ok_or_else(|| file.fault(format!("names node {tag}, which it does not hold")))
    }

    /// Name of a physical group; one without a name is called by its dimension and tag.
    pub fn group(&self, dimension: i64, tag: i64) -> String {
        let kind = ["point", "curve", "surface", "volume"].get(dimension as usize).unwrap_or(&"physical");
        self.names.get(&(dimension, tag)).cloned().unwrap_or_else(|| format!("{kind}-{tag}"))
    }
}

/// Reads a file of version 2 or 4.1, as text or binary of either byte order.
pub(super) fn read(bytes: &[u8]) -> Result<Raw, Fault> {
    let mut file = Bytes::new(bytes);
    if file.full_line() != Some("$MeshFormat") {
        return Err("is no Gmsh file: it must begin with $MeshFormat".into());
    }
    let head: Vec<&str> = file.line().unwrap_or_default().split_whitespace().collect();
    let [version, binary, width] = head[..] else {
        return Err(file.fault("$MeshFormat must say version, file type and size of numbers, as in \"4.1 0 8\""));
    };
    let old = matches!(version, "2" | "2.0" | "2.1" | "2.2");
    if !old && version != "4.1" {
        return Err(format!("is of MSH version {version}; 2.2 and 4.1 are read: gmsh FILE -save -format msh41 -o NEW.msh").into());
    }
    let width = match width {
        "4" if !old => 4,
        "8" => 8,
        other => return Err(file.fault(format!("numbers of {other} bytes are not read; 8 are"))),
    };
    let coding = match binary {
        "0" => Coding::Text,
        "1" => match file.take(4)? {
            [1, 0, 0, 0] => Coding::LittleEndian,
            [0, 0, 0, 1] => Coding::BigEndian,
            _ => return Err("is damaged: the number that tells its byte order is not 1".into()),
        },
        other => return Err(file.fault(format!("file type {other} is not known; 0 is text, 1 is binary"))),
    };
    end(&mut file, "MeshFormat")?;
    let mut msh = Msh { width, ..Msh::default() };
    while let Some(line) = file.full_line() {
        let Some(section) = line.strip_prefix('$') else {
            return Err(file.fault("is damaged: a section must begin here ($Nodes, $Elements, …)"));
        };
        file.coding = coding;
        match section {
            "PhysicalNames" => names(&mut file, &mut msh)?,
            "Entities" if !old => msh4::entities(&mut file, &mut msh)?,
            "PartitionedEntities" => return Err("is partitioned; save it as one mesh (gmsh FILE -save -part 1)".into()),
            "Nodes" if old => msh2::nodes(&mut file, &mut msh)?,
            "Nodes" => msh4::nodes(&mut file, &mut msh)?,
            "Elements" if old => msh2::elements(&mut file, &mut msh)?,
            "Elements" => msh4::elements(&mut file, &mut msh)?,
            other => {
                file.coding = Coding::Text;
                if !file.skip_past(format!("$End{other}").as_bytes()) {
                    return Err(file.fault(format!("ends within ${other}: the file is cut short")));
                }
                continue;
            }
        }
        end(&mut file, section)?;
    }
    match msh.seen {
        _ if file.left() > 0 => Err("is damaged: it goes on with bytes that are no text where a section must begin".into()),
        [true, true] => Ok(msh.raw),
        [false, _] => Err("holds no nodes".into()),
        [true, false] => Err("holds no elements".into()),
    }
}

/// The end of a section; sections begin as text.
fn end(file: &mut Bytes, section: &str) -> Result<(), Fault> {
    file.coding = Coding::Text;
    match file.word() {
        Some(word) if word.strip_prefix("$End") == Some(section) => Ok(()),
        Some(_) => Err(file.fault(format!("${section} must end here with $End{section}"))),
        None => Err(file.fault(format!("ends within ${section}: the file is cut short"))),
    }
}

/// `dimension tag "name"`, as text in binary files too.
fn names(file: &mut Bytes, msh: &mut Msh) -> Result<(), Fault> {
    file.coding = Coding::Text;
    let count = file.text()?;
    let count = file.room(count, 6, "names of physical groups")?;
    for _ in 0..count {
        let (dimension, tag) = (file.text()?, file.text()?);
        let line = file.line().unwrap_or_default();
        let name = line.strip_prefix('"').and_then(|l| l.strip_suffix('"'));
        let name = name.ok_or_else(|| file.fault("a physical group is named by a dimension, a tag and a \"name\""))?;
        msh.names.insert((dimension, tag), name.to_string());
    }
    Ok(())
}

//! Nodes and elements of MSH 2: a list of each, with physical groups beside every element.

use super::bytes::{Bytes, Coding, Fault};
use super::kinds::{self, Kind};
use super::msh::Msh;

/// The count of a section, which is text in binary files too.
fn count(file: &mut Bytes, each: [usize; 2], things: &str) -> Result<usize, Fault> {
    let coding = file.coding;
    file.coding = Coding::Text;
    let announced = file.text()?;
    // Binary numbers begin after the end of the line.
    let mark = file.mark();
    let rest = file.line().unwrap_or_default();
    if coding == Coding::Text {
        file.back_to(mark);
    } else if !rest.is_empty() {
        return Err(file.fault(format!("the number of {things} must stand alone in its line")));
    }
    file.coding = coding;
    file.room(announced, each[usize::from(coding != Coding::Text)], things)
}

/// `tag x y z` of every node.
pub(super) fn nodes(file: &mut Bytes, msh: &mut Msh) -> Result<(), Fault> {
    for _ in 0..count(file, [8, 28], "nodes")? {
        let tag = file.int()?;
        let place = [file.real()?, file.real()?, file.real()?];
        let tag = u64::try_from(tag).map_err(|_| file.fault(format!("node {tag}: tags are ≥ 0")))?;
        msh.node(tag, place);
    }
    msh.seen[0] = true;
    Ok(())
}

/// `tag type tags… nodes…` of every element; in binary files elements of one type follow a head with type, number and number of tags.
pub(super) fn elements(file: &mut Bytes, msh: &mut Msh) -> Result<(), Fault> {
    let mut left = count(file, [8, 8], "elements")?;
    while left > 0 {
        let text = file.coding == Coding::Text;
        let (mut of, mut follow, mut tags) = (0, 1, 0);
        if !text {
            (of, follow, tags) = (file.int()?, file.int()?, file.int()?);
        }
        let follow = usize::try_from(follow).ok().filter(|n| (1..=left).contains(n));
        let follow = follow.ok_or_else(|| file.fault("a block of elements is longer than all elements, or has none"))?;
        for _ in 0..follow {
            file.int()?;
            if text {
                (of, tags) = (file.int()?, file.int()?);
            }
            element(file, msh, of, tags)?;
        }
        left -= follow;
    }
    msh.seen[1] = true;
    Ok(())
}

/// Tags and nodes of an element of a type.
fn element(file: &mut Bytes, msh: &mut Msh, of: i64, tags: i64) -> Result<(), Fault> {
    let (kind, count) = kinds::gmsh(of).ok_or_else(|| file.fault(format!("elements of type {of} are not known")))?;
    let mut physical = 0;
    // Physical group, geometric entity, partitions.
    for k in 0..tags {
        let tag = file.int()?;
        physical = if k == 0 { tag } else { physical };
    }
    let mut nodes = [0; kinds::MOST_NODES];
    for n in &mut nodes[..count] {
        let tag = file.int()?;
        *n = msh.find(tag as u64, file)?;
    }
    let groups = if physical == 0 { Vec::new() } else { vec![msh.group(dimension(of, kind), physical)] };
    msh.raw.element(kind, &nodes[..count], &groups);
    Ok(())
}

/// Dimension of a type of elements.
fn dimension(of: i64, kind: Kind) -> i64 {
    match (kind, of) {
        (Kind::Part, 15) => 0,
        (Kind::Part, 1 | 8 | 26..=28) => 1,
        (Kind::Part, _) => 2,
        _ => 3,
    }
}

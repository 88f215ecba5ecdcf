//! Entities, nodes and elements of MSH 4.1: blocks by geometric entity, which know their physical groups.

use super::bytes::{Bytes, Fault};
use super::kinds;
use super::msh::Msh;

/// Physical groups of points, curves, surfaces and volumes.
pub(super) fn entities(file: &mut Bytes, msh: &mut Msh) -> Result<(), Fault> {
    let width = msh.width;
    let counts = [file.size(width)?, file.size(width)?, file.size(width)?, file.size(width)?];
    for (dimension, announced) in (0..).zip(counts) {
        for _ in 0..file.room(announced, 5 * file.width(4), "geometric entities")? {
            let tag = file.int()?;
            // The box around it; of a point its place.
            for _ in 0..if dimension == 0 { 3 } else { 6 } {
                file.real()?;
            }
            let announced = file.size(width)?;
            let physical = file.room(announced, file.width(4), "physical groups")?;
            // A negative tag is the group of the entity turned round.
            let groups = (0..physical).map(|_| Ok(file.int()?.abs())).collect::<Result<Vec<i64>, Fault>>()?;
            msh.entities.insert((dimension, tag), groups);
            if dimension > 0 {
                let announced = file.size(width)?;
                for _ in 0..file.room(announced, file.width(4), "bounding entities")? {
                    file.int()?;
                }
            }
        }
    }
    Ok(())
}

/// Blocks of nodes: first all tags, then all places.
pub(super) fn nodes(file: &mut Bytes, msh: &mut Msh) -> Result<(), Fault> {
    let width = msh.width;
    let (blocks, all) = (file.size(width)?, file.size(width)?);
    file.size(width)?;
    file.size(width)?;
    file.room(all, 4 * file.width(6), "nodes")?;
    let least = 3 * file.width(4) + file.width(width);
    for _ in 0..file.room(blocks, least, "blocks of nodes")? {
        let dimension = file.int()?;
        file.int()?;
        let parametric = file.int()?;
        let announced = file.size(width)?;
        let count = file.room(announced, file.width(width) + 3 * file.width(8), "nodes in a block")?;
        let tags = (0..count).map(|_| file.size(width)).collect::<Result<Vec<u64>, Fault>>()?;
        for tag in tags {
            let place = [file.real()?, file.real()?, file.real()?];
            for _ in 0..if parametric != 0 { dimension } else { 0 } {
                file.real()?;
            }
            msh.node(tag, place);
        }
    }
    msh.seen[0] = true;
    Ok(())
}

/// Blocks of elements of one type on one entity.
pub(super) fn elements(file: &mut Bytes, msh: &mut Msh) -> Result<(), Fault> {
    let width = msh.width;
    let (blocks, all) = (file.size(width)?, file.size(width)?);
    file.size(width)?;
    file.size(width)?;
    file.room(all, 2 * file.width(width), "elements")?;
    let least = 3 * file.width(4) + file.width(width);
    let mut nodes = Vec::new();
    for _ in 0..file.room(blocks, least, "blocks of elements")? {
        let (dimension, entity, of) = (file.int()?, file.int()?, file.int()?);
        let (kind, size) = kinds::gmsh(of).ok_or_else(|| file.fault(format!("elements of type {of} are not known")))?;
        let groups = msh.entities.get(&(dimension, entity)).cloned().unwrap_or_default();
        let groups: Vec<String> = groups.into_iter().map(|tag| msh.group(dimension, tag)).collect();
        let announced = file.size(width)?;
        for _ in 0..file.room(announced, (1 + size) * file.width(width), "elements in a block")? {
            file.size(width)?;
            nodes.clear();
            for _ in 0..size {
                let tag = file.size(width)?;
                nodes.push(msh.find(tag, file)?);
            }
            msh.raw.element(kind, &nodes, &groups);
        }
    }
    msh.seen[1] = true;
    Ok(())
}

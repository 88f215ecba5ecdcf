//! Tables of one kind in one buffer: `tables.rs`, beside the build script, says how kernels read them.

use super::buffers::Maker;
use super::error::GpuError;
use super::pipelines::ARENAS;
use std::collections::HashMap;

/// Words after the last table. Where an empty table starts there is room for one element of the largest struct.
const SPARE: usize = 64;
/// At the head, in place of the start of a table that is not there.
const MISSING: u32 = u32::MAX;

/// An arena in the making.
pub(crate) struct Arena {
    buffer: &'static str,
    tables: &'static [&'static str],
    /// Starts of the tables in words, then the tables.
    words: Vec<u32>,
}

impl Arena {
    /// An empty one, for the buffer of this name.
    pub(crate) fn new(buffer: &str) -> Arena {
        let (buffer, tables) = *ARENAS.iter().find(|a| a.0 == buffer).expect("kernels know the arena");
        Arena { buffer, tables, words: vec![MISSING; tables.len()] }
    }

    /// Adds a table.
    pub(crate) fn put<T: bytemuck::NoUninit>(&mut self, table: &str, data: &[T]) {
        let place = self.tables.iter().position(|t| *t == table).expect("kernels know the table");
        self.words[place] = self.words.len() as u32;
        self.words.extend(bytemuck::pod_collect_to_vec::<u8, u32>(bytemuck::cast_slice(data)));
    }

    /// Makes the buffer.
    ///
    /// # Errors
    /// More than the device has.
    pub(crate) fn upload<M: Maker>(mut self, gpu: &M, to: &mut HashMap<&'static str, M::Buffer>) -> Result<(), GpuError> {
        let end = self.words.len() as u32;
        self.words[..self.tables.len()].iter_mut().filter(|start| **start == MISSING).for_each(|start| *start = end);
        self.words.extend([0; SPARE]);
        to.insert(self.buffer, gpu.upload(self.buffer, &self.words)?);
        Ok(())
    }

    /// Bytes of an arena whose tables take so many.
    pub(crate) fn bytes(buffer: &str, tables: u64) -> u64 {
        4 * (Arena::new(buffer).tables.len() + SPARE) as u64 + tables
    }
}

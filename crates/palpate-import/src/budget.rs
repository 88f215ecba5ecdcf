//! Memory that a source of many files may take: each of them is small, and all of them may be larger than the machine.

use crate::error::{ImportError, refuse};
use palpate_io::{Room, available, gigabytes};
use std::path::Path;

/// What was left when reading began, and what has been taken since.
pub struct Budget {
    room: Option<Room>,
    taken: u64,
}

impl Budget {
    /// Begins to count.
    pub fn new() -> Budget {
        Budget { room: available(), taken: 0 }
    }

    /// Counts so many values of a source.
    ///
    /// # Errors
    /// All values so far take more than there was.
    pub fn take<T>(&mut self, source: &Path, values: &[T]) -> Result<(), ImportError> {
        self.taken += size_of_val(values) as u64;
        match self.room.filter(|r| r.bytes < self.taken) {
            Some(room) => {
                let text = format!("takes more than {} once it is read, and {room}; name a part of it", gigabytes(self.taken));
                refuse(source, text)
            }
            None => Ok(()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_does_not_fit_is_refused_before_all_is_read() {
        let mut budget =
            Budget { room: Some(Room { bytes: 3_000_000, by: "free on this machine", addresses: false, reserved: 0 }), taken: 0 };
        let image = [0u16; 500_000];
        (0..3).for_each(|_| budget.take(Path::new("bag"), &image).unwrap());
        let e = budget.take(Path::new("bag"), &image).unwrap_err().to_string();
        let said = "takes more than 4 MB once it is read, and 3 MB of memory are left (free on this machine); name a part of it";
        assert_eq!(e, format!("bag: {said}"));
    }
}

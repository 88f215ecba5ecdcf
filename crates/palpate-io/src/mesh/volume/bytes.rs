//! A file of text, binary numbers or both, read from front to back; what is announced is checked against what is left.

use std::str::FromStr;

/// What is wrong with a file, and in which line where it has lines.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Fault {
    pub line: Option<usize>,
    pub message: String,
}

impl From<String> for Fault {
    fn from(message: String) -> Fault {
        Fault { line: None, message }
    }
}

impl From<&str> for Fault {
    fn from(message: &str) -> Fault {
        message.to_string().into()
    }
}

/// How numbers stand in a file.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Coding {
    Text,
    LittleEndian,
    BigEndian,
}

/// A place in a file.
pub(super) struct Bytes<'a> {
    all: &'a [u8],
    at: usize,
    pub coding: Coding,
}

impl<'a> Bytes<'a> {
    pub fn new(all: &'a [u8]) -> Bytes<'a> {
        Bytes { all, at: 0, coding: Coding::Text }
    }

    /// Bytes that are left.
    pub fn left(&self) -> usize {
        self.all.len() - self.at
    }

    /// An error here: with its line where numbers are text.
    pub fn fault(&self, message: impl Into<String>) -> Fault {
        // That of the last byte that was read.
        let line = 1 + self.all[..self.at.saturating_sub(1)].iter().filter(|b| **b == b'\n').count();
        Fault { line: (self.coding == Coding::Text).then_some(line), message: message.into() }
    }

    /// A number of things of at least `each` bytes that something announces, as far as the file can hold them.
    ///
    /// # Errors
    /// It cannot.
    pub fn room(&self, announced: u64, each: usize, things: &str) -> Result<usize, Fault> {
        let each = each.max(1) as u64;
        match announced.checked_mul(each) {
            Some(bytes) if bytes <= self.left() as u64 => Ok(announced as usize),
            _ => Err(self.fault(format!(
                "announces {announced} {things}, and only {} bytes follow: the file is cut short or damaged",
                self.left()
            ))),
        }
    }

    /// Fewest bytes of a whole number of so many bytes: one digit and a space in text.
    pub fn width(&self, binary: usize) -> usize {
        if self.coding == Coding::Text { 2 } else { binary }
    }

    /// The next word of the text.
    pub fn word(&mut self) -> Option<&'a str> {
        let rest = &self.all[self.at..];
        let start = rest.iter().position(|b| !b.is_ascii_whitespace())?;
        let length = rest[start..].iter().position(u8::is_ascii_whitespace).unwrap_or(rest.len() - start);
        let word = std::str::from_utf8(&rest[start..start + length]).ok()?;
        self.at += start + length;
        Some(word)
    }

    /// What is left of the line, without spaces around it; `None` at the end, and where it is no text.
    pub fn line(&mut self) -> Option<&'a str> {
        let rest = &self.all[self.at..];
        if rest.is_empty() {
            return None;
        }
        let length = rest.iter().position(|b| *b == b'\n').unwrap_or(rest.len());
        let line = std::str::from_utf8(&rest[..length]).ok()?;
        self.at = (self.at + length + 1).min(self.all.len());
        Some(line.trim())
    }

    /// The next line that is not empty.
    pub fn full_line(&mut self) -> Option<&'a str> {
        loop {
            match self.line()? {
                "" => {}
                line => return Some(line),
            }
        }
    }

    /// Passes over everything up to and with a mark; false where it is not there.
    pub fn skip_past(&mut self, mark: &[u8]) -> bool {
        match self.all[self.at..].windows(mark.len()).position(|w| w == mark) {
            Some(n) => {
                self.at += n + mark.len();
                true
            }
            None => false,
        }
    }

    /// Where this place is, to come back to.
    pub fn mark(&self) -> usize {
        self.at
    }

    /// Goes back.
    pub fn back_to(&mut self, mark: usize) {
        self.at = mark;
    }

    /// The next `n` bytes.
    pub fn take(&mut self, n: usize) -> Result<&'a [u8], Fault> {
        let part = self.all.get(self.at..self.at.saturating_add(n)).ok_or_else(|| self.ended())?;
        self.at += n;
        Ok(part)
    }

    fn ended(&self) -> Fault {
        self.fault("ends where numbers must follow: the file is cut short")
    }

    /// A number as a word.
    pub fn text<T: FromStr>(&mut self) -> Result<T, Fault> {
        let mark = self.at;
        let word = match self.word() {
            Some(word) => word,
            None if self.all[mark..].iter().all(u8::is_ascii_whitespace) => return Err(self.ended()),
            None => return Err(self.fault("holds bytes that are no text where a number must stand")),
        };
        word.parse().map_err(|_| {
            let shown: String = word.chars().take(20).collect();
            self.fault(format!("\"{shown}\" stands where a number must"))
        })
    }

    fn binary<const N: usize>(&mut self) -> Result<[u8; N], Fault> {
        let mut bytes: [u8; N] = self.take(N)?.try_into().map_err(|_| self.ended())?;
        if self.coding == Coding::BigEndian {
            bytes.reverse();
        }
        Ok(bytes)
    }

    /// A whole number of four bytes.
    pub fn int(&mut self) -> Result<i64, Fault> {
        match self.coding {
            Coding::Text => self.text(),
            _ => Ok(i64::from(i32::from_le_bytes(self.binary()?))),
        }
    }

    /// A whole number ≥ 0 of so many bytes (4 or 8).
    pub fn size(&mut self, bytes: usize) -> Result<u64, Fault> {
        match (self.coding, bytes) {
            (Coding::Text, _) => self.text(),
            (_, 4) => Ok(u64::from(u32::from_le_bytes(self.binary()?))),
            _ => Ok(u64::from_le_bytes(self.binary()?)),
        }
    }

    /// A number of eight bytes.
    pub fn real(&mut self) -> Result<f64, Fault> {
        match self.coding {
            Coding::Text => self.text(),
            _ => Ok(f64::from_le_bytes(self.binary()?)),
        }
    }
}

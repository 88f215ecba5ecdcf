//! Messages of ROS 2 in CDR (the encapsulation of DDS-XTypes), as far as depth images and their cameras need it. An own reader: serde's crates for
//! CDR want the types as Rust structs and copy every byte of an image one by one.

/// A message that is read from its beginning on; every read may find its end.
pub struct Cdr<'a> {
    bytes: &'a [u8],
    at: usize,
    little: bool,
}

impl<'a> Cdr<'a> {
    /// Begins behind the encapsulation; `None` of what is no plain CDR.
    pub fn new(message: &'a [u8]) -> Option<Cdr<'a>> {
        let (head, bytes) = message.split_at_checked(4)?;
        match head[..2] {
            [0, 0] => Some(Cdr { bytes, at: 0, little: false }),
            [0, 1] => Some(Cdr { bytes, at: 0, little: true }),
            _ => None,
        }
    }

    /// Numbers lie at multiples of their size.
    fn word<const N: usize>(&mut self) -> Option<[u8; N]> {
        self.at = self.at.next_multiple_of(N);
        let mut b: [u8; N] = self.bytes.get(self.at..self.at + N)?.try_into().ok()?;
        self.at += N;
        if !self.little {
            b.reverse();
        }
        Some(b)
    }

    /// A byte.
    pub fn u8(&mut self) -> Option<u8> {
        self.word::<1>().map(|b| b[0])
    }

    /// A whole number.
    pub fn u32(&mut self) -> Option<u32> {
        self.word().map(u32::from_le_bytes)
    }

    /// A number.
    pub fn f64(&mut self) -> Option<f64> {
        self.word().map(f64::from_le_bytes)
    }

    /// Bytes behind their number.
    pub fn bytes(&mut self) -> Option<&'a [u8]> {
        let n = self.u32()? as usize;
        let b = self.bytes.get(self.at..self.at.checked_add(n)?)?;
        self.at += n;
        Some(b)
    }

    /// A text, which ends with a zero.
    pub fn text(&mut self) -> Option<String> {
        let b = self.bytes()?;
        Some(String::from_utf8_lossy(b.strip_suffix(b"\0").unwrap_or(b)).into_owned())
    }

    /// Numbers behind their number.
    pub fn numbers(&mut self) -> Option<Vec<f64>> {
        let n = self.u32()? as usize;
        // What a count says may be anything.
        (n <= self.bytes.len() / 8).then(|| (0..n).map(|_| self.f64()).collect())?
    }

    /// `std_msgs/Header`: its stamp [ns] and frame.
    pub fn header(&mut self) -> Option<(u64, String)> {
        let (seconds, nanos) = (self.u32()?, self.u32()?);
        Some((u64::from(seconds) * 1_000_000_000 + u64::from(nanos), self.text()?))
    }
}

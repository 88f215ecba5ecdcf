//! Pickles of plain data: the opcodes that `torch.save` uses for dictionaries, lists, numbers and tensors, and no other.
//!
//! A pickle is a program for a stack machine, and Python's would call whatever it names. Here names are only looked at, and calls are kept as
//! what they would be called with: nothing that a file says is run. Numbers and names of opcodes are those of Python's `pickletools`.

use std::collections::HashMap;

/// Values more than this are no table of a data set.
const MOST: usize = 1 << 24;

/// Longest name of a class or function [B]: a text that is kept once could be made a name at every opcode.
const NAME: usize = 1 << 10;

/// Place of a value among all values of a pickle: what is in several places is one value.
pub type At = usize;

/// A value.
#[derive(Clone, Debug, PartialEq)]
pub enum Value {
    /// None.
    None,
    /// A truth value.
    Bool(bool),
    /// A whole number.
    Whole(i64),
    /// A number.
    Real(f64),
    /// A text.
    Text(String),
    /// A tuple or a list.
    List(Vec<At>),
    /// A dictionary: keys and values.
    Dict(Vec<(At, At)>),
    /// A class or a function, `module.name`.
    Name(String),
    /// What lies elsewhere, by what it is found with.
    Elsewhere(At),
    /// What a name would give for these arguments.
    Call {
        /// The name's place.
        name: At,
        /// The place of the arguments.
        arguments: At,
    },
    /// Where a group of values begins.
    Mark,
}

impl Value {
    /// What it is, for messages.
    pub fn kind(&self) -> &'static str {
        match self {
            Value::None => "None",
            Value::Bool(_) => "a truth value",
            Value::Whole(_) => "a whole number",
            Value::Real(_) => "a number",
            Value::Text(_) => "a text",
            Value::List(_) => "a list",
            Value::Dict(_) => "a dictionary",
            Value::Name(_) => "a class or function",
            Value::Elsewhere(_) => "a storage",
            Value::Call { .. } => "an object",
            Value::Mark => "nothing",
        }
    }
}

/// All values of a pickle.
#[derive(Debug)]
pub struct Pickle {
    values: Vec<Value>,
    top: At,
}

impl Pickle {
    /// The value that it holds.
    pub fn top(&self) -> &Value {
        &self.values[self.top]
    }

    /// The value at a place.
    pub fn at(&self, at: At) -> &Value {
        &self.values[at]
    }

    /// The members of a list or tuple.
    pub fn list(&self, at: At) -> Option<&[At]> {
        match self.at(at) {
            Value::List(all) => Some(all),
            _ => None,
        }
    }

    /// Runs the machine over the bytes of a pickle.
    ///
    /// # Errors
    /// What is wrong: an opcode that is not read, with its name, or a program that does not hold together.
    pub fn read(bytes: &[u8]) -> Result<Pickle, String> {
        let mut machine = Machine { bytes, place: 0, values: Vec::new(), stack: Vec::new(), memo: HashMap::new() };
        let top = machine.run()?;
        Ok(Pickle { values: machine.values, top })
    }
}

struct Machine<'a> {
    bytes: &'a [u8],
    place: usize,
    values: Vec<Value>,
    stack: Vec<At>,
    memo: HashMap<u64, At>,
}

impl<'a> Machine<'a> {
    fn take(&mut self, n: usize) -> Result<&'a [u8], String> {
        let end = self.place.checked_add(n).filter(|e| *e <= self.bytes.len());
        let part = end.map(|e| &self.bytes[self.place..e]).ok_or("the pickle ends within an opcode")?;
        self.place += n;
        Ok(part)
    }

    /// An unsigned number of so many bytes, the lowest first.
    fn number(&mut self, n: usize) -> Result<u64, String> {
        Ok(self.take(n)?.iter().rev().fold(0, |x, b| x << 8 | u64::from(*b)))
    }

    /// A signed number of any length, the lowest byte first.
    fn long(&mut self, n: usize) -> Result<i64, String> {
        let part = self.take(n)?;
        if n > 8 {
            return Err("a whole number has more than 64 bits".into());
        }
        let negative = part.last().is_some_and(|b| b & 0x80 != 0);
        let begin = if negative { -1i64 } else { 0 };
        Ok(part.iter().rev().fold(begin, |x, b| x << 8 | i64::from(*b)))
    }

    fn text(&mut self, n: u64) -> Result<String, String> {
        let part = self.take(usize::try_from(n).map_err(|_| "a text is too long")?)?;
        String::from_utf8(part.to_vec()).map_err(|_| "a text is no UTF-8".into())
    }

    /// A text up to the end of its line.
    fn line(&mut self) -> Result<String, String> {
        let rest = &self.bytes[self.place..];
        let n = rest.iter().position(|b| *b == b'\n').ok_or("the pickle ends within a name")?;
        let text = self.text(n as u64)?;
        self.place += 1;
        Ok(text)
    }

    fn push(&mut self, value: Value) -> Result<(), String> {
        if self.values.len() >= MOST || self.stack.len() >= MOST {
            return Err(format!("the pickle holds more than {MOST} values"));
        }
        self.stack.push(self.values.len());
        self.values.push(value);
        Ok(())
    }

    fn pop(&mut self) -> Result<At, String> {
        self.stack.pop().ok_or_else(|| "the pickle takes a value where there is none".into())
    }

    fn last(&self) -> Result<At, String> {
        self.stack.last().copied().ok_or_else(|| "the pickle takes a value where there is none".into())
    }

    /// Values down to the last mark, in order.
    fn up_to_mark(&mut self) -> Result<Vec<At>, String> {
        let begin = self.stack.iter().rposition(|at| self.values[*at] == Value::Mark).ok_or("the pickle lacks a mark")?;
        let all = self.stack.split_off(begin + 1);
        self.stack.pop();
        Ok(all)
    }

    fn tuple(&mut self, n: usize) -> Result<(), String> {
        let begin = self.stack.len().checked_sub(n).ok_or("the pickle takes a value where there is none")?;
        let all = self.stack.split_off(begin);
        self.push(Value::List(all))
    }

    fn append(&mut self, more: Vec<At>) -> Result<(), String> {
        let at = self.last()?;
        match &mut self.values[at] {
            Value::List(all) => all.extend(more),
            other => return Err(format!("the pickle appends to {}", other.kind())),
        }
        Ok(())
    }

    fn set(&mut self, more: Vec<At>) -> Result<(), String> {
        if !more.len().is_multiple_of(2) {
            return Err("the pickle has a key without a value".into());
        }
        let at = self.last()?;
        // An ordered dictionary is a call until something is put into it.
        if matches!(self.values[at], Value::Call { .. }) {
            self.values[at] = Value::Dict(Vec::new());
        }
        match &mut self.values[at] {
            Value::Dict(all) => all.extend(more.chunks_exact(2).map(|p| (p[0], p[1]))),
            other => return Err(format!("the pickle puts a key into {}", other.kind())),
        }
        Ok(())
    }

    fn keep(&mut self, number: u64) -> Result<(), String> {
        let at = self.last()?;
        self.memo.insert(number, at);
        Ok(())
    }

    fn recall(&mut self, number: u64) -> Result<(), String> {
        let at = *self.memo.get(&number).ok_or_else(|| format!("the pickle recalls value {number}, which it did not keep"))?;
        if self.stack.len() >= MOST {
            return Err(format!("the pickle holds more than {MOST} values"));
        }
        self.stack.push(at);
        Ok(())
    }

    fn run(&mut self) -> Result<At, String> {
        loop {
            let code = self.take(1)?[0];
            match code {
                0x80 => {
                    let version = self.number(1)?;
                    if version > 5 {
                        return Err(format!("pickle protocol {version} is not read; 2 to 5 are"));
                    }
                }
                0x95 => drop(self.take(8)?),
                b'.' => return self.pop(),
                b'(' => self.push(Value::Mark)?,
                b'0' => drop(self.pop()?),
                b'1' => drop(self.up_to_mark()?),
                b'N' => self.push(Value::None)?,
                0x88 => self.push(Value::Bool(true))?,
                0x89 => self.push(Value::Bool(false))?,
                b'J' => {
                    let x = self.number(4)? as u32 as i32;
                    self.push(Value::Whole(x.into()))?;
                }
                b'K' => {
                    let x = self.number(1)? as i64;
                    self.push(Value::Whole(x))?;
                }
                b'M' => {
                    let x = self.number(2)? as i64;
                    self.push(Value::Whole(x))?;
                }
                0x8a => {
                    let n = self.number(1)? as usize;
                    let x = self.long(n)?;
                    self.push(Value::Whole(x))?;
                }
                b'G' => {
                    let bits = self.take(8)?.iter().fold(0, |x, b| x << 8 | u64::from(*b));
                    self.push(Value::Real(f64::from_bits(bits)))?;
                }
                b'X' | 0x8c | 0x8d => {
                    let n = self.number(match code {
                        b'X' => 4,
                        0x8c => 1,
                        _ => 8,
                    })?;
                    let text = self.text(n)?;
                    self.push(Value::Text(text))?;
                }
                b')' | b']' => self.push(Value::List(Vec::new()))?,
                b'}' => self.push(Value::Dict(Vec::new()))?,
                0x85..=0x87 => self.tuple(usize::from(code) - 0x84)?,
                b't' | b'l' => {
                    let all = self.up_to_mark()?;
                    self.push(Value::List(all))?;
                }
                b'a' => {
                    let one = self.pop()?;
                    self.append(vec![one])?;
                }
                b'e' => {
                    let all = self.up_to_mark()?;
                    self.append(all)?;
                }
                b's' => {
                    let (value, key) = (self.pop()?, self.pop()?);
                    self.set(vec![key, value])?;
                }
                b'u' => {
                    let all = self.up_to_mark()?;
                    self.set(all)?;
                }
                b'q' => {
                    let n = self.number(1)?;
                    self.keep(n)?;
                }
                b'r' => {
                    let n = self.number(4)?;
                    self.keep(n)?;
                }
                0x94 => self.keep(self.memo.len() as u64)?,
                b'h' => {
                    let n = self.number(1)?;
                    self.recall(n)?;
                }
                b'j' => {
                    let n = self.number(4)?;
                    self.recall(n)?;
                }
                b'c' => {
                    let (module, name) = (self.line()?, self.line()?);
                    self.push(Value::Name(format!("{module}.{name}")))?;
                }
                0x93 => {
                    let (name, module) = (self.pop()?, self.pop()?);
                    let (Value::Text(module), Value::Text(name)) = (&self.values[module], &self.values[name]) else {
                        return Err("the pickle names something by what is no text".into());
                    };
                    if module.len().saturating_add(name.len()) > NAME {
                        return Err(format!("the pickle has a name of more than {NAME} bytes"));
                    }
                    let name = format!("{module}.{name}");
                    self.push(Value::Name(name))?;
                }
                b'Q' => {
                    let by = self.pop()?;
                    self.push(Value::Elsewhere(by))?;
                }
                b'R' => {
                    let (arguments, name) = (self.pop()?, self.pop()?);
                    self.push(Value::Call { name, arguments })?;
                }
                // Attributes of a dictionary, as those of a network's parameters, say nothing about its entries.
                b'b' if self.stack.iter().rev().nth(1).is_some_and(|at| matches!(self.values[*at], Value::Dict(_))) => {
                    self.pop()?;
                }
                other => return Err(format!("opcode {} at byte {} is not read", name_of(other), self.place - 1)),
            }
        }
    }
}

/// The name of an opcode that is not read.
fn name_of(code: u8) -> String {
    let known = [
        (b'b', "BUILD"),
        (b'i', "INST"),
        (b'o', "OBJ"),
        (0x81, "NEWOBJ"),
        (0x92, "NEWOBJ_EX"),
        (b'B', "BINBYTES"),
        (b'C', "SHORT_BINBYTES"),
        (0x8e, "BINBYTES8"),
        (0x96, "BYTEARRAY8"),
        (0x97, "NEXT_BUFFER"),
        (0x98, "READONLY_BUFFER"),
        (b'T', "BINSTRING"),
        (b'U', "SHORT_BINSTRING"),
        (b'S', "STRING"),
        (b'V', "UNICODE"),
        (b'I', "INT"),
        (b'L', "LONG"),
        (0x8b, "LONG4"),
        (b'F', "FLOAT"),
        (b'P', "PERSID"),
        (b'2', "DUP"),
        (b'd', "DICT"),
        (b'p', "PUT"),
        (b'g', "GET"),
        (0x82, "EXT1"),
        (0x83, "EXT2"),
        (0x84, "EXT4"),
        (0x8f, "EMPTY_SET"),
        (0x90, "ADDITEMS"),
        (0x91, "FROZENSET"),
    ];
    known.iter().find(|k| k.0 == code).map_or_else(|| format!("0x{code:02x}"), |k| k.1.to_string())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn plain_data_is_read_and_what_is_shared_is_one_value() {
        // {"a": [1, -2, 3.5], "b": the same list, "c": None}, protocol 2, as Python's pickle.dumps writes it.
        let bytes = b"\x80\x02}q\x00(X\x01\x00\x00\x00aq\x01]q\x02(K\x01J\xfe\xff\xff\xffG@\x0c\x00\x00\x00\x00\x00\x00eX\x01\x00\x00\x00bq\x03h\x02X\x01\x00\x00\x00cq\x04Nu.";
        let p = Pickle::read(bytes).unwrap();
        let Value::Dict(all) = p.top() else { panic!("{:?}", p.top()) };
        let list: Vec<&Value> = p.list(all[0].1).unwrap().iter().map(|v| p.at(*v)).collect();
        assert_eq!(list, [&Value::Whole(1), &Value::Whole(-2), &Value::Real(3.5)]);
        assert_eq!((all[0].1, p.at(all[2].1)), (all[1].1, &Value::None));
    }

    #[test]
    fn damaged_pickles_never_panic() {
        let whole = b"\x80\x02}q\x00(X\x01\x00\x00\x00act\nf\n((X\x01\x00\x00\x00sK\x02tQK\x00M\x01\x02\x85\x8a\x02\xff\x7f\x89)]N0K\x01ah\x00tRu.".to_vec();
        assert!(matches!(Pickle::read(&whole).unwrap().top(), Value::Dict(d) if d.len() == 1));
        for k in 0..20_000usize {
            let mut b = whole.clone();
            for j in 0..1 + k % 4 {
                let at = (k * 7919 + j * 104_729) % b.len();
                b[at] = b[at].wrapping_mul(31).wrapping_add((k / 64 + j) as u8);
            }
            let _ = Pickle::read(&b[..b.len() - k % 3]);
        }
    }

    #[test]
    fn a_text_that_is_kept_does_not_become_long_names() {
        let text = [&b"X"[..], &600u32.to_le_bytes(), &[b'a'; 600]].concat();
        let bytes = [b"\x80\x02", &text[..], b"q\x00h\x00\x93."].concat();
        assert_eq!(Pickle::read(&bytes).unwrap_err(), "the pickle has a name of more than 1024 bytes");
    }

    #[test]
    fn what_is_not_read_is_named_and_nothing_is_called() {
        // pickle.dumps of an object that would run a command: the call is kept, not made.
        let p = Pickle::read(b"\x80\x02cposix\nsystem\nq\x00X\x04\x00\x00\x00trueq\x01\x85q\x02Rq\x03.").unwrap();
        let Value::Call { name, .. } = p.top() else { panic!("{:?}", p.top()) };
        assert_eq!(p.at(*name), &Value::Name("posix.system".into()));
        for (bytes, wanted) in [
            (&b"\x80\x02)\x81."[..], "opcode NEWOBJ at byte 3 is not read"),
            (b"\x80\x02N}b.", "opcode BUILD"),
            (b"\x80\x09.", "pickle protocol 9"),
            (b"\x80\x02h\x05.", "recalls value 5"),
            (b"\x80\x02K\x01K\x02s.", "takes a value where there is none"),
            (b"\x80\x02Na.", "takes a value"),
            (b"\x80\x02NNa.", "appends to None"),
            (b"\x80\x02e.", "lacks a mark"),
            (b"\x80\x02X\xff\xff\xff\xffa", "ends within"),
            (b"\x80\x02\x8a\x09\x00\x00\x00\x00\x00\x00\x00\x00\x01.", "more than 64 bits"),
            (b"", "ends within"),
        ] {
            let e = Pickle::read(bytes).unwrap_err();
            assert!(e.contains(wanted), "{bytes:?}: {e}");
        }
    }
}

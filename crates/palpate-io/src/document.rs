//! A TOML file with line numbers: typed access to keys whose errors name file, line, key and what is allowed.

use crate::error::{InputError, number};
use crate::input::read_bytes;
use crate::keys::Schema;
use glam::DVec3;
use std::ops::Range;
use std::path::{Path, PathBuf};
use toml_edit::{Array, Document, Item, TableLike, Value};

/// A parsed TOML file.
pub(crate) struct Source {
    /// The file, as it was named.
    pub path: PathBuf,
    document: Document<String>,
}

/// The text of a file.
///
/// # Errors
/// It is not there, may not be read, or is not UTF-8.
pub fn read_text(path: impl AsRef<Path>) -> Result<String, InputError> {
    text(path.as_ref())
}

fn text(path: &Path) -> Result<String, InputError> {
    String::from_utf8(read_bytes(path)?).map_err(|_| InputError::file(path, "is not UTF-8 text"))
}

impl Source {
    /// Reads and parses a file.
    pub fn read(path: &Path) -> Result<Source, InputError> {
        Source::parse(path, read_text(path)?)
    }

    /// Parses text that was read from `path`.
    pub fn parse(path: &Path, text: String) -> Result<Source, InputError> {
        match Document::parse(text.clone()) {
            Ok(document) => Ok(Source { path: path.to_path_buf(), document }),
            Err(e) => {
                let line = e.span().map(|s| line_of(&text, s.start));
                Err(InputError { line, ..InputError::file(path, format!("not valid TOML: {}", e.message())) })
            }
        }
    }

    /// The whole file as a table.
    pub fn root(&self) -> Table<'_> {
        Table { source: self, table: self.document.as_table(), path: String::new(), span: None }
    }

    /// Folder that relative paths in the file start from.
    pub fn folder(&self) -> &Path {
        match self.path.parent() {
            Some(p) if !p.as_os_str().is_empty() => p,
            _ => Path::new("."),
        }
    }

    /// An error about a dotted path (`clamp.0.box`), with its line.
    pub fn fault(&self, key: &str, message: impl Into<String>) -> InputError {
        InputError { line: self.line_of_key(key), key: key.to_string(), ..InputError::file(&self.path, message) }
    }

    /// Line of a dotted path (`clamp.0.box`), or of the deepest part of it that is in the file.
    pub fn line_of_key(&self, key: &str) -> Option<usize> {
        let parts: Vec<&str> = key.split('.').collect();
        let (mut table, mut line, mut i) = (self.root(), None, 0);
        while i < parts.len() && table.has(parts[i]) {
            let name = parts[i];
            line = table.error(name, "").line.or(line);
            i += 1;
            let row = parts.get(i).and_then(|n| n.parse::<usize>().ok());
            let row = row.and_then(|n| table.tables(name).ok()?.into_iter().nth(n));
            if let Some(row) = row {
                line = row.own_error("").line.or(line);
                table = row;
                i += 1;
            } else if let Ok(Some(inner)) = table.optional_table(name) {
                table = inner;
            } else {
                break;
            }
        }
        line
    }

    fn line(&self, span: Option<Range<usize>>) -> Option<usize> {
        span.map(|s| line_of(self.document.raw(), s.start))
    }

    fn error(&self, span: Option<Range<usize>>, key: &str, message: impl Into<String>) -> InputError {
        InputError { file: self.path.clone(), line: self.line(span), key: key.to_string(), message: message.into() }
    }
}

fn line_of(text: &str, offset: usize) -> usize {
    1 + text.bytes().take(offset).filter(|&b| b == b'\n').count()
}

/// A table of the file and its dotted path.
#[derive(Clone)]
pub(crate) struct Table<'a> {
    source: &'a Source,
    table: &'a dyn TableLike,
    path: String,
    span: Option<Range<usize>>,
}

/// The words a user knows for a TOML type.
fn kind(item: &Item) -> &'static str {
    match item {
        Item::None => "nothing",
        Item::Table(_) | Item::Value(Value::InlineTable(_)) => "a table",
        Item::ArrayOfTables(_) => "an array of tables",
        Item::Value(Value::String(_)) => "a string",
        Item::Value(Value::Integer(_)) => "an integer",
        Item::Value(Value::Float(_)) => "a number",
        Item::Value(Value::Boolean(_)) => "true or false",
        Item::Value(Value::Datetime(_)) => "a date",
        Item::Value(Value::Array(_)) => "an array",
    }
}

impl<'a> Table<'a> {
    /// Dotted path of a key of this table.
    pub fn key(&self, key: &str) -> String {
        if self.path.is_empty() { key.to_string() } else { format!("{}.{key}", self.path) }
    }

    /// An error about a key of this table, or about the table when it lacks the key.
    pub fn error(&self, key: &str, message: impl Into<String>) -> InputError {
        let span = self.table.get_key_value(key).and_then(|(k, i)| k.span().or_else(|| i.span())).or_else(|| self.span.clone());
        self.source.error(span, &self.key(key), message)
    }

    /// An error about this table.
    pub fn own_error(&self, message: impl Into<String>) -> InputError {
        self.source.error(self.span.clone(), &self.path, message)
    }

    /// Errors at the first key (in the order of the file) that the schema does not know.
    pub fn check_keys(&self, schema: &Schema) -> Result<(), InputError> {
        for (key, item) in self.table.iter() {
            if !schema.keys.contains(&key) && schema.child(key).is_none() {
                return Err(self.error(key, format!("unknown key; {}", schema.suggest(key))));
            }
            let Some(child) = schema.child(key) else { continue };
            if let Some(table) = self.optional_table(key).ok().flatten() {
                table.check_keys(child)?;
            } else if !matches!(item, Item::Value(Value::String(_))) {
                for table in self.tables(key)? {
                    table.check_keys(child)?;
                }
            }
        }
        Ok(())
    }

    fn get(&self, key: &str) -> Option<&'a Item> {
        self.table.get(key).filter(|i| !i.is_none())
    }

    /// True when the table has the key.
    pub fn has(&self, key: &str) -> bool {
        self.get(key).is_some()
    }

    /// Names of the keys in the order of the file.
    pub fn names(&self) -> Vec<&'a str> {
        self.table.iter().map(|(k, _)| k).collect()
    }

    fn wrong(&self, key: &str, wanted: &str, item: &Item) -> InputError {
        self.error(key, format!("expected {wanted}, found {}", kind(item)))
    }

    /// The error for a key that must be there.
    pub fn missing(&self, key: &str, wanted: &str) -> InputError {
        self.error(key, format!("missing; expected {wanted}"))
    }

    /// A table under a key (header or inline).
    pub fn optional_table(&self, key: &str) -> Result<Option<Table<'a>>, InputError> {
        let Some(item) = self.get(key) else { return Ok(None) };
        let table = item.as_table_like().ok_or_else(|| self.wrong(key, "a table", item))?;
        let span = self.table.get_key_value(key).and_then(|(k, i)| i.span().or_else(|| k.span()));
        Ok(Some(Table { source: self.source, table, path: self.key(key), span }))
    }

    /// Tables under a key: `[[key]]` or an array of inline tables; none when absent.
    pub fn tables(&self, key: &str) -> Result<Vec<Table<'a>>, InputError> {
        let Some(item) = self.get(key) else { return Ok(Vec::new()) };
        let path = |i: usize| format!("{}.{i}", self.key(key));
        match item {
            Item::ArrayOfTables(a) => Ok((a.iter().enumerate())
                .map(|(i, t)| Table { source: self.source, table: t, path: path(i), span: t.span() })
                .collect()),
            Item::Value(Value::Array(a)) => (a.iter().enumerate())
                .map(|(i, v)| match v {
                    Value::InlineTable(t) => Ok(Table { source: self.source, table: t, path: path(i), span: t.span() }),
                    _ => Err(self.source.error(v.span(), &path(i), "expected a table")),
                })
                .collect(),
            _ => Err(self.wrong(key, &format!("an array of tables ([[{}]])", self.key(key)), item)),
        }
    }

    fn value_f64(&self, key: &str, value: &Value) -> Result<f64, InputError> {
        let x = match value {
            Value::Integer(i) => *i.value() as f64,
            Value::Float(f) => *f.value(),
            other => {
                let found = kind(&Item::Value(other.clone()));
                return Err(self.source.error(value.span(), &self.key(key), format!("expected a number, found {found}")));
            }
        };
        if x.is_finite() {
            Ok(x)
        } else {
            Err(self.source.error(
                value.span(),
                &self.key(key),
                format!("{x} is not a number that can be used; give a finite one"),
            ))
        }
    }

    /// A finite number.
    pub fn optional_f64(&self, key: &str) -> Result<Option<f64>, InputError> {
        match self.get(key) {
            None => Ok(None),
            Some(Item::Value(v)) => self.value_f64(key, v).map(Some),
            Some(item) => Err(self.wrong(key, "a number", item)),
        }
    }

    /// A finite number within a range that `allowed` puts in words (`"must be > 0"`).
    pub fn f64_where(&self, key: &str, ok: impl Fn(f64) -> bool, allowed: &str) -> Result<Option<f64>, InputError> {
        match self.optional_f64(key)? {
            Some(x) if !ok(x) => Err(self.error(key, format!("{} {allowed}", number(x)))),
            x => Ok(x),
        }
    }

    /// An array of exactly `n` finite numbers.
    pub fn optional_numbers(&self, key: &str, n: usize) -> Result<Option<Vec<f64>>, InputError> {
        let Some(item) = self.get(key) else { return Ok(None) };
        let array = item.as_array().ok_or_else(|| self.wrong(key, &format!("an array of {n} numbers"), item))?;
        if array.len() != n {
            return Err(self.error(key, format!("expected an array of {n} numbers, found {}", array.len())));
        }
        array.iter().map(|v| self.value_f64(key, v)).collect::<Result<_, _>>().map(Some)
    }

    /// An array of finite numbers.
    pub fn optional_list(&self, key: &str) -> Result<Option<Vec<f64>>, InputError> {
        let Some(item) = self.get(key) else { return Ok(None) };
        let array = item.as_array().ok_or_else(|| self.wrong(key, "an array of numbers", item))?;
        self.optional_numbers(key, array.len())
    }

    /// A vector `[x, y, z]`.
    pub fn optional_vec3(&self, key: &str) -> Result<Option<DVec3>, InputError> {
        Ok(self.optional_numbers(key, 3)?.map(|v| DVec3::new(v[0], v[1], v[2])))
    }

    /// A vector that must be there.
    pub fn vec3(&self, key: &str) -> Result<DVec3, InputError> {
        self.optional_vec3(key)?.ok_or_else(|| self.missing(key, "[x, y, z]"))
    }

    /// Rows of `N` numbers each, `[[…], …]`.
    pub fn optional_rows<const N: usize>(&self, key: &str) -> Result<Option<Vec<[f64; N]>>, InputError> {
        let Some(item) = self.get(key) else { return Ok(None) };
        let names = match N {
            3 => "[x, y, z], three".to_string(),
            4 => "[time, x, y, z], four".to_string(),
            n => format!("rows of {n}"),
        };
        let wrong = || self.wrong(key, &format!("an array of {names} numbers each"), item);
        let row = |v: &Value| {
            let v = v.as_array().filter(|a| a.len() == N).ok_or_else(wrong)?;
            let mut row = [0.0; N];
            for (out, x) in row.iter_mut().zip(v) {
                *out = self.value_f64(key, x)?;
            }
            Ok(row)
        };
        item.as_array().ok_or_else(wrong)?.iter().map(row).collect::<Result<_, _>>().map(Some)
    }

    /// An array of vectors `[[x, y, z], …]`.
    pub fn optional_points(&self, key: &str) -> Result<Option<Vec<DVec3>>, InputError> {
        Ok(self.optional_rows::<3>(key)?.map(|rows| rows.into_iter().map(DVec3::from_array).collect()))
    }

    /// True where the key holds a string.
    pub fn is_str(&self, key: &str) -> bool {
        self.get(key).is_some_and(Item::is_str)
    }

    /// A 4 × 4 matrix, row by row.
    pub fn optional_matrix4(&self, key: &str) -> Result<Option<[[f64; 4]; 4]>, InputError> {
        let Some(item) = self.get(key) else { return Ok(None) };
        let shape = || self.wrong(key, "four rows of four numbers (row-major 4 × 4)", item);
        let rows = item.as_array().filter(|a| a.len() == 4).ok_or_else(shape)?;
        let mut m = [[0.0; 4]; 4];
        for (r, row) in rows.iter().enumerate() {
            let row = row.as_array().filter(|a| a.len() == 4).ok_or_else(shape)?;
            for (c, v) in row.iter().enumerate() {
                m[r][c] = self.value_f64(key, v)?;
            }
        }
        Ok(Some(m))
    }

    /// A string.
    pub fn optional_str(&self, key: &str) -> Result<Option<&'a str>, InputError> {
        let Some(item) = self.get(key) else { return Ok(None) };
        item.as_str().map(Some).ok_or_else(|| self.wrong(key, "a string", item))
    }

    /// A file or folder; relative names start from the folder of this file.
    pub fn optional_path(&self, key: &str) -> Result<Option<PathBuf>, InputError> {
        match self.optional_str(key)? {
            // Joined to the folder it would be the folder itself.
            Some("") => Err(self.error(key, "is empty; expected a path, relative to the folder of this file")),
            name => Ok(name.map(|n| self.source.folder().join(n))),
        }
    }

    /// A file that is there; relative names start from the folder of this file.
    pub fn optional_file(&self, key: &str) -> Result<Option<PathBuf>, InputError> {
        match self.optional_path(key)? {
            Some(path) if !path.exists() => Err(self.error(key, format!("there is no file {}", path.display()))),
            path => Ok(path),
        }
    }

    /// One of a list of names.
    pub fn optional_choice<T: Copy>(&self, key: &str, choices: &[(&str, T)]) -> Result<Option<T>, InputError> {
        let Some(name) = self.optional_str(key)? else { return Ok(None) };
        self.choose(key, name, choices).map(Some)
    }

    fn choose<T: Copy>(&self, key: &str, name: &str, choices: &[(&str, T)]) -> Result<T, InputError> {
        choices.iter().find(|(n, _)| *n == name).map(|(_, t)| *t).ok_or_else(|| {
            let known: Vec<String> = choices.iter().map(|(n, _)| format!("\"{n}\"")).collect();
            self.error(key, format!("\"{name}\" is not known; allowed: {}", known.join(", ")))
        })
    }

    /// A name or an array of names out of a list.
    pub fn optional_choices<T: Copy>(&self, key: &str, choices: &[(&str, T)]) -> Result<Option<Vec<T>>, InputError> {
        let Some(item) = self.get(key) else { return Ok(None) };
        let Some(array) = item.as_array() else { return self.optional_choice(key, choices).map(|c| c.map(|c| vec![c])) };
        if array.is_empty() {
            return Err(self.error(key, "is empty; give at least one name"));
        }
        let names = array.iter().map(|v| {
            let name = v.as_str().ok_or_else(|| self.wrong(key, "a string or an array of strings", item))?;
            self.choose(key, name, choices)
        });
        names.collect::<Result<_, _>>().map(Some)
    }

    /// True or false.
    pub fn optional_bool(&self, key: &str) -> Result<Option<bool>, InputError> {
        let Some(item) = self.get(key) else { return Ok(None) };
        item.as_bool().map(Some).ok_or_else(|| self.wrong(key, "true or false", item))
    }

    /// A whole number in a range.
    pub fn optional_count(&self, key: &str, allowed: std::ops::RangeInclusive<u64>) -> Result<Option<u64>, InputError> {
        let Some(item) = self.get(key) else { return Ok(None) };
        let wanted = match *allowed.end() {
            u64::MAX => format!("a whole number ≥ {}", allowed.start()),
            end => format!("a whole number from {} to {end}", allowed.start()),
        };
        let i = item.as_integer().ok_or_else(|| self.wrong(key, &wanted, item))?;
        match u64::try_from(i) {
            Ok(n) if allowed.contains(&n) => Ok(Some(n)),
            _ => Err(self.error(key, format!("{i} is out of range; expected {wanted}"))),
        }
    }

    /// A pair of numbers for each component, or one for all.
    pub fn optional_pairs(&self, key: &str, components: usize) -> Result<Option<Vec<(f64, f64)>>, InputError> {
        let Some(item) = self.get(key) else { return Ok(None) };
        let vector = if components > 1 { ", or an array of three of these" } else { "" };
        let wrong = || self.wrong(key, &format!("a pair [value, standard deviation]{vector}"), item);
        let pair = |a: &Array| -> Result<(f64, f64), InputError> {
            let numbers: Vec<f64> = a.iter().map(|x| self.value_f64(key, x)).collect::<Result<_, _>>()?;
            if let [value, sd] = numbers[..] { Ok((value, sd)) } else { Err(wrong()) }
        };
        let all = item.as_array().ok_or_else(wrong)?;
        if components > 1 && all.len() == components && all.iter().all(Value::is_array) {
            return all.iter().filter_map(Value::as_array).map(pair).collect::<Result<_, _>>().map(Some);
        }
        if all.iter().any(Value::is_array) {
            return Err(wrong());
        }
        Ok(Some(vec![pair(all)?; components]))
    }

    /// A number, or an array of numbers and pairs of numbers, as fit ranges use them: `[x]` per entry either one number or two.
    pub fn optional_ranges(&self, key: &str, components: usize) -> Result<Option<Vec<(f64, f64)>>, InputError> {
        let Some(item) = self.get(key) else { return Ok(None) };
        let wrong = || {
            let vector = if components > 1 { ", or an array of three of these" } else { "" };
            self.wrong(key, &format!("a number or a range [low, high]{vector}"), item)
        };
        let one = |v: &Value| -> Result<(f64, f64), InputError> {
            match v {
                Value::Array(a) if a.len() == 2 => {
                    let pair: Vec<f64> = a.iter().map(|x| self.value_f64(key, x)).collect::<Result<_, _>>()?;
                    if pair[0] > pair[1] {
                        return Err(
                            self.error(key, format!("[{}, {}]: low must not exceed high", number(pair[0]), number(pair[1])))
                        );
                    }
                    Ok((pair[0], pair[1]))
                }
                Value::Array(_) => Err(wrong()),
                v => self.value_f64(key, v).map(|x| (x, x)),
            }
        };
        let value = item.as_value().ok_or_else(wrong)?;
        match value {
            Value::Array(a) if components > 1 && a.len() == components => a.iter().map(one).collect::<Result<_, _>>().map(Some),
            v => Ok(Some(vec![one(v)?; components])),
        }
    }
}

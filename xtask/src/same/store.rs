//! The stored hashes, `bench/same.json`, and what differs from them.

use super::measure::{Measured, Quantity};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::Path;

/// The file.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Store {
    /// By name of the backend: `cpu`, `gpu`.
    pub backends: BTreeMap<String, Part>,
}

/// What one backend computed.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Part {
    /// What decides the bits beside the code: vector instructions, or adapter and driver.
    pub made_on: String,
    /// By name of the case.
    pub cases: BTreeMap<String, Record>,
}

/// What one backend computed of one case.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Record {
    /// Day on which these numbers were accepted.
    pub date: String,
    /// Why they were.
    pub why: String,
    /// By name.
    pub quantities: BTreeMap<String, Stored>,
}

/// One quantity.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Stored {
    /// Hash of all its numbers.
    pub hash: String,
    /// Some of the numbers. Where numbers belong to paths of parameters, every path that the hash covers is a key.
    pub values: BTreeMap<String, Vec<f64>>,
}

/// One quantity that is not what is stored.
#[derive(Clone, Debug, PartialEq)]
pub struct Row {
    /// The case.
    pub case: String,
    /// The backend.
    pub backend: String,
    /// The quantity.
    pub quantity: String,
    /// How far it is from what is stored.
    pub far: String,
    /// False for what is only worth a word.
    pub counts: bool,
}

impl From<&Quantity> for Stored {
    fn from(q: &Quantity) -> Stored {
        Stored { hash: q.hash(|_| true), values: q.values.clone() }
    }
}

impl Record {
    /// A record accepted today.
    pub fn new(measured: &Measured, date: String, why: &str) -> Record {
        let quantities = measured.iter().map(|(name, q)| (name.clone(), q.into())).collect();
        Record { date, why: why.into(), quantities }
    }

    /// What differs in `measured`: quantity and how far; the last is false for news that no stored number contradicts.
    pub fn compare(&self, measured: &Measured) -> Vec<(String, String, bool)> {
        let mut found = Vec::new();
        for (name, stored) in &self.quantities {
            match measured.get(name) {
                None => found.push((name.clone(), "no longer computed".into(), true)),
                Some(now) => found.extend(stored.compare(now).map(|(far, counts)| (name.clone(), far, counts))),
            }
        }
        let new = measured.keys().filter(|name| !self.quantities.contains_key(*name));
        found.extend(new.map(|name| (name.clone(), "new, not stored".into(), true)));
        found
    }
}

impl Stored {
    fn compare(&self, now: &Quantity) -> Option<(String, bool)> {
        let gone: Vec<&str> = self.values.keys().filter(|k| !now.values.contains_key(*k)).map(String::as_str).collect();
        if !gone.is_empty() {
            return Some((format!("without {}", gone.join(", ")), true));
        }
        if now.hash(|key| self.values.contains_key(key)) != self.hash {
            return Some((self.far(now), true));
        }
        let new: Vec<&str> = now.values.keys().filter(|k| !self.values.contains_key(*k)).map(String::as_str).collect();
        (!new.is_empty()).then(|| (format!("the same; new beside it: {}", new.join(", ")), false))
    }

    /// The largest relative change among the numbers that are stored themselves.
    fn far(&self, now: &Quantity) -> String {
        let size = |x: &[f64]| x.iter().fold(0.0f64, |m, x| m.max(x.abs()));
        let change = |old: &[f64], new: &[f64]| {
            let moved = old.iter().zip(new).fold(0.0f64, |m, (a, b)| m.max((a - b).abs()));
            let lost = old.len() != new.len() || old.iter().zip(new).any(|(a, b)| a.is_nan() != b.is_nan());
            if lost {
                f64::INFINITY
            } else if moved == 0.0 {
                0.0
            } else {
                moved / size(old).max(size(new))
            }
        };
        let changes = self.values.iter().map(|(k, old)| (change(old, &now.values[k]), k));
        match changes.max_by(|a, b| a.0.total_cmp(&b.0)) {
            Some((far, key)) if far > 0.0 => format!("{far:.1e} ({key})"),
            _ => "bits of numbers that are not stored themselves".into(),
        }
    }
}

impl Part {
    /// What differs in one case.
    pub fn compare(&self, case: &str, backend: &str, measured: &Measured) -> Vec<Row> {
        let row = |quantity: &str, far: String, counts| Row {
            case: case.into(),
            backend: backend.into(),
            quantity: quantity.into(),
            far,
            counts,
        };
        match self.cases.get(case) {
            None => vec![row("all", "new, not stored".into(), true)],
            Some(record) => record.compare(measured).into_iter().map(|(q, far, counts)| row(&q, far, counts)).collect(),
        }
    }
}

impl Store {
    /// Reads the file; an empty store where there is none.
    ///
    /// # Errors
    /// The file cannot be read.
    pub fn read(path: &Path) -> Result<Store, String> {
        if !path.exists() {
            return Ok(Store::default());
        }
        let text = std::fs::read_to_string(path).map_err(|e| format!("{}: {e}", path.display()))?;
        serde_json::from_str(&text).map_err(|e| format!("{}: {e}", path.display()))
    }

    /// Writes the file with one line per quantity, so that a change of one is a change of one line.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn write(&self, path: &Path) -> Result<(), String> {
        let text = self.text().map_err(|e| e.to_string())?;
        std::fs::write(path, text).map_err(|e| format!("{}: {e}", path.display()))
    }

    fn text(&self) -> serde_json::Result<String> {
        let list = |lines: Vec<String>, indent: &str| format!("{{\n{}\n{indent}}}", lines.join(",\n"));
        let quoted = |s: &str| serde_json::to_string(s);
        let record = |r: &Record| -> serde_json::Result<String> {
            let line = |(name, q): (&String, &Stored)| Ok(format!("          {}: {}", quoted(name)?, serde_json::to_string(q)?));
            let lines: serde_json::Result<Vec<String>> = r.quantities.iter().map(line).collect();
            Ok(format!(
                "{{\"date\": {}, \"why\": {}, \"quantities\": {}}}",
                quoted(&r.date)?,
                quoted(&r.why)?,
                list(lines?, "        ")
            ))
        };
        let part = |p: &Part| -> serde_json::Result<String> {
            let line = |(name, r): (&String, &Record)| Ok(format!("        {}: {}", quoted(name)?, record(r)?));
            let lines: serde_json::Result<Vec<String>> = p.cases.iter().map(line).collect();
            Ok(format!("{{\"made_on\": {}, \"cases\": {}}}", quoted(&p.made_on)?, list(lines?, "    ")))
        };
        let line = |(name, p): (&String, &Part)| Ok(format!("    {}: {}", quoted(name)?, part(p)?));
        let lines: serde_json::Result<Vec<String>> = self.backends.iter().map(line).collect();
        Ok(format!("{{\"backends\": {}}}\n", list(lines?, "")))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::same::{cases::CASES, measure::measure};
    use palpate::Backend;

    fn part(measured: &Measured) -> Part {
        let record = Record::new(measured, "2026-01-01".into(), "a test");
        Part { made_on: String::new(), cases: [("spin".into(), record)].into() }
    }

    #[test]
    fn one_bit_of_one_number_is_a_row_and_another_order_of_parameters_is_none() {
        let case = CASES.iter().find(|c| c.name == "spin").unwrap();
        let alone = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
        let measured = alone.install(|| measure(case, Backend::Cpu)).unwrap();
        let part = part(&measured);
        let side_by_side = rayon::ThreadPoolBuilder::new().num_threads(3).build().unwrap();
        assert_eq!(part.compare("spin", "cpu", &side_by_side.install(|| measure(case, Backend::Cpu)).unwrap()), []);
        for name in measured.keys() {
            let mut other = measured.clone();
            let q = other.get_mut(name).unwrap();
            let place = q.numbers.iter().position(|x| *x != 0.0).unwrap();
            q.numbers[place] = q.numbers[place].next_up();
            let rows = part.compare("spin", "cpu", &other);
            assert_eq!(rows.len(), 1, "{name}: {rows:?}");
            assert!(rows[0].counts && rows[0].quantity == *name);
        }
    }

    #[test]
    fn how_far_a_change_goes_is_said_with_the_parameter() {
        let of = |e: f64| Quantity {
            keys: vec!["a".into(), "e".into()],
            numbers: vec![1.0, e],
            values: [("a".into(), vec![1.0]), ("e".into(), vec![e])].into(),
            square: false,
        };
        let part = part(&[("gradient".into(), of(2.0))].into());
        let rows = part.compare("spin", "cpu", &[("gradient".into(), of(2.002))].into());
        assert_eq!(rows[0].far, "1.0e-3 (e)");
        let mut more = of(2.0);
        more.keys.insert(1, "b".into());
        more.numbers.insert(1, 7.0);
        more.values.insert("b".into(), vec![7.0]);
        let rows = part.compare("spin", "cpu", &[("gradient".into(), more)].into());
        assert_eq!((rows[0].far.as_str(), rows[0].counts), ("the same; new beside it: b", false));
        let rows = part.compare("spin", "cpu", &[("gradient".into(), Quantity::default())].into());
        assert!(rows[0].counts && rows[0].far == "without a, e", "{rows:?}");
    }

    #[test]
    fn a_file_is_read_as_it_was_written() {
        let q = Quantity { numbers: vec![0.1], values: [("x".into(), vec![0.1, -1e-300])].into(), ..Quantity::default() };
        let store = Store { backends: [("cpu".into(), part(&[("cost".into(), q)].into()))].into() };
        let file = tempfile::NamedTempFile::new().unwrap();
        store.write(file.path()).unwrap();
        assert_eq!(Store::read(file.path()).unwrap(), store);
    }
}

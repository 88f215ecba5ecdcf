//! Marks of guesses: a comment `# guess: …` above the key.

use crate::capture::Guess;
use toml_edit::{DocumentMut, Item, Table};

/// The text of a TOML file with a comment above the key of every guess, and lines about the whole at its head.
///
/// # Errors
/// The text is no TOML.
pub fn mark(text: &str, guesses: &[(&str, &Guess)], head: &[String]) -> Result<String, toml_edit::TomlError> {
    let mut doc: DocumentMut = text.parse()?;
    let mut head: Vec<String> = head.iter().map(|h| format!("# {h}\n")).collect();
    for (key, guess) in guesses {
        let comment = format!("# guess: {}\n", guess.line());
        if !mark_one(doc.as_table_mut(), key, &comment) {
            head.push(comment);
        }
    }
    Ok(format!("{}{}{doc}", head.concat(), if head.is_empty() { "" } else { "\n" }))
}

/// Puts a comment above a key; false where the key is not there.
fn mark_one(table: &mut Table, path: &str, comment: &str) -> bool {
    let (first, rest) = path.split_once('.').map_or((path, None), |(a, b)| (a, Some(b)));
    match (table.get_mut(first), rest) {
        (Some(Item::Table(t)), Some(rest)) => mark_one(t, rest, comment),
        (Some(Item::Table(t)), None) => {
            let before = t.decor().prefix().and_then(|p| p.as_str()).unwrap_or("\n").to_string();
            t.decor_mut().set_prefix(format!("{before}{comment}"));
            true
        }
        (Some(Item::ArrayOfTables(a)), rest) => {
            let (number, rest) = rest.map_or(("0", None), |r| r.split_once('.').map_or((r, None), |(n, r)| (n, Some(r))));
            let Some(t) = number.parse().ok().and_then(|n: usize| a.get_mut(n)) else { return false };
            match rest {
                Some(rest) => mark_one(t, rest, comment),
                None => {
                    let before = t.decor().prefix().and_then(|p| p.as_str()).unwrap_or("\n").to_string();
                    t.decor_mut().set_prefix(format!("{before}{comment}"));
                    true
                }
            }
        }
        (Some(Item::Value(_)), _) => {
            let Some(mut key) = table.key_mut(first) else { return false };
            let before = key.leaf_decor().prefix().and_then(|p| p.as_str()).unwrap_or("").to_string();
            key.leaf_decor_mut().set_prefix(format!("{before}{comment}"));
            true
        }
        _ => false,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn comments_stand_above_their_keys() {
        let text = "a = 1\n\n[time]\nstart = 0.5\n\n[[camera]]\nname = \"x\"\npose = [\n  1,\n]\n";
        let g = |what| Guess::scene(what, "", "because", "--flag");
        let (a, b, c, d) = (g("A"), g("B"), g("C"), g("D"));
        let marked =
            mark(text, &[("time.start", &a), ("camera.0.pose", &b), ("camera", &c), ("none", &d)], &["x".into()]).unwrap();
        let expected = "# x\n# guess: D: because; fix with --flag\n\na = 1\n\n[time]\n# guess: A: because; fix with --flag\nstart = 0.5\n\n\
                        # guess: C: because; fix with --flag\n[[camera]]\nname = \"x\"\n# guess: B: because; fix with --flag\npose = [\n  1,\n]\n";
        assert_eq!(marked, expected);
    }
}

//! What pages show is what the program does: every command in a block `sh` is run, in order, in a folder of its own, and what a block `text` behind it
//! shows is compared.
//!
//! A page makes its own input. A block behind `<!-- file: NAME -->` becomes that file, one behind `<!-- append to: NAME -->` is added to it; `assets` lies in
//! the folder, as in a clone. A line of output may leave something out (`…`), and so may a block between two lines. Numbers agree within three in a hundred:
//! another processor rounds otherwise. Times are not compared.
//!
//! Blocks behind `<!-- slow -->` go to a shell, and run in a slow test only.

use std::ffi::OsStr;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

/// Largest relative difference of two numbers. What stands in pages differs by the fourth digit between processors; errors of errors by the second.
const CLOSE: f64 = 0.03;

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

/// The program: the one named by `PALPATE_BINARY`, or the one built with this test.
fn program() -> PathBuf {
    std::env::var_os("PALPATE_BINARY").map_or_else(|| env!("CARGO_BIN_EXE_palpate").into(), PathBuf::from)
}

/// Parts that a page breaks a line into, at most.
const BROKEN: usize = 5;

/// What stands above a slow block.
const SLOW_MARK: &str = "<!-- slow -->";

/// A code block: language, the comment above it, its lines.
struct Block {
    language: String,
    comment: String,
    text: String,
    line: usize,
}

fn blocks(page: &str) -> Vec<Block> {
    let mut all = Vec::new();
    let (mut open, mut comment) = (None::<Block>, String::new());
    for (i, line) in page.lines().enumerate() {
        if let Some(mut block) = open.take() {
            if line.starts_with("```") {
                all.push(block);
            } else {
                block.text.push_str(line);
                block.text.push('\n');
                open = Some(block);
            }
        } else if let Some(language) = line.strip_prefix("```") {
            open = Some(Block {
                language: language.into(),
                comment: std::mem::take(&mut comment),
                text: String::new(),
                line: i + 1,
            });
        } else {
            comment = line.strip_prefix("<!-- ").and_then(|l| l.strip_suffix(" -->")).unwrap_or("").into();
        }
    }
    all
}

fn copy(from: &Path, to: &Path) {
    fs::create_dir_all(to).unwrap();
    for entry in fs::read_dir(from).unwrap().map(Result::unwrap) {
        let target = to.join(entry.file_name());
        if entry.path().is_dir() {
            copy(&entry.path(), &target);
        } else {
            fs::copy(entry.path(), target).unwrap();
        }
    }
}

/// Words of a command line; quotes of both kinds hold words together, and ` #` begins a comment.
fn words(line: &str) -> Vec<String> {
    let (mut all, mut word, mut quote) = (Vec::new(), None::<String>, None);
    for c in line.chars().chain([' ']) {
        match (quote, c) {
            (Some(q), _) if c == q => quote = None,
            (None, '"' | '\'') => {
                quote = Some(c);
                word.get_or_insert_default();
            }
            (None, '#') if word.is_none() => break,
            (None, _) if c.is_whitespace() => all.extend(word.take()),
            _ => word.get_or_insert_default().push(c),
        }
    }
    all
}

/// A number and what surrounds it, as in `(noise` or `1253,`.
fn number(word: &str) -> Option<(&str, f64, &str)> {
    let start = word.find(|c: char| c.is_ascii_digit() || c == '-')?;
    let end = word.rfind(|c: char| c.is_ascii_digit())? + 1;
    let value = word.get(start..end)?.parse().ok()?;
    Some((&word[..start], value, &word[end..]))
}

/// Whether two rows of words are the same, but for rounding and times.
fn same(expected: &[&str], said: &[&str]) -> bool {
    expected.len() == said.len()
        && (0..said.len()).all(|i| match (number(expected[i]), number(said[i])) {
            (Some(a), Some(b)) => {
                let unit = said.get(i + 1).is_some_and(|u| u.trim_end_matches([',', ';', ')']) == "s");
                let time = unit && i > 0 && (said[i - 1] == "in" || said[i - 1].ends_with(','));
                let close = (a.1 - b.1).abs() <= CLOSE * a.1.abs().max(b.1.abs());
                (a.0, a.2) == (b.0, b.2) && (time || close)
            }
            _ => expected[i] == said[i],
        })
}

/// Whether a line of output is the one that a page shows: its first part is the beginning, the last one the end, and others lie between in order.
fn shows(expected: &str, said: &str) -> bool {
    let said: Vec<&str> = said.split_whitespace().collect();
    let parts: Vec<Vec<&str>> = expected.split('…').map(|part| part.split_whitespace().collect()).collect();
    let [first, between @ .., last] = &parts[..] else { return same(&parts[0], &said) };
    let Some(mut left) = said.len().checked_sub(first.len() + last.len()).map(|n| &said[first.len()..first.len() + n]) else {
        return false;
    };
    let ends = same(first, &said[..first.len()]) && same(last, &said[said.len() - last.len()..]);
    ends && between.iter().all(|part| {
        let at = (0..(left.len() + 1).saturating_sub(part.len())).find(|&i| same(part, &left[i..i + part.len()]));
        at.is_some_and(|i| {
            left = &left[i + part.len()..];
            true
        })
    })
}

/// A command that works in the folder of a page.
fn in_folder(name: impl AsRef<OsStr>, folder: &Path) -> Command {
    let mut command = Command::new(name);
    command.current_dir(folder).env_remove("PALPATE_ADAPTER").env("XDG_RUNTIME_DIR", std::env::temp_dir());
    // What memory a fit takes grows with its threads. Pages show two, and other tests beside this one leave it one.
    command.env("RAYON_NUM_THREADS", "2");
    command
}

/// What a command says.
fn say(mut command: Command, place: &str) -> String {
    let answer = command.output().unwrap_or_else(|e| panic!("{place}: {command:?}: {e}"));
    let said = [answer.stderr, answer.stdout].map(|b| String::from_utf8(b).expect("UTF-8")).concat();
    assert!(answer.status.success(), "{place}: {command:?}\n{said}");
    said
}

/// Finds every line of a block in what was said, in order.
fn compare(block: &str, output: &str, place: &str) {
    let shown: Vec<&str> = block.lines().filter(|l| l.trim() != "…" && !l.trim().is_empty()).collect();
    let (mut rest, mut i) = (output.lines(), 0);
    while i < shown.len() {
        // A page breaks long lines.
        let found = (i + 1..=shown.len().min(i + BROKEN)).find_map(|j| {
            let line = shown[i..j].join(" ");
            rest.clone().position(|said| shows(&line, said)).map(|at| (j, at))
        });
        let (next, at) = found.unwrap_or_else(|| panic!("{place}: the page shows\n{}\nand palpate says\n{output}", shown[i]));
        rest.nth(at);
        i = next;
    }
}

/// Runs the page, with its slow blocks or without, and returns how many blocks and commands it has.
fn run(name: &str, slow: bool) -> usize {
    let page = fs::read_to_string(root().join(name)).unwrap();
    let stem = Path::new(name).file_stem().unwrap().to_str().unwrap();
    let above = Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("pages-{stem}-{}-{slow}", std::process::id()));
    let folder = above.join("clone");
    for input in ["assets", "tests/export"] {
        copy(&root().join(input), &folder.join(input));
    }
    #[cfg(unix)]
    if slow {
        // Measured recordings lie beside the clone.
        let recordings = root().join("../shared").canonicalize().expect("the recordings");
        std::os::unix::fs::symlink(recordings, above.join("shared")).unwrap();
    }
    let path = std::env::var("PATH").unwrap_or_default();
    let path = format!("{}:{path}", program().parent().expect("it lies in a folder").display());
    let (mut output, mut count) = (String::new(), 0);
    for block in blocks(&page) {
        let place = format!("{name}:{}", block.line);
        if let Some(file) = block.comment.strip_prefix("file: ") {
            fs::write(folder.join(file), &block.text).unwrap();
        } else if let Some(file) = block.comment.strip_prefix("append to: ") {
            match fs::read_to_string(folder.join(file)) {
                Ok(old) => fs::write(folder.join(file), old + "\n" + &block.text).unwrap(),
                // What is added to may be made by a slow block.
                Err(e) => assert!(!slow && page.contains(SLOW_MARK), "{place}: {file}: {e}"),
            }
        } else if block.language == "sh" && block.comment == "slow" {
            output.clear();
            if slow {
                let mut command = in_folder("sh", &folder);
                command.args(["-e", "-c", &block.text]).env("PATH", &path);
                output = say(command, &place);
                count += 1;
            }
        } else if block.language == "sh" {
            output.clear();
            for line in block.text.replace("\\\n", " ").lines().filter(|l| !l.trim().is_empty()) {
                let words = words(line);
                assert_eq!(words.first().map(String::as_str), Some("palpate"), "{place}: only palpate is run: {line}");
                let mut command = in_folder(program(), &folder);
                command.args(&words[1..]);
                output += &say(command, &place);
                count += 1;
            }
        } else if block.language == "text" && !output.is_empty() {
            compare(&block.text, &output, &place);
            output.clear();
        }
    }
    fs::remove_dir_all(&above).unwrap();
    count
}

#[test]
fn the_ten_minutes_go_as_the_page_says() {
    assert_eq!(run("docs/ten-minutes.md", false), 7);
}

#[test]
fn the_effect_is_found_as_the_page_says() {
    assert_eq!(run("docs/an-effect.md", false), 3);
}

/// Commands of other pages that are marked to be run. Long fits are left to tests of their own: `tests/cli/fitting.rs` has that of the README.
#[test]
fn commands_of_other_pages_run() {
    let commands: usize = other_pages().iter().map(|page| run(page, false)).sum();
    assert!(commands >= OTHERS, "{commands} commands");
}

#[test]
// Three minutes: fits, diagnoses and tracked images.
#[ignore = "slow: cargo xtask test --full"]
fn slow_commands_of_pages_run() {
    let slow = other_pages().into_iter().filter(|p| fs::read_to_string(root().join(p)).unwrap().contains(SLOW_MARK));
    let commands: usize = slow.map(|page| run(&page, true)).sum();
    assert!(commands >= SLOW, "{commands} commands");
}

fn other_pages() -> Vec<String> {
    let mut pages: Vec<String> = fs::read_dir(root().join("docs"))
        .unwrap()
        .map(|e| format!("docs/{}", e.unwrap().file_name().to_str().unwrap()))
        .filter(|n| n.ends_with(".md") && !["docs/ten-minutes.md", "docs/an-effect.md"].contains(&n.as_str()))
        .collect();
    pages.push("README.md".into());
    pages.sort();
    pages
}

/// So many there are at least.
const OTHERS: usize = 6;
/// So many blocks and commands of pages with slow ones.
const SLOW: usize = 15;

#[test]
fn lines_are_compared_as_readers_compare_them() {
    let line = "  residual: 1.511 mm now (1.496 mm from noise), 12296 points in 8.2 s";
    assert!(shows(line, "residual: 1.512 mm now (1.495 mm from noise), 12290 points in 99 s"));
    assert!(!shows(line, "residual: 1.611 mm now (1.495 mm from noise), 12290 points in 99 s"));
    assert!(!shows(line, "residual: 1.511 m now (1.496 mm from noise), 12296 points in 8.2 s"));
    assert!(shows("wrote … files", "wrote 3 and 4 files") && !shows("wrote … files", "wrote 3 and 4 places"));
    assert!(shows("a … c … e …", "a b c d e f") && !shows("a … e … c …", "a b c d e f") && !shows("a … a", "a"));
    assert!(!shows("± 0.1 s", "± 0.2 s"));
    assert_eq!(
        words("palpate fit a.toml --camera \"eye=1 fov=2\"   # a comment"),
        ["palpate", "fit", "a.toml", "--camera", "eye=1 fov=2"]
    );
}

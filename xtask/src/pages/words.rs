//! How long the sentences of a page are.
//!
//! A sentence ends with a full stop, a question mark or an exclamation mark before a blank, unless a small letter follows. A paragraph, an item of a
//! list and a cell of a table end one too. What stands between blanks is a word, signs of formulas too. Code blocks and headings are not counted; cells
//! are, but not in the average, which short ones would flatter.

use super::outside_code;

/// Most words of one sentence.
const LONGEST: usize = 40;
/// Most words of a page's mean sentence.
const MEAN: f64 = 20.0;
/// A page of fewer sentences has no mean.
const FEW: usize = 5;

/// Words that end with a full stop and end no sentence: abbreviations, and titles of journals.
const ABBREVIATED: [&str; 29] = [
    "e.g.", "i.e.", "al.", "cf.", "Fig.", "Figs.", "Eq.", "Eqs.", "Sec.", "Sci.", "Math.", "Soc.", "Comput.", "Phil.", "Trans.",
    "Graph.", "Sem.", "Abh.", "Acad.", "Appl.", "Mech.", "Eng.", "Stat.", "Vis.", "Fluids.", "Numer.", "Phys.", "Proc.", "vs.",
];

/// A sentence.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Sentence {
    /// Line where its paragraph begins.
    pub line: usize,
    /// Its number of words.
    pub words: usize,
    /// Its first words.
    pub beginning: String,
    /// True for one in a table.
    pub cell: bool,
}

/// A paragraph, an item or a cell: line, text, and whether it is a cell.
type Block = (usize, String, bool);

fn is_marker(word: &str) -> bool {
    let digits = word.trim_end_matches('.');
    ["-", "*", "+"].contains(&word)
        || (digits.len() < word.len() && !digits.is_empty() && digits.chars().all(|c| c.is_ascii_digit()))
}

fn blocks(text: &str) -> Vec<Block> {
    let mut all: Vec<Block> = Vec::new();
    let mut open = false;
    let mut before = 0;
    for (number, line) in outside_code(text) {
        // A code block in between ends a paragraph too.
        open &= number == before + 1;
        before = number;
        let line = line.trim();
        let picture = line.starts_with("![") && line.ends_with(')');
        if line.is_empty() || line.starts_with('#') || line.starts_with("<!--") || picture {
            open = false;
            continue;
        }
        if line.starts_with('|') {
            open = false;
            if !line.chars().all(|c| "|-: ".contains(c)) {
                let cells = line.trim_matches('|').replace("\\|", "¦");
                all.extend(cells.split('|').map(|cell| (number, cell.trim().to_string(), true)));
            }
            continue;
        }
        let (first, rest) = line.split_once(' ').unwrap_or((line, ""));
        let (item, content) = if is_marker(first) { (true, rest) } else { (false, line.trim_start_matches(['>', ' '])) };
        match all.last_mut() {
            Some(last) if open && !item => {
                last.1.push(' ');
                last.1.push_str(content);
            }
            _ => all.push((number, content.to_string(), false)),
        }
        open = true;
    }
    all
}

/// The text without the addresses of its links and without pictures.
fn without_addresses(text: &str) -> String {
    let mut out = String::new();
    let mut rest = text;
    while let Some(at) = rest.find("](") {
        out.push_str(&rest[..at]);
        let address = &rest[at + 2..];
        rest = address.find(')').map_or("", |end| &address[end + 1..]);
    }
    out + rest
}

/// Whether a sentence ends with this word, which another one follows.
fn ends(word: &str, next: &str) -> bool {
    let bare = word.trim_end_matches(['*', '_', '"', '”', '’', ')', '`', ']']);
    // An initial, as in "J. R. Stat. Soc.", and no symbol at the end of a sentence.
    let initial = bare.chars().count() == 2 && bare.starts_with(char::is_alphabetic) && next.contains('.');
    let abbreviated = ABBREVIATED.contains(&bare.trim_start_matches(['(', '*', '_']));
    bare.ends_with(['.', '?', '!'])
        && !initial
        && !abbreviated
        && (next.starts_with(['`', '['])
            || next == "palpate"
            || !next.trim_start_matches(['*', '_', '"', '“', '(', '[']).starts_with(|c: char| c.is_ascii_lowercase()))
}

/// All sentences of a page.
pub fn sentences(text: &str) -> Vec<Sentence> {
    let mut all = Vec::new();
    for (line, text, cell) in blocks(text) {
        let text = without_addresses(&text);
        let words: Vec<&str> = text.split_whitespace().collect();
        let mut begin = 0;
        for i in 0..words.len() {
            if i + 1 == words.len() || ends(words[i], words[i + 1]) {
                let beginning = words[begin..words.len().min(begin + 8)].join(" ");
                all.push(Sentence { line, words: i + 1 - begin, beginning, cell });
                begin = i + 1;
            }
        }
    }
    all
}

/// Sentences of a page that are too long, and a mean that is.
pub fn check(name: &str, text: &str, found: &mut Vec<String>) {
    let all = sentences(text);
    for s in all.iter().filter(|s| s.words > LONGEST) {
        found.push(format!("{name}:{}: a sentence of {} words (at most {LONGEST}): \"{} …\"", s.line, s.words, s.beginning));
    }
    let prose: Vec<f64> = all.iter().filter(|s| !s.cell).map(|s| s.words as f64).collect();
    let mean = prose.iter().sum::<f64>() / prose.len().max(1) as f64;
    if prose.len() >= FEW && mean > MEAN {
        found.push(format!("{name}: {mean:.1} words in the mean sentence (at most {MEAN})"));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn lengths(text: &str) -> Vec<usize> {
        sentences(text).iter().map(|s| s.words).collect()
    }

    #[test]
    fn sentences_end_where_a_reader_ends_them() {
        assert_eq!(lengths("# A heading\n\nOne two three.\nFour *five.* Six. palpate [a](b) c\n"), [3, 2, 1, 3]);
        assert_eq!(
            lengths("It is 0.5 m, see Fig. 3 of Weiss et al. (2020), e.g. there. And h. next. The E. Then J. R. Soc. 3"),
            [14, 3, 2, 5]
        );
        assert_eq!(
            lengths("- one two\n- three\n  four\n1. five six\n\nSeven\n```\nno words here\n```\neight nine\n"),
            [2, 2, 2, 1, 2]
        );
        assert_eq!(lengths("See [the page](a.md#b c) now. `code` too.\n![a picture](b.png)\n"), [4, 2]);
        let cells: Vec<_> = sentences("| a b | c |\n|---|---|\n| dd. E f | g |\n").iter().map(|s| (s.words, s.cell)).collect();
        assert_eq!(cells, [(2, true), (1, true), (1, true), (2, true), (1, true)]);
    }

    #[test]
    fn long_sentences_are_named_and_so_is_a_long_mean() {
        let said = |text: &str| {
            let mut found = Vec::new();
            check("a.md", text, &mut found);
            found
        };
        let of = |words: usize| "word ".repeat(words - 1) + "word.";
        assert!(said(&of(LONGEST)).is_empty());
        let long = said(&format!("First.\n\n{}\n", of(LONGEST + 1)));
        assert!(long.len() == 1 && long[0].starts_with("a.md:3: a sentence of 41 words"), "{long:?}");
        assert!(said(&format!("| {} |\n", of(LONGEST + 1))).len() == 1);
        // Capitals, so that each is a sentence of its own.
        let page = |words: usize| format!("Word {}\n\n", of(words - 1)).repeat(FEW);
        assert!(said(&page(20)).is_empty());
        assert_eq!(said(&page(21)), ["a.md: 21.0 words in the mean sentence (at most 20)"]);
    }
}

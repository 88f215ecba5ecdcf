//! Every object that is made on the device has a label, so that errors of drivers and captures of a frame name it.

use std::fs;
use std::path::{Path, PathBuf};

/// Calls that take a descriptor with a label.
const CALLS: [&str; 3] = [".create_", ".begin_compute_pass(", ".request_device("];
/// Descriptors that have none.
const WITHOUT: [&str; 1] = ["InstanceDescriptor"];

/// A text up to the bracket that closes its first one, which it holds.
fn closed(text: &str) -> &str {
    let mut depth = 0;
    for (i, c) in text.char_indices() {
        match c {
            '{' | '(' | '[' => depth += 1,
            '}' | ')' | ']' => depth -= 1,
            _ => continue,
        }
        if depth == 0 {
            return &text[..=i];
        }
    }
    text
}

/// Line of a place in a text.
fn line(text: &str, at: usize) -> usize {
    1 + text[..at].matches('\n').count()
}

/// Field `label` of a descriptor: `label`, `label: Some(…)`, or what else stands there.
fn label_of(descriptor: &str) -> Option<&str> {
    let fields = descriptor.strip_prefix('{')?;
    let mut depth = 0;
    let inner = fields.split(|c: char| {
        depth += i32::from("{([".contains(c)) - i32::from("})]".contains(c));
        c == ',' && depth == 0
    });
    inner.map(|f| f.trim().trim_end_matches('}').trim()).find(|f| f.split(':').next().is_some_and(|name| name.trim() == "label"))
}

/// Lines of a source that make something without a label.
fn unlabelled(text: &str) -> Vec<usize> {
    // Comments are blanked, so that lines keep their numbers.
    let text: String = text.lines().map(|l| format!("{}\n", if l.trim_start().starts_with("//") { "" } else { l })).collect();
    let mut out = Vec::new();
    for (at, _) in text.match_indices("Descriptor {") {
        let start = text[..at].rfind(|c: char| !c.is_alphanumeric()).map_or(0, |i| i + 1);
        let known = WITHOUT.iter().any(|w| text[start..].starts_with(w));
        let label = label_of(closed(&text[at + "Descriptor ".len()..]));
        // A name that is bound to no label is found below.
        if !known && !label.is_some_and(|l| l == "label" || (l.contains("Some(") && !l.contains("\"\""))) {
            out.push(line(&text, at));
        }
    }
    // What a call is given is written there, or has been under the name `descriptor`.
    for (at, _) in CALLS.iter().flat_map(|c| text.match_indices(c)) {
        let given = text[at..].split_once('(').map_or("", |c| c.1).trim_start().trim_start_matches('&');
        let (path, rest) =
            given.split_at(given.find(|c: char| !(c.is_alphanumeric() || ":_".contains(c))).unwrap_or(given.len()));
        if path != "descriptor" && !(path.ends_with("Descriptor") && rest.starts_with(" {")) {
            out.push(line(&text, at));
        }
    }
    // Ways to no label that the above would take for one.
    for way in ["label = None", "label: None", "Descriptor::default()"] {
        out.extend(text.match_indices(way).map(|(at, _)| line(&text, at)));
    }
    out.sort_unstable();
    out.dedup();
    out
}

/// Source files below a folder.
fn sources(folder: &Path) -> Vec<PathBuf> {
    let entries = fs::read_dir(folder).unwrap_or_else(|e| panic!("{}: {e}", folder.display()));
    entries
        .flat_map(|e| {
            let path = e.unwrap_or_else(|e| panic!("{e}")).path();
            if path.is_dir() { sources(&path) } else { vec![path] }
        })
        .filter(|p| p.extension().is_some_and(|e| e == "rs"))
        .collect()
}

#[test]
fn everything_made_on_the_device_has_a_label() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let mut made = 0;
    // This file holds what must be found by the other test.
    for path in sources(&root).iter().filter(|p| !p.ends_with("tests/labels.rs")) {
        let text = fs::read_to_string(path).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
        assert_eq!(unlabelled(&text), Vec::<usize>::new(), "{}", path.display());
        made += CALLS.iter().map(|c| text.matches(c).count()).sum::<usize>();
    }
    println!("{made} calls that make something");
    assert!(made >= 14, "{made}");
}

#[test]
fn something_without_a_label_is_found() {
    let whole =
        "fn f() {\n    let b = device.create_buffer(&wgpu::BufferDescriptor { label: Some(name), size: f(8, 9), usage });\n}\n";
    assert_eq!(unlabelled(whole), Vec::<usize>::new());
    for wrong in ["label: None", "size: 8", "label: Some(\"\")", "label: name", "..Default::default()"] {
        assert_eq!(unlabelled(&whole.replace("label: Some(name)", wrong)), [2], "{wrong}");
    }
    let calls = [
        "device.create_command_encoder(&Default::default());",
        "device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());",
        "encoder.begin_compute_pass(&Default::default());",
        "device.create_texture(&given);",
        "device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {\n    extra: X { label: Some(name) },\n});",
        "adapter.request_device(&wgpu::DeviceDescriptor::default());",
        "let label = None;",
    ];
    for wrong in calls {
        assert_eq!(unlabelled(wrong), [1], "{wrong}");
    }
    let shorter =
        "let label = Some(source.name);\nlet l = device.create_x(&wgpu::XDescriptor {\n    label,\n    entries: &[],\n});";
    assert_eq!(unlabelled(shorter), Vec::<usize>::new());
}

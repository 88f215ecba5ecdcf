//! `palpate inspect --devices`: the graphics adapters of this machine and what they can run.

use crate::cli::Console;
use crate::results;
use crate::results::devices::{Device, DevicesDocument};
use palpate_gpu::{AdapterReport, adapters};

/// Bytes in the largest unit that leaves a number of at least one.
fn bytes(n: u64) -> String {
    let units = [(1 << 30, "GiB"), (1 << 20, "MiB"), (1 << 10, "KiB")];
    let (size, unit) = units.into_iter().find(|(size, _)| n >= *size).unwrap_or((1, "B"));
    format!("{:.4} {unit}", n as f64 / size as f64).replace(".0000", "")
}

fn kind(a: &AdapterReport) -> &'static str {
    match format!("{:?}", a.kind).as_str() {
        "DiscreteGpu" => "discrete GPU",
        "IntegratedGpu" => "integrated GPU",
        "VirtualGpu" => "virtual GPU",
        "Cpu" => "software",
        _ => "other",
    }
}

/// Limits that decide how large a body and batch may be.
fn limits(a: &AdapterReport) -> [(&'static str, u64, String); 5] {
    let l = &a.limits;
    let count = |n: u32| (u64::from(n), n.to_string());
    let size = |n: u64| (n, bytes(n));
    let entry = |name, (n, text): (u64, String)| (name, n, text);
    [
        entry("max_storage_buffer_binding_size", size(l.max_storage_buffer_binding_size)),
        entry("max_buffer_size", size(l.max_buffer_size)),
        entry("max_storage_buffers_per_shader_stage", count(l.max_storage_buffers_per_shader_stage)),
        entry("max_compute_invocations_per_workgroup", count(l.max_compute_invocations_per_workgroup)),
        entry("max_compute_workgroup_storage_size", size(u64::from(l.max_compute_workgroup_storage_size))),
    ]
}

fn verdict(a: &AdapterReport) -> String {
    match &a.refusal {
        None => "runs every kernel".into(),
        Some(e) => format!("cannot be used: {e}"),
    }
}

fn device(a: &AdapterReport) -> Device {
    Device {
        index: a.index,
        pci: a.pci.map(|p| p.to_string()),
        name: a.name.clone(),
        kind: kind(a).into(),
        api: format!("{:?}", a.api),
        usable: a.refusal.is_none(),
        verdict: verdict(a),
        subgroups: a.subgroups,
        timestamps: a.timestamps,
        limits: limits(a).into_iter().map(|(name, number, _)| (name.to_string(), number)).collect(),
    }
}

/// Prints the list; an empty one says what to do.
pub fn run(console: &mut Console) -> i32 {
    let found = adapters();
    if console.json() {
        console.print(&results::line(&DevicesDocument { devices: found.iter().map(device).collect() }));
        return 0;
    }
    if found.is_empty() {
        console.print(
            "no graphics adapter; --backend cpu needs none. Install a Vulkan driver to use a GPU (on Debian and Ubuntu \
             mesa-vulkan-drivers also brings a software adapter)",
        );
        return 0;
    }
    let yes = |b: bool| if b { "yes" } else { "no" };
    let text = found.iter().map(|a| {
        let place = a.pci.map_or_else(|| "no PCI address".into(), |p| format!("PCI {p}"));
        let about = format!("{}  {}\n   {}, {:?}, {place}", a.index, a.name, kind(a), a.api);
        let mut lines = vec![about, format!("   {}", verdict(a))];
        let lanes = if a.subgroups { "subgroups" } else { "workgroup memory (no subgroups of eight lanes)" };
        lines.push(format!("   lanes of a cell talk by {lanes}; passes can be timed: {}", yes(a.timestamps)));
        lines.extend(limits(a).into_iter().map(|(k, _, text)| format!("   {k:38} {text}")));
        lines.join("\n")
    });
    let mut list: Vec<String> = text.collect();
    list.push("PALPATE_ADAPTER chooses one by its number, its PCI address, or a part of its name".into());
    console.print(&list.join("\n"));
    0
}

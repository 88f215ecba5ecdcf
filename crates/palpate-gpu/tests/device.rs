//! The device: what is listed, what is refused, and that both ways for lanes to talk work.

use palpate_gpu::{Choice, Gpu, GpuError, Lanes, adapters};

#[test]
fn a_wrong_name_lists_what_there_is() {
    let error = Gpu::open(&Choice::Named("no such adapter".into())).unwrap_err();
    let GpuError::NoAdapter { wanted, found } = &error else { panic!("{error}") };
    assert_eq!(wanted.as_deref(), Some("no such adapter"));
    // A driver is missing where there is no adapter at all; elsewhere the names are what helps.
    let hint = error.hint();
    assert!(hint.contains("--backend cpu") && found.iter().all(|name| hint.contains(name)), "{hint}");
    assert_eq!(hint.contains("install a Vulkan driver"), found.is_empty(), "{hint}");
    let none = GpuError::NoAdapter { wanted: None, found: Vec::new() };
    assert!(none.hint().contains("install a Vulkan driver"), "{}", none.hint());
}

#[test]
fn every_usable_adapter_opens_by_its_name() {
    let all = adapters();
    let usable: Vec<_> = all.iter().filter(|a| a.refusal.is_none()).collect();
    if usable.is_empty() {
        let refusals: Vec<_> = all.iter().filter_map(|a| a.refusal.as_ref()).collect();
        assert!(std::env::var("PALPATE_GPU").as_deref() != Ok("require"), "no usable adapter: {refusals:?}");
        println!("skipped: no usable adapter");
    }
    for a in usable {
        let name = a.name.split(" (").next().unwrap_or(&a.name).to_string();
        let gpu = Gpu::open(&Choice::Named(name)).unwrap_or_else(|e| panic!("{e}"));
        println!("{} {:?} {:?} timestamps {:?}", gpu.name, gpu.kind, a.api, gpu.tick());
        for lanes in [Lanes::Memory, Lanes::Subgroup] {
            if lanes == Lanes::Memory || a.subgroups {
                Gpu::open_with(&Choice::Named(gpu.name.clone()), Some(lanes)).unwrap_or_else(|e| panic!("{e}"));
            }
        }
    }
}

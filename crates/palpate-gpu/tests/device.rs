//! The device: what is listed, what is refused, and that both ways for lanes to talk work.

use palpate_gpu::{Choice, Gpu, GpuError, Lanes, adapters};

#[test]
fn a_wrong_name_lists_what_there_is() {
    let error = Gpu::open(&Choice::Named("no such adapter".into())).unwrap_err();
    assert!(matches!(&error, GpuError::NoAdapter { wanted: Some(w), .. } if w == "no such adapter"), "{error}");
    assert!(error.hint().contains("--backend cpu"));
}

#[test]
fn every_usable_adapter_opens_by_its_name() {
    for a in adapters().iter().filter(|a| a.refusal.is_none()) {
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

//! The device: what is listed, what is refused, and that both ways for lanes to talk work.

use palpate_gpu::{Choice, Gpu, GpuError, Lanes, PciAddress, adapters};

#[test]
fn a_choice_is_an_index_a_place_on_the_bus_or_a_part_of_a_name() {
    let at = |domain, bus, device, function| Choice::Pci(PciAddress { domain, bus, device, function });
    let named = |name: &str| Choice::Named(name.into());
    for (text, choice) in [
        ("", Choice::Auto),
        (" ", Choice::Auto),
        ("0", Choice::Index(0)),
        ("07", Choice::Index(7)),
        ("15", Choice::Index(15)),
        // A part of "GeForce RTX 4090".
        ("4090", named("4090")),
        ("llvmpipe", named("llvmpipe")),
        ("0000:01:00.0", at(0, 1, 0, 0)),
        ("00000000:C1:00.0", at(0, 0xc1, 0, 0)),
        ("10de:af:1f.7", at(0x10de, 0xaf, 0x1f, 7)),
        ("01:00.0", at(0, 1, 0, 0)),
        ("1:2:3:4.0", named("1:2:3:4.0")),
        ("001:00.0", named("001:00.0")),
        ("+1:00.0", named("+1:00.0")),
        ("LLVM 15.0", named("LLVM 15.0")),
        ("-1", named("-1")),
    ] {
        assert_eq!(Choice::parse(text), choice, "{text:?}");
    }
    let place = PciAddress::parse("C1:0a.0").expect("a place");
    assert_eq!(place.to_string(), "0000:c1:0a.0");
    assert_eq!(PciAddress::parse(&place.to_string()), Some(place));
}

/// Two equal cards differ in number and place alone.
#[test]
fn of_two_equal_cards_each_can_be_meant() {
    let Some(first) = adapters().into_iter().next() else {
        println!("skipped: no adapter to make twins of");
        return;
    };
    let place = |bus| PciAddress { domain: 0, bus, device: 0, function: 0 };
    let twins = [0, 1].map(|k| palpate_gpu::AdapterReport { index: k, pci: Some(place(k as u8)), ..first.clone() });
    let meant = |text: &str| twins.each_ref().map(|t| t.is_meant(&Choice::parse(text)));
    assert_eq!(meant("1"), [false, true]);
    assert_eq!(meant("00000000:00:00.0"), [true, false]);
    assert_eq!(meant("0000:01:00.0"), [false, true]);
    assert_eq!(meant("0000:02:00.0"), [false, false]);
    assert_eq!((meant(""), meant(&first.name)), ([true, true], [true, true]));
}

#[test]
fn a_wrong_choice_lists_what_there_is() {
    let nowhere = PciAddress { domain: 0xffff, bus: 0xff, device: 0x1f, function: 7 };
    for (choice, told) in [
        (Choice::Named("no such adapter".into()), "no graphics adapter with \"no such adapter\" in its name (found: "),
        (Choice::Index(99), "no graphics adapter with the index 99 (found: "),
        (Choice::Pci(nowhere), "no graphics adapter at the PCI address ffff:ff:1f.7 (found: "),
    ] {
        let error = Gpu::open(&choice).unwrap_err();
        assert!(error.to_string().starts_with(told), "{error}");
        let GpuError::NoAdapter { wanted, found } = &error else { panic!("{error}") };
        assert_eq!((wanted, found.len()), (&choice, adapters().len()));
        // A driver is missing where there is no adapter at all; elsewhere the names are what helps.
        let hint = error.hint();
        assert!(hint.contains("--backend cpu") && found.iter().all(|name| hint.contains(name)), "{hint}");
        assert_eq!(hint.contains("install a Vulkan driver"), found.is_empty(), "{hint}");
        assert_eq!(hint.contains("an index, a PCI address or a part of a name"), !found.is_empty(), "{hint}");
    }
    let none = GpuError::NoAdapter { wanted: Choice::Auto, found: Vec::new() };
    assert_eq!(none.to_string(), "no graphics adapter (found: none)");
    assert!(none.hint().contains("install a Vulkan driver"), "{}", none.hint());
}

#[test]
fn every_usable_adapter_opens_by_its_name_its_index_and_its_place() {
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
        for choice in [Some(Choice::Index(a.index)), a.pci.map(Choice::Pci)].into_iter().flatten() {
            let opened = Gpu::open(&choice).unwrap_or_else(|e| panic!("{e}"));
            assert!(a.is_meant(&choice) && a.name.starts_with(&opened.name), "{choice:?} opens {}", opened.name);
        }
        for lanes in [Lanes::Memory, Lanes::Subgroup] {
            if lanes == Lanes::Memory || a.subgroups {
                Gpu::open_with(&Choice::Named(gpu.name.clone()), Some(lanes)).unwrap_or_else(|e| panic!("{e}"));
            }
        }
    }
}

//! Every kernel is valid WGSL, in both variants: with subgroups, and with workgroup memory on adapters that have none.

#[path = "../../validate.rs"]
pub(super) mod validate;

use crate::device::Lanes;
use crate::device::pipelines::PASSES;
use validate::validate;

pub(super) const VARIANTS: [Lanes; 2] = [Lanes::Subgroup, Lanes::Memory];

#[test]
fn both_variants_of_every_pass_are_valid() {
    for pass in &PASSES {
        for (lanes, source) in VARIANTS.into_iter().zip(pass.sources) {
            let (module, _) =
                validate(source, lanes == Lanes::Subgroup).unwrap_or_else(|e| panic!("{} ({lanes:?}): {e}", pass.name));
            let entries: Vec<&str> = module.entry_points.iter().map(|e| e.name.as_str()).collect();
            assert_eq!(entries, [pass.name]);
        }
        assert_eq!(pass.lanes, pass.sources[0] != pass.sources[1], "{}", pass.name);
    }
    assert!(PASSES.iter().any(|p| p.lanes));
}

#[test]
fn a_subgroup_call_in_the_variant_without_subgroups_is_refused() {
    let call = "let planted = subgroupShuffleXor(1u, 1u);\n    ";
    let mut planted = 0;
    for pass in PASSES.iter().filter(|p| p.lanes) {
        let [with, without] = pass.sources;
        // What the other variant is made of.
        assert!(with.contains("subgroup") && !without.contains("subgroup"), "{}", pass.name);
        validate(with, false).err().unwrap_or_else(|| panic!("{} needs no subgroups", pass.name));
        // One call at the start of the entry point.
        let start = without.find(&format!("fn {}(", pass.name)).unwrap_or_else(|| panic!("{} has no entry", pass.name));
        let body = start + without[start..].find("{\n").unwrap_or_else(|| panic!("{} has no body", pass.name)) + 2;
        let wrong = format!("{}    {call}{}", &without[..body], &without[body..].trim_start());
        let refusal = validate(&wrong, false).err().unwrap_or_else(|| panic!("{}: the planted call passes", pass.name));
        assert!(refusal.to_lowercase().contains("subgroup"), "{}: {refusal}", pass.name);
        // It is the capability that is missing, nothing else.
        validate(&wrong, true).unwrap_or_else(|e| panic!("{}: {e}", pass.name));
        planted += 1;
    }
    assert!(planted > 5, "{planted}");
}

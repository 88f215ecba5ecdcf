//! Contact of surface patches with planes.

use super::{Along, Past, Pull, Term};
use crate::device::pipelines::pass;
use crate::device::pipelines::shared::{asks, structs};
use crate::passes::{ALL, Passes, Per};

pub(super) struct Contact;

impl Passes<'_, '_> {
    /// What planes do to patches at the new state.
    pub(crate) fn touch(&mut self, section: u32) {
        self.run(pass::TOUCH_PATCHES, section, Per::Patch, 0);
    }

    /// True where planes or effects on patches see the past's place of a patch.
    pub(super) fn patches_see_past(&self) -> bool {
        self.world.geometry.shape.fields & structs::FIELD_COUPLED != 0
    }
}

impl Term for Contact {
    fn residual(&self, s: &mut Passes, section: u32) {
        s.touch(section);
    }

    fn tangent(&self, s: &mut Passes, section: u32) {
        // Where effects add to it: anew, because the convex part may be wanted after the exact one was taken.
        if s.world.geometry.effects.on_patches() {
            s.touch(section);
        }
    }

    fn by_past(&self, s: &mut Passes, past: &Past) {
        if s.patches_see_past() {
            s.run_with(pass::TOUCH_PATCHES, ALL, Per::Patch, asks::TOUCH_OLD, &past.named());
        }
    }

    fn by_coefficients(&self, s: &mut Passes, along: &Along) {
        if along.patches {
            s.run_with(pass::PUSH_PATCHES, ALL, Per::Patch, along.flags, &along.named);
        } else if along.gathered {
            s.run(pass::TOUCH_PATCHES, ALL, Per::Patch, asks::NO_TOUCH);
        }
    }

    fn by_coefficients_transposed(&self, s: &mut Passes, pull: &Pull) {
        let scales = s.world.plan.planes.iter().any(|p| p.stiffness.is_none());
        let sought = pull.sought();
        if s.world.geometry.shape.planes != 0 && (sought.planes || (sought.modulus && scales)) {
            s.run_with(pass::PULL_PATCHES, ALL, Per::Patch, 0, &pull.named);
        }
    }
}

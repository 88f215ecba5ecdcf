//! Laws of points: what effects do to patches of the surface and to nodes, one pass an effect.

use super::{Along, Past, Pull, Term, bit};
use crate::device::pipelines::pass;
use crate::device::pipelines::shared::points::{AT_CONTACT, AT_NODES, COLUMN, FORCE, QUESTION_AT, STIFFNESS};
use crate::device::pipelines::shared::pulls::{ROW_AT, SEEK_AT, SEEK_GRAVITY, SEEK_OWN, SEEK_PLANES, SEEK_STIFFNESS, SEEK_TIME};
use crate::device::recorder::Named;
use crate::passes::{ALL, Passes, Per};
use crate::world::World;
use palpate_model::params::coefficients::Sought;

/// Effects on patches, at planes and elsewhere; they add to what planes left there.
pub(super) struct SurfaceLaws;

/// Effects on nodes.
pub(super) struct NodeLaws;

/// True when laws of points depend on what changes.
pub(super) fn change(world: &World, moved: &Sought) -> bool {
    let points = &world.geometry.effects.points;
    let shared = moved.gravity || moved.modulus || moved.start || moved.planes;
    !points.is_empty() && (shared || points.iter().any(|p| moved.effects[p.0]))
}

impl Passes<'_, '_> {
    /// Asks every effect on nodes and adds its answer to `forces`, or to the matrix.
    fn press_nodes(&mut self, section: u32, question: u32, forces: &wgpu::Buffer, more: &Named) {
        let named: Vec<_> = more.iter().copied().chain([("forces", forces)]).collect();
        self.press(pass::PRESS_NODES, Per::Node, [section, question], &named);
    }

    /// Asks every effect on patches and adds its answer to what the planes' pass left.
    fn press_patches(&mut self, section: u32, question: u32, more: &Named) {
        self.press(pass::PRESS_PATCHES, Per::Patch, [section, question], more);
    }

    fn press(&mut self, pass: usize, per: Per, [section, question]: [u32; 2], more: &Named) {
        let world = self.world;
        for (k, (_, site)) in world.geometry.effects.points.iter().enumerate() {
            if (site.site == AT_NODES) == matches!(per, Per::Node) {
                self.run_with(pass, section, per, k as u32 + (question << QUESTION_AT), more);
            }
        }
    }

    /// One pass an effect, by all that it depends on.
    fn pull_points(&mut self, pass: usize, per: Per, pull: &Pull) {
        let (world, sought) = (self.world, pull.sought());
        for (k, ((number, site), first)) in world.geometry.effects.points.iter().zip(&pull.sums.points).enumerate() {
            // What does nothing depends on nothing but its own numbers.
            let acts = !world.is_absent(*number);
            let what = bit(sought.effects[*number], SEEK_OWN)
                | bit(sought.gravity && acts, SEEK_GRAVITY)
                | bit(sought.modulus && acts, SEEK_STIFFNESS)
                | bit(sought.start && acts, SEEK_TIME)
                | bit(sought.planes && site.site == AT_CONTACT && acts, SEEK_PLANES);
            if what != 0 && (site.site == AT_NODES) == matches!(per, Per::Node) {
                self.run_with(pass, ALL, per, k as u32 | what << SEEK_AT | first << ROW_AT, &pull.named);
            }
        }
    }
}

impl Term for SurfaceLaws {
    fn residual(&self, s: &mut Passes, section: u32) {
        s.press_patches(section, FORCE, &[]);
    }

    fn tangent(&self, s: &mut Passes, section: u32) {
        s.press_patches(section, STIFFNESS, &[]);
    }

    fn by_past(&self, s: &mut Passes, past: &Past) {
        if s.patches_see_past() {
            s.press_patches(ALL, past.question(), &past.named());
        }
    }

    fn by_coefficients(&self, s: &mut Passes, along: &Along) {
        if along.patches {
            s.press_patches(ALL, COLUMN, &along.named);
        }
    }

    fn by_coefficients_transposed(&self, s: &mut Passes, pull: &Pull) {
        s.pull_points(pass::PULL_PATCH_LAWS, Per::Patch, pull);
    }
}

impl Term for NodeLaws {
    fn residual(&self, s: &mut Passes, section: u32) {
        s.press_nodes(section, FORCE, &s.world.buffers["residual"], &[]);
    }

    fn tangent(&self, s: &mut Passes, section: u32) {
        s.press_nodes(section, STIFFNESS, &s.world.buffers["column"], &[]);
    }

    fn by_past(&self, s: &mut Passes, past: &Past) {
        s.press_nodes(ALL, past.question(), past.to, &past.named());
    }

    fn by_coefficients(&self, s: &mut Passes, along: &Along) {
        if along.points {
            s.press_nodes(ALL, COLUMN, &s.world.buffers["column"], &along.named);
        }
    }

    fn by_coefficients_transposed(&self, s: &mut Passes, pull: &Pull) {
        s.pull_points(pass::PULL_NODE_LAWS, Per::Node, pull);
    }
}

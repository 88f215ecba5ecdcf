//! How long the loops of one invocation may be, and how many columns are solved for at the same time.

use crate::device::GpuError;

/// Loop iterations that one invocation may use up in one dispatch: lavapipe silently stops at 65,535.
pub(crate) const LOOPS: u64 = 32_000;
/// Most columns of a member (derivatives by so many parameters) that are solved for at the same time.
const COLUMNS: u64 = 8;

/// Columns that a batch of so many members is solved for at the same time: one workgroup lists them all.
pub(crate) fn columns(members: u64) -> u64 {
    (MOST_SYSTEMS / members.max(1)).clamp(1, COLUMNS)
}

/// Loop iterations of a listing for 64 systems, members and columns, and beside that.
const LISTING: [u64; 2] = [7, 64];
/// Systems that it can list.
pub(crate) const MOST_SYSTEMS: u64 = (LOOPS - LISTING[1]) / LISTING[0] * 64;

/// What the loops of the kernels of a step run over, at most.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Most {
    pub(crate) members: u64,
    pub(crate) nodes: u64,
    /// Blocks of a row of the matrix.
    pub(crate) row: u64,
    /// Patches and clamp cells of a cell.
    pub(crate) supports: u64,
    pub(crate) planes: u64,
    pub(crate) obstacles: u64,
    pub(crate) jets: u64,
    /// Patches that jets may blow on, entries of the deformation at one, and those that have a node.
    pub(crate) patches: u64,
    pub(crate) frame: u64,
    pub(crate) framed: u64,
    /// Planes at which effects on contact are asked.
    pub(crate) pressed: u64,
    pub(crate) masses: u64,
    /// Entries of a stencil.
    pub(crate) stencil: u64,
    /// Elastic points and patches that have a node, and that make a block.
    pub(crate) valence: u64,
    pub(crate) pairs: u64,
    /// Stars that have a node, and nodes of an elastic point.
    pub(crate) stars: u64,
    pub(crate) star: u64,
    /// Clamps that hold a node.
    pub(crate) holders: u64,
    /// Numbers of effects on clamps, those that change matrices twice.
    pub(crate) grips: u64,
    /// Numbers of effects that change the stiffness in time.
    pub(crate) aging: u64,
    /// Groups of nodes of the preconditioner's second level, and nodes of the largest.
    pub(crate) groups: u64,
    pub(crate) group: u64,
    /// Iterations of conjugate gradients in one dispatch, by one workgroup and by those that stay.
    pub(crate) chunk: u64,
    pub(crate) stay: u64,
    /// Many workgroups share the solve of a member.
    pub(crate) many: bool,
}

impl Most {
    /// Nodes that a lane of a workgroup of 256 goes through.
    pub(crate) fn share(&self) -> u64 {
        self.nodes.div_ceil(256)
    }

    /// Of one iteration of conjugate gradients in one workgroup, or of a look at the true residual: rows with their blocks and point masses, three
    /// sweeps, two sums, and the second level of the preconditioner, four lanes a group.
    pub(super) fn of_iteration(&self) -> u64 {
        1 + self.share() * (self.row + 4 + (1 + 2 * self.stencil) * self.masses) + 20 + self.restriction() + self.correction()
    }

    /// Of one iteration by workgroups that stay, if one alone had all slices and groups: a look at how far it is, rows with eight lanes each, and each
    /// group's motion.
    pub(super) fn of_staying(&self) -> u64 {
        let slices = self.nodes.div_ceil(32) + self.groups;
        let of_slice = 1 + self.row + (1 + 2 * self.stencil) * self.masses + 8 + 16;
        let of_group = 1 + self.groups.div_ceil(64) * (1 + self.group.div_ceil(32)) + self.group.div_ceil(64) + 4 * 8;
        40 + self.groups.div_ceil(64) + slices.div_ceil(64) + slices * of_slice + self.groups * of_group
    }

    /// Of the groups' forces, by one workgroup.
    fn restriction(&self) -> u64 {
        self.groups.div_ceil(64) * (1 + self.group.div_ceil(4))
    }

    /// Of the groups' motions, by one workgroup.
    fn correction(&self) -> u64 {
        self.groups.div_ceil(64) * (1 + self.groups.div_ceil(4))
    }

    /// Upper bounds of the loop iterations of one invocation, by kernel; `tests/loops.rs` compares them with the shaders.
    pub(crate) fn loops(&self) -> [(&'static str, u64); 38] {
        [
            ("list_members", (columns(self.members) * self.members).div_ceil(64) * LISTING[0] + LISTING[1]),
            (
                "iterate_cg",
                if self.many { 0 } else { self.chunk * self.of_iteration() + 2 * self.share() + self.correction() + 10 },
            ),
            ("look_cg", if self.many { 0 } else { self.of_iteration() + self.share() + 30 }),
            // Parts of nodes in one workgroup.
            ("begin_solve", 2 * self.nodes.div_ceil(64 * 256) + 30),
            // Parts of slices, and for every group its own.
            (
                "advance_cg",
                (self.nodes.div_ceil(32) + self.groups).div_ceil(64)
                    + self.groups.div_ceil(64) * (1 + self.group.div_ceil(32))
                    + self.group.div_ceil(64)
                    + 60,
            ),
            // Waits in vain end all of it, and others are short.
            ("persist_cg", self.stay * self.of_staying() + 40),
            ("step_back", 3 * self.row + 20),
            // An effect is asked up to six times for derivatives by all its inputs, and some laws several times in a step.
            ("press_patches", 410 * self.pressed.max(1) + 2 * self.stencil + 84),
            ("touch_patches", (1 + palpate_model::mechanics::contact::INSTANTS as u64) * self.planes + 2 * self.stencil + 4),
            // Twice a spline of 4 × 4 × 4 samples, and the instants of a step.
            ("press_obstacles", 60 * self.obstacles + 2 * self.stencil + 4),
            ("pull_obstacles", 60 * self.obstacles + 2 * self.stencil + 4),
            ("aim_jets", self.frame + self.jets * (1 + self.stencil)),
            ("frame_jets", self.jets * (self.patches.div_ceil(64) + 9)),
            // A patch looks for the one before it among all.
            ("see_jets", self.frame + self.jets * (1 + self.stencil + self.patches)),
            ("press_jets", 2 * self.frame + self.stencil + self.jets * (1 + self.stencil) + 3),
            ("pull_jets", self.frame + self.stencil + self.jets * (1 + self.stencil)),
            ("turn_jets", self.framed),
            // Once for each input, all planes together, and once for each of a plane's own numbers.
            ("pull_patch_laws", 1000 * self.pressed.max(1) + 2 * self.stencil + 684),
            ("pull_patches", (9 + palpate_model::mechanics::contact::INSTANTS as u64) * self.planes + 2 * self.stencil + 24),
            ("pull_holds", 2 * (27 * self.grips + 60) + self.aging + 100),
            // Rotations by Jacobi's method at up to three states, and sums over the corners of a cell.
            ("pull_cells", 2600 + self.aging),
            ("gather_matrix", 8 * (4 + 2 * self.supports) + 12),
            ("spread_elastic", self.valence),
            ("gather_elastic", 10 * self.pairs + 12),
            // Nine derivatives by hyper-dual numbers, or a rotation by Jacobi's method.
            ("tangent_elastic", 9 * 800 + 20 * self.stencil),
            ("brace_stars", self.stars * (self.star + 1)),
            ("push_stars", self.stars * (self.star + 1 + self.aging)),
            ("pull_stars", self.star * (self.star + 1) + self.aging),
            ("place_held", self.holders * (1 + self.holders)),
            ("pull_elastic", 2 * (800 + self.stencil) + self.stencil + self.aging + 40),
            // Laws of cells at up to three states of an element, by every number.
            ("push_tet_laws", 2 * (1300 + 2 * self.stencil) + self.aging + 10),
            ("pull_tet_laws", 3 * (2200 + 2 * self.stencil) + self.stencil + self.aging + 10),
            ("push_held", self.holders * 4 + self.aging + self.grips * (2 + self.holders) + 10),
            ("pull_held", self.holders * 4 + 10 * self.aging + self.grips * (20 + self.holders) + 40),
            ("pull_densities", self.stencil * (self.stencil + 1)),
            ("push_nodes", 60 + 2 * self.row + (4 + 2 * self.stencil) * self.masses),
            ("push_cells", 2600 + 2 * self.supports + self.aging),
            ("push_holds", 2 * (2 * self.grips + 10 * self.grips + 60) + self.aging + 60),
        ]
    }
}

/// Refuses sizes at which an invocation of some kernel could loop longer than every adapter allows.
pub(super) fn check_loops(most: &Most) -> Result<(), GpuError> {
    match most.loops().into_iter().find(|l| l.1 > LOOPS) {
        None => Ok(()),
        Some((what, needed)) => {
            let limit = "loop iterations of one invocation";
            Err(GpuError::Limit { limit, available: LOOPS, needed, what: format!("the kernel `{what}`") })
        }
    }
}

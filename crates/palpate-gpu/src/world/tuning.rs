//! Ways to solve: one or many workgroups a member, with an assembled matrix or without.

use crate::device::GpuError;

/// From so many nodes on, many workgroups share the conjugate gradients of a member: one workgroup alone then cannot draw a
/// device's memory bandwidth. Below, a graphics processor is asked which is faster, for bodies that are not tiny; on a software adapter three
/// dispatches an iteration cost more than they save.
pub const MANY: usize = 4096;
/// How A p is computed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Product {
    /// With the assembled, blocked matrix.
    Matrix,
    /// From the element matrices, cell by cell.
    Free,
}

impl Product {
    /// As `PALPATE_GPU_PRODUCT` has it.
    pub const fn name(self) -> &'static str {
        match self {
            Product::Matrix => "csr",
            Product::Free => "free",
        }
    }

    /// The one of a name.
    pub(crate) fn named(name: &str) -> Option<Product> {
        [Product::Matrix, Product::Free].into_iter().find(|p| p.name() == name)
    }
}

/// What is given instead of chosen.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Tuning {
    /// Nodes from which on many workgroups share a solve.
    pub many_from: usize,
    /// `None` = whichever is faster on the device.
    pub product: Option<Product>,
    /// So many workgroups at most stay for all iterations of a member's linear solve (`solve/stay.rs`); 0 = every iteration has dispatches of its own.
    pub crew: u32,
}

impl Default for Tuning {
    fn default() -> Tuning {
        Tuning { many_from: MANY, product: None, crew: 0 }
    }
}

impl Tuning {
    /// As `PALPATE_GPU_CG` (one, many, stay) and `PALPATE_GPU_PRODUCT` (csr, free) say.
    ///
    /// # Errors
    /// They say something else.
    pub fn from_env() -> Result<Tuning, GpuError> {
        let get = |name| std::env::var(name).unwrap_or_default();
        Tuning::parse(&get("PALPATE_GPU_CG"), &get("PALPATE_GPU_PRODUCT"))
    }

    pub(crate) fn parse(cg: &str, product: &str) -> Result<Tuning, GpuError> {
        let wrong = |name, value: &str, allowed| GpuError::Setting { name, value: value.into(), allowed };
        Ok(Tuning {
            many_from: match cg {
                "" => MANY,
                "one" => usize::MAX,
                "many" | "stay" => 0,
                _ => return Err(wrong("PALPATE_GPU_CG", cg, "one, many, stay")),
            },
            crew: if cg == "stay" { u32::MAX } else { 0 },
            product: match product {
                "" => None,
                name => Some(Product::named(name).ok_or_else(|| wrong("PALPATE_GPU_PRODUCT", name, "csr, free"))?),
            },
        })
    }
}

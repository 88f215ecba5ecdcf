//! Judgement by one quantity: the expected log predictive density of data left out.
//!
//! A model M, linear around its fit, leaves residuals of cells (in units of their noise)
//!
//! ```text
//! y = −Σ_q a_q c_q − Σ_k s_k d_k + g + ε
//! ```
//!
//! with ε the noise, N(0, 1) in every cell; c_q its free numbers' columns; d_k the fields of errors that every model has (`Field`: what finer
//! computations change, s_k ~ N(1, 1), and half of it anew in every block, along the field and in any direction; systematic errors of the
//! recording, s_k ~ N(0, 1)); and g one discrepancy, N(0, τ²) in every block. Beside one size τ all of it is Gaussian, so that the density of a block under the other folds is a formula
//! ([`density`]). Sizes are mixed as predicts best ([`stack`]).
//!
//! ```text
//! elpd(M)  = Σ_blocks ln p(y_block | y of the other folds, M)          Vehtari, Gelman & Gabry, Stat. Comput. 27, 2017
//! S(M)     = elpd(M) + ln p(M)                                         ln p: [`prior`]
//! M°, M⁺   = the model as the whole truth (τ = 0), and beside a discrepancy of mixed size
//! ```
//!
//! Every decision of a diagnosis compares two such scores ([`rule`]).

pub mod density;
pub mod prior;
pub mod rule;
pub mod stack;

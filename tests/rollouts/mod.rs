//! Whole simulations: adjoint, sensitivities and differences agree.

mod gradients;

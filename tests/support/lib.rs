//! What the tests share: small plans, tolerances with their reasons.

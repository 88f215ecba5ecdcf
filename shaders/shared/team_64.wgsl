//! Lanes of a workgroup that sums (`shared/totals`).

const TEAM = 64u;

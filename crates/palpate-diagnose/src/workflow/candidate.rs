//! What tells hypotheses of a search apart.

/// Which hypothesis: a candidate by its place in the table, or a pair of them. Pairs come after all single ones, in the order of their
/// parts.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum CandidateId {
    Single(usize),
    /// The smaller number first.
    Pair(usize, usize),
}

impl CandidateId {
    /// Two single candidates as one, whichever comes first.
    pub fn pair(a: CandidateId, b: CandidateId) -> CandidateId {
        let first = |id| match id {
            CandidateId::Single(n) | CandidateId::Pair(n, _) => n,
        };
        let (a, b) = (first(a), first(b));
        CandidateId::Pair(a.min(b), a.max(b))
    }
}

#[cfg(test)]
mod tests {
    use super::CandidateId::{self, Pair, Single};

    #[test]
    fn pairs_come_after_single_ones_and_have_no_order_within() {
        assert_eq!(CandidateId::pair(Single(7), Single(2)), CandidateId::pair(Single(2), Single(7)));
        let mut all = [Pair(2, 7), Single(900), Pair(0, 30), Single(3), Pair(2, 5)];
        all.sort();
        assert_eq!(all, [Single(3), Single(900), Pair(0, 30), Pair(2, 5), Pair(2, 7)]);
    }
}

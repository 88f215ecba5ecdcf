//! Which frames belong to which step, member by member, in rounds that hold at most one frame of each member.

use super::shots::{node_count, row_count};
use crate::layout::Look;
use palpate_model::observation::instant::Instant;
use palpate_model::observation::{ReadingKind, Viewed};
use palpate_model::plan::Plan;

/// Looks that are worked on together: `count` of them from `first` on in the buffer of all looks.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Round {
    pub(crate) first: usize,
    pub(crate) count: usize,
    /// Most points, markers, observed nodes and scalar residuals of its frames.
    pub(crate) points: usize,
    pub(crate) markers: usize,
    pub(crate) nodes: usize,
    pub(crate) rows: usize,
}

/// All looks of a batch.
#[derive(Clone, Debug, Default)]
pub(crate) struct Agenda {
    pub(crate) looks: Vec<Look>,
    /// Rounds of every step.
    pub(crate) steps: Vec<Vec<Round>>,
}

impl Agenda {
    /// The looks of members that see these views, start at `starts` [s] on their recording's clock and have their first shots at `firsts`; at
    /// most `slots` in a round.
    pub(crate) fn new(plan: &Plan, views: &[Viewed], starts: &[f64], firsts: &[u32], slots: usize) -> Agenda {
        let mut agenda = Agenda::default();
        for k in 0..plan.clock.steps.max(1) {
            let of_member: Vec<Vec<Look>> = views
                .iter()
                .enumerate()
                .map(|(member, viewed)| {
                    let look = |at: &Instant| Look {
                        member: member as u32,
                        frame: at.frame as u32,
                        shot: firsts[member] + at.frame as u32,
                        pad: 0,
                        value: at.value.map(|f| f as f32),
                        rate: at.rate.map(|f| f as f32),
                        weights: weights(viewed, at.frame),
                    };
                    viewed.instants(plan.clock.step, starts[member], k).iter().map(look).collect()
                })
                .collect();
            let most = of_member.iter().map(Vec::len).max().unwrap_or(0);
            let mut rounds = Vec::new();
            for r in 0..most {
                let together: Vec<Look> = of_member.iter().filter_map(|looks| looks.get(r).copied()).collect();
                for part in together.chunks(slots.max(1)) {
                    rounds.push(Round::new(plan, views, agenda.looks.len(), part));
                    agenda.looks.extend_from_slice(part);
                }
            }
            agenda.steps.push(rounds);
        }
        agenda
    }
}

/// 1/(n σ²) of every kind of readings in a frame [1/m²]: depth points, markers, tracked points, displacements.
fn weights(viewed: &Viewed, frame: usize) -> [f32; 4] {
    let kinds = [ReadingKind::Depth, ReadingKind::Marker, ReadingKind::Track, ReadingKind::Displacement];
    kinds.map(|kind| {
        let noise = viewed.observation().noise_in(&viewed.observation().frames[frame], kind);
        (viewed.scale() / (noise * noise)) as f32
    })
}

impl Round {
    fn new(plan: &Plan, views: &[Viewed], first: usize, looks: &[Look]) -> Round {
        let mut round = Round { first, count: looks.len(), ..Round::default() };
        for look in looks {
            let f = &views[look.member as usize].observation().frames[look.frame as usize];
            round.points = round.points.max(f.points.len());
            round.markers = round.markers.max(f.markers.len());
            round.nodes = round.nodes.max(node_count(plan, f));
            round.rows = round.rows.max(row_count(plan, f));
        }
        round
    }

    /// The same round in parts of at most `count` looks.
    pub(crate) fn parts(self, count: usize) -> impl Iterator<Item = Round> {
        let size = count.max(1);
        (0..self.count).step_by(size).map(move |i| Round { first: self.first + i, count: size.min(self.count - i), ..self })
    }
}

//! The peers' figures: measured elsewhere, for comparison. Not ours, and not on this machine.

use super::BenchModel;

/// Figures for one number of agents (ms per control step).
#[derive(Clone, Copy, Debug)]
pub(super) struct PeerFigures {
    pub(super) agents: u32,
    /// BotNet as published, propagation only, one process, no RPC, Python 3.11 on a 2-core AMD EPYC: full, disk, randomness
    /// (its distance mended).
    botnet: [Option<f64>; 3],
    /// Table I of the BotNet paper (arXiv 2108.13606).
    paper: Option<f64>,
    /// What this program is to reach: full, disk, randomness.
    to_reach: [Option<f64>; 3],
}

impl PeerFigures {
    pub(super) fn for_agents(agents: u32) -> Option<&'static Self> {
        ROWS.iter().find(|figures| figures.agents == agents)
    }

    /// Ten thousand robots are measured with the disk alone: the other models look at all pairs.
    pub(super) fn measures(&self, model: BenchModel) -> bool {
        self.agents < 10_000 || model == BenchModel::Disk
    }

    pub(super) fn botnet_ms(&self, model: BenchModel) -> Option<f64> {
        self.botnet[model as usize]
    }

    pub(super) fn paper_ms(&self, model: BenchModel) -> Option<f64> {
        self.paper.filter(|_| model == BenchModel::Full)
    }

    pub(super) fn goal_ms(&self, model: BenchModel) -> Option<f64> {
        self.to_reach[model as usize]
    }
}

const fn row(
    agents: u32,
    botnet: Option<[f64; 3]>,
    paper: Option<f64>,
    to_reach: [Option<f64>; 3],
) -> PeerFigures {
    let botnet = match botnet {
        Some([full, disk, randomness]) => [Some(full), Some(disk), Some(randomness)],
        None => [None; 3],
    };
    PeerFigures { agents, botnet, paper, to_reach }
}

const fn all(limit: f64) -> [Option<f64>; 3] {
    [Some(limit); 3]
}

/// The table's rows.
pub(super) const ROWS: [PeerFigures; 8] = [
    row(5, Some([0.26, 0.26, 0.34]), Some(0.85), all(0.12)),
    row(10, Some([0.48, 0.47, 0.56]), Some(1.6), all(0.13)),
    row(50, Some([2.6, 2.3, 2.7]), Some(8.3), all(0.2)),
    row(100, Some([5.8, 4.6, 5.9]), Some(17.9), all(0.3)),
    row(500, Some([55.0, 29.0, 63.0]), Some(154.0), [Some(2.0), None, None]),
    row(1000, Some([167.0, 69.0, 187.0]), Some(560.0), [Some(6.0), Some(2.0), None]),
    row(2500, Some([802.0, 260.0, 1321.0]), Some(2273.0), [Some(30.0), Some(5.0), Some(80.0)]),
    row(10_000, None, None, [None, Some(25.0), None]),
];

//! What became of a mote's application packets, as cells of its row.

use crate::table::Cell;
use metrics::kpi::{LATENCY_QUANTILES, MotePackets, PacketAccount};

/// A mote's packets as last reported. They are kept because quantiles take sorting, and in most steps no packet of a mote arrives.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct PacketCells {
    delivered: u64,
    latency_s: [Option<f64>; LATENCY_QUANTILES.len()],
}

impl PacketCells {
    /// The columns from `delivered` to `mean_hops`.
    pub(super) fn cells(&mut self, account: &PacketAccount, mote: usize) -> [Cell<'static>; 8] {
        if account.is_empty() {
            return [Cell::Null; 8];
        }
        let packets = account.of_mote(mote);
        let [delivered, dropped] =
            packets.map_or([0; 2], |packets| [packets.delivered, packets.dropped]);
        if let (Some(packets), true) = (packets, delivered != self.delivered) {
            self.delivered = delivered;
            self.latency_s = packets.latency_quantiles_s(LATENCY_QUANTILES.map(|(_, level)| level));
        }
        let number = |value: Option<f64>| Cell::or_null(value, Cell::F64);
        let [median, p95, p99, longest] = self.latency_s.map(number);
        [
            Cell::U64(delivered),
            Cell::U64(dropped),
            number(packets.and_then(MotePackets::mean_latency_s)),
            median,
            p95,
            p99,
            longest,
            number(packets.and_then(MotePackets::mean_hops)),
        ]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proto::types::{PacketKind, Packets};

    const S: u64 = 1_000_000_000;

    /// Packets of mote 1 to mote 0 that took so many seconds; 0: dropped.
    fn packets(seconds: &[u64]) -> Packets {
        let n = seconds.len();
        Packets {
            id: (0..n as u64).collect(),
            kind: vec![0; n],
            source: vec![1; n],
            destination: vec![0; n],
            created_ns: vec![5 * S; n],
            ended_ns: seconds.iter().map(|&s| (5 + s) * S).collect(),
            hops: vec![2; n],
            payload_bytes: vec![90; n],
            outcome: seconds.iter().map(|&s| u32::from(s == 0)).collect(),
            kinds: vec![PacketKind { name: "app".to_owned(), is_application: true, created: 9 }],
            reasons: vec!["max_retries".to_owned()],
        }
    }

    #[test]
    fn a_row_tells_what_became_of_the_motes_packets_until_then() {
        let (mut account, mut told) = (PacketAccount::default(), [PacketCells::default(); 2]);
        assert_eq!(told[1].cells(&account, 1), [Cell::Null; 8]);
        account.add(&packets(&[2, 0]));
        let number = Cell::F64;
        let two = number(2.0);
        assert_eq!(
            told[1].cells(&account, 1),
            [Cell::U64(1), Cell::U64(1), two, two, two, two, two, two]
        );
        account.add(&packets(&[8]));
        let after = told[1].cells(&account, 1);
        assert_eq!(after[..4], [Cell::U64(2), Cell::U64(1), number(5.0), number(5.0)]);
        assert_eq!(after[6..], [number(8.0), two]);
        assert_eq!(told[1].cells(&account, 1), after);
        assert_eq!(told[0].cells(&account, 0)[..3], [Cell::U64(0), Cell::U64(0), Cell::Null]);
    }
}

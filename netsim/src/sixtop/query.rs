//! COUNT and LIST: RFC 8480, § 3.3.4 and § 3.3.5. Every scheduling function that uses 6P answers them with this.

use crate::mac::{Cell, Slotframe};
use crate::wire::Eui64;
use crate::wire::sixp::{
    AnswerContent, CellOptions, ReturnCode, SixpAnswer, SixpCell, SixpRequest,
};

/// Cells that one LIST response holds: 127 octets less 21 of MAC header, 2 of FCS, 6 of headers of information elements
/// and 4 of 6P leave room for 23 cells of 4 octets.
pub const MAX_LISTED: usize = 23;

/// The answer to COUNT or LIST from `peer`, given the slotframe in which cells are negotiated; `None` of other requests.
#[must_use]
pub fn answer(frame: &Slotframe, peer: Eui64, request: &SixpRequest) -> Option<SixpAnswer> {
    match request {
        SixpRequest::Count { options, .. } => {
            let n = matching(frame, peer, *options).count();
            let count = AnswerContent::Count(u16::try_from(n).unwrap_or(u16::MAX));
            Some(SixpAnswer { code: ReturnCode::Success, content: count })
        }
        SixpRequest::List { options, offset, max_num_cells, .. } => {
            let mut cells: Vec<SixpCell> = matching(frame, peer, *options).collect();
            cells.sort_unstable();
            let first = usize::from(*offset).min(cells.len());
            let room = usize::from(*max_num_cells).min(MAX_LISTED);
            let end = cells.len().min(first + room);
            let code = if end == cells.len() { ReturnCode::EndOfList } else { ReturnCode::Success };
            let content = AnswerContent::Cells(cells[first..end].to_vec());
            Some(SixpAnswer { code, content })
        }
        SixpRequest::Add(_)
        | SixpRequest::Delete(_)
        | SixpRequest::Relocate { .. }
        | SixpRequest::Clear { .. }
        | SixpRequest::Signal { .. } => None,
    }
}

/// Cells with `peer` that a bitmap selects: figure 8. Order is the slotframe's.
fn matching(
    frame: &Slotframe,
    peer: Eui64,
    options: CellOptions,
) -> impl Iterator<Item = SixpCell> {
    let selects = move |cell: &Cell| match options.0 & 7 {
        0 => true,
        // SHARED alone: whatever else they are.
        4 => cell.options.shared,
        bits => {
            let (tx, rx, shared) = (bits & 1 != 0, bits & 2 != 0, bits & 4 != 0);
            (cell.options.rx, cell.options.tx, cell.options.shared) == (tx, rx, shared)
        }
    };
    let with_peer = frame.cells().iter().filter(move |cell| cell.neighbour == Some(peer));
    with_peer
        .filter(move |cell| selects(cell))
        .map(|cell| SixpCell { slot: cell.slot, channel: cell.channel })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mac::{CellOptions as Own, Schedule};
    use proto::ids::MoteId;

    fn schedule() -> Schedule {
        let mut schedule = Schedule::new();
        schedule.add_slotframe(2, 101);
        let (peer, other) = (Some(Eui64::of_mote(MoteId(1))), Some(Eui64::of_mote(MoteId(2))));
        for (slot, channel, options, neighbour) in [
            (7, 9, Own::RX, peer),
            (1, 4, Own::RX, peer),
            (1, 3, Own::RX, peer),
            (5, 3, Own::TX, peer),
            (6, 0, Own::TX_SHARED, peer),
            (8, 0, Own::TX_RX_SHARED, peer),
            (9, 0, Own::RX, other),
        ] {
            schedule.add(2, Cell::new(slot, channel, options, neighbour)).unwrap();
        }
        schedule
    }

    fn ask(request: &SixpRequest) -> SixpAnswer {
        answer(schedule().slotframe(2).unwrap(), Eui64::of_mote(MoteId(1)), request).unwrap()
    }

    #[test]
    fn rfc8480_figure_8_count_selects_by_the_requesters_view_of_options() {
        for (bitmap, expected) in [(0, 6), (1, 3), (2, 1), (3, 0), (4, 2), (5, 0), (6, 1), (7, 1)] {
            let request = SixpRequest::Count { metadata: 0, options: CellOptions(bitmap) };
            let count = AnswerContent::Count(expected);
            assert_eq!(
                ask(&request),
                SixpAnswer { code: ReturnCode::Success, content: count },
                "bitmap {bitmap}"
            );
        }
    }

    #[test]
    fn rfc8480_3_3_5_list_ends_with_rc_eol_and_begins_anywhere() {
        let list = |offset, max_num_cells| {
            ask(&SixpRequest::List { metadata: 0, options: CellOptions(1), offset, max_num_cells })
        };
        let cells = |cells: &[(u16, u16)]| {
            let cells = cells.iter().map(|&(slot, channel)| SixpCell { slot, channel }).collect();
            AnswerContent::Cells(cells)
        };
        let [some, rest, beyond] = [list(0, 2), list(2, 2), list(9, 2)];
        assert_eq!(
            some,
            SixpAnswer { code: ReturnCode::Success, content: cells(&[(1, 3), (1, 4)]) }
        );
        assert_eq!(rest, SixpAnswer { code: ReturnCode::EndOfList, content: cells(&[(7, 9)]) });
        assert_eq!(beyond, SixpAnswer { code: ReturnCode::EndOfList, content: cells(&[]) });
    }
}

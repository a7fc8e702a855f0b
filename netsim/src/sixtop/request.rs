//! What a 6P request asks for: RFC 8480, § 3.3.

use crate::mac;
use crate::wire::sixp::{CellOptions, ReturnCode, SixpCell, SixpRequest};

/// Whether the responder proposes the cells, so that a confirmation follows (§ 3.1.2): ADD and DELETE without cells,
/// RELOCATE without candidates.
#[must_use]
pub(crate) fn is_three_step(request: &SixpRequest) -> bool {
    match request {
        SixpRequest::Add(body) | SixpRequest::Delete(body) => body.cells.is_empty(),
        SixpRequest::Relocate { candidates, .. } => candidates.is_empty(),
        SixpRequest::Count { .. }
        | SixpRequest::List { .. }
        | SixpRequest::Clear { .. }
        | SixpRequest::Signal { .. } => false,
    }
}

/// Whether schedules differ once it is complete. CLEAR aside, which both ends carry out whatever the other does.
#[must_use]
pub(crate) fn changes_cells(request: &SixpRequest) -> bool {
    matches!(request, SixpRequest::Add(_) | SixpRequest::Delete(_) | SixpRequest::Relocate { .. })
}

/// All cells it names.
pub fn cells(request: &SixpRequest) -> impl Iterator<Item = &SixpCell> {
    let (first, second): (&[SixpCell], &[SixpCell]) = match request {
        SixpRequest::Add(body) | SixpRequest::Delete(body) => (&body.cells, &[]),
        SixpRequest::Relocate { relocation, candidates, .. } => (relocation, candidates),
        SixpRequest::Count { .. }
        | SixpRequest::List { .. }
        | SixpRequest::Clear { .. }
        | SixpRequest::Signal { .. } => (&[], &[]),
    };
    first.iter().chain(second)
}

/// Whether a return code means that the transaction has failed (§ 3.4.7, § 6.2.4).
#[must_use]
pub(crate) fn is_error(code: ReturnCode) -> bool {
    !matches!(code, ReturnCode::Success | ReturnCode::EndOfList)
}

/// What is wrong with a request in itself, whatever the schedule: options that mean nothing (figure 7), lists shorter than
/// what is asked for (§ 3.3.1 to § 3.3.3).
#[must_use]
pub fn fault(request: &SixpRequest) -> Option<ReturnCode> {
    let (options, is_short) = match request {
        SixpRequest::Add(body) | SixpRequest::Delete(body) => {
            let is_short = !body.cells.is_empty() && body.cells.len() < usize::from(body.num_cells);
            (body.options, is_short)
        }
        SixpRequest::Relocate { options, num_cells, relocation, candidates, .. } => {
            let n = usize::from(*num_cells);
            let is_short =
                n == 0 || relocation.len() != n || (!candidates.is_empty() && candidates.len() < n);
            (*options, is_short)
        }
        SixpRequest::Count { .. }
        | SixpRequest::List { .. }
        | SixpRequest::Clear { .. }
        | SixpRequest::Signal { .. } => return None,
    };
    if options_here(options).is_none() {
        return Some(ReturnCode::Error);
    }
    is_short.then_some(ReturnCode::ErrorCellList)
}

const TX: u8 = 1;
const RX: u8 = 2;
const SHARED: u8 = 4;

/// Options of cells as the requester's bitmap, from its own options (§ 6.2.6).
#[must_use]
pub fn bitmap(options: mac::CellOptions) -> CellOptions {
    let bit = |is_set: bool, bit: u8| if is_set { bit } else { 0 };
    CellOptions(bit(options.tx, TX) | bit(options.rx, RX) | bit(options.shared, SHARED))
}

/// Options at the requester's end of cells with this bitmap; `None` if neither end would transmit in them.
#[must_use]
pub(crate) fn options_there(bitmap: CellOptions) -> Option<mac::CellOptions> {
    let has = |bit: u8| bitmap.0 & bit != 0;
    let options = mac::CellOptions { tx: has(TX), rx: has(RX), shared: has(SHARED) };
    (options.tx || options.rx).then_some(options)
}

/// Options at the responder's end of cells with this bitmap: what is sent there is received here (figure 7).
#[must_use]
pub(crate) fn options_here(bitmap: CellOptions) -> Option<mac::CellOptions> {
    options_there(bitmap).map(|there| mac::CellOptions { tx: there.rx, rx: there.tx, ..there })
}

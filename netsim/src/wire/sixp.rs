//! 6P messages: RFC 8480, § 3.2.

mod bytes;

pub use bytes::SixpCommand;

use serde::{Deserialize, Serialize};

/// A 6P message (RFC 8480, § 3.2).
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct SixpRepr {
    /// Version: 0.
    pub version: u8,
    /// Scheduling function: 0 is MSF (RFC 9033, § 16.1).
    pub sfid: u8,
    /// Sequence number of the transaction.
    pub seqnum: u8,
    /// Request, response or confirmation, with its contents.
    pub body: SixpBody,
}

/// What a 6P message says.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum SixpBody {
    /// Asks for something.
    Request(SixpRequest),
    /// Answers; completes a transaction of two steps.
    Response(SixpAnswer),
    /// Completes a transaction of three steps.
    Confirmation(SixpAnswer),
}

/// A 6P request, by command.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum SixpRequest {
    /// Add cells (§ 3.3.1).
    Add(CellRequest),
    /// Delete cells (§ 3.3.2).
    Delete(CellRequest),
    /// Move cells (§ 3.3.3).
    Relocate {
        /// Opaque to 6P.
        metadata: u16,
        /// Options of the cells.
        options: CellOptions,
        /// Number of cells to move.
        num_cells: u8,
        /// Cells to be moved.
        relocation: Vec<SixpCell>,
        /// Where to. Empty: the responder proposes, in three steps.
        candidates: Vec<SixpCell>,
    },
    /// How many cells are there (§ 3.3.4)?
    Count {
        /// Opaque to 6P.
        metadata: u16,
        /// Cells with these options.
        options: CellOptions,
    },
    /// Which cells are there (§ 3.3.5)?
    List {
        /// Opaque to 6P.
        metadata: u16,
        /// Cells with these options.
        options: CellOptions,
        /// Number of the first cell to be listed.
        offset: u16,
        /// Most cells in the answer.
        max_num_cells: u16,
    },
    /// Forget all cells with me (§ 3.3.6).
    Clear {
        /// Opaque to 6P.
        metadata: u16,
    },
    /// Whatever the scheduling function means by it (§ 3.3.7).
    Signal {
        /// Opaque to 6P.
        metadata: u16,
        /// Opaque to 6P.
        payload: Vec<u8>,
    },
}

/// Body of ADD and DELETE.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct CellRequest {
    /// Opaque to 6P: MSF puts the slotframe's handle in it.
    pub metadata: u16,
    /// Options of the cells, as the requester sees them.
    pub options: CellOptions,
    /// Number of cells to add or delete.
    pub num_cells: u8,
    /// From among these. Empty: the responder proposes, in three steps.
    pub cells: Vec<SixpCell>,
}

/// Options of a cell as a bitmap (§ 6.2.6): bit 0 TX, bit 1 RX, bit 2 shared.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub struct CellOptions(pub u8);

/// A cell: slot offset and channel offset.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub struct SixpCell {
    /// Slot offset within the slotframe.
    pub slot: u16,
    /// Channel offset, before hopping.
    pub channel: u16,
}

/// A response or confirmation.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct SixpAnswer {
    /// Success, or why the request was not carried out.
    pub code: ReturnCode,
    /// What else it carries.
    pub content: AnswerContent,
}

/// What an answer carries beside its code.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum AnswerContent {
    /// Nothing.
    Nothing,
    /// Cells: of ADD, DELETE, RELOCATE and LIST.
    Cells(Vec<SixpCell>),
    /// How many: of COUNT.
    Count(u16),
    /// Of SIGNAL.
    Payload(Vec<u8>),
}

/// Return codes (§ 6.2.4).
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[repr(u8)]
pub enum ReturnCode {
    /// RC_SUCCESS.
    Success = 0,
    /// RC_EOL: end of list.
    EndOfList = 1,
    /// RC_ERR: generic error.
    Error = 2,
    /// RC_RESET: critical error, reset.
    Reset = 3,
    /// RC_ERR_VERSION.
    ErrorVersion = 4,
    /// RC_ERR_SFID.
    ErrorSfid = 5,
    /// RC_ERR_SEQNUM.
    ErrorSeqnum = 6,
    /// RC_ERR_CELLLIST.
    ErrorCellList = 7,
    /// RC_ERR_BUSY.
    ErrorBusy = 8,
    /// RC_ERR_LOCKED.
    ErrorLocked = 9,
}

#[cfg(test)]
mod tests;

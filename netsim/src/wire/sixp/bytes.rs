//! Octets of 6P messages: RFC 8480, § 3.2.2 to 3.3.7. Multi-byte fields go least significant byte first, as in every
//! information element of IEEE Std 802.15.4.

use super::{
    AnswerContent, CellOptions, CellRequest, ReturnCode, SixpAnswer, SixpBody, SixpCell, SixpRepr,
    SixpRequest,
};
use crate::wire::Malformed;
use crate::wire::sink::{ByteReader, Put, Sink, bytes_of, length_of, write};

/// Types of messages (§ 6.2.2).
const REQUEST: u8 = 0;
const RESPONSE: u8 = 1;
const CONFIRMATION: u8 = 2;

/// Identifiers of commands (§ 6.2.3).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum SixpCommand {
    /// CMD_ADD.
    Add = 1,
    /// CMD_DELETE.
    Delete = 2,
    /// CMD_RELOCATE.
    Relocate = 3,
    /// CMD_COUNT.
    Count = 4,
    /// CMD_LIST.
    List = 5,
    /// CMD_SIGNAL.
    Signal = 6,
    /// CMD_CLEAR.
    Clear = 7,
}

impl SixpRequest {
    /// Its command.
    #[must_use]
    pub fn command(&self) -> SixpCommand {
        match self {
            Self::Add(_) => SixpCommand::Add,
            Self::Delete(_) => SixpCommand::Delete,
            Self::Relocate { .. } => SixpCommand::Relocate,
            Self::Count { .. } => SixpCommand::Count,
            Self::List { .. } => SixpCommand::List,
            Self::Signal { .. } => SixpCommand::Signal,
            Self::Clear { .. } => SixpCommand::Clear,
        }
    }
}

impl SixpRepr {
    /// Length (bytes) within its information element: header of 4, then the body.
    #[must_use]
    pub fn buffer_len(&self) -> usize {
        length_of(self)
    }

    /// Writes it to the beginning of `bytes`, which must have room for [`Self::buffer_len`].
    pub fn emit(&self, bytes: &mut [u8]) {
        write(self, bytes);
    }

    /// Its bytes.
    #[must_use]
    pub fn to_vec(&self) -> Vec<u8> {
        bytes_of(self)
    }

    /// The message that these bytes are. An answer does not name the command that it answers: its content is identified by its
    /// length (4 bytes a cell, 2 a number of cells, anything else is a payload). Who knows the command asks
    /// [`Self::parse_answer`].
    ///
    /// # Errors
    /// Unknown version, type, command or return code, and lists that are cut off.
    pub fn parse(bytes: &[u8]) -> Result<Self, Malformed> {
        Self::parse_with(bytes, None)
    }

    /// As [`Self::parse`], where answers are known to be to `command`.
    ///
    /// # Errors
    /// As [`Self::parse`], and content that does not belong to the command.
    pub fn parse_answer(bytes: &[u8], command: SixpCommand) -> Result<Self, Malformed> {
        Self::parse_with(bytes, Some(command))
    }

    fn parse_with(bytes: &[u8], answered: Option<SixpCommand>) -> Result<Self, Malformed> {
        let mut reader = ByteReader::new(bytes);
        let first = reader.u8()?;
        let code = reader.u8()?;
        let (sfid, seqnum) = (reader.u8()?, reader.u8()?);
        let body = match first >> 4 & 3 {
            REQUEST => SixpBody::Request(parse_request(code, &mut reader)?),
            RESPONSE => SixpBody::Response(parse_answer(code, &mut reader, answered)?),
            CONFIRMATION => SixpBody::Confirmation(parse_answer(code, &mut reader, answered)?),
            _ => return Err(Malformed { what: "reserved type of 6P message", at: 0 }),
        };
        if !reader.is_empty() {
            return Err(reader.malformed("more than the 6P message has"));
        }
        Ok(Self { version: first & 0xf, sfid, seqnum, body })
    }
}

impl Put for SixpRepr {
    fn put<S: Sink>(&self, sink: &mut S) {
        let (kind, code) = match &self.body {
            SixpBody::Request(request) => (REQUEST, request.command() as u8),
            SixpBody::Response(answer) => (RESPONSE, answer.code as u8),
            SixpBody::Confirmation(answer) => (CONFIRMATION, answer.code as u8),
        };
        sink.put(&[kind << 4 | self.version & 0xf, code, self.sfid, self.seqnum]);
        match &self.body {
            SixpBody::Request(request) => put_request(request, sink),
            SixpBody::Response(answer) | SixpBody::Confirmation(answer) => {
                put_content(&answer.content, sink);
            }
        }
    }
}

fn put_request<S: Sink>(request: &SixpRequest, sink: &mut S) {
    match request {
        SixpRequest::Add(cells) | SixpRequest::Delete(cells) => {
            sink.put_u16_le(cells.metadata);
            sink.put(&[cells.options.0, cells.num_cells]);
            put_cells(&cells.cells, sink);
        }
        SixpRequest::Relocate { metadata, options, num_cells, relocation, candidates } => {
            sink.put_u16_le(*metadata);
            sink.put(&[options.0, *num_cells]);
            put_cells(relocation, sink);
            put_cells(candidates, sink);
        }
        SixpRequest::Count { metadata, options } => {
            sink.put_u16_le(*metadata);
            sink.put_u8(options.0);
        }
        SixpRequest::List { metadata, options, offset, max_num_cells } => {
            sink.put_u16_le(*metadata);
            sink.put(&[options.0, 0]);
            sink.put_u16_le(*offset);
            sink.put_u16_le(*max_num_cells);
        }
        SixpRequest::Clear { metadata } => sink.put_u16_le(*metadata),
        SixpRequest::Signal { metadata, payload } => {
            sink.put_u16_le(*metadata);
            sink.put(payload);
        }
    }
}

fn put_content<S: Sink>(content: &AnswerContent, sink: &mut S) {
    match content {
        AnswerContent::Nothing => {}
        AnswerContent::Cells(cells) => put_cells(cells, sink),
        AnswerContent::Count(n) => sink.put_u16_le(*n),
        AnswerContent::Payload(payload) => sink.put(payload),
    }
}

fn put_cells<S: Sink>(cells: &[SixpCell], sink: &mut S) {
    for cell in cells {
        sink.put_u16_le(cell.slot);
        sink.put_u16_le(cell.channel);
    }
}

fn parse_request(code: u8, reader: &mut ByteReader<'_>) -> Result<SixpRequest, Malformed> {
    let unknown = Malformed { what: "unknown 6P command", at: 1 };
    if !(SixpCommand::Add as u8..=SixpCommand::Clear as u8).contains(&code) {
        return Err(unknown);
    }
    let metadata = reader.u16_le()?;
    if code == SixpCommand::Clear as u8 {
        return Ok(SixpRequest::Clear { metadata });
    }
    if code == SixpCommand::Signal as u8 {
        return Ok(SixpRequest::Signal { metadata, payload: reader.rest().to_vec() });
    }
    let options = CellOptions(reader.u8()?);
    if code == SixpCommand::Count as u8 {
        return Ok(SixpRequest::Count { metadata, options });
    }
    let num_cells = reader.u8()?;
    if code == SixpCommand::List as u8 {
        let (offset, max_num_cells) = (reader.u16_le()?, reader.u16_le()?);
        return Ok(SixpRequest::List { metadata, options, offset, max_num_cells });
    }
    if code == SixpCommand::Relocate as u8 {
        let relocation =
            parse_cells(&mut ByteReader::new(reader.take(4 * usize::from(num_cells))?))?;
        let candidates = parse_cells(reader)?;
        return Ok(SixpRequest::Relocate { metadata, options, num_cells, relocation, candidates });
    }
    let cells = CellRequest { metadata, options, num_cells, cells: parse_cells(reader)? };
    Ok(if code == SixpCommand::Add as u8 {
        SixpRequest::Add(cells)
    } else {
        SixpRequest::Delete(cells)
    })
}

fn parse_answer(
    code: u8,
    reader: &mut ByteReader<'_>,
    answered: Option<SixpCommand>,
) -> Result<SixpAnswer, Malformed> {
    let code =
        ReturnCode::from_number(code).ok_or(Malformed { what: "unknown return code", at: 1 })?;
    let content = match answered {
        Some(SixpCommand::Count) if !reader.is_empty() => AnswerContent::Count(reader.u16_le()?),
        Some(SixpCommand::Signal) if !reader.is_empty() => {
            AnswerContent::Payload(reader.rest().to_vec())
        }
        Some(
            SixpCommand::Add | SixpCommand::Delete | SixpCommand::Relocate | SixpCommand::List,
        ) if matches!(code, ReturnCode::Success | ReturnCode::EndOfList) || !reader.is_empty() => {
            AnswerContent::Cells(parse_cells(reader)?)
        }
        Some(_) => AnswerContent::Nothing,
        None => match reader.remaining() {
            0 => AnswerContent::Nothing,
            2 => AnswerContent::Count(reader.u16_le()?),
            n if n.is_multiple_of(4) => AnswerContent::Cells(parse_cells(reader)?),
            _ => AnswerContent::Payload(reader.rest().to_vec()),
        },
    };
    Ok(SixpAnswer { code, content })
}

fn parse_cells(reader: &mut ByteReader<'_>) -> Result<Vec<SixpCell>, Malformed> {
    let mut cells = Vec::with_capacity(reader.remaining() / 4);
    while !reader.is_empty() {
        cells.push(SixpCell { slot: reader.u16_le()?, channel: reader.u16_le()? });
    }
    Ok(cells)
}

impl ReturnCode {
    /// The code of this number.
    #[must_use]
    pub(crate) fn from_number(number: u8) -> Option<Self> {
        let all = [
            Self::Success,
            Self::EndOfList,
            Self::Error,
            Self::Reset,
            Self::ErrorVersion,
            Self::ErrorSfid,
            Self::ErrorSeqnum,
            Self::ErrorCellList,
            Self::ErrorBusy,
            Self::ErrorLocked,
        ];
        all.get(usize::from(number)).copied()
    }
}

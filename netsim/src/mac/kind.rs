//! What frames are for, as they are counted and recorded.

use super::queue::Priority;
use crate::app::ports::SWARM_PORT;
use crate::wire::datagram::Upper;
use crate::wire::frame::Content;
use crate::wire::rpl::RplMessage;

/// What a frame is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FrameKind {
    /// Enhanced beacons.
    Beacon,
    /// Keep-alive frames.
    KeepAlive,
    /// 6P messages.
    Sixp,
    /// DODAG information objects.
    Dio,
    /// DODAG information solicitations.
    Dis,
    /// Destination advertisements, and their acknowledgments.
    Dao,
    /// Messages of the join protocol.
    Join,
    /// Payloads of robots.
    Swarm,
    /// Datagrams of applications.
    Data,
}

impl FrameKind {
    /// How many kinds there are.
    pub const N: usize = 9;
    /// All of them, in the order of their indices.
    pub const ALL: [Self; Self::N] = [
        Self::Beacon,
        Self::KeepAlive,
        Self::Sixp,
        Self::Dio,
        Self::Dis,
        Self::Dao,
        Self::Join,
        Self::Swarm,
        Self::Data,
    ];

    /// The kind of a frame with this content; a fragment has that of its datagram.
    #[must_use]
    pub fn of(content: &Content) -> Self {
        match content {
            Content::Beacon(_) => Self::Beacon,
            Content::KeepAlive => Self::KeepAlive,
            Content::Sixp(_) => Self::Sixp,
            Content::Lowpan(part) => match &part.datagram().upper {
                Upper::Rpl(RplMessage::Dio(_)) => Self::Dio,
                Upper::Rpl(RplMessage::Dis(_)) => Self::Dis,
                Upper::Rpl(RplMessage::Dao(_) | RplMessage::DaoAck(_)) => Self::Dao,
                Upper::Udp(udp) if udp.destination_port == SWARM_PORT => Self::Swarm,
                Upper::Udp(_) if Priority::of(content, false) == Priority::Data => Self::Data,
                Upper::Udp(_) => Self::Join,
            },
        }
    }

    /// In records.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Beacon => "beacon",
            Self::KeepAlive => "keep-alive",
            Self::Sixp => "6p",
            Self::Dio => "dio",
            Self::Dis => "dis",
            Self::Dao => "dao",
            Self::Join => "join",
            Self::Swarm => "swarm",
            Self::Data => "data",
        }
    }
}

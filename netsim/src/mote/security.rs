//! Which frames are secured, and which are taken (RFC 8180, § 4.6; RFC 9031, § 5; IEEE Std 802.15.4-2015, 9.2).
//!
//! A mote has the keys K1 and K2 while it is admitted: the join response brings them. Until then it is a pledge, and sends
//! frames that are not secured. So do the two ends of a join exchange on the link, the pledge and its proxy.
//!
//! | frame | is taken by |
//! |---|---|
//! | beacon | everybody: a pledge, which cannot verify it, as well (6.3.1.2) |
//! | secured with K2 | motes with keys |
//! | not secured | pledges; of motes with keys those who exempt its sender (secExempt, 9.2.4): join messages and keep-alives for them |
//!
//! A frame that is not taken is dropped before the MAC acts on it: it is not acknowledged, and corrects no clock.

use super::Mote;
use crate::join::ports;
use crate::mote::settings::Settings;
use crate::wire::datagram::{Datagram, Upper};
use crate::wire::fragment::LowpanRepr;
use crate::wire::frame::{Content, FrameRepr};
use crate::wire::security::FrameSecurity;

/// Whether a datagram is one of a join exchange between a pledge and its proxy.
fn is_join_on_link(datagram: &Datagram) -> bool {
    datagram.destination.is_unicast_link_local()
        && matches!(&datagram.upper, Upper::Udp(udp) if udp.destination_port == ports::COAP)
}

/// Whether motes with keys exempt a frame that is not secured.
fn is_exempt(frame: &FrameRepr) -> bool {
    frame.destination.is_some()
        && match &frame.content {
            Content::KeepAlive => true,
            Content::Lowpan(LowpanRepr::Whole(datagram)) => is_join_on_link(datagram),
            Content::Lowpan(LowpanRepr::First(part) | LowpanRepr::Next(part)) => {
                is_join_on_link(&part.datagram)
            }
            Content::Beacon(_) | Content::Sixp(_) => false,
        }
}

impl Mote {
    /// How its beacons are secured.
    pub(super) fn beacon_security(&self, settings: &Settings) -> FrameSecurity {
        if settings.is_secured() { FrameSecurity::K1 } else { FrameSecurity::Unsecured }
    }

    /// How a frame without a datagram is secured.
    pub(super) fn frame_security(&self, settings: &Settings) -> FrameSecurity {
        if settings.is_secured() && self.joined {
            FrameSecurity::K2
        } else {
            FrameSecurity::Unsecured
        }
    }

    /// How a frame with a datagram, or a part of it, is secured.
    pub(super) fn datagram_security(
        &self,
        settings: &Settings,
        datagram: &Datagram,
    ) -> FrameSecurity {
        if settings.is_secured() && is_join_on_link(datagram) {
            FrameSecurity::Unsecured
        } else {
            self.frame_security(settings)
        }
    }

    /// How a frame with this content is secured.
    pub(super) fn content_security(&self, settings: &Settings, content: &Content) -> FrameSecurity {
        match content {
            Content::Beacon(_) => self.beacon_security(settings),
            Content::KeepAlive | Content::Sixp(_) => self.frame_security(settings),
            Content::Lowpan(part) => self.datagram_security(settings, part.datagram()),
        }
    }

    /// Whether it takes a frame, so secured.
    #[inline]
    #[must_use]
    pub fn takes(&self, settings: &Settings, frame: &FrameRepr) -> bool {
        !settings.is_secured()
            || match frame.security {
                FrameSecurity::K1 => true,
                FrameSecurity::K2 => self.joined,
                FrameSecurity::Unsecured => !self.joined || is_exempt(frame),
            }
    }
}

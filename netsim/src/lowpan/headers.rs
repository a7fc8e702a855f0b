//! What the headers of a datagram want of a mote that has received it.

use super::DropReason;
use crate::wire::Eui64;
use crate::wire::datagram::{Datagram, SourceRoute};
use std::net::Ipv6Addr;

/// What is to be done with a datagram.
#[derive(Clone, Debug, PartialEq)]
pub enum Step {
    /// It is for this mote.
    Here,
    /// It goes on, as it is here: one hop fewer left, this mote taken off the source route. RPL packet information is
    /// routing's business.
    Onward(Datagram),
}

/// Looks at the destination, the source route (RFC 6554, § 4.2) and the hop limit (RFC 8200, § 3) of a datagram that mote
/// `own` has received. A datagram for a group ends here: none is routed.
///
/// # Errors
///
/// It goes no further.
pub fn step(datagram: &Datagram, own: Eui64) -> Result<Step, DropReason> {
    let is_own = |address: Ipv6Addr| address == own.global() || address == own.link_local();
    if datagram.destination.is_multicast() {
        return Ok(Step::Here);
    }
    let mut route = match datagram.route.as_ref().map(|route| (route, route.hops.as_slice())) {
        None | Some((_, [])) if is_own(datagram.destination) => return Ok(Step::Here),
        None | Some((_, [])) => None,
        Some((_, [last])) if is_own(*last) && is_own(datagram.destination) => {
            return Ok(Step::Here);
        }
        // Routes are strict, do not visit groups, and do not come back.
        Some((_, [first, rest @ ..]))
            if !is_own(*first)
                || rest.is_empty()
                || rest.iter().any(|&hop| hop.is_multicast() || is_own(hop)) =>
        {
            return Err(DropReason::SourceRouteError);
        }
        Some((route, [_, rest @ ..])) => Some(SourceRoute { hops: rest.to_vec(), ..*route }),
    };
    // Link-local addresses mean something else on the next link (RFC 4291, § 2.5.6).
    if datagram.destination.is_unicast_link_local() || datagram.source.is_unicast_link_local() {
        return Err(DropReason::NoRoute);
    }
    // Within a tunnel the outer header counts (RFC 2473, § 3.1).
    let mut hop_limit = datagram.hop_limit;
    let counts = route.as_mut().and_then(|route| route.tunnel_hop_limit.as_mut());
    let counts = counts.unwrap_or(&mut hop_limit);
    if *counts <= 1 {
        return Err(DropReason::TimeExceeded);
    }
    *counts -= 1;
    Ok(Step::Onward(Datagram { hop_limit, route, ..datagram.clone() }))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::wire::address::ALL_NODES;
    use crate::wire::datagram::{UdpRepr, Upper};
    use proto::ids::MoteId;

    fn mote(n: u32) -> Eui64 {
        Eui64::of_mote(MoteId(n))
    }

    fn datagram(source: MoteId, destination: MoteId, hops: &[u32]) -> Datagram {
        let hops: Vec<_> = hops.iter().map(|&hop| mote(hop).global()).collect();
        Datagram {
            packet: 1,
            source: mote(source.0).global(),
            destination: mote(destination.0).global(),
            dscp: 0,
            hop_limit: 64,
            rpi: None,
            route: (!hops.is_empty()).then_some(SourceRoute {
                root: mote(0).global(),
                hops,
                tunnel_hop_limit: (source != MoteId(0)).then_some(64),
            }),
            upper: Upper::Udp(UdpRepr {
                source_port: 1,
                destination_port: 2,
                payload: bytes::Bytes::new(),
            }),
        }
    }

    #[test]
    fn rfc6554_4_2_a_mote_on_the_route_takes_itself_off_and_passes_on() {
        let Ok(Step::Onward(next)) = step(&datagram(MoteId(0), MoteId(3), &[1, 2, 3]), mote(1))
        else {
            panic!()
        };
        assert_eq!(next, Datagram { hop_limit: 63, ..datagram(MoteId(0), MoteId(3), &[2, 3]) });
        let Ok(Step::Onward(next)) = step(&next, mote(2)) else { panic!() };
        assert_eq!(next, Datagram { hop_limit: 62, ..datagram(MoteId(0), MoteId(3), &[3]) });
        assert_eq!(step(&next, mote(3)), Ok(Step::Here));
    }

    #[test]
    fn rfc6554_4_2_routes_that_come_back_or_were_not_meant_for_this_mote_are_refused() {
        for (hops, at) in [(&[1, 2, 1, 3][..], 1), (&[2, 3], 1), (&[1], 1)] {
            let refused = step(&datagram(MoteId(0), MoteId(3), hops), mote(at));
            assert_eq!(refused, Err(DropReason::SourceRouteError), "{hops:?}");
        }
        let mut group = datagram(MoteId(0), MoteId(3), &[1, 2, 3]);
        group.route.as_mut().unwrap().hops[1] = ALL_NODES;
        assert_eq!(step(&group, mote(1)), Err(DropReason::SourceRouteError));
    }

    #[test]
    fn rfc8200_3_a_datagram_with_one_hop_left_arrives_but_is_not_passed_on() {
        let last = Datagram { hop_limit: 1, ..datagram(MoteId(5), MoteId(0), &[]) };
        assert_eq!(step(&last, mote(0)), Ok(Step::Here));
        assert_eq!(step(&last, mote(2)), Err(DropReason::TimeExceeded));
        let routed = Datagram { hop_limit: 1, ..datagram(MoteId(0), MoteId(2), &[1, 2]) };
        assert_eq!(step(&routed, mote(1)), Err(DropReason::TimeExceeded));
    }

    #[test]
    fn rfc2473_3_1_within_a_tunnel_the_outer_hop_limit_falls_and_the_inner_one_stays() {
        let sent = Datagram { hop_limit: 1, ..datagram(MoteId(5), MoteId(3), &[1, 2, 3]) };
        let Ok(Step::Onward(next)) = step(&sent, mote(1)) else { panic!() };
        let Ok(Step::Onward(next)) = step(&next, mote(2)) else { panic!() };
        let limits = (next.hop_limit, next.route.as_ref().and_then(|route| route.tunnel_hop_limit));
        assert_eq!(limits, (1, Some(62)));
        assert_eq!(step(&next, mote(3)), Ok(Step::Here));

        let mut last = sent;
        last.route.as_mut().unwrap().tunnel_hop_limit = Some(1);
        assert_eq!(step(&last, mote(1)), Err(DropReason::TimeExceeded));
    }

    #[test]
    fn what_is_meant_for_the_link_or_a_group_is_never_passed_on() {
        let group = Datagram { destination: ALL_NODES, ..datagram(MoteId(1), MoteId(2), &[]) };
        assert_eq!(step(&group, mote(7)), Ok(Step::Here));
        let link =
            Datagram { destination: mote(2).link_local(), ..datagram(MoteId(1), MoteId(2), &[]) };
        assert_eq!(step(&link, mote(2)), Ok(Step::Here));
        assert_eq!(step(&link, mote(7)), Err(DropReason::NoRoute));
        let from_link =
            Datagram { source: mote(1).link_local(), ..datagram(MoteId(1), MoteId(2), &[]) };
        assert_eq!(step(&from_link, mote(7)), Err(DropReason::NoRoute));
    }
}

//! Membership in a version of a DODAG.

use super::objective::{INFINITE_RANK, Objective};
use super::trickle::Trickle;
use super::{Config, Mode};
use crate::wire::Eui64;
use crate::wire::rpl::{DioRepr, DodagConfiguration};
use proto::time::{SimDuration, SimTime};
use serde::{Deserialize, Serialize};
use std::net::Ipv6Addr;

/// The DODAG a mote belongs to, and its place in it.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(super) struct Dodag {
    pub(super) id: Ipv6Addr,
    pub(super) version: u8,
    pub(super) grounded: bool,
    pub(super) preference: u8,
    /// Mode of operation.
    pub(super) mode: u8,
    pub(super) configuration: DodagConfiguration,
    pub(super) prefix: Option<u64>,
    pub(super) parent: Option<Eui64>,
    pub(super) rank: u16,
    /// What the last DIO said, or the first one will.
    pub(super) advertised_rank: u16,
    /// L: the lowest rank advertised in this version (RFC 6550, § 8.2.2.4).
    pub(super) lowest_rank: u16,
    pub(super) dtsn: u8,
    /// The parent's DTSN when last looked at.
    pub(super) parent_dtsn: u8,
    /// Does not offer itself as parent (RFC 6550, § 8.5).
    pub(super) is_leaf: bool,
}

/// A version of a DODAG that was left.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(super) struct Past {
    pub(super) dodag: Dodag,
    pub(super) left: SimTime,
}

impl Dodag {
    /// As a root begins one.
    pub(super) fn of_root(config: &Config, own: Eui64, version: u8, dtsn: u8) -> Self {
        let configuration = config.configuration();
        let rank = configuration.min_hop_rank_increase;
        Self {
            id: own.under(config.prefix),
            version,
            grounded: config.grounded,
            preference: config.preference.min(7),
            mode: config.mode.code(),
            configuration,
            prefix: Some(config.prefix),
            parent: None,
            rank,
            advertised_rank: rank,
            lowest_rank: rank,
            dtsn,
            parent_dtsn: 0,
            is_leaf: false,
        }
    }

    /// As a neighbour announces it.
    pub(super) fn of_dio(dio: &DioRepr, config: &Config, dtsn: u8) -> Self {
        let configuration = dio.configuration.unwrap_or_else(|| config.configuration());
        let is_leaf = config.is_leaf
            || Objective::of_code(configuration.objective).is_none()
            || Mode::LAST_CODE < dio.mode;
        Self {
            id: dio.dodag_id,
            version: dio.version,
            grounded: dio.grounded,
            preference: dio.preference,
            mode: dio.mode,
            configuration,
            prefix: dio.prefix,
            parent: None,
            rank: INFINITE_RANK,
            advertised_rank: INFINITE_RANK,
            lowest_rank: INFINITE_RANK,
            dtsn,
            parent_dtsn: dio.dtsn,
            is_leaf,
        }
    }

    /// Who keeps routes down; `None`: nobody, or a way that is not known here.
    pub(super) fn mode(&self) -> Option<Mode> {
        [Mode::NonStoring, Mode::Storing].into_iter().find(|mode| mode.code() == self.mode)
    }

    /// DAGRank: the whole hops of a rank (RFC 6550, § 3.5.1).
    pub(super) fn dag_rank(&self, rank: u16) -> u16 {
        rank / self.configuration.min_hop_rank_increase.max(1)
    }

    /// The highest rank permitted in this version (RFC 6550, § 8.2.2.4, rule 3).
    pub(super) fn rank_limit(&self) -> u16 {
        match self.configuration.max_rank_increase {
            0 => INFINITE_RANK - 1,
            increase => self.lowest_rank.saturating_add(increase).min(INFINITE_RANK - 1),
        }
    }

    /// A Trickle timer with the DODAG's parameters (RFC 6550, § 8.3.1).
    pub(super) fn trickle(&self) -> Trickle {
        let c = &self.configuration;
        let min_ns = 1_000_000u64.checked_shl(c.dio_interval_min.into()).unwrap_or(u64::MAX);
        Trickle::new(SimDuration::from_ns(min_ns), c.dio_interval_doublings, c.dio_redundancy)
    }

    /// A DIO with this rank.
    pub(super) fn dio(&self, instance: u8, rank: u16) -> DioRepr {
        DioRepr {
            instance,
            version: self.version,
            rank,
            grounded: self.grounded,
            mode: self.mode,
            preference: self.preference,
            dtsn: self.dtsn,
            dodag_id: self.id,
            configuration: Some(self.configuration),
            prefix: self.prefix,
        }
    }
}

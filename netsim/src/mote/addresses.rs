//! Which mote has which address.

use crate::wire::Eui64;
use proto::ids::MoteId;

/// Addresses of all motes.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Addresses {
    by_mote: Vec<Eui64>,
    /// Motes in the order of their addresses.
    by_address: Vec<MoteId>,
}

/// Two motes with one address.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Twice {
    /// The address that both have.
    pub address: Eui64,
    /// Numbers of the two motes.
    pub motes: [MoteId; 2],
}

impl Addresses {
    /// Addresses of `n` motes: the given ones for the first, default ones for the rest.
    ///
    /// # Errors
    ///
    /// Two have the same.
    pub fn new(n: usize, given: &[Eui64]) -> Result<Self, Twice> {
        let rest = (given.len().min(n)..n).map(MoteId::from_index).map(Eui64::of_mote);
        let by_mote: Vec<Eui64> = given.iter().take(n).copied().chain(rest).collect();
        let mut by_address: Vec<MoteId> = MoteId::first(n).collect();
        by_address.sort_by_key(|&mote| by_mote[mote.index()]);
        for pair in by_address.windows(2) {
            let address = by_mote[pair[0].index()];
            if address == by_mote[pair[1].index()] {
                return Err(Twice { address, motes: [pair[0], pair[1]] });
            }
        }
        Ok(Self { by_mote, by_address })
    }

    /// The address of a mote.
    #[must_use]
    pub fn eui64(&self, mote: MoteId) -> Eui64 {
        self.by_mote[mote.index()]
    }

    /// The mote with an address.
    #[inline]
    #[must_use]
    pub fn mote(&self, address: Eui64) -> Option<MoteId> {
        // Default addresses hold the number.
        let guess = (address.0 & 0xffff_ffff) as usize;
        if self.by_mote.get(guess) == Some(&address) {
            return Some(MoteId(guess as u32));
        }
        let place =
            self.by_address.binary_search_by_key(&address, |&mote| self.eui64(mote)).ok()?;
        Some(self.by_address[place])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a4_given_addresses_serve_the_first_motes_and_none_may_come_twice() {
        let given = [0x0200_0000_0000_0010, 0x0200_0000_0000_0002].map(Eui64);
        let twice = Addresses::new(3, &given).unwrap_err();
        assert_eq!(twice.motes, [1, 2].map(MoteId));
        let addresses = Addresses::new(4, &given[..1]).unwrap();
        assert_eq!(addresses.eui64(MoteId(0)), given[0]);
        assert_eq!(addresses.eui64(MoteId(3)), Eui64::of_mote(MoteId(3)));
        for mote in MoteId::first(4) {
            assert_eq!(addresses.mote(addresses.eui64(mote)), Some(mote));
        }
        assert_eq!(addresses.mote(Eui64(7)), None);
    }
}

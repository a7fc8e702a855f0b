//! In how many slots a radio listens, counted from slotframes instead of slots.

use super::Slotframe;
use physics::asn::Asn;

/// Slots from `from` (included) to `until` (excluded) in which at least one slotframe receives: the inclusion–exclusion
/// principle over the slotframes, two residues meeting as the Chinese remainder theorem says.
pub(super) fn listening_slots(frames: &[Slotframe], from: Asn, until: Asn) -> u64 {
    if frames.iter().any(|frame| frame.n_receives == frame.slots) {
        return until - from;
    }
    let mut receiving = frames.iter().filter(|frame| frame.n_receives != 0);
    match (receiving.next(), receiving.next()) {
        (None, _) => return 0,
        (Some(frame), None) => return frame.n_receiving(from, until),
        _ => {}
    }
    let mut sets: Vec<Residues> = Vec::with_capacity(frames.len());
    for frame in frames {
        let length = u64::from(frame.slots);
        let slots = frame.receives.iter().enumerate().filter(|(_, receives)| **receives);
        let offsets = slots.map(|(slot, _)| slot as u64);
        match sets.iter_mut().find(|set| set.modulus == length) {
            Some(set) => {
                set.offsets.extend(offsets);
                set.offsets.sort_unstable();
                set.offsets.dedup();
            }
            None => sets.push(Residues { modulus: length, offsets: offsets.collect() }),
        }
    }
    sets.retain(|set| !set.offsets.is_empty());
    if sets.iter().any(|set| set.offsets.len() as u64 == set.modulus) {
        return until - from;
    }
    union_size(&sets, from.0, until.0)
}

/// Numbers that leave one of `offsets` when divided by `modulus`.
struct Residues {
    modulus: u64,
    offsets: Vec<u64>,
}

fn union_size(sets: &[Residues], from: u64, until: u64) -> u64 {
    let Some((first, rest)) = sets.split_first() else { return 0 };
    // |A ∪ B| = |A| + |B| − |A ∩ B|, B being the union of the rest.
    let meets: Vec<Residues> = rest.iter().map(|set| intersection(first, set)).collect();
    first.size(from, until) + union_size(rest, from, until) - union_size(&meets, from, until)
}

fn intersection(a: &Residues, b: &Residues) -> Residues {
    let common = gcd(a.modulus, b.modulus);
    let modulus = a.modulus / common * b.modulus;
    let mut offsets = Vec::new();
    for &x in &a.offsets {
        for &y in &b.offsets {
            if x % common == y % common {
                // The first number that leaves x and y: found by steps of the longer modulus.
                let (start, step, want, modulo) = if a.modulus < b.modulus {
                    (y, b.modulus, x, a.modulus)
                } else {
                    (x, a.modulus, y, b.modulus)
                };
                let mut number = start;
                while number % modulo != want {
                    number += step;
                }
                offsets.push(number);
            }
        }
    }
    Residues { modulus, offsets }
}

fn gcd(a: u64, b: u64) -> u64 {
    if b == 0 { a } else { gcd(b, a % b) }
}

impl Residues {
    fn size(&self, from: u64, until: u64) -> u64 {
        let below = |limit: u64, offset: u64| {
            if limit <= offset { 0 } else { (limit - offset - 1) / self.modulus + 1 }
        };
        self.offsets.iter().map(|&offset| below(until, offset) - below(from, offset)).sum()
    }
}

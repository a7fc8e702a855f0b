//! Values of a function that takes long to compute, kept for arguments that return.

use std::cell::Cell;

/// The latest values of one pure function of a number. Where motes stand still, powers and their ratios are the same in slot
/// after slot.
#[derive(Debug)]
pub(super) struct Memo([Cell<(u64, f64)>; N_ENTRIES]);

/// A power of two.
const N_ENTRIES: usize = 64;

/// The place of a key among `n`, a power of two: keys that are near each other part. The upper bits of a product depend on
/// all bits of the key, and the factor is 2^64 over the golden ratio (Knuth: The Art of Computer Programming, 6.4).
#[inline]
pub(crate) fn place_of(key: u64, n: usize) -> usize {
    (key.wrapping_mul(0x9e37_79b9_7f4a_7c15) >> (u64::BITS - n.ilog2())) as usize
}

impl Memo {
    pub(super) const fn new() -> Self {
        // These bits are those of a NaN, whose value is NaN.
        Self([const { Cell::new((u64::MAX, f64::NAN)) }; N_ENTRIES])
    }

    /// `function` of `x`. It must be the same function in every call.
    pub(super) fn value(&self, x: f64, function: impl FnOnce(f64) -> f64) -> f64 {
        let bits = x.to_bits();
        let entry = &self.0[place_of(bits, N_ENTRIES)];
        let (known, value) = entry.get();
        if known == bits {
            return value;
        }
        let value = function(x);
        entry.set((bits, value));
        value
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_are_those_of_the_function_however_often_arguments_return() {
        let memo = Memo::new();
        for round in 0..4 {
            for step in 0..500 {
                let x = f64::from(step) / 7.0;
                assert_eq!(memo.value(x, libm::exp).to_bits(), libm::exp(x).to_bits(), "{round}");
            }
        }
        assert!(memo.value(f64::from_bits(u64::MAX), libm::exp).is_nan());
        let mut n_computed = 0;
        for _ in 0..3 {
            memo.value(-1.5, |x| {
                n_computed += 1;
                x
            });
        }
        assert_eq!(n_computed, 1);
    }
}

//! Powers with whole exponents, by multiplication alone.
//!
//! The platform's `powi` promises no precision, hence its results may differ between processors and compilers. These do not.

/// The square of a number: one multiplication, rounded once.
#[must_use]
#[inline]
pub fn square(x: f64) -> f64 {
    x * x
}

/// A number to the power of a whole exponent, by repeated squaring: 1 for an exponent of 0, NaN and infinite bases included.
///
/// The order of the multiplications is that of `__powidf2` in LLVM's compiler-rt, from the exponent's lowest bit upward:
/// the cube is `x * (x * x)`. A negative exponent is the reciprocal of the positive power, which overflows where the power does.
#[must_use]
#[inline]
pub fn integer_power(base: f64, exponent: i32) -> f64 {
    let mut product = 1.0;
    let mut factor = base;
    let mut left = exponent.unsigned_abs();
    loop {
        if left % 2 == 1 {
            product *= factor;
        }
        left /= 2;
        if left == 0 {
            break;
        }
        factor *= factor;
    }
    if exponent < 0 { 1.0 / product } else { product }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn powers_multiply_from_the_lowest_bit_upward() {
        // A base whose powers do not fit into 53 bits: another order of multiplication rounds otherwise.
        let x = 1.1_f64;
        let (two, four) = (x * x, (x * x) * (x * x));
        assert_eq!(square(x).to_bits(), two.to_bits());
        for (exponent, expected) in [
            (0, 1.0),
            (1, x),
            (2, two),
            (3, x * two),
            (4, four),
            (7, (x * two) * four),
            (-1, 1.0 / x),
            (-3, 1.0 / (x * two)),
        ] {
            assert_eq!(integer_power(x, exponent).to_bits(), expected.to_bits(), "{exponent}");
        }
    }

    #[test]
    fn powers_of_two_are_exact_down_to_the_least_exponent_that_a_number_has() {
        assert_eq!(integer_power(0.5, 1022), f64::MIN_POSITIVE);
        assert_eq!(integer_power(2.0, i32::MIN), 0.0);
        assert_eq!(integer_power(f64::NAN, 0), 1.0);
    }
}

//! Decimal numbers as G-code writes them: sign, digits, point, digits. No exponent: `E` is the extruder.

/// 10⁰ … 10²², all exact in an `f64`.
const POWERS_OF_TEN: [f64; 23] = [
    1e0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9, 1e10, 1e11, 1e12, 1e13, 1e14, 1e15, 1e16, 1e17, 1e18,
    1e19, 1e20, 1e21, 1e22,
];

/// Digits that surely fit into a `u64`.
const DIGITS_MAX: usize = 19;

/// A whole number up to this is exact in an `f64`.
const EXACT_MAX: u64 = 1 << 53;

/// Reads a number that begins at `at`, correctly rounded, with the place behind it. `None` where there is no digit.
///
/// With at most 2⁵³ as mantissa and 10²² as divisor both are exact, so that their quotient is the correctly rounded
/// value (Clinger 1990); anything longer goes to the standard library, which rounds correctly, too.
#[inline]
pub(crate) fn read(bytes: &[u8], at: usize) -> Option<(f64, usize)> {
    let mut end = at;
    let mut negative = false;
    if let Some(&sign @ (b'-' | b'+')) = bytes.get(end) {
        negative = sign == b'-';
        end += 1;
    }
    let first = end;
    let mut mantissa: u64 = 0;
    while let Some(digit) = digit_at(bytes, end) {
        mantissa = mantissa.wrapping_mul(10).wrapping_add(digit);
        end += 1;
    }
    let mut digits = end - first;
    let mut decimals = 0;
    if bytes.get(end) == Some(&b'.') {
        end += 1;
        let point = end;
        while let Some(digit) = digit_at(bytes, end) {
            mantissa = mantissa.wrapping_mul(10).wrapping_add(digit);
            end += 1;
        }
        decimals = end - point;
        digits += decimals;
    }
    if digits == 0 {
        return None;
    }
    let magnitude = if digits <= DIGITS_MAX && mantissa <= EXACT_MAX {
        mantissa as f64 / POWERS_OF_TEN[decimals]
    } else {
        read_long(&bytes[first..end])
    };
    Some((if negative { -magnitude } else { magnitude }, end))
}

#[inline]
fn digit_at(bytes: &[u8], at: usize) -> Option<u64> {
    let digit = bytes.get(at)?.wrapping_sub(b'0');
    (digit < 10).then_some(u64::from(digit))
}

#[cold]
fn read_long(digits: &[u8]) -> f64 {
    // Only digits and a point: the conversions cannot fail, and infinity is caught as out of range.
    core::str::from_utf8(digits).ok().and_then(|text| text.parse().ok()).unwrap_or(f64::INFINITY)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn the_forms_that_slicers_write() {
        for (text, value, length) in [
            ("139.412", 139.412, 7),
            (".35", 0.35, 3),
            ("-.5", -0.5, 3),
            ("+7.", 7.0, 3),
            ("007", 7.0, 3),
            ("-0.00012 ", -0.00012, 8),
            ("12E5", 12.0, 2),
            ("1.2.3", 1.2, 3),
        ] {
            assert_eq!(read(text.as_bytes(), 0), Some((value, length)), "{text}");
        }
        for text in ["", "-", ".", "+.", "--1", "e5", "NaN", "inf"] {
            assert_eq!(read(text.as_bytes(), 0), None, "{text}");
        }
    }

    #[test]
    fn hundreds_of_digits_neither_wrap_nor_panic() {
        let long = "9".repeat(400);
        assert_eq!(read(long.as_bytes(), 0), Some((f64::INFINITY, 400)));
        let fine = format!("1.{}1", "0".repeat(400));
        assert_eq!(read(fine.as_bytes(), 0), Some((1.0, 403)));
    }

    proptest! {
        #[test]
        fn every_number_is_correctly_rounded(text in "[-+]?[0-9]{0,24}[.][0-9]{1,24}") {
            prop_assert_eq!(read(text.as_bytes(), 0), Some((text.parse::<f64>().unwrap(), text.len())));
        }

        #[test]
        fn short_numbers_are_correctly_rounded(value in -1_000_000_000i64..1_000_000_000, decimals in 0usize..9) {
            let text = format!("{:.*}", decimals, value as f64 / POWERS_OF_TEN[decimals]);
            prop_assert_eq!(read(text.as_bytes(), 0), Some((text.parse::<f64>().unwrap(), text.len())));
        }
    }
}

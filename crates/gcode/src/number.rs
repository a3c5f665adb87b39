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
// Inlined by force: returning a pair through memory would cost as much as reading a number.
#[allow(clippy::inline_always)]
#[inline(always)]
pub(crate) fn read(bytes: &[u8], at: usize) -> Option<(f64, usize)> {
    let mut first = at;
    let mut negative = false;
    if let Some(&sign @ (b'-' | b'+')) = bytes.get(at) {
        negative = sign == b'-';
        first += 1;
    }
    let (magnitude, end) = match read_short(bytes, first) {
        Some(found) => found,
        None => read_any(bytes, first)?,
    };
    Some((if negative { -magnitude } else { magnitude }, end))
}

/// Digits and a point that end within eight bytes, as nearly all numbers of a print do, in a dozen operations on one
/// 64-bit word instead of a loop (the sum of digits by three multiplications is known from Langdale and Lemire's work on
/// parsing). `None` where this does not apply.
#[allow(clippy::inline_always)]
#[inline(always)]
fn read_short(bytes: &[u8], at: usize) -> Option<(f64, usize)> {
    const ONES: u64 = 0x0101_0101_0101_0101;
    let word = if let Some(window) = bytes.get(at..at + 8).and_then(|window| window.first_chunk()) {
        u64::from_le_bytes(*window)
    } else {
        // Less than eight bytes are left: those before them are shifted out, and zeros, no digits, come in.
        let missing = 8 - bytes.len().checked_sub(at).filter(|&left| left > 0)?;
        u64::from_le_bytes(*bytes.last_chunk()?) >> (8 * missing)
    };
    let digits = word ^ (ONES * u64::from(b'0'));
    // The high bit of every byte that is no digit.
    let others = (((digits & (ONES * 0x7f)) + ONES * 0x76) | digits) & (ONES * 0x80);
    // Bits before the first byte that is no digit; a number that fills the window may go on behind it.
    let whole = others.trailing_zeros() & !7;
    if whole == 64 {
        return None;
    }
    let below = (1 << whole) - 1;
    let (packed, bits, length, divisor) = if (word >> whole) & 0xff == u64::from(b'.') {
        let behind = (others & (others - 1)).trailing_zeros() & !7;
        if behind == 64 && digit_at(bytes, at + 8).is_some() {
            return None;
        }
        let decimals = (behind - whole) / 8 - 1;
        let packed = (digits & below) | ((digits >> 8) & !below);
        (packed, behind - 8, behind / 8, POWERS_OF_TEN[decimals as usize])
    } else {
        (digits, whole, whole / 8, 1.0)
    };
    if bits == 0 {
        return None;
    }
    // The last digit into the highest byte, zeros before the first.
    let sum = packed << (64 - bits);
    let sum = sum.wrapping_mul(10).wrapping_add(sum >> 8) & 0x00ff_00ff_00ff_00ff;
    let sum = sum.wrapping_mul(100).wrapping_add(sum >> 16) & 0x0000_ffff_0000_ffff;
    let sum = sum.wrapping_mul(10_000).wrapping_add(sum >> 32) & 0xffff_ffff;
    Some((sum as f64 / divisor, at + length as usize))
}

/// Digits and a point of any length.
#[inline(never)]
fn read_any(bytes: &[u8], first: usize) -> Option<(f64, usize)> {
    let mut end = first;
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
    Some((magnitude, end))
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
        fn the_short_way_agrees_with_the_long_one(
            bytes in proptest::collection::vec(prop_oneof![b'0'..=b'9', Just(b'.'), any::<u8>()], 0..20),
            at in 0usize..20,
        ) {
            if let Some(found) = read_short(&bytes, at) {
                prop_assert_eq!(Some(found), read_any(&bytes, at));
            }
        }

        #[test]
        fn short_numbers_are_correctly_rounded(value in -1_000_000_000i64..1_000_000_000, decimals in 0usize..9) {
            let text = format!("{:.*}", decimals, value as f64 / POWERS_OF_TEN[decimals]);
            prop_assert_eq!(read(text.as_bytes(), 0), Some((text.parse::<f64>().unwrap(), text.len())));
        }
    }
}

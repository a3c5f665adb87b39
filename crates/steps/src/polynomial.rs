//! Polynomials on a stretch: where they turn, and where they pass a value. For any numbers, in bounded time.
//!
//! Roots are found between the roots of the derivative, which are found in the same way: between two of them a polynomial
//! is monotone, and has one root where its ends differ in sign. Newton's method, kept within the bracket by bisection.

/// The most roots of a polynomial of degree 4, which is the derivative of the highest there is.
pub(crate) const ROOTS_MAX: usize = 4;
/// Newton steps or halvings: 64 halvings end a bracket of any width at the last bit.
const ITERATIONS_MAX: u32 = 64;

/// Places in ascending order.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Roots {
    at: [f64; ROOTS_MAX],
    count: usize,
}

impl Roots {
    pub(crate) fn as_slice(&self) -> &[f64] {
        &self.at[..self.count]
    }

    fn push(&mut self, at: f64) {
        if self.count < ROOTS_MAX {
            self.at[self.count] = at;
            self.count += 1;
        }
    }
}

/// `c₀ + c₁·u + c₂·u² + …`
fn value(coefficients: &[f64], u: f64) -> f64 {
    coefficients.iter().rev().fold(0.0, |sum, coefficient| sum * u + coefficient)
}

fn derivative(coefficients: &[f64]) -> [f64; ROOTS_MAX] {
    let mut out = [0.0; ROOTS_MAX];
    for (index, coefficient) in coefficients.iter().enumerate().skip(1) {
        out[index - 1] = index as f64 * coefficient;
    }
    out
}

/// Where a polynomial of degree 4 at most (constant first) changes its sign within 0 < u < 1.
pub(crate) fn sign_changes(coefficients: &[f64]) -> Roots {
    let mut roots = Roots::default();
    // What is left of them is of their degree, or a constant.
    let mut coefficients = coefficients;
    while let [lower @ .., 0.0] = coefficients {
        coefficients = lower;
    }
    let Some((&constant, rest)) = coefficients.split_first() else { return roots };
    // The constant outweighs all else: the usual case.
    if rest.is_empty() || rest.iter().fold(0.0, |sum, coefficient| sum + coefficient.abs()) < constant.abs() {
        return roots;
    }
    let slope = derivative(coefficients);
    let slope = &slope[..coefficients.len() - 1];
    let turns = if slope.len() > 1 { sign_changes(slope) } else { Roots::default() };
    let mut low = (0.0, constant);
    for &high in turns.as_slice().iter().chain(&[1.0]) {
        let high = (high, value(coefficients, high));
        if low.1 * high.1 < 0.0 {
            roots.push(root(coefficients, slope, low, high));
        }
        // A touch is no change of sign, but the next stretch starts on its own side.
        low = (high.0, if high.1 == 0.0 { low.1 } else { high.1 });
    }
    roots
}

/// The root between two places of different sign.
fn root(coefficients: &[f64], slope: &[f64], low: (f64, f64), high: (f64, f64)) -> f64 {
    let rises = low.1 < 0.0;
    let (mut low, mut high) = (low.0, high.0);
    let mut at = 0.5 * (low + high);
    for _ in 0..ITERATIONS_MAX {
        let here = value(coefficients, at);
        *(if (here < 0.0) == rises { &mut low } else { &mut high }) = at;
        let newton = at - here / value(slope, at);
        let next = if newton > low && newton < high { newton } else { 0.5 * (low + high) };
        if (next - at).abs() <= 1e-15 * high {
            return next;
        }
        at = next;
    }
    at
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn all_simple_roots_are_found(mut roots in proptest::collection::vec(-0.5..1.5_f64, 1..5), scale in -9.0..9.0_f64) {
            roots.sort_by(f64::total_cmp);
            prop_assume!(roots.windows(2).all(|pair| pair[1] - pair[0] > 1e-3));
            prop_assume!(roots.iter().all(|root| root.abs() > 1e-3 && (root - 1.0).abs() > 1e-3));
            let mut coefficients = vec![scale];
            for root in &roots {
                let mut product = vec![0.0; coefficients.len() + 1];
                for (index, coefficient) in coefficients.iter().enumerate() {
                    product[index] -= root * coefficient;
                    product[index + 1] += coefficient;
                }
                coefficients = product;
            }
            prop_assume!(scale.abs() > 1e-6);
            let within: Vec<f64> = roots.into_iter().filter(|root| (0.0..1.0).contains(root)).collect();
            let found = sign_changes(&coefficients);
            prop_assert_eq!(found.as_slice().len(), within.len());
            for (found, root) in found.as_slice().iter().zip(within) {
                prop_assert!((found - root).abs() < 1e-6, "{} {}", found, root);
            }
        }

        #[test]
        fn any_numbers_end(coefficients in proptest::collection::vec(any::<f64>(), 0..=5)) {
            let found = sign_changes(&coefficients);
            prop_assert!(found.as_slice().iter().all(|root| (0.0..=1.0).contains(root)));
        }
    }
}

//! A smooth function of the way between two poses, as the polynomial through nine of its values.

/// Number of values.
pub(super) const NODES: usize = 9;

/// Newton's form of the polynomial through the values at [`node`]s: value and derivatives come from the same
/// coefficients, so they belong together exactly.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Polynomial {
    coefficients: [f64; NODES],
}

/// Where value `index` stands between 0 and 1: Chebyshev's points, which keep the polynomial from swinging.
pub(super) fn node(index: usize) -> f64 {
    let angle = std::f64::consts::PI * index as f64 / (NODES - 1) as f64;
    0.5 * (1.0 - libm::cos(angle))
}

impl Polynomial {
    /// The polynomial through `values` at the nodes.
    pub(super) fn through(values: [f64; NODES]) -> Self {
        let mut coefficients = values;
        for order in 1..NODES {
            for i in (order..NODES).rev() {
                coefficients[i] = (coefficients[i] - coefficients[i - 1]) / (node(i) - node(i - order));
            }
        }
        Self { coefficients }
    }

    /// Value, first and second derivative at `s`.
    pub(super) fn at(&self, s: f64) -> [f64; 3] {
        let [mut value, mut first, mut second] = [0.0; 3];
        for (index, coefficient) in self.coefficients.iter().enumerate().rev() {
            let x = s - node(index);
            second = second * x + 2.0 * first;
            first = first * x + value;
            value = value * x + coefficient;
        }
        [value, first, second]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cosine_comes_back_with_its_derivatives() {
        let cosine = Polynomial::through(std::array::from_fn(|i| libm::cos(1.5 * node(i))));
        for i in 0..=100 {
            let s = f64::from(i) / 100.0;
            let expected = [libm::cos(1.5 * s), -1.5 * libm::sin(1.5 * s), -2.25 * libm::cos(1.5 * s)];
            for (order, (got, want)) in cosine.at(s).into_iter().zip(expected).enumerate() {
                // The remainder: at most 1.5⁹ / 9! times the product of the distances to the nodes, 1e-5.
                let tolerance = [2e-9, 1e-7, 1e-5][order];
                assert!((got - want).abs() < tolerance, "derivative {order} at {s}: {got} {want}");
            }
        }
    }
}

//! Small dense linear algebra with sizes known when compiling, so that the loops unroll.

/// `x <- A⁻¹ x` for a symmetric positive definite `a`, of which the upper triangle is read, in place.
///
/// Elimination by rows, `A = Uᵀ D U`: no sum to wait for, and a pivot costs one division and no square root. Whole rows
/// are subtracted, as a fixed length costs less than skipping the lower triangle, which holds nothing of use then.
pub(crate) fn cholesky_solve<const N: usize>(a: &mut [[f64; N]; N], x: &mut [f64; N]) {
    let mut inverse = [0.0; N];
    for k in 0..N {
        let pivot = a[k];
        inverse[k] = 1.0 / pivot[k];
        let value = x[k];
        for i in k + 1..N {
            let scaled = pivot[i] * inverse[k];
            add_scaled(&mut a[i], -scaled, &pivot);
            x[i] -= scaled * value;
        }
    }
    for k in (0..N).rev() {
        x[k] *= inverse[k];
        let value = x[k];
        for i in 0..k {
            x[i] -= a[i][k] * value;
        }
    }
}

/// `a <- a⁻¹` for a symmetric positive definite `a`, in place; false, and nothing of use in `a`, when it is not.
///
/// Gauss-Jordan elimination; a positive definite matrix needs no exchange of rows.
pub(crate) fn invert<const N: usize>(a: &mut [[f64; N]; N]) -> bool {
    for k in 0..N {
        let diagonal = a[k][k];
        if diagonal.is_nan() || diagonal <= 0.0 {
            return false;
        }
        let inverse = 1.0 / diagonal;
        let pivot = a[k].map(|entry| entry * inverse);
        for row in a.iter_mut() {
            let value = row[k];
            add_scaled(row, -value, &pivot);
            row[k] = -value * inverse;
        }
        a[k] = pivot;
        a[k][k] = inverse;
    }
    true
}

/// `x += scale y`
#[inline]
pub(crate) fn add_scaled(x: &mut [f64], scale: f64, y: &[f64]) {
    for (x, y) in x.iter_mut().zip(y) {
        *x += scale * y;
    }
}

/// `x · y`
#[inline]
pub(crate) fn dot(x: &[f64], y: &[f64]) -> f64 {
    x.iter().zip(y).map(|(x, y)| x * y).sum()
}

//! Anderson acceleration of a fixed-point iteration x ← g(x) (Anderson 1965; Walker and Ni 2011; for local/global
//! solvers Peng et al. 2018).
//!
//! From the last m differences of the residual g(x) − x it takes the combination that cancels the present residual
//! best, and applies the same combination to g. Nothing here looks at an energy: the caller keeps or refuses what is
//! proposed.

/// Numbers worked on at a time: all columns' parts of that length stay in the first cache level.
const BLOCK: usize = 512;

/// Relative ridge on the normal equations: the differences grow parallel near the solution.
const RIDGE: f64 = 1e-12;

/// Largest window. Beyond about five differences the normal equations lose more than the history gains.
pub(super) const MAX_WINDOW: usize = 8;

/// The history of one iteration.
pub(super) struct Anderson {
    /// Differences of the residual and of g, one column an iteration, used in turns.
    residuals: Vec<Vec<f64>>,
    values: Vec<Vec<f64>>,
    last_residual: Vec<f64>,
    last_value: Vec<f64>,
    /// Products of the residual columns.
    gram: [[f64; MAX_WINDOW]; MAX_WINDOW],
    filled: usize,
    next: usize,
    started: bool,
}

impl Anderson {
    /// For vectors of `size` numbers and a window of `window` differences, at most [`MAX_WINDOW`]; 0 accelerates
    /// nothing.
    pub fn new(size: usize, window: usize) -> Self {
        let window = window.min(MAX_WINDOW);
        let size = if window == 0 { 0 } else { size };
        Self {
            residuals: vec![vec![0.0; size]; window],
            values: vec![vec![0.0; size]; window],
            last_residual: vec![0.0; size],
            last_value: vec![0.0; size],
            gram: [[0.0; MAX_WINDOW]; MAX_WINDOW],
            filled: 0,
            next: 0,
            started: false,
        }
    }

    /// Forgets the history: the iteration has changed.
    pub fn reset(&mut self) {
        (self.filled, self.next, self.started) = (0, 0, false);
    }

    /// From x and g = g(x), replaces g by the accelerated value; false if there is no history yet and g stays.
    pub fn accelerate(&mut self, x: &[f64], g: &mut [f64]) -> bool {
        let window = self.residuals.len();
        if window == 0 {
            return false;
        }
        if !self.started {
            for ((r, x), g) in self.last_residual.iter_mut().zip(x).zip(&*g) {
                *r = g - x;
            }
            self.last_value.copy_from_slice(g);
            self.started = true;
            return false;
        }
        let column = self.next;
        self.next = (self.next + 1) % window;
        self.filled = (self.filled + 1).min(window);
        let mut products = [0.0; MAX_WINDOW];
        let mut fresh = [0.0; MAX_WINDOW];
        for start in (0..x.len()).step_by(BLOCK) {
            let block = start..(start + BLOCK).min(x.len());
            let (r, v) = (
                &mut self.residuals[column][block.clone()],
                &mut self.values[column][block.clone()],
            );
            let (last_r, last_v) = (
                &mut self.last_residual[block.clone()],
                &mut self.last_value[block.clone()],
            );
            for (i, (x, g)) in x[block.clone()].iter().zip(&g[block.clone()]).enumerate() {
                let residual = g - x;
                r[i] = residual - last_r[i];
                v[i] = g - last_v[i];
                last_r[i] = residual;
                last_v[i] = *g;
            }
            let (new, now) = (
                &self.residuals[column][block.clone()],
                &self.last_residual[block.clone()],
            );
            for j in 0..self.filled {
                let old = &self.residuals[j][block.clone()];
                fresh[j] += dot(old, new);
                products[j] += dot(old, now);
            }
        }
        for j in 0..self.filled {
            self.gram[column][j] = fresh[j];
            self.gram[j][column] = fresh[j];
        }
        if !self.solve(&mut products[..self.filled]) {
            self.reset();
            return self.accelerate(x, g);
        }
        for start in (0..x.len()).step_by(BLOCK) {
            let block = start..(start + BLOCK).min(x.len());
            for (j, factor) in products[..self.filled].iter().enumerate() {
                let old = &self.values[j][block.clone()];
                for (g, v) in g[block.clone()].iter_mut().zip(old) {
                    *g -= factor * v;
                }
            }
        }
        true
    }

    /// Solves the normal equations in place, by Cholesky on columns scaled to unit length; false if they are singular.
    fn solve(&self, rhs: &mut [f64]) -> bool {
        let n = rhs.len();
        let mut scale = [1.0; MAX_WINDOW];
        for (j, s) in scale[..n].iter_mut().enumerate() {
            *s = self.gram[j][j].sqrt();
        }
        if scale.iter().any(|s| !(*s > 0.0 && s.is_finite())) {
            return false;
        }
        let mut l = [[0.0; MAX_WINDOW]; MAX_WINDOW];
        for i in 0..n {
            for j in 0..=i {
                let mut sum = self.gram[i][j] / (scale[i] * scale[j]);
                if i == j {
                    sum += RIDGE;
                }
                for k in 0..j {
                    sum -= l[i][k] * l[j][k];
                }
                if i == j {
                    if sum <= 0.0 {
                        return false;
                    }
                    l[i][i] = sum.sqrt();
                } else {
                    l[i][j] = sum / l[j][j];
                }
            }
        }
        for i in 0..n {
            let mut sum = rhs[i] / scale[i];
            for k in 0..i {
                sum -= l[i][k] * rhs[k];
            }
            rhs[i] = sum / l[i][i];
        }
        for i in (0..n).rev() {
            let mut sum = rhs[i];
            for k in i + 1..n {
                sum -= l[k][i] * rhs[k];
            }
            rhs[i] = sum / l[i][i];
        }
        for (r, s) in rhs.iter_mut().zip(scale) {
            *r /= s;
        }
        true
    }
}

/// In four sums, which the compiler can keep side by side.
#[inline]
fn dot(a: &[f64], b: &[f64]) -> f64 {
    let mut sums = [0.0; 4];
    let (a, b) = (a.chunks_exact(4), b.chunks_exact(4));
    let rest: f64 = a
        .remainder()
        .iter()
        .zip(b.remainder())
        .map(|(a, b)| a * b)
        .sum();
    for (a, b) in a.zip(b) {
        for k in 0..4 {
            sums[k] += a[k] * b[k];
        }
    }
    (sums[0] + sums[1]) + (sums[2] + sums[3]) + rest
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        /// A linear iteration of m dimensions is at its fixed point after m differences.
        #[test]
        fn a_linear_iteration_ends_when_the_window_spans_it(
            rates in prop::array::uniform5(0.05..0.95f64), start in prop::array::uniform5(-1.0..1.0f64),
        ) {
            for (i, a) in rates.iter().enumerate() {
                prop_assume!(rates[..i].iter().all(|b| (a - b).abs() > 0.03));
            }
            // Repeated, so that whole blocks and a rest of one are summed.
            let size = 5 * 331;
            let rate = |i: usize| rates[i % 5];
            let mut x: Vec<f64> = (0..size).map(|i| start[i % 5]).collect();
            let mut anderson = Anderson::new(size, 5);
            let norm = |x: &[f64]| x.iter().map(|v| v * v).sum::<f64>().sqrt();
            let before = norm(&x);
            for _ in 0..8 {
                let mut g: Vec<f64> = x.iter().enumerate().map(|(i, v)| rate(i) * v).collect();
                anderson.accelerate(&x, &mut g);
                x = g;
            }
            prop_assert!(norm(&x) <= 1e-3 * before);
        }
    }

    #[test]
    fn without_a_window_nothing_changes() {
        let mut g = vec![1.0, 2.0];
        assert!(!Anderson::new(2, 0).accelerate(&[0.0, 0.0], &mut g));
        assert_eq!(g, [1.0, 2.0]);
    }
}

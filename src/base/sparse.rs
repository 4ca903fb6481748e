//! Symmetric positive definite systems whose pattern stays while their values change.
//!
//! [`Pattern`] is the lower triangle in compressed columns and gives every entry a *slot*; callers look their slots
//! up once and then only write values. [`Cholesky`] orders and analyses the pattern once (faer, AMD ordering,
//! supernodal where that pays) and factors into memory it keeps. One thread: the result does not depend on the
//! number of processors.

use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::cholesky::ldlt::factor::LdltRegularization;
use faer::linalg::cholesky::llt::factor::LltRegularization;
use faer::sparse::linalg::cholesky::supernodal::SupernodalLdltRef;
use faer::sparse::linalg::cholesky::{
    CholeskySymbolicParams, LltRef, SymbolicCholesky, SymbolicCholeskyRaw, SymmetricOrdering,
    factorize_symbolic_cholesky,
};
use faer::sparse::{SparseColMatRef, SymbolicSparseColMat};
use faer::{Conj, MatMut, Par, Side};

/// The pattern of a symmetric n × n matrix: its lower triangle, diagonal included, in compressed columns.
#[derive(Clone, Debug)]
pub struct Pattern {
    symbolic: SymbolicSparseColMat<u32>,
}

impl Pattern {
    /// The pattern with entries at `pairs` (in either order, repeats allowed) and on the whole diagonal.
    /// Every index must be below `size`.
    pub fn new(size: usize, pairs: impl IntoIterator<Item = (u32, u32)>) -> Self {
        let mut entries: Vec<(u32, u32)> = pairs
            .into_iter()
            .map(|(i, j)| (i.min(j), i.max(j)))
            .collect();
        entries.extend((0..size as u32).map(|i| (i, i)));
        entries.sort_unstable();
        entries.dedup();
        let mut col_ptr = vec![0u32; size + 1];
        for &(col, _) in &entries {
            col_ptr[col as usize + 1] += 1;
        }
        for col in 0..size {
            col_ptr[col + 1] += col_ptr[col];
        }
        let rows = entries.into_iter().map(|(_, row)| row).collect();
        Self {
            symbolic: SymbolicSparseColMat::new_checked(size, size, col_ptr, None, rows),
        }
    }

    /// The pattern of a matrix of `block` × `block` blocks: every entry of `self` becomes a full block.
    pub fn expanded(&self, block: usize) -> Self {
        let size = self.size();
        let (ptr, rows) = (self.symbolic.col_ptr(), self.symbolic.row_idx());
        let mut col_ptr = Vec::with_capacity(size * block + 1);
        let mut expanded = Vec::with_capacity(rows.len() * block * block);
        col_ptr.push(0);
        for col in 0..size {
            for c in 0..block {
                for &row in &rows[ptr[col] as usize..ptr[col + 1] as usize] {
                    // Of the block on the diagonal only the lower triangle is stored.
                    let above = if row as usize == col { c } else { 0 };
                    expanded.extend((above..block).map(|r| row * block as u32 + r as u32));
                }
                col_ptr.push(expanded.len() as u32);
            }
        }
        Self {
            symbolic: SymbolicSparseColMat::new_checked(
                size * block,
                size * block,
                col_ptr,
                None,
                expanded,
            ),
        }
    }

    /// Rows (= columns) of the matrix.
    pub fn size(&self) -> usize {
        self.symbolic.nrows()
    }

    /// Stored entries: the length of the value array.
    pub fn entries(&self) -> usize {
        self.symbolic.row_idx().len()
    }

    /// Where the value of the diagonal entry (i, i) stands in the value array.
    pub fn diagonal(&self, i: usize) -> usize {
        // Every column starts with it.
        self.symbolic.col_ptr()[i] as usize
    }

    /// The product of the symmetric matrix with these `values` and the vector `x`, into `product`.
    pub fn multiply(&self, values: &[f64], x: &[f64], product: &mut [f64]) {
        let (ptr, rows) = (self.symbolic.col_ptr(), self.symbolic.row_idx());
        product.fill(0.0);
        for col in 0..self.size() {
            let (start, end) = (ptr[col] as usize, ptr[col + 1] as usize);
            let here = x[col];
            let mut sum = values[start] * here;
            for (&row, &value) in rows[start + 1..end].iter().zip(&values[start + 1..end]) {
                sum += value * x[row as usize];
                product[row as usize] += value * here;
            }
            product[col] += sum;
        }
    }

    /// Where the value of entry (i, j) stands in the value array; `None` if the pattern has no such entry.
    pub fn slot(&self, i: usize, j: usize) -> Option<usize> {
        let (col, row) = (i.min(j), i.max(j) as u32);
        let (ptr, rows) = (self.symbolic.col_ptr(), self.symbolic.row_idx());
        let (start, end) = (ptr[col] as usize, ptr[col + 1] as usize);
        rows[start..end].binary_search(&row).ok().map(|k| start + k)
    }
}

/// Why a factorisation failed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum FactorError {
    /// A pivot was not positive: the matrix is singular or indefinite at this accuracy.
    #[error("the linear system is not positive definite")]
    NotPositiveDefinite,
    /// The factor does not fit.
    #[error("out of memory while factoring a linear system; use fewer triangles")]
    OutOfMemory,
}

/// A Cholesky factor with its workspace; the symbolic part is computed once.
pub struct Cholesky {
    pattern: Pattern,
    symbolic: SymbolicCholesky<u32>,
    factor: Vec<f64>,
    memory: MemBuffer,
    /// Right-hand sides that `memory` has room for.
    width: usize,
}

impl Cholesky {
    /// Orders and analyses the pattern. Nothing can be solved before [`Cholesky::factor`].
    ///
    /// # Errors
    /// [`FactorError::OutOfMemory`].
    pub fn new(pattern: Pattern) -> Result<Self, FactorError> {
        let symbolic = factorize_symbolic_cholesky(
            pattern.symbolic.as_ref(),
            Side::Lower,
            SymmetricOrdering::Amd,
            CholeskySymbolicParams::default(),
        )
        .map_err(|_| FactorError::OutOfMemory)?;
        let scratch = symbolic
            .factorize_numeric_llt_scratch::<f64>(Par::Seq, Default::default())
            .or(symbolic.solve_in_place_scratch::<f64>(1, Par::Seq));
        let memory = MemBuffer::try_new(scratch).map_err(|_| FactorError::OutOfMemory)?;
        let factor = vec![0.0; symbolic.len_val()];
        Ok(Self {
            pattern,
            symbolic,
            factor,
            memory,
            width: 1,
        })
    }

    /// The pattern, for looking up slots.
    pub fn pattern(&self) -> &Pattern {
        &self.pattern
    }

    /// Factors the matrix whose entries are `values` (by slot).
    ///
    /// # Errors
    /// [`FactorError::NotPositiveDefinite`]; the factor is then unusable until the next success.
    pub fn factor(&mut self, values: &[f64]) -> Result<(), FactorError> {
        let matrix = SparseColMatRef::new(self.pattern.symbolic.as_ref(), values);
        self.symbolic
            .factorize_numeric_llt(
                &mut self.factor,
                matrix,
                Side::Lower,
                LltRegularization::default(),
                Par::Seq,
                MemStack::new(&mut self.memory),
                Default::default(),
            )
            .map(drop)
            .map_err(|_| FactorError::NotPositiveDefinite)
    }

    /// Replaces `rhs` by the solution of the factored system.
    pub fn solve(&mut self, rhs: &mut [f64]) {
        self.solve_columns(rhs, 1);
    }

    /// Replaces each of `count` right-hand sides, one after the other in `rhs`, by its solution. Some dozens at once
    /// cost a fraction of as many single solves, since every part of the factor is read once for all; the last digits
    /// depend on how many there are.
    pub fn solve_columns(&mut self, rhs: &mut [f64], count: usize) {
        if count > self.width {
            let scratch = self
                .symbolic
                .solve_in_place_scratch::<f64>(count, Par::Seq)
                .or(self
                    .symbolic
                    .factorize_numeric_llt_scratch::<f64>(Par::Seq, Default::default()));
            self.memory = MemBuffer::new(scratch);
            self.width = count;
        }
        let size = self.pattern.size();
        LltRef::<'_, u32, f64>::new(&self.symbolic, &self.factor).solve_in_place_with_conj(
            Conj::No,
            MatMut::from_column_major_slice_mut(rhs, size, count),
            Par::Seq,
            MemStack::new(&mut self.memory),
        );
    }
}

/// Number of negative eigenvalues of the symmetric matrix whose entries are `values` (by slot): by Sylvester's law of
/// inertia that of the negative pivots of its LDLᵀ factor. The pivots are taken in the order of the pattern, not of
/// their size, which is sound for matrices that are positive definite but for a few eigenvalues well above rounding.
///
/// # Errors
/// [`FactorError::NotPositiveDefinite`] if a pivot vanishes, [`FactorError::OutOfMemory`].
pub fn negative_eigenvalues(pattern: &Pattern, values: &[f64]) -> Result<usize, FactorError> {
    let symbolic = factorize_symbolic_cholesky(
        pattern.symbolic.as_ref(),
        Side::Lower,
        SymmetricOrdering::Amd,
        CholeskySymbolicParams::default(),
    )
    .map_err(|_| FactorError::OutOfMemory)?;
    let scratch = symbolic.factorize_numeric_ldlt_scratch::<f64>(Par::Seq, Default::default());
    let mut memory = MemBuffer::try_new(scratch).map_err(|_| FactorError::OutOfMemory)?;
    let mut factor = vec![0.0; symbolic.len_val()];
    symbolic
        .factorize_numeric_ldlt(
            &mut factor,
            SparseColMatRef::new(pattern.symbolic.as_ref(), values),
            Side::Lower,
            LdltRegularization::default(),
            Par::Seq,
            MemStack::new(&mut memory),
            Default::default(),
        )
        .map_err(|_| FactorError::NotPositiveDefinite)?;
    // The pivots stand on the diagonal of the factor.
    let mut pivots = Vec::with_capacity(pattern.size());
    match symbolic.raw() {
        SymbolicCholeskyRaw::Simplicial(simplicial) => {
            let starts = &simplicial.col_ptr()[..pattern.size()];
            pivots.extend(starts.iter().map(|&start| factor[start as usize]));
        }
        SymbolicCholeskyRaw::Supernodal(supernodal) => {
            let factor = SupernodalLdltRef::<'_, u32, f64>::new(supernodal, &factor);
            for s in 0..supernodal.n_supernodes() {
                let block = factor.supernode(s).val();
                pivots.extend((0..block.ncols()).map(|k| block[(k, k)]));
            }
        }
    }
    if pivots.iter().any(|p| !p.is_finite() || *p == 0.0) {
        return Err(FactorError::NotPositiveDefinite);
    }
    Ok(pivots.iter().filter(|p| **p < 0.0).count())
}

/// A factor L of [`Cholesky`] by its columns, for solving a few right-hand sides side by side in one pass each way.
///
/// Where a system is small enough for its solve to be bound by how its factor is walked, this walk is the shortest:
/// only what is structurally there, indices of four bytes, and the right-hand sides interleaved, so that every entry
/// of L is read once for all of them. Unknowns stand in the order of elimination, [`Triangle::order`].
#[derive(Clone, Debug)]
pub struct Triangle {
    order: Vec<u32>,
    starts: Vec<u32>,
    rows: Vec<u32>,
    values: Vec<f64>,
    reciprocals: Vec<f64>,
    /// Where the diagonal entries and the others stand in the factor.
    diagonal_slots: Vec<u32>,
    slots: Vec<u32>,
}

impl Triangle {
    /// The structure of the factor; solving needs [`Triangle::refresh`] after each [`Cholesky::factor`].
    pub fn new(cholesky: &Cholesky) -> Self {
        let size = cholesky.pattern.size();
        let order: Vec<u32> = match cholesky.symbolic.perm() {
            Some(perm) => perm.arrays().0.to_vec(),
            None => (0..size as u32).collect(),
        };
        let columns = eliminated(&cholesky.pattern, &order);
        let mut starts = vec![0u32; size + 1];
        for (j, column) in columns.iter().enumerate() {
            starts[j + 1] = starts[j] + column.len() as u32;
        }
        let (mut slots, mut diagonal_slots) =
            (Vec::with_capacity(starts[size] as usize), vec![0; size]);
        // Position in its stored column by row, valid for the rows of one (super)node at a time.
        let mut place = vec![0u32; size];
        match cholesky.symbolic.raw() {
            SymbolicCholeskyRaw::Simplicial(simplicial) => {
                let (ptr, rows) = (simplicial.col_ptr(), simplicial.row_idx());
                for (j, column) in columns.iter().enumerate() {
                    for k in ptr[j]..ptr[j + 1] {
                        place[rows[k as usize] as usize] = k;
                    }
                    diagonal_slots[j] = place[j];
                    slots.extend(column.iter().map(|&row| place[row as usize]));
                }
            }
            SymbolicCholeskyRaw::Supernodal(supernodal) => {
                for s in 0..supernodal.n_supernodes() {
                    let (start, end) = (
                        supernodal.supernode_begin()[s],
                        supernodal.supernode_end()[s],
                    );
                    let pattern = supernodal.supernode(s).pattern();
                    let height = end - start + pattern.len() as u32;
                    for (k, row) in (start..end).chain(pattern.iter().copied()).enumerate() {
                        place[row as usize] = k as u32;
                    }
                    for j in start..end {
                        let first = supernodal.col_ptr_for_val()[s] + (j - start) * height;
                        diagonal_slots[j as usize] = first + (j - start);
                        let column = &columns[j as usize];
                        slots.extend(column.iter().map(|&row| first + place[row as usize]));
                    }
                }
            }
        }
        Self {
            order,
            starts,
            rows: columns.concat(),
            values: vec![0.0; slots.len()],
            reciprocals: vec![0.0; size],
            diagonal_slots,
            slots,
        }
    }

    /// Takes over the values of the factor, which must be of the same [`Cholesky`].
    pub fn refresh(&mut self, cholesky: &Cholesky) {
        let factor = &cholesky.factor;
        for (value, &slot) in self.values.iter_mut().zip(&self.slots) {
            *value = factor[slot as usize];
        }
        for (value, &slot) in self.reciprocals.iter_mut().zip(&self.diagonal_slots) {
            *value = 1.0 / factor[slot as usize];
        }
    }

    /// The unknowns of the matrix in the order of elimination.
    pub fn order(&self) -> &[u32] {
        &self.order
    }

    /// Entries below the diagonal.
    pub fn entries(&self) -> usize {
        self.rows.len()
    }

    /// Replaces `N` right-hand sides, one row an unknown in the order of elimination, by their solutions.
    pub fn solve<const N: usize>(&self, rhs: &mut [[f64; N]]) {
        let size = self.reciprocals.len();
        let rhs = &mut rhs[..size];
        for j in 0..size {
            let here = rhs[j].map(|v| v * self.reciprocals[j]);
            rhs[j] = here;
            let column = self.starts[j] as usize..self.starts[j + 1] as usize;
            for (&row, &value) in self.rows[column.clone()].iter().zip(&self.values[column]) {
                let there = &mut rhs[row as usize];
                for k in 0..N {
                    there[k] -= value * here[k];
                }
            }
        }
        for j in (0..size).rev() {
            let mut here = rhs[j];
            let column = self.starts[j] as usize..self.starts[j + 1] as usize;
            for (&row, &value) in self.rows[column.clone()].iter().zip(&self.values[column]) {
                let there = &rhs[row as usize];
                for k in 0..N {
                    here[k] -= value * there[k];
                }
            }
            rhs[j] = here.map(|v| v * self.reciprocals[j]);
        }
    }
}

/// The rows below the diagonal of every column of the factor, ascending, when the unknowns are eliminated in `order`.
fn eliminated(pattern: &Pattern, order: &[u32]) -> Vec<Vec<u32>> {
    let size = order.len();
    let mut rank = vec![0u32; size];
    for (k, &unknown) in order.iter().enumerate() {
        rank[unknown as usize] = k as u32;
    }
    let mut columns: Vec<Vec<u32>> = vec![Vec::new(); size];
    let (ptr, rows) = (pattern.symbolic.col_ptr(), pattern.symbolic.row_idx());
    for col in 0..size {
        for &row in &rows[ptr[col] as usize + 1..ptr[col + 1] as usize] {
            let (a, b) = (rank[col], rank[row as usize]);
            columns[a.min(b) as usize].push(a.max(b));
        }
    }
    for j in 0..size {
        columns[j].sort_unstable();
        columns[j].dedup();
        // What this column reaches, the first column that it reaches inherits.
        if let Some((&parent, rest)) = columns[j].split_first() {
            let rest = rest.to_vec();
            columns[parent as usize].extend(rest);
        }
    }
    columns
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The Laplacian of an n × m grid has the eigenvalues 4 − 2 cos(aπ/(n+1)) − 2 cos(bπ/(m+1)), sizes on both sides of
    /// where supernodes pay.
    #[test]
    fn negative_eigenvalues_of_a_shifted_grid_laplacian_are_counted() {
        for (n, m) in [(1usize, 1usize), (3, 5), (23, 31), (101, 97)] {
            let at = |i: usize, j: usize| (i * m + j) as u32;
            let mut pairs = Vec::new();
            for i in 0..n {
                for j in 0..m {
                    pairs.extend((i + 1 < n).then(|| (at(i, j), at(i + 1, j))));
                    pairs.extend((j + 1 < m).then(|| (at(i, j), at(i, j + 1))));
                }
            }
            let pattern = Pattern::new(n * m, pairs.iter().copied());
            let line = |k: usize, n: usize| {
                2.0 - 2.0 * (k as f64 * std::f64::consts::PI / (n + 1) as f64).cos()
            };
            let mut exact: Vec<f64> = (1..=n)
                .flat_map(|a| (1..=m).map(move |b| line(a, n) + line(b, m)))
                .collect();
            exact.sort_by(f64::total_cmp);
            for below in [0usize, 1, 4] {
                let Some(&upper) = exact.get(below) else {
                    continue;
                };
                // The 2nd and 3rd of a near-square grid are close, but never so close.
                let lower = if below == 0 { 0.0 } else { exact[below - 1] };
                let shift = 0.5 * (lower + upper);
                let mut values = vec![0.0; pattern.entries()];
                for i in 0..n * m {
                    values[pattern.diagonal(i)] = 4.0 - shift;
                }
                for &(i, j) in &pairs {
                    values[pattern.slot(i as usize, j as usize).unwrap()] = -1.0;
                }
                assert_eq!(negative_eigenvalues(&pattern, &values), Ok(below));
            }
        }
    }

    #[test]
    fn a_grid_laplacian_is_solved_again_after_its_values_change() {
        let side = 20usize;
        let at = |i: usize, j: usize| (i * side + j) as u32;
        let mut pairs = Vec::new();
        for i in 0..side {
            for j in 0..side {
                if i + 1 < side {
                    pairs.push((at(i, j), at(i + 1, j)));
                }
                if j + 1 < side {
                    pairs.push((at(i, j + 1), at(i, j)));
                }
            }
        }
        let mut solver = Cholesky::new(Pattern::new(side * side, pairs.clone())).unwrap();
        for scale in [1.0, 7.0] {
            let mut values = vec![0.0; solver.pattern().entries()];
            let expected: Vec<f64> = (0..side * side).map(|i| (i as f64 * 0.37).sin()).collect();
            let mut rhs = vec![0.0; side * side];
            let mut add = |i: usize, j: usize, v: f64, rhs: &mut [f64]| {
                values[solver.pattern().slot(i, j).unwrap()] += v;
                rhs[i] += v * expected[j];
                if i != j {
                    rhs[j] += v * expected[i];
                }
            };
            for i in 0..side * side {
                add(i, i, 4.5 * scale, &mut rhs);
            }
            for &(i, j) in &pairs {
                add(i as usize, j as usize, -scale, &mut rhs);
            }
            let mut product = vec![0.0; side * side];
            solver.pattern().multiply(&values, &expected, &mut product);
            let off = |a: &f64, b: &f64| (a - b).abs();
            assert!(product.iter().zip(&rhs).all(|(a, b)| off(a, b) < 1e-12));
            assert_eq!(
                solver.pattern().slot(7, 7),
                Some(solver.pattern().diagonal(7))
            );
            solver.factor(&values).unwrap();
            solver.solve(&mut rhs);
            let worst = rhs
                .iter()
                .zip(&expected)
                .map(|(a, b)| (a - b).abs())
                .fold(0.0, f64::max);
            assert!(worst < 1e-12, "{worst:e}");
        }
        let negative = vec![-1.0; solver.pattern().entries()];
        assert_eq!(
            solver.factor(&negative),
            Err(FactorError::NotPositiveDefinite)
        );
    }

    /// A band with some long-range pairs, in both storages that faer has.
    #[test]
    fn the_triangle_solves_as_the_factor_does() {
        for (size, reach) in [(60usize, 2usize), (90, 60)] {
            let pairs = (0..size as u32)
                .flat_map(|i| (1..=reach as u32).map(move |k| (i, (i * 7 + k * k) % size as u32)));
            let pairs: Vec<_> = pairs.filter(|(i, j)| i != j).collect();
            let mut solver = Cholesky::new(Pattern::new(size, pairs.clone())).unwrap();
            let mut triangle = Triangle::new(&solver);
            for shift in [1.0, 5.0] {
                let mut values = vec![0.0; solver.pattern().entries()];
                for &(i, j) in &pairs {
                    let (i, j) = (i as usize, j as usize);
                    for (a, b, v) in [(i, i, 1.0), (j, j, 1.0), (i, j, -1.0)] {
                        values[solver.pattern().slot(a, b).unwrap()] += v;
                    }
                }
                for i in 0..size {
                    values[solver.pattern().diagonal(i)] += shift;
                }
                solver.factor(&values).unwrap();
                triangle.refresh(&solver);
                let side = |c: usize| -> Vec<f64> {
                    (0..size)
                        .map(|i| ((i * (c + 1)) as f64 * 0.7).sin())
                        .collect()
                };
                let mut rows: Vec<[f64; 3]> = triangle
                    .order()
                    .iter()
                    .map(|&i| [0, 1, 2].map(|c| side(c)[i as usize]))
                    .collect();
                triangle.solve(&mut rows);
                for c in 0..3 {
                    let mut expected = side(c);
                    solver.solve(&mut expected);
                    for (row, &i) in rows.iter().zip(triangle.order()) {
                        assert!((row[c] - expected[i as usize]).abs() < 1e-13);
                    }
                }
            }
        }
    }

    #[test]
    fn blocks_expand_to_full_blocks() {
        let pattern = Pattern::new(3, [(2, 0)]).expanded(3);
        assert_eq!(pattern.size(), 9);
        assert!(pattern.slot(6, 2).is_some() && pattern.slot(2, 6).is_some());
        assert!(pattern.slot(3, 0).is_none());
        assert_eq!(pattern.entries(), 3 * 6 + 9);
    }
}

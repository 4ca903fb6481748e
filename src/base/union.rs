//! Disjoint sets (union–find).

/// Elements 0, 1, … in disjoint sets, each set named by its smallest element: the result does not depend on the order
/// of the joins.
#[derive(Clone, Debug)]
pub struct Union {
    parent: Vec<usize>,
}

impl Union {
    /// `count` elements, each alone.
    pub fn new(count: usize) -> Self {
        Self {
            parent: (0..count).collect(),
        }
    }

    /// The smallest element of the set of `n`.
    pub fn root(&mut self, mut n: usize) -> usize {
        while self.parent[n] != n {
            self.parent[n] = self.parent[self.parent[n]];
            n = self.parent[n];
        }
        n
    }

    /// Joins two sets; false if they were one already.
    pub fn join(&mut self, a: usize, b: usize) -> bool {
        let (a, b) = (self.root(a), self.root(b));
        self.parent[a.max(b)] = a.min(b);
        a != b
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sets_are_named_by_their_smallest_element() {
        let mut sets = Union::new(6);
        assert!(sets.join(5, 3) && sets.join(3, 4) && !sets.join(4, 5));
        let roots: Vec<usize> = (0..6).map(|n| sets.root(n)).collect();
        assert_eq!(roots, [0, 1, 2, 3, 3, 3]);
    }
}

//! Typed indices: a vertex number cannot be used where a face number is meant.

use std::marker::PhantomData;
use std::ops::{Deref, DerefMut, Index, IndexMut};

/// An index into one kind of element.
pub trait Id: Copy + Eq + Ord + std::fmt::Debug {
    /// The position in a [`Per`] container, counted from 0.
    fn index(self) -> usize;
    /// The id of the element at `index`. Meshes here have fewer than 2³² elements of a kind.
    fn from_index(index: usize) -> Self;
}

/// Declares a public id type. The number shown to a person (`Display`) counts from 1, as OBJ files do.
macro_rules! typed_id {
    ($(#[$doc:meta])* $name:ident) => {
        $(#[$doc])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
        pub struct $name(pub u32);

        impl $crate::base::ids::Id for $name {
            #[inline]
            fn index(self) -> usize {
                self.0 as usize
            }
            #[inline]
            fn from_index(index: usize) -> Self {
                debug_assert!(index <= u32::MAX as usize);
                Self(index as u32)
            }
        }

        impl std::fmt::Display for $name {
            fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                write!(f, "{}", self.0 as u64 + 1)
            }
        }
    };
}
pub(crate) use typed_id;

/// One value per element, opened by that element's id; also a plain slice for loops over all.
#[derive(Clone, Debug, PartialEq)]
pub struct Per<I, T> {
    values: Vec<T>,
    id: PhantomData<fn(I)>,
}

impl<I: Id, T> Per<I, T> {
    /// Wraps values that are already in the order of their ids.
    pub fn new(values: Vec<T>) -> Self {
        Self {
            values,
            id: PhantomData,
        }
    }

    /// The same value for each of `count` elements.
    pub fn filled(count: usize, value: T) -> Self
    where
        T: Clone,
    {
        Self::new(vec![value; count])
    }

    /// All ids, in order.
    pub fn ids(&self) -> impl ExactSizeIterator<Item = I> + use<I, T> {
        (0..self.values.len()).map(I::from_index)
    }

    /// Ids with their values, in order.
    pub fn iter_ids(&self) -> impl ExactSizeIterator<Item = (I, &T)> {
        self.values
            .iter()
            .enumerate()
            .map(|(i, v)| (I::from_index(i), v))
    }

    /// The values as a vector.
    pub fn into_vec(self) -> Vec<T> {
        self.values
    }
}

impl<I: Id, T> Index<I> for Per<I, T> {
    type Output = T;
    #[inline]
    fn index(&self, id: I) -> &T {
        &self.values[id.index()]
    }
}

impl<I: Id, T> IndexMut<I> for Per<I, T> {
    #[inline]
    fn index_mut(&mut self, id: I) -> &mut T {
        &mut self.values[id.index()]
    }
}

impl<I, T> Deref for Per<I, T> {
    type Target = [T];
    #[inline]
    fn deref(&self) -> &[T] {
        &self.values
    }
}

impl<I, T> DerefMut for Per<I, T> {
    #[inline]
    fn deref_mut(&mut self) -> &mut [T] {
        &mut self.values
    }
}

impl<I: Id, T> FromIterator<T> for Per<I, T> {
    fn from_iter<It: IntoIterator<Item = T>>(iter: It) -> Self {
        Self::new(iter.into_iter().collect())
    }
}

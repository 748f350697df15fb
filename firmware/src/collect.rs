//! What the standard library does with iterators, without its panics.

use heapless::Vec;

/// The first `N` items. `collect` panics where there are more; here a map or a caller has seen to it that there are not.
pub(crate) fn collect<T, const N: usize>(items: impl IntoIterator<Item = T>) -> Vec<T, N> {
    let mut list = Vec::new();
    // There is room for `N`.
    items.into_iter().take(N).for_each(|item| drop(list.push(item)));
    list
}

/// The items with their numbers from 0. `enumerate` checks that its count does not overflow, which no list's does.
pub(crate) fn numbered<T>(items: impl IntoIterator<Item = T>) -> impl Iterator<Item = (usize, T)> {
    let mut next = 0usize;
    items.into_iter().map(move |item| {
        let number = next;
        next = next.wrapping_add(1);
        (number, item)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_does_not_fit_is_left_out() {
        assert_eq!(collect::<_, 3>(0..2), [0, 1]);
        assert_eq!(collect::<_, 3>(0..9), [0, 1, 2]);
        assert!(numbered([7, 8]).eq([(0, 7), (1, 8)]));
    }
}

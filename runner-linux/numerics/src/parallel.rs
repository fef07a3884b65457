//! Work on all threads, its results in the order of the items: the same for any number of threads.
//!
//! An adapter of rayon is compiled anew for every closure that it is given. Here rayon sees one function, which does the
//! work of a number.

use std::convert::Infallible;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};

use rayon::prelude::*;

/// `work` of each item.
pub fn map<T: Sync, R: Send>(items: &[T], work: impl Fn(&T) -> R + Sync) -> Vec<R> {
    numbers(items.len(), |number| work(&items[number]))
}

/// `work` of each number below `count`.
pub fn numbers<R: Send>(count: usize, work: impl Fn(usize) -> R + Sync) -> Vec<R> {
    match try_numbers(count, || (), |(), number| Ok::<R, Infallible>(work(number))) {
        Ok(results) => results,
        Err(never) => match never {},
    }
}

/// `work` of each item.
///
/// # Errors
/// That of the first item that fails; what comes after it may be left out.
pub fn try_map<T: Sync, R: Send, E: Send>(items: &[T], work: impl Fn(&T) -> Result<R, E> + Sync) -> Result<Vec<R>, E> {
    try_numbers(items.len(), || (), |(), number| work(&items[number]))
}

/// `work` of each item, with memory that is made once for each thread.
///
/// # Errors
/// That of the first item that fails; what comes after it may be left out.
pub fn try_map_with<T: Sync, M: Send, R: Send, E: Send>(
    items: &[T],
    memory: impl Fn() -> M + Sync,
    work: impl Fn(&mut M, &T) -> Result<R, E> + Sync,
) -> Result<Vec<R>, E> {
    try_numbers(items.len(), memory, |memory, number| work(memory, &items[number]))
}

/// `work` of each number below `count`, with memory that is made once for each thread.
///
/// # Errors
/// That of the lowest number that fails; what comes after it may be left out.
pub fn try_numbers<M: Send, R: Send, E: Send>(
    count: usize,
    memory: impl Fn() -> M + Sync,
    work: impl Fn(&mut M, usize) -> Result<R, E> + Sync,
) -> Result<Vec<R>, E> {
    let results: Vec<Mutex<Option<Result<R, E>>>> = (0..count).map(|_| Mutex::new(None)).collect();
    let idle = Mutex::new(Vec::new());
    let lowest_failure = AtomicUsize::new(usize::MAX);
    for_each(count, &|number| {
        if number > lowest_failure.load(Ordering::Relaxed) {
            return;
        }
        let mine = lock(&idle).pop();
        let mut mine = mine.unwrap_or_else(&memory);
        let result = work(&mut mine, number);
        if result.is_err() {
            lowest_failure.fetch_min(number, Ordering::Relaxed);
        }
        *lock(&results[number]) = Some(result);
        lock(&idle).push(mine);
    });
    // Nothing is missing before the first failure.
    results.into_iter().filter_map(|result| result.into_inner().unwrap_or_else(PoisonError::into_inner)).collect()
}

fn for_each(count: usize, work: &(dyn Fn(usize) + Sync)) {
    (0..count).into_par_iter().for_each(work);
}

/// Work that panics ends them all before anybody looks.
fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn results_are_in_the_order_of_the_items() {
        let items: Vec<usize> = (0..10_000).rev().collect();
        assert_eq!(map(&items, |item| item * 2), items.iter().map(|item| item * 2).collect::<Vec<_>>());
        assert!(numbers(0, |number| number).is_empty());
    }

    #[test]
    fn the_first_failure_is_told() {
        let fails = |&number: &usize| if number % 1_000 == 700 { Err(number) } else { Ok(number) };
        let items: Vec<usize> = (0..10_000).collect();
        for _ in 0..20 {
            assert_eq!(try_map(&items, fails), Err(700));
        }
        assert_eq!(try_map(&items[..700], fails).map(|all| all.len()), Ok(700));
    }

    #[test]
    fn memory_is_made_for_as_many_as_work_at_once() {
        let made = AtomicUsize::new(0);
        let memory = || made.fetch_add(1, Ordering::Relaxed);
        let results: Result<Vec<()>, ()> = try_map_with(&[(); 5_000], memory, |_, ()| Ok(()));
        assert_eq!(results.map(|all| all.len()), Ok(5_000));
        assert!(made.into_inner() <= rayon::current_num_threads());
    }
}

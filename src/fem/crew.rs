//! Threads that help where others are idle.
//!
//! A solve is mostly one of several that run side by side, each on a thread of its own. Where fewer run than there are
//! threads, those that do share their work with helpers. Helpers are plain threads: rayon's would, while they wait for
//! each other, begin another solve in the middle of this one. What is worked out does not depend on how many help.

use std::cell::Cell;
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Threads that solve, helpers among them.
static AT_WORK: AtomicUsize = AtomicUsize::new(0);

thread_local! {
    static IS_SEATED: Cell<bool> = const { Cell::new(false) };
}

/// The count of this thread among those that solve; ends with the value.
pub(crate) struct Seat {
    is_counted: bool,
}

impl Seat {
    /// Counts this thread, unless it is counted already.
    pub(crate) fn take() -> Seat {
        let is_counted = !IS_SEATED.replace(true);
        if is_counted {
            AT_WORK.fetch_add(1, Ordering::Relaxed);
        }
        Seat { is_counted }
    }
}

impl Drop for Seat {
    fn drop(&mut self) {
        if self.is_counted {
            IS_SEATED.set(false);
            AT_WORK.fetch_sub(1, Ordering::Relaxed);
        }
    }
}

/// Threads that were idle and help until the value ends.
pub(crate) struct Crew {
    helpers: usize,
}

impl Crew {
    /// All threads that are idle.
    pub(crate) fn gather() -> Crew {
        Crew::gather_up_to(usize::MAX)
    }

    /// Threads that are idle, `most` of them at the most: others may need the rest.
    fn gather_up_to(most: usize) -> Crew {
        let threads = rayon::current_num_threads();
        let mut helpers = 0;
        let take = |at_work: usize| {
            // This thread works whether it is counted or not.
            helpers = threads.saturating_sub(at_work.max(1)).min(most);
            (helpers > 0).then_some(at_work + helpers)
        };
        match AT_WORK.fetch_update(Ordering::Relaxed, Ordering::Relaxed, take) {
            Ok(_) => Crew { helpers },
            Err(_) => Crew::alone(),
        }
    }

    /// So many threads, this one among them, whether they are idle or not.
    #[cfg(test)]
    pub(crate) fn of(num_threads: usize) -> Crew {
        AT_WORK.fetch_add(num_threads - 1, Ordering::Relaxed);
        Crew { helpers: num_threads - 1 }
    }

    /// Nobody.
    pub(crate) fn alone() -> Crew {
        Crew { helpers: 0 }
    }

    /// Threads in all, this one among them.
    pub(crate) fn num_threads(&self) -> usize {
        self.helpers + 1
    }

    /// Does `work` on each of `items`, the last first, whoever is free. `state` is made once by each thread.
    pub(crate) fn share<T: Send, S>(
        &self,
        items: Vec<T>,
        state: impl Fn() -> S + Sync,
        work: impl Fn(&mut S, T) + Sync,
    ) {
        let helpers = self.helpers.min(items.len().saturating_sub(1));
        if helpers == 0 {
            let mut state = state();
            return items.into_iter().rev().for_each(|item| work(&mut state, item));
        }
        let items = Mutex::new(items);
        let run = || {
            let mut state = state();
            // A thread that panicked poisons nothing here: its panic ends the scope.
            while let Some(item) = { items.lock().unwrap_or_else(|e| e.into_inner()).pop() } {
                work(&mut state, item);
            }
        };
        std::thread::scope(|scope| {
            for _ in 0..helpers {
                scope.spawn(|| {
                    // The crew counts it.
                    IS_SEATED.set(true);
                    run();
                });
            }
            run();
        });
    }
}

/// What `work` makes of each of `items`, in their order: as many side by side as there are idle threads. Solves in it
/// share what threads are left.
#[cfg(feature = "calibration")]
pub(crate) fn side_by_side<T: Send, R: Send>(items: Vec<T>, work: impl Fn(T) -> R + Sync) -> Vec<R> {
    if items.len() < 2 {
        return items.into_iter().map(work).collect();
    }
    let _seat = Seat::take();
    let crew = Crew::gather_up_to(items.len() - 1);
    let mut results: Vec<Option<R>> = items.iter().map(|_| None).collect();
    let places = items.into_iter().zip(&mut results).collect();
    crew.share(places, || (), |(), (item, place)| *place = Some(work(item)));
    results.into_iter().flatten().collect()
}

/// Stops the others where a thread panics, which would else wait for its turn for ever.
struct StopOnPanic<'a>(&'a AtomicUsize);

impl Drop for StopOnPanic<'_> {
    fn drop(&mut self) {
        if std::thread::panicking() {
            self.0.store(STOPPED, Ordering::Release);
        }
    }
}

/// The turn that never comes.
const STOPPED: usize = usize::MAX;
/// How often a thread looks whether it is its turn before it lets others run.
const LOOKS: usize = 200;

impl Crew {
    /// For each of 0, 1, … `num` − 1: `prepare`, whoever is free, and then, strictly in that order, `commit`. What is
    /// committed is therefore what one thread alone would commit, to the last bit. `state` is made once by each thread.
    ///
    /// # Errors
    /// The first that `prepare` gives, in that order; nothing after it is committed.
    pub(crate) fn in_turn<S, E: Send>(
        &self,
        num: usize,
        state: impl Fn() -> S + Sync,
        prepare: impl Fn(&mut S, usize) -> Result<(), E> + Sync,
        commit: impl FnMut(&S, usize) + Send,
    ) -> Result<(), E> {
        let (next, turn) = (AtomicUsize::new(0), AtomicUsize::new(0));
        let ending = Mutex::new((commit, Ok(())));
        let run = || {
            let _guard = StopOnPanic(&turn);
            let mut state = state();
            loop {
                let index = next.fetch_add(1, Ordering::Relaxed);
                if index >= num {
                    return;
                }
                let prepared = prepare(&mut state, index);
                let mut looks = 0;
                loop {
                    match turn.load(Ordering::Acquire) {
                        STOPPED => return,
                        now if now == index => break,
                        _ if looks < LOOKS => std::hint::spin_loop(),
                        _ => std::thread::yield_now(),
                    }
                    looks += 1;
                }
                // Only the thread whose turn it is asks for the lock.
                let mut ending = ending.lock().unwrap_or_else(|e| e.into_inner());
                match prepared {
                    Ok(()) => (ending.0)(&state, index),
                    Err(error) => {
                        ending.1 = Err(error);
                        turn.store(STOPPED, Ordering::Release);
                        return;
                    }
                }
                turn.store(index + 1, Ordering::Release);
            }
        };
        std::thread::scope(|scope| {
            for _ in 0..self.helpers.min(num.saturating_sub(1)) {
                scope.spawn(run);
            }
            run();
        });
        ending.into_inner().unwrap_or_else(|e| e.into_inner()).1
    }
}

impl Drop for Crew {
    fn drop(&mut self) {
        if self.helpers > 0 {
            AT_WORK.fetch_sub(self.helpers, Ordering::Relaxed);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What is committed comes in order, and ends before the first error.
    #[test]
    fn turns_are_taken_in_order() {
        for threads in [1, 2, 5] {
            let mut seen = Vec::new();
            let square = |state: &mut usize, index: usize| {
                *state = index * index;
                if index == 70 || index == 80 { Err(index) } else { Ok(()) }
            };
            let found = Crew::of(threads).in_turn(100, || 0, square, |&state, index| seen.push((index, state)));
            assert_eq!(found, Err(70));
            assert_eq!(seen, (0..70).map(|i| (i, i * i)).collect::<Vec<_>>());
            assert_eq!(Crew::of(threads).in_turn(0, || 0, square, |_, _| unreachable!()), Ok(()));
        }
    }

    /// A panic is passed on, and nobody waits for the turn that never comes.
    #[test]
    fn a_panic_ends_all_turns() {
        let work = || {
            let panicking = |_: &mut (), index: usize| if index == 5 { panic!("at five") } else { Ok::<(), ()>(()) };
            let _ = Crew::of(3).in_turn(50, || (), panicking, |(), _| {});
        };
        assert!(std::panic::catch_unwind(work).is_err());
    }

    /// Results come in the order of their items, whoever worked on them, and nobody stays counted.
    #[test]
    #[cfg(feature = "calibration")]
    fn results_come_in_order() {
        for threads in [1, 2, 5] {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            for num in [0, 1, 2, 30] {
                let nested = |n: usize| side_by_side(vec![n, n], |n| n * n).into_iter().sum::<usize>();
                let found = pool.install(|| side_by_side((0..num).collect(), nested));
                assert_eq!(found, (0..num).map(|n| 2 * n * n).collect::<Vec<_>>());
            }
            pool.install(|| assert!(!IS_SEATED.get()));
        }
    }

    /// Each item is worked on once.
    #[test]
    fn items_are_shared_without_rest() {
        for threads in [1, 2, 5] {
            let sum = AtomicUsize::new(0);
            Crew::of(threads).share(
                (1..=100).collect(),
                || (),
                |(), i: usize| {
                    sum.fetch_add(i, Ordering::Relaxed);
                },
            );
            assert_eq!(sum.into_inner(), 5050);
        }
    }
}

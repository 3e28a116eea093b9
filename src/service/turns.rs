//! Whose computation is next: few run at a time, and one caller's never more than one.

use std::collections::HashMap;
use std::sync::{Arc, Mutex, PoisonError, Weak};
use tokio::sync::{OwnedSemaphorePermit, Semaphore};

/// Turns for computations that a request waits for. A caller who asks for many waits for his own; with two turns the
/// second is always somebody else's.
#[derive(Debug)]
pub struct Turns {
    all: Arc<Semaphore>,
    of_callers: Mutex<HashMap<String, Weak<Semaphore>>>,
}

/// A turn, until it is dropped.
#[derive(Debug)]
pub struct Turn {
    _of_all: OwnedSemaphorePermit,
    _of_caller: OwnedSemaphorePermit,
    /// Others of the caller find it as long as somebody waits or works.
    _own: Arc<Semaphore>,
}

impl Turns {
    /// So many at a time.
    pub fn new(max: usize) -> Turns {
        Turns { all: Arc::new(Semaphore::new(max)), of_callers: Mutex::default() }
    }

    /// Waits for a turn of `caller`; none once the service ends.
    pub async fn take(&self, caller: &str) -> Option<Turn> {
        let own = {
            let mut callers = self.of_callers.lock().unwrap_or_else(PoisonError::into_inner);
            callers.retain(|_, semaphore| semaphore.strong_count() > 0);
            match callers.get(caller).and_then(Weak::upgrade) {
                Some(own) => own,
                None => {
                    let own = Arc::new(Semaphore::new(1));
                    callers.insert(caller.into(), Arc::downgrade(&own));
                    own
                }
            }
        };
        let _of_caller = own.clone().acquire_owned().await.ok()?;
        let _of_all = self.all.clone().acquire_owned().await.ok()?;
        Some(Turn { _of_all, _of_caller, _own: own })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::Duration;

    #[tokio::test]
    async fn one_caller_leaves_a_turn_to_the_others() {
        let turns = Arc::new(Turns::new(2));
        let first = turns.take("anna").await.expect("a turn");
        let waits = |caller: &'static str| {
            let turns = turns.clone();
            async move { tokio::time::timeout(Duration::from_millis(50), turns.take(caller)).await.is_err() }
        };
        assert!(waits("anna").await, "her second waits for her first");
        let other = turns.take("ben").await.expect("the other turn");
        assert!(waits("cleo").await, "both are taken");
        drop(first);
        assert!(!waits("cleo").await);
        drop(other);
        assert!(!waits("anna").await);
        assert!(turns.of_callers.lock().expect("whole").len() <= 2, "those who are gone are forgotten");
    }
}

//! How many requests, bodies or connections there are at a time: in all, and of each caller.
//!
//! A caller is a token, or an address where there are no tokens. One caller can fill its own share alone.

use super::problem::Problem;
use std::collections::HashMap;
use std::sync::{Arc, Mutex, PoisonError};

/// What is counted.
#[derive(Debug)]
pub struct Quota {
    what: &'static str,
    max: usize,
    max_of_caller: usize,
    counts: Mutex<HashMap<String, usize>>,
}

/// One that is counted for as long as it lives.
#[derive(Debug)]
pub struct Entered {
    quota: Arc<Quota>,
    caller: String,
}

/// Why there is no room for one more.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Full {
    /// The caller has all it may have.
    #[error("you have {limit} {what} at a time, the most that one token or address may have; wait until one has ended")]
    Caller {
        /// What is counted.
        what: &'static str,
        /// Most of one caller.
        limit: usize,
    },
    /// All callers together have all there may be.
    #[error("the service has {limit} {what} at a time, the most it takes; try again")]
    All {
        /// What is counted.
        what: &'static str,
        /// Most in all.
        limit: usize,
    },
}

impl Quota {
    /// At most `max` of `what` (plural) at a time, at most `max_of_caller` of them one caller's.
    pub fn new(what: &'static str, max: usize, max_of_caller: usize) -> Arc<Quota> {
        Arc::new(Quota { what, max, max_of_caller, counts: Mutex::default() })
    }

    /// Counts one more of `caller`.
    ///
    /// # Errors
    /// [`Full`].
    pub fn enter(self: &Arc<Self>, caller: &str) -> Result<Entered, Full> {
        let mut counts = self.counts.lock().unwrap_or_else(PoisonError::into_inner);
        if counts.get(caller).is_some_and(|count| *count >= self.max_of_caller) {
            return Err(Full::Caller { what: self.what, limit: self.max_of_caller });
        }
        if counts.values().sum::<usize>() >= self.max {
            return Err(Full::All { what: self.what, limit: self.max });
        }
        *counts.entry(caller.into()).or_default() += 1;
        Ok(Entered { quota: self.clone(), caller: caller.into() })
    }

    /// How many there are now.
    pub fn count(&self) -> usize {
        self.counts.lock().unwrap_or_else(PoisonError::into_inner).values().sum()
    }
}

impl Drop for Entered {
    fn drop(&mut self) {
        let mut counts = self.quota.counts.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(count) = counts.get_mut(&self.caller) {
            *count -= 1;
            if *count == 0 {
                counts.remove(&self.caller);
            }
        }
    }
}

impl From<Full> for Problem {
    fn from(full: Full) -> Self {
        Problem::new("too-many-requests", full.to_string()).after(1)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_caller_fills_its_own_share_alone() {
        let quota = Quota::new("bodies", 5, 3);
        let mut held: Vec<Entered> = (0..3).map(|_| quota.enter("anna").expect("room")).collect();
        assert_eq!(quota.enter("anna").unwrap_err(), Full::Caller { what: "bodies", limit: 3 });
        held.extend((0..2).map(|_| quota.enter("ben").expect("room")));
        assert_eq!(quota.enter("cleo").unwrap_err(), Full::All { what: "bodies", limit: 5 });
        held.remove(0);
        held.push(quota.enter("cleo").expect("room again"));
        assert_eq!(quota.count(), 5);
        drop(held);
        assert!(quota.counts.lock().expect("whole").is_empty());
    }
}

//! What reading may take of memory: a limit for each reading, and one for all readings of a process together.
//!
//! A few kilobytes can promise, and expand to, gigabytes. So every reader asks here before it allocates what the size
//! of its input does not bound, and gives back what it no longer holds. All limits stand in this file.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

/// What one reading of the command may take, bytes.
const COMMAND_READING_BYTES: u64 = 1 << 30;
/// What one reading of the service may take, bytes.
const SERVICE_READING_BYTES: u64 = 512 << 20;
/// What one JSON body of the service may take once it is parsed, bytes.
const SERVICE_JSON_BYTES: u64 = 256 << 20;

/// Memory that all readings of the command share.
static COMMAND: MemoryPool = MemoryPool::new(4 << 30);
/// Memory that the recordings of all running jobs of the service share.
static JOBS: MemoryPool = MemoryPool::new(1 << 30);
/// Memory that all uploads which the service reads share. Running jobs hold none of it.
static UPLOADS: MemoryPool = MemoryPool::new(512 << 20);
/// Memory that all JSON bodies which the service parses share.
static JSON_BODIES: MemoryPool = MemoryPool::new(256 << 20);
/// Memory that all bodies which the service is receiving share. Slow senders hold none of what readings need.
static BODIES: MemoryPool = MemoryPool::new(256 << 20);

/// Memory that several readings share.
#[derive(Debug)]
pub struct MemoryPool {
    limit_bytes: u64,
    taken_bytes: AtomicU64,
}

impl MemoryPool {
    /// A pool of so many bytes.
    pub const fn new(limit_bytes: u64) -> MemoryPool {
        MemoryPool { limit_bytes, taken_bytes: AtomicU64::new(0) }
    }

    fn take(&self, bytes: u64) -> bool {
        let add = |taken: u64| taken.checked_add(bytes).filter(|sum| *sum <= self.limit_bytes);
        self.taken_bytes.fetch_update(Ordering::AcqRel, Ordering::Acquire, add).is_ok()
    }

    fn give_back(&self, bytes: u64) {
        self.taken_bytes.fetch_sub(bytes, Ordering::AcqRel);
    }

    /// What is taken now, bytes.
    pub fn taken_bytes(&self) -> u64 {
        self.taken_bytes.load(Ordering::Acquire)
    }
}

/// Says that nobody waits for a reading any more.
#[derive(Clone, Debug, Default)]
pub struct StopFlag(Arc<AtomicBool>);

impl StopFlag {
    /// Ends the reading at its next look.
    pub fn stop(&self) {
        self.0.store(true, Ordering::Release);
    }

    /// Whether it is to end.
    pub fn is_stopped(&self) -> bool {
        self.0.load(Ordering::Acquire)
    }
}

/// Why a reading gets no more memory.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum MemoryError {
    /// It would take more than one reading may.
    #[error(
        "{what} would take the memory of this reading to {} MB (limit: {} MB); crop the images to the specimen's box, or give fewer steps or values",
        wanted_bytes / 1_000_000,
        limit_bytes / 1_000_000
    )]
    TooMuch {
        /// What was to be read.
        what: &'static str,
        /// What the reading would hold, bytes.
        wanted_bytes: u64,
        /// What it may hold, bytes.
        limit_bytes: u64,
    },
    /// Other readings of the process hold what is left.
    #[error(
        "other readings hold the memory that {what} needs (all together: {} MB); try again when they have ended",
        limit_bytes / 1_000_000
    )]
    Busy {
        /// What was to be read.
        what: &'static str,
        /// What all may hold together, bytes.
        limit_bytes: u64,
    },
    /// The system has no more.
    #[error("the system gives no memory for {what} ({} MB)", wanted_bytes / 1_000_000)]
    System {
        /// What was to be read.
        what: &'static str,
        /// What was asked for, bytes.
        wanted_bytes: u64,
    },
    /// Nobody waits for it any more.
    #[error("the reading was stopped: nobody waits for it any more")]
    Stopped,
}

/// What a reading may take.
#[derive(Clone, Debug)]
pub struct MemoryLimit {
    /// This reading alone, bytes.
    pub reading_bytes: u64,
    /// What else belongs to this reading and is held already, bytes: a job's recordings are one reading.
    pub beside_bytes: u64,
    /// What it shares with others.
    pub pool: &'static MemoryPool,
    /// Ends it early.
    pub stop: StopFlag,
}

impl MemoryLimit {
    fn of(reading_bytes: u64, pool: &'static MemoryPool) -> MemoryLimit {
        MemoryLimit { reading_bytes, beside_bytes: 0, pool, stop: StopFlag::default() }
    }

    /// Of the command.
    pub fn command() -> MemoryLimit {
        MemoryLimit::of(COMMAND_READING_BYTES, &COMMAND)
    }

    /// Of all recordings that a job of the service reads.
    pub fn job() -> MemoryLimit {
        MemoryLimit::of(SERVICE_READING_BYTES, &JOBS)
    }

    /// Of a recording that is uploaded to the service.
    pub fn upload() -> MemoryLimit {
        MemoryLimit::of(SERVICE_READING_BYTES, &UPLOADS)
    }

    /// Of a JSON body that the service parses.
    pub fn service_json() -> MemoryLimit {
        MemoryLimit::of(SERVICE_JSON_BYTES, &JSON_BODIES)
    }

    /// Of a body of at most `max_bytes` that the service receives.
    pub fn body(max_bytes: u64) -> MemoryLimit {
        MemoryLimit::of(max_bytes, &BODIES)
    }

    /// Begins a reading.
    pub fn begin(&self) -> ReadingMemory {
        ReadingMemory { limit: self.clone(), taken_bytes: AtomicU64::new(0) }
    }
}

/// The memory of one reading; given back when dropped.
#[derive(Debug)]
pub struct ReadingMemory {
    limit: MemoryLimit,
    taken_bytes: AtomicU64,
}

impl ReadingMemory {
    /// Takes memory before it is allocated.
    ///
    /// # Errors
    /// [`MemoryError`].
    pub fn take(&self, what: &'static str, bytes: u64) -> Result<(), MemoryError> {
        self.check()?;
        let limit_bytes = self.limit.reading_bytes;
        let held_bytes = self.limit.beside_bytes.saturating_add(self.taken_bytes.load(Ordering::Acquire));
        let wanted_bytes = held_bytes.saturating_add(bytes);
        if wanted_bytes > limit_bytes {
            return Err(MemoryError::TooMuch { what, wanted_bytes, limit_bytes });
        }
        if !self.limit.pool.take(bytes) {
            return Err(MemoryError::Busy { what, limit_bytes: self.limit.pool.limit_bytes });
        }
        self.taken_bytes.fetch_add(bytes, Ordering::AcqRel);
        Ok(())
    }

    /// Takes the memory of `count` values of type `T`.
    ///
    /// # Errors
    /// [`MemoryError`].
    pub fn take_values<T>(&self, what: &'static str, count: u64) -> Result<(), MemoryError> {
        self.take(what, count.saturating_mul(size_of::<T>() as u64))
    }

    /// An empty list with room for `count` values, whose memory is taken.
    ///
    /// # Errors
    /// [`MemoryError`].
    pub fn list<T>(&self, what: &'static str, count: u64) -> Result<Vec<T>, MemoryError> {
        self.take_values::<T>(what, count)?;
        let wanted_bytes = count.saturating_mul(size_of::<T>() as u64);
        let mut list = Vec::new();
        let reserved = usize::try_from(count).ok().and_then(|count| list.try_reserve_exact(count).ok());
        reserved.ok_or(MemoryError::System { what, wanted_bytes })?;
        Ok(list)
    }

    /// Gives back what is no longer held.
    pub fn give_back(&self, bytes: u64) {
        let bytes = bytes.min(self.taken_bytes.load(Ordering::Acquire));
        self.taken_bytes.fetch_sub(bytes, Ordering::AcqRel);
        self.limit.pool.give_back(bytes);
    }

    /// Gives back the memory of `count` values of type `T`.
    pub fn give_back_values<T>(&self, count: usize) {
        self.give_back((count as u64).saturating_mul(size_of::<T>() as u64));
    }

    /// What is held, bytes.
    pub fn taken_bytes(&self) -> u64 {
        self.taken_bytes.load(Ordering::Acquire)
    }

    /// Whether somebody still waits for the reading.
    ///
    /// # Errors
    /// [`MemoryError::Stopped`].
    pub fn check(&self) -> Result<(), MemoryError> {
        if self.limit.stop.is_stopped() { Err(MemoryError::Stopped) } else { Ok(()) }
    }
}

impl Drop for ReadingMemory {
    fn drop(&mut self) {
        self.limit.pool.give_back(self.taken_bytes());
    }
}

/// What a JSON text may take once it is parsed into values, bytes: an estimate from its punctuation, never below.
///
/// An array of one number takes 160 bytes, an object of one field 720 (a node of its tree has room for eleven), each of
/// five to seven characters.
pub fn json_bytes(text: &[u8]) -> u64 {
    let (mut bytes, mut is_text, mut is_escaped) = (64 + text.len() as u64, false, false);
    for byte in text {
        if is_text {
            match byte {
                _ if is_escaped => is_escaped = false,
                b'\\' => is_escaped = true,
                b'"' => is_text = false,
                _ => {}
            }
            continue;
        }
        bytes += match byte {
            b'"' => {
                is_text = true;
                32
            }
            b',' => 64,
            b'[' => 160,
            b'{' => 720,
            _ => 0,
        };
    }
    bytes
}

#[cfg(test)]
mod tests {
    use super::*;

    static SMALL: MemoryPool = MemoryPool::new(1000);

    #[test]
    fn a_reading_takes_no_more_than_its_limit_and_its_pool() {
        let limit = MemoryLimit::of(800, &SMALL);
        let first = limit.begin();
        first.take("an image", 700).expect("it fits");
        assert_eq!(
            first.take("an image", 101),
            Err(MemoryError::TooMuch { what: "an image", wanted_bytes: 801, limit_bytes: 800 })
        );
        let second = limit.begin();
        assert_eq!(second.take("a mask", 301), Err(MemoryError::Busy { what: "a mask", limit_bytes: 1000 }));
        assert!(matches!(second.take("a mask", u64::MAX), Err(MemoryError::TooMuch { .. })));
        first.give_back(200);
        second.take_values::<f64>("a mask", 37).expect("there is room now");
        drop(first);
        assert_eq!(SMALL.taken_bytes(), 296);
        second.limit.stop.stop();
        assert_eq!(second.take("a mask", 1), Err(MemoryError::Stopped));
        drop(second);
        assert_eq!(SMALL.taken_bytes(), 0);
    }

    #[test]
    fn what_belongs_to_a_reading_counts_against_its_limit() {
        static POOL: MemoryPool = MemoryPool::new(10_000);
        let limit = MemoryLimit::of(800, &POOL);
        let first = limit.begin();
        first.take("an image", 700).expect("it fits");
        let second = MemoryLimit { beside_bytes: first.taken_bytes(), ..limit }.begin();
        second.take("an image", 100).expect("it fits");
        let error = MemoryError::TooMuch { what: "an image", wanted_bytes: 801, limit_bytes: 800 };
        assert_eq!(second.take("an image", 1), Err(error));
        assert_eq!(POOL.taken_bytes(), 800);
    }

    #[test]
    fn json_is_weighed_by_what_it_becomes() {
        assert!(json_bytes(br#"[{"":0},{"":0}]"#) > 2 * 700);
        // Punctuation within text is text.
        assert!(json_bytes(br#""[[[[\"[[[[{{{{,,,,""#) < 200);
    }
}

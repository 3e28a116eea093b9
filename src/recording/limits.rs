//! What reading a recording may take.

use crate::file::MemoryLimit;

/// What reading may take.
#[derive(Clone, Debug)]
pub struct ReadLimits {
    /// Largest file, bytes.
    pub max_file_bytes: u64,
    /// Memory of everything that one recording is read into.
    pub memory: MemoryLimit,
    /// Most steps.
    pub max_steps: usize,
}

impl ReadLimits {
    /// Of a recording that is uploaded to the service.
    pub fn upload() -> ReadLimits {
        ReadLimits { max_file_bytes: 128 << 20, memory: MemoryLimit::upload(), max_steps: 200 }
    }

    /// Of a recording that a job of the service reads; its recordings together are one reading.
    pub fn job() -> ReadLimits {
        ReadLimits { memory: MemoryLimit::job(), ..ReadLimits::upload() }
    }
}

impl Default for ReadLimits {
    /// Of the command.
    fn default() -> Self {
        ReadLimits { max_file_bytes: 1 << 30, memory: MemoryLimit::command(), max_steps: 1000 }
    }
}

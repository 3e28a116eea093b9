//! What reading a recording may take.

/// What reading may take.
#[derive(Clone, Copy, Debug)]
pub struct ReadLimits {
    /// Largest file, bytes.
    pub max_file_bytes: u64,
    /// Most numbers of an image.
    pub max_values: u64,
    /// Most steps.
    pub max_steps: usize,
}

impl Default for ReadLimits {
    fn default() -> Self {
        ReadLimits { max_file_bytes: 1 << 30, max_values: 200_000_000, max_steps: 1000 }
    }
}

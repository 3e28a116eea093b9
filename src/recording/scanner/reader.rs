//! What all files of scanners have in common: volumes that can be asked for, and a list of them.

use super::error::ScannerError;
use crate::file::ReadingMemory;
use crate::recording::nifti::Image;

/// Files of a scanner.
pub trait VolumeReader {
    /// One line for each series.
    fn lines(&self) -> Vec<SeriesLine>;

    /// A volume of a series, counted from 1: values as the scanner scales them; the affine is RAS, mm.
    ///
    /// # Errors
    /// [`ScannerError`].
    fn volume(&self, series: &str, volume: usize, memory: &ReadingMemory) -> Result<Image, ScannerError>;
}

/// One series of a scanner's files.
#[derive(Clone, Debug, PartialEq)]
pub struct SeriesLine {
    /// Its short name, by which it can be asked for.
    pub name: String,
    /// Its full name, by which it can be asked for, too.
    pub identifier: String,
    /// What the operator called it.
    pub description: String,
    /// Images (slices).
    pub num_images: usize,
    /// Volumes; `None` where its images make none.
    pub num_volumes: Option<usize>,
    /// Kinds of its images, as the scanner calls them.
    pub kinds: Vec<String>,
}

impl SeriesLine {
    /// Lines of text, one for each series.
    pub fn table(lines: &[SeriesLine]) -> String {
        let line = |s: &SeriesLine| {
            let volumes = match s.num_volumes {
                Some(1) => "1 volume".to_string(),
                Some(n) => format!("{n} volumes"),
                None => "no volume".to_string(),
            };
            let kinds = s.kinds.join(" or ");
            format!("  {} \"{}\": {} images, {volumes}; {kinds}; {}", s.name, s.description, s.num_images, s.identifier)
        };
        lines.iter().map(line).collect::<Vec<_>>().join("\n")
    }
}

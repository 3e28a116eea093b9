//! Why the files of a scanner were not read.

use crate::file::{MemoryError, ReadError};
use std::path::PathBuf;

/// Why slices make no volume.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum StackFault {
    /// Orientation or spacing are no such.
    #[error("{what} is {found:?}; it must be {requirement}")]
    Number {
        /// Which.
        what: &'static str,
        /// What was found.
        found: Vec<f64>,
        /// What it must be.
        requirement: &'static str,
    },
    /// The slices' distances differ.
    #[error(
        "the distances of neighbouring slices run from {least_mm} to {most_mm} mm: a slice is missing, or it is no regular stack"
    )]
    Distances {
        /// Least, mm.
        least_mm: f64,
        /// Most, mm.
        most_mm: f64,
    },
    /// The slices do not stand above one another.
    #[error("the slices are shifted by up to {shift_mm} mm against the normal of their planes; resample the stack")]
    Shifted {
        /// Largest shift, mm.
        shift_mm: f64,
    },
    /// Some slices were taken more often than others.
    #[error(
        "{few} images lie at {at_mm:?} mm and {many} at other slices: the series is not complete; export all of it"
    )]
    Incomplete {
        /// Images at that place.
        few: usize,
        /// Images at others.
        many: usize,
        /// The place, mm.
        at_mm: [f64; 3],
    },
    /// Images that do not go together.
    #[error("its images differ in {what}: {a} and {b}; give a series whose images agree")]
    Differ {
        /// In what.
        what: &'static str,
        /// One of them.
        a: String,
        /// Another one.
        b: String,
    },
}

/// Why the files of a scanner were not read.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ScannerError {
    /// A file cannot be read.
    #[error("{}: {source}", path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// Why.
        source: ReadError,
    },
    /// It would take more memory than reading may.
    #[error(transparent)]
    Memory(#[from] MemoryError),
    /// A file is no DICOM file.
    #[error("{}: no DICOM file: the letters DICM are missing after the first 128 bytes", path.display())]
    NotDicom {
        /// The file.
        path: PathBuf,
    },
    /// The images are stored in a way that is not read.
    #[error(
        "{}: its transfer syntax is {uid} ({name}); only uncompressed little-endian images are read: convert it, for \
         example with `gdcmconv --raw` or `dcmconv +te`",
        path.display()
    )]
    TransferSyntax {
        /// The file.
        path: PathBuf,
        /// Identifier of the transfer syntax.
        uid: String,
        /// What it is called.
        name: &'static str,
    },
    /// A file ends before what it promises.
    #[error("{}: {what} needs {wanted} bytes, the file has {left} left: it is damaged or cut short", path.display())]
    CutShort {
        /// The file.
        path: PathBuf,
        /// What was to be read.
        what: String,
        /// Bytes that were promised.
        wanted: u64,
        /// Bytes that there are.
        left: u64,
    },
    /// An entry of a header is missing or makes no sense.
    #[error("{}: {entry} is {found}; it must be {requirement}", path.display())]
    Header {
        /// The file.
        path: PathBuf,
        /// Which entry.
        entry: String,
        /// What it holds; `missing` where it is not there.
        found: String,
        /// What it must be.
        requirement: &'static str,
    },
    /// The slices of a series make no volume.
    #[error("series {series}: {fault}")]
    Stack {
        /// The series.
        series: String,
        /// Why.
        fault: StackFault,
    },
    /// The images are not there.
    #[error("{series} is no series of these files, or of several of them. There are:\n{listing}")]
    NoSeries {
        /// What was asked for.
        series: String,
        /// What there is.
        listing: String,
    },
    /// A series has fewer volumes.
    #[error("series {series} has {found} volumes, volume {asked} was asked for; volumes are counted from 1")]
    NoVolume {
        /// The series.
        series: String,
        /// Volumes that it has.
        found: usize,
        /// What was asked for.
        asked: usize,
    },
    /// No list of series was given.
    #[error(
        "which series are the phases along x, y and z, and which the magnitude, at which drive, is not guessed: say it \
         (--series FILE, see the page on files that are imported). There are:\n{listing}"
    )]
    NoSeriesGiven {
        /// What there is.
        listing: String,
    },
    /// There is no image.
    #[error("{}: there is no {what} in it", path.display())]
    NoImage {
        /// The place that was searched.
        path: PathBuf,
        /// What was looked for.
        what: &'static str,
    },
    /// The volumes of a recording do not lie on one grid.
    #[error("volume {volume} of series {series} does not lie on the grid of {first}: {what}; resample it")]
    Grid {
        /// The series.
        series: String,
        /// The volume, from 1.
        volume: usize,
        /// The series of the first volume.
        first: String,
        /// What differs.
        what: &'static str,
    },
    /// The range of the phases cannot be seen.
    #[error(
        "the values of the phases run from {low} to {high}, which fills none of the known ranges (−π to π, −1000π to \
         1000π, 0 to 4096, −4096 to 4096, −2048 to 2048): say which values stand for −π and π (--phase-range LOW,HIGH)"
    )]
    PhaseRange {
        /// Least value.
        low: f64,
        /// Largest value.
        high: f64,
    },
    /// Phases lie outside of the range that was given.
    #[error(
        "the values of the phases run from {low} to {high}, outside of the range {range:?} that was given \
         (--phase-range)"
    )]
    PhaseOutside {
        /// Least value.
        low: f64,
        /// Largest value.
        high: f64,
        /// The range.
        range: [f64; 2],
    },
    /// A magnitude is negative.
    #[error("series {series}: the least magnitude is {least}; give the series of magnitudes, not one of phases")]
    Magnitude {
        /// The series.
        series: String,
        /// Its least value.
        least: f64,
    },
}

//! DICOM images (PS3.3: MR image, single frames or enhanced with many) as volumes.
//!
//! Files are grouped by their series; the slices of a series are sorted along the normal of their planes. Where a place
//! was taken several times (directions, times, phase beside magnitude), the first image of every place is volume 1, the
//! second volume 2 and so on, in the order of instance numbers and frames. What a volume shows is for the caller to
//! say.

use super::dicom_elements::{Elements, name_of, read_elements, tag};
use super::error::{ScannerError, StackFault};
use super::reader::{SeriesLine, VolumeReader};
use super::stack::{Plane, dot};
use crate::file::{ReadingMemory, read_limited};
use crate::recording::nifti::Image;
use std::fs;
use std::path::{Path, PathBuf};

/// Images at one place differ by less than this along the normal, mm.
const SAME_PLACE_MM: f64 = 1e-3;
/// Longest text that is kept of a header, characters.
const TEXT_LENGTH: usize = 64;

/// How the numbers of an image are stored.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Pixels {
    rows: usize,
    columns: usize,
    num_bytes: usize,
    stored: u32,
    shift: u32,
    is_signed: bool,
}

impl Pixels {
    fn value(&self, bytes: &[u8]) -> f64 {
        let mut raw = [0u8; 4];
        raw[..bytes.len()].copy_from_slice(bytes);
        let bits = u64::from(u32::from_le_bytes(raw)) >> self.shift & ((1u64 << self.stored) - 1);
        let is_negative = self.is_signed && bits >> (self.stored - 1) == 1;
        bits as f64 - if is_negative { (1u64 << self.stored) as f64 } else { 0.0 }
    }
}

/// One image of a series.
#[derive(Clone, Debug)]
struct Frame {
    file: usize,
    /// Place among the images of its file.
    index: usize,
    instance: i64,
    position: [f64; 3],
    plane: Plane,
    pixels: Pixels,
    slope: f64,
    intercept: f64,
    kind: String,
}

/// The images of one series.
struct Series {
    uid: String,
    number: Option<i64>,
    description: String,
    frames: Vec<Frame>,
}

/// DICOM files by series.
pub struct DicomFiles {
    paths: Vec<PathBuf>,
    max_file_bytes: u64,
    series: Vec<Series>,
    /// Files that are no images: catalogues, texts.
    num_passed_over: usize,
}

fn shortened(text: Option<String>) -> String {
    text.unwrap_or_default().chars().take(TEXT_LENGTH).collect()
}

/// What went wrong with an entry of a file.
fn entry_fault(path: &Path, tag: u32, found: Option<String>, requirement: &'static str) -> ScannerError {
    let found = found.unwrap_or_else(|| "missing".into());
    ScannerError::Header { path: path.into(), entry: name_of(tag), found, requirement }
}

impl DicomFiles {
    /// Reads the headers of files. Those that are no DICOM files, or without an image, are passed over, and counted.
    ///
    /// # Errors
    /// [`ScannerError`]; [`ScannerError::NoImage`] where none is an image.
    pub fn open(paths: Vec<PathBuf>, max_file_bytes: u64, memory: &ReadingMemory) -> Result<DicomFiles, ScannerError> {
        let mut found = DicomFiles { paths, max_file_bytes, series: Vec::new(), num_passed_over: 0 };
        for file in 0..found.paths.len() {
            let path = found.paths[file].clone();
            let read = with_file(&path, max_file_bytes, memory, |bytes| {
                let before = memory.taken_bytes();
                let elements = match read_elements(bytes, &path, memory) {
                    // A lone file that is none is a mistake; among others it may be anything.
                    Err(ScannerError::NotDicom { .. }) if found.paths.len() > 1 => return Ok(None),
                    read => read?,
                };
                let header_bytes = memory.taken_bytes() - before;
                if elements.bytes(tag::PIXELS).is_none() {
                    return Ok(None);
                }
                let uid = elements.text(tag::SERIES_UID);
                let uid = uid.ok_or_else(|| entry_fault(&path, tag::SERIES_UID, None, "an identifier"))?;
                let frames = frames_of(file, &path, &elements, memory)?;
                let number = elements.text(tag::SERIES_NUMBER).and_then(|text| text.parse().ok());
                memory.give_back(header_bytes);
                Ok(Some(Series {
                    uid: uid.chars().take(TEXT_LENGTH).collect(),
                    number,
                    description: shortened(elements.text(tag::SERIES_DESCRIPTION)),
                    frames,
                }))
            })?;
            match read {
                None => found.num_passed_over += 1,
                Some(new) => match found.series.iter_mut().find(|s| s.uid == new.uid) {
                    Some(series) => series.frames.extend(new.frames),
                    None => found.series.push(new),
                },
            }
        }
        if found.series.is_empty() {
            let path = found.paths.first().cloned().unwrap_or_default();
            return Err(ScannerError::NoImage { path, what: "DICOM image" });
        }
        found.series.sort_by(|a, b| (a.number, &a.uid).cmp(&(b.number, &b.uid)));
        Ok(found)
    }

    /// Files that were passed over: those that are no DICOM files and those without an image.
    pub fn num_passed_over(&self) -> usize {
        self.num_passed_over
    }
}

impl VolumeReader for DicomFiles {
    fn lines(&self) -> Vec<SeriesLine> {
        let line = |series: &Series| SeriesLine {
            name: series.number.map_or_else(|| series.uid.clone(), |number| number.to_string()),
            identifier: series.uid.clone(),
            description: series.description.clone(),
            num_images: series.frames.len(),
            num_volumes: volumes_of(series).map(|v| v.len()).ok(),
            kinds: kinds_of(series),
        };
        self.series.iter().map(line).collect()
    }

    /// A series is named by its identifier (SeriesInstanceUID) or its number.
    fn volume(&self, name: &str, volume: usize, memory: &ReadingMemory) -> Result<Image, ScannerError> {
        let is_asked = |s: &&Series| s.uid == name || s.number.is_some_and(|number| number.to_string() == name);
        let mut asked = self.series.iter().filter(is_asked);
        let (Some(series), None) = (asked.next(), asked.next()) else {
            return Err(ScannerError::NoSeries { series: name.into(), listing: SeriesLine::table(&self.lines()) });
        };
        let in_series = |fault| ScannerError::Stack { series: name.into(), fault };
        let volumes = volumes_of(series).map_err(in_series)?;
        let slices = match volume.checked_sub(1).and_then(|v| volumes.get(v)) {
            Some(slices) => slices,
            None => {
                return Err(ScannerError::NoVolume { series: name.into(), found: volumes.len(), asked: volume });
            }
        };
        let first = slices[0];
        if let Some(other) = slices.iter().find(|s| s.kind != first.kind) {
            let (a, b) = (first.kind.clone(), other.kind.clone());
            return Err(in_series(StackFault::Differ { what: "the image type within one volume", a, b }));
        }
        let positions: Vec<[f64; 3]> = slices.iter().map(|s| s.position).collect();
        let affine = first.plane.affine(&positions).map_err(in_series)?;
        let Pixels { rows, columns, .. } = first.pixels;
        let mut values: Vec<f64> = memory.list("a volume", (rows * columns * slices.len()) as u64)?;
        // Slices of one file are decoded together, so that a file of many frames is read once.
        let mut at = 0;
        while at < slices.len() {
            let file = slices[at].file;
            let count = slices[at..].iter().take_while(|s| s.file == file).count();
            let path = &self.paths[file];
            with_file(path, self.max_file_bytes, memory, |bytes| {
                let before = memory.taken_bytes();
                let elements = read_elements(bytes, path, memory)?;
                for slice in &slices[at..at + count] {
                    decode(slice, path, &elements, &mut values)?;
                }
                memory.give_back(memory.taken_bytes() - before);
                Ok(())
            })?;
            at += count;
        }
        Ok(Image { shape: [columns, rows, slices.len(), 1, 1], affine, intent: 0, values, unit_mm: Some(1.0) })
    }
}

/// Reads a file, hands its bytes on, and gives back what was taken for them.
fn with_file<T>(
    path: &Path,
    max_bytes: u64,
    memory: &ReadingMemory,
    read: impl FnOnce(&[u8]) -> Result<T, ScannerError>,
) -> Result<T, ScannerError> {
    let fail = |source| ScannerError::File { path: path.into(), source };
    let num_bytes = fs::metadata(path).map_err(|e| fail(e.into()))?.len().min(max_bytes);
    memory.take("a DICOM file", num_bytes)?;
    let bytes = read_limited(path, num_bytes).map_err(fail)?;
    let done = read(&bytes)?;
    drop(bytes);
    memory.give_back(num_bytes);
    Ok(done)
}

/// The images of a file.
fn frames_of(
    file: usize,
    path: &Path,
    elements: &Elements,
    memory: &ReadingMemory,
) -> Result<Vec<Frame>, ScannerError> {
    let pixels = pixels_of(path, elements)?;
    let num_frames = match elements.text(tag::FRAMES) {
        None => 1,
        Some(text) => match text.parse::<u64>() {
            Ok(n @ 1..) => n,
            _ => return Err(entry_fault(path, tag::FRAMES, Some(text), "a number from 1 up")),
        },
    };
    let wanted = (pixels.rows * pixels.columns * pixels.num_bytes) as u64;
    let wanted = wanted.saturating_mul(num_frames);
    let left = elements.bytes(tag::PIXELS).unwrap_or_default().len() as u64;
    if wanted > left {
        let what = format!("{} of {num_frames} images", name_of(tag::PIXELS));
        return Err(ScannerError::CutShort { path: path.into(), what, wanted, left });
    }
    let per_frame = elements.items(tag::PER_FRAME);
    if num_frames > 1 && per_frame.len() as u64 != num_frames {
        let found = format!("a list of {} items beside {num_frames} frames", per_frame.len());
        return Err(entry_fault(path, tag::PER_FRAME, Some(found), "a list with an item for each frame"));
    }
    let instance = elements.text(tag::INSTANCE_NUMBER).and_then(|text| text.parse().ok()).unwrap_or(0);
    memory.take("the list of images", num_frames.saturating_mul(2 * (size_of::<Frame>() + 4 * TEXT_LENGTH) as u64))?;
    let shared = elements.items(tag::SHARED).first();
    let frames = (0..num_frames as usize).map(|index| {
        // What a frame has of its own comes before what all share, and both before what the file says as a whole.
        let within = |sequence: u32| {
            let own = per_frame.get(index).and_then(|frame| frame.items(sequence).first());
            own.or_else(|| shared.and_then(|shared| shared.items(sequence).first()))
        };
        let numbers = |sequence: u32, tag: u32| -> Option<Vec<f64>> {
            within(sequence).and_then(|item| item.decimals(tag)).or_else(|| elements.decimals(tag))
        };
        let some = |sequence: u32, tag: u32, requirement: &'static str| {
            let text = || within(sequence).and_then(|i| i.text(tag)).or_else(|| elements.text(tag));
            numbers(sequence, tag).ok_or_else(|| entry_fault(path, tag, text(), requirement))
        };
        let position = some(tag::POSITION_SEQUENCE, tag::POSITION, "three numbers, mm")?;
        let orientation = some(tag::ORIENTATION_SEQUENCE, tag::ORIENTATION, "six numbers")?;
        let spacing = some(tag::MEASURES_SEQUENCE, tag::PIXEL_SPACING, "two numbers, mm")?;
        let (&[x, y, z], &[a, b, c, d, e, f], &[between_rows, between_columns]) =
            (&position[..], &orientation[..], &spacing[..])
        else {
            let found = format!("{position:?}, with {orientation:?} and {spacing:?}");
            let requirement = "three numbers, with six for the orientation and two for the spacing";
            return Err(entry_fault(path, tag::POSITION, Some(found), requirement));
        };
        let scale = |tag: u32, default: f64| match numbers(tag::TRANSFORMATION_SEQUENCE, tag).as_deref() {
            None => Ok(default),
            Some(&[value]) if value.is_finite() => Ok(value),
            Some(found) => Err(entry_fault(path, tag, Some(format!("{found:?}")), "one finite number")),
        };
        let own_kind = within(tag::MR_FRAME_TYPE_SEQUENCE).and_then(|item| item.text(tag::FRAME_TYPE));
        Ok(Frame {
            file,
            index,
            instance,
            position: [x, y, z],
            plane: Plane {
                along: [[a, b, c], [d, e, f]],
                spacing_mm: [between_columns, between_rows],
                thickness_mm: numbers(tag::MEASURES_SEQUENCE, tag::SLICE_THICKNESS).and_then(|t| t.first().copied()),
            },
            pixels,
            slope: scale(tag::SLOPE, 1.0)?,
            intercept: scale(tag::INTERCEPT, 0.0)?,
            kind: shortened(own_kind.or_else(|| elements.text(tag::IMAGE_TYPE))),
        })
    });
    frames.collect()
}

fn pixels_of(path: &Path, elements: &Elements) -> Result<Pixels, ScannerError> {
    let number =
        |tag: u32, default: Option<u16>, requirement: &'static str, is_fit: &dyn Fn(u16) -> bool| match elements
            .u16(tag)
            .or(default.filter(|_| elements.bytes(tag).is_none()))
        {
            Some(value) if is_fit(value) => Ok(value),
            found => Err(entry_fault(path, tag, found.map(|f| f.to_string()), requirement)),
        };
    number(tag::SAMPLES, Some(1), "1: images of colours are none of phases", &|n| n == 1)?;
    let rows = number(tag::ROWS, None, "a number from 1 up", &|n| n > 0)?;
    let columns = number(tag::COLUMNS, None, "a number from 1 up", &|n| n > 0)?;
    let allocated = number(tag::BITS_ALLOCATED, None, "8, 16 or 32", &|n| [8, 16, 32].contains(&n))?;
    let is_within = |n: u16| n > 0 && n <= allocated;
    let stored = number(tag::BITS_STORED, None, "from 1 up to the bits allocated", &is_within)?;
    let is_high = |n: u16| n < allocated && n + 1 >= stored;
    let high = number(tag::HIGH_BIT, Some(stored - 1), "below the bits allocated, all stored bits below it", &is_high)?;
    let sign = number(tag::REPRESENTATION, Some(0), "0 or 1", &|n| n < 2)?;
    Ok(Pixels {
        rows: rows.into(),
        columns: columns.into(),
        num_bytes: usize::from(allocated / 8),
        stored: stored.into(),
        shift: u32::from(high + 1 - stored),
        is_signed: sign == 1,
    })
}

/// Adds the numbers of an image.
fn decode(frame: &Frame, path: &Path, elements: &Elements, values: &mut Vec<f64>) -> Result<(), ScannerError> {
    let Pixels { rows, columns, num_bytes, .. } = frame.pixels;
    let size = rows * columns * num_bytes;
    let bytes = elements.bytes(tag::PIXELS).unwrap_or_default();
    let Some(bytes) = bytes.get(frame.index * size..(frame.index + 1) * size) else {
        // The file has changed since its header was read.
        let (wanted, left) = (((frame.index + 1) * size) as u64, bytes.len() as u64);
        return Err(ScannerError::CutShort { path: path.into(), what: name_of(tag::PIXELS), wanted, left });
    };
    values.extend(bytes.chunks_exact(num_bytes).map(|b| frame.slope * frame.pixels.value(b) + frame.intercept));
    Ok(())
}

/// Kinds of the images of a series, each once, in their order.
fn kinds_of(series: &Series) -> Vec<String> {
    let mut kinds: Vec<String> = Vec::new();
    for frame in &series.frames {
        if !kinds.contains(&frame.kind) {
            kinds.push(frame.kind.clone());
        }
    }
    kinds
}

/// The volumes of a series: slices sorted along the normal.
fn volumes_of(series: &Series) -> Result<Vec<Vec<&Frame>>, StackFault> {
    let Some(first) = series.frames.first() else { return Ok(Vec::new()) };
    first.plane.check()?;
    for frame in &series.frames {
        if frame.pixels.rows != first.pixels.rows || frame.pixels.columns != first.pixels.columns {
            let words = |p: &Pixels| format!("{} × {}", p.columns, p.rows);
            return Err(StackFault::Differ { what: "size", a: words(&first.pixels), b: words(&frame.pixels) });
        }
        let differs = |a: f64, b: f64| !((a - b).abs() <= 1e-3 * a.abs().max(1.0));
        let pairs = [(0, 0), (0, 1), (0, 2), (1, 0), (1, 1), (1, 2)];
        let is_turned = pairs.iter().any(|&(i, c)| differs(first.plane.along[i][c], frame.plane.along[i][c]));
        if is_turned || (0..2).any(|i| differs(first.plane.spacing_mm[i], frame.plane.spacing_mm[i])) {
            let words = |p: &Plane| format!("{:?} at {:?} mm", p.along, p.spacing_mm);
            let what = "orientation or pixel spacing";
            return Err(StackFault::Differ { what, a: words(&first.plane), b: words(&frame.plane) });
        }
    }
    let normal = first.plane.normal();
    let mut sorted: Vec<(f64, &Frame)> = series.frames.iter().map(|f| (dot(f.position, normal), f)).collect();
    sorted.sort_by(|(a, _), (b, _)| a.total_cmp(b));
    let mut places: Vec<Vec<&Frame>> = Vec::new();
    let mut last = f64::NEG_INFINITY;
    for (height, frame) in sorted {
        match places.last_mut() {
            Some(place) if height - last <= SAME_PLACE_MM => place.push(frame),
            _ => places.push(vec![frame]),
        }
        last = height;
    }
    let count = places.iter().map(Vec::len).max().unwrap_or(0);
    if let Some(place) = places.iter().find(|p| p.len() != count) {
        return Err(StackFault::Incomplete { few: place.len(), many: count, at_mm: place[0].position });
    }
    for place in &mut places {
        place.sort_by_key(|f| (f.instance, f.file, f.index));
    }
    Ok((0..count).map(|volume| places.iter().map(|place| place[volume]).collect()).collect())
}

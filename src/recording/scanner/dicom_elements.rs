//! The data elements of a DICOM file (PS3.5, explicit and implicit little-endian). Values are slices of the file's
//! bytes: a length that lies costs no memory.

use super::error::ScannerError;
use crate::file::ReadingMemory;
use std::path::Path;

/// Sequences within sequences up to here; images have three.
const MAX_DEPTH: usize = 16;
/// Length of what ends with a delimiter.
const UNDEFINED: u32 = u32::MAX;
const ITEM: u32 = 0xFFFE_E000;
const END_OF_ITEM: u32 = 0xFFFE_E00D;
const END_OF_SEQUENCE: u32 = 0xFFFE_E0DD;
const TRANSFER_SYNTAX: u32 = 0x0002_0010;
/// Where the letters DICM stand.
const MAGIC_AT: usize = 128;

/// Transfer syntaxes that are not read, by their identifiers (PS3.6, table A-1).
const FOREIGN: [(&str, &str); 14] = [
    ("1.2.840.10008.1.2.1.99", "deflated"),
    ("1.2.840.10008.1.2.2", "big-endian"),
    ("1.2.840.10008.1.2.4.50", "JPEG baseline"),
    ("1.2.840.10008.1.2.4.51", "JPEG extended"),
    ("1.2.840.10008.1.2.4.57", "JPEG lossless"),
    ("1.2.840.10008.1.2.4.70", "JPEG lossless, first-order prediction"),
    ("1.2.840.10008.1.2.4.80", "JPEG-LS lossless"),
    ("1.2.840.10008.1.2.4.81", "JPEG-LS near-lossless"),
    ("1.2.840.10008.1.2.4.90", "JPEG 2000 lossless"),
    ("1.2.840.10008.1.2.4.91", "JPEG 2000"),
    ("1.2.840.10008.1.2.4.201", "high-throughput JPEG 2000 lossless"),
    ("1.2.840.10008.1.2.4.202", "high-throughput JPEG 2000 lossless, by resolution"),
    ("1.2.840.10008.1.2.4.203", "high-throughput JPEG 2000"),
    ("1.2.840.10008.1.2.5", "run lengths"),
];

/// The elements that are kept, by tag, with their names; all others are passed over.
pub(super) mod tag {
    /// What kind of image.
    pub const IMAGE_TYPE: u32 = 0x0008_0008;
    /// What the operator called the series.
    pub const SERIES_DESCRIPTION: u32 = 0x0008_103E;
    /// What kind of frame.
    pub const FRAME_TYPE: u32 = 0x0008_9007;
    /// Thickness of a slice, mm.
    pub const SLICE_THICKNESS: u32 = 0x0018_0050;
    /// In a frame: its type.
    pub const MR_FRAME_TYPE_SEQUENCE: u32 = 0x0018_9226;
    /// Identifier of the series.
    pub const SERIES_UID: u32 = 0x0020_000E;
    /// Number of the series.
    pub const SERIES_NUMBER: u32 = 0x0020_0011;
    /// Number of the image in its series.
    pub const INSTANCE_NUMBER: u32 = 0x0020_0013;
    /// Centre of the first pixel, mm, LPS.
    pub const POSITION: u32 = 0x0020_0032;
    /// Directions of rows and columns, LPS.
    pub const ORIENTATION: u32 = 0x0020_0037;
    /// In a frame: its position.
    pub const POSITION_SEQUENCE: u32 = 0x0020_9113;
    /// In a frame: its orientation.
    pub const ORIENTATION_SEQUENCE: u32 = 0x0020_9116;
    /// Numbers per pixel.
    pub const SAMPLES: u32 = 0x0028_0002;
    /// Frames of the file.
    pub const FRAMES: u32 = 0x0028_0008;
    /// Rows of a frame.
    pub const ROWS: u32 = 0x0028_0010;
    /// Columns of a frame.
    pub const COLUMNS: u32 = 0x0028_0011;
    /// Distance of rows, then of columns, mm.
    pub const PIXEL_SPACING: u32 = 0x0028_0030;
    /// Bits that a number takes.
    pub const BITS_ALLOCATED: u32 = 0x0028_0100;
    /// Bits that are used of them.
    pub const BITS_STORED: u32 = 0x0028_0101;
    /// The highest of the bits that are used.
    pub const HIGH_BIT: u32 = 0x0028_0102;
    /// 1 for numbers with a sign.
    pub const REPRESENTATION: u32 = 0x0028_0103;
    /// What a stored zero stands for.
    pub const INTERCEPT: u32 = 0x0028_1052;
    /// What a stored one adds.
    pub const SLOPE: u32 = 0x0028_1053;
    /// In a frame: its spacing.
    pub const MEASURES_SEQUENCE: u32 = 0x0028_9110;
    /// In a frame: its slope and intercept.
    pub const TRANSFORMATION_SEQUENCE: u32 = 0x0028_9145;
    /// What all frames share.
    pub const SHARED: u32 = 0x5200_9229;
    /// What each frame has of its own.
    pub const PER_FRAME: u32 = 0x5200_9230;
    /// The stored numbers.
    pub const PIXELS: u32 = 0x7FE0_0010;

    /// Every tag above with its name in the standard, and whether it is a sequence.
    pub const ALL: [(u32, &str, bool); 28] = [
        (IMAGE_TYPE, "ImageType", false),
        (SERIES_DESCRIPTION, "SeriesDescription", false),
        (FRAME_TYPE, "FrameType", false),
        (SLICE_THICKNESS, "SliceThickness", false),
        (MR_FRAME_TYPE_SEQUENCE, "MRImageFrameTypeSequence", true),
        (SERIES_UID, "SeriesInstanceUID", false),
        (SERIES_NUMBER, "SeriesNumber", false),
        (INSTANCE_NUMBER, "InstanceNumber", false),
        (POSITION, "ImagePositionPatient", false),
        (ORIENTATION, "ImageOrientationPatient", false),
        (POSITION_SEQUENCE, "PlanePositionSequence", true),
        (ORIENTATION_SEQUENCE, "PlaneOrientationSequence", true),
        (SAMPLES, "SamplesPerPixel", false),
        (FRAMES, "NumberOfFrames", false),
        (ROWS, "Rows", false),
        (COLUMNS, "Columns", false),
        (PIXEL_SPACING, "PixelSpacing", false),
        (BITS_ALLOCATED, "BitsAllocated", false),
        (BITS_STORED, "BitsStored", false),
        (HIGH_BIT, "HighBit", false),
        (REPRESENTATION, "PixelRepresentation", false),
        (INTERCEPT, "RescaleIntercept", false),
        (SLOPE, "RescaleSlope", false),
        (MEASURES_SEQUENCE, "PixelMeasuresSequence", true),
        (TRANSFORMATION_SEQUENCE, "PixelValueTransformationSequence", true),
        (SHARED, "SharedFunctionalGroupsSequence", true),
        (PER_FRAME, "PerFrameFunctionalGroupsSequence", true),
        (PIXELS, "PixelData", false),
    ];
}

/// Name of a kept tag.
pub(super) fn name_of(tag: u32) -> String {
    match tag::ALL.iter().find(|known| known.0 == tag) {
        Some((_, name, _)) => format!("{name} ({:04X},{:04X})", tag >> 16, tag & 0xFFFF),
        None => format!("the element ({:04X},{:04X})", tag >> 16, tag & 0xFFFF),
    }
}

/// What an element holds.
enum Value<'a> {
    Bytes(&'a [u8]),
    Items(Vec<Elements<'a>>),
}

/// The kept elements of a file or of an item of a sequence.
#[derive(Default)]
pub(super) struct Elements<'a> {
    list: Vec<(u32, Value<'a>)>,
}

impl<'a> Elements<'a> {
    /// The bytes of an element.
    pub(super) fn bytes(&self, tag: u32) -> Option<&'a [u8]> {
        self.list.iter().find_map(|(t, value)| match value {
            Value::Bytes(bytes) if *t == tag => Some(*bytes),
            _ => None,
        })
    }

    /// The items of a sequence; none where it is not there.
    pub(super) fn items(&self, tag: u32) -> &[Elements<'a>] {
        let items = self.list.iter().find_map(|(t, value)| match value {
            Value::Items(items) if *t == tag => Some(items.as_slice()),
            _ => None,
        });
        items.unwrap_or_default()
    }

    /// A text without the blanks that fill it up.
    pub(super) fn text(&self, tag: u32) -> Option<String> {
        let text = String::from_utf8_lossy(self.bytes(tag)?);
        let text = text.trim_matches(|c: char| c == '\0' || c.is_whitespace());
        (!text.is_empty()).then(|| text.to_string())
    }

    /// The numbers of a decimal string, at most six.
    pub(super) fn decimals(&self, tag: u32) -> Option<Vec<f64>> {
        self.text(tag)?.split('\\').take(6).map(|part| part.trim().parse().ok()).collect()
    }

    /// An unsigned number of 16 bits.
    pub(super) fn u16(&self, tag: u32) -> Option<u16> {
        let bytes: [u8; 2] = self.bytes(tag)?.try_into().ok()?;
        Some(u16::from_le_bytes(bytes))
    }
}

/// The bytes of a file while they are read.
struct Cursor<'a, 'b> {
    path: &'b Path,
    bytes: &'a [u8],
    at: usize,
    is_explicit: bool,
    memory: &'b ReadingMemory,
}

/// Tag, kind and length of an element; the kind is zero where the file does not say it.
struct Head {
    tag: u32,
    kind: [u8; 2],
    length: u32,
}

impl<'a> Cursor<'a, '_> {
    fn take(&mut self, count: usize, what: impl Fn() -> String) -> Result<&'a [u8], ScannerError> {
        let left = self.bytes.len() - self.at;
        if count > left {
            let (wanted, left) = (count as u64, left as u64);
            return Err(ScannerError::CutShort { path: self.path.into(), what: what(), wanted, left });
        }
        self.at += count;
        Ok(&self.bytes[self.at - count..self.at])
    }

    fn u16(&mut self) -> Result<u16, ScannerError> {
        let b = self.take(2, || "an element".into())?;
        Ok(u16::from_le_bytes([b[0], b[1]]))
    }

    fn u32(&mut self) -> Result<u32, ScannerError> {
        let b = self.take(4, || "an element".into())?;
        Ok(u32::from_le_bytes([b[0], b[1], b[2], b[3]]))
    }

    fn head(&mut self) -> Result<Head, ScannerError> {
        let tag = u32::from(self.u16()?) << 16 | u32::from(self.u16()?);
        // Items and delimiters have no kind.
        if !self.is_explicit || tag >> 16 == 0xFFFE {
            return Ok(Head { tag, kind: [0; 2], length: self.u32()? });
        }
        let kind = self.take(2, || name_of(tag))?;
        let kind = [kind[0], kind[1]];
        let is_long = matches!(
            &kind,
            b"OB" | b"OD" | b"OF" | b"OL" | b"OV" | b"OW" | b"SQ" | b"SV" | b"UC" | b"UN" | b"UR" | b"UT" | b"UV"
        );
        if !is_long {
            return Ok(Head { tag, kind, length: self.u16()?.into() });
        }
        self.take(2, || name_of(tag))?;
        Ok(Head { tag, kind, length: self.u32()? })
    }

    /// Elements up to `end`, or to the end of the item where it is not known.
    fn elements(&mut self, end: Option<usize>, depth: usize) -> Result<Elements<'a>, ScannerError> {
        let mut found = Elements::default();
        while end.is_none_or(|end| self.at < end) {
            self.memory.check()?;
            let head = self.head()?;
            if head.tag == END_OF_ITEM && end.is_none() {
                break;
            }
            let known = tag::ALL.iter().find(|known| known.0 == head.tag);
            let is_sequence = head.kind == *b"SQ"
                || head.length == UNDEFINED
                || known.is_some_and(|(_, _, is_sequence)| *is_sequence);
            let value = if is_sequence {
                // A value of unknown kind and length is a sequence in the implicit form (PS3.5, 6.2.2).
                let was_explicit = self.is_explicit;
                self.is_explicit = was_explicit && head.kind != *b"UN";
                let items = self.sequence(&head, known.is_some(), depth + 1);
                self.is_explicit = was_explicit;
                Value::Items(items?)
            } else {
                Value::Bytes(self.take(head.length as usize, || name_of(head.tag))?)
            };
            if known.is_some() {
                if found.list.iter().any(|(tag, _)| *tag == head.tag) {
                    return Err(self.fault(head.tag, "there twice", "there once"));
                }
                // A list that grows holds its old place beside the new one.
                self.memory.take_values::<[(u32, Value); 2]>("the header of a DICOM file", 1)?;
                found.list.push((head.tag, value));
            }
        }
        match end {
            Some(end) if self.at > end => {
                let wanted = (self.at - end) as u64;
                Err(ScannerError::CutShort { path: self.path.into(), what: "an item".into(), wanted, left: 0 })
            }
            _ => Ok(found),
        }
    }

    fn sequence(&mut self, head: &Head, is_kept: bool, depth: usize) -> Result<Vec<Elements<'a>>, ScannerError> {
        if depth > MAX_DEPTH {
            return Err(self.fault(head.tag, "a sequence in a sequence seventeen times", "one up to sixteen times"));
        }
        let end = if head.length == UNDEFINED {
            None
        } else {
            let left = self.bytes.len() - self.at;
            if head.length as usize > left {
                let (what, wanted, left) = (name_of(head.tag), u64::from(head.length), left as u64);
                return Err(ScannerError::CutShort { path: self.path.into(), what, wanted, left });
            }
            Some(self.at + head.length as usize)
        };
        let mut items = Vec::new();
        while end.is_none_or(|end| self.at < end) {
            let item = self.head()?;
            match item.tag {
                END_OF_SEQUENCE if end.is_none() => break,
                ITEM => {}
                _ => return Err(self.fault(item.tag, "among the items of a sequence", "within an item")),
            }
            let inside = match item.length {
                UNDEFINED => self.elements(None, depth)?,
                length if !is_kept => {
                    self.take(length as usize, || "an item".into())?;
                    continue;
                }
                length => {
                    let left = self.bytes.len() - self.at;
                    if length as usize > left {
                        let (what, wanted, left) = ("an item".into(), u64::from(length), left as u64);
                        return Err(ScannerError::CutShort { path: self.path.into(), what, wanted, left });
                    }
                    self.elements(Some(self.at + length as usize), depth)?
                }
            };
            if is_kept {
                self.memory.take_values::<[Elements; 2]>("the header of a DICOM file", 1)?;
                items.push(inside);
            }
        }
        Ok(items)
    }

    fn fault(&self, tag: u32, found: &str, requirement: &'static str) -> ScannerError {
        ScannerError::Header { path: self.path.into(), entry: name_of(tag), found: found.into(), requirement }
    }
}

/// The kept elements of a DICOM file; `path` is for messages. What they take is taken from `memory`.
///
/// # Errors
/// [`ScannerError`]; [`ScannerError::NotDicom`] where it is no such file.
pub(super) fn read_elements<'a>(
    bytes: &'a [u8],
    path: &Path,
    memory: &ReadingMemory,
) -> Result<Elements<'a>, ScannerError> {
    if bytes.get(MAGIC_AT..MAGIC_AT + 4) != Some(b"DICM") {
        return Err(ScannerError::NotDicom { path: path.into() });
    }
    let mut cursor = Cursor { path, bytes, at: MAGIC_AT + 4, is_explicit: true, memory };
    let mut syntax = None;
    // The file's own group is explicit in every file.
    while cursor.bytes.get(cursor.at..cursor.at + 2) == Some(&[2, 0]) {
        let head = cursor.head()?;
        let value = cursor.take(head.length as usize, || name_of(head.tag))?;
        if head.tag == TRANSFER_SYNTAX {
            let uid = String::from_utf8_lossy(value).trim_matches(|c: char| c == '\0' || c == ' ').to_string();
            syntax = Some(uid);
        }
    }
    cursor.is_explicit = match syntax.as_deref() {
        Some("1.2.840.10008.1.2.1") => true,
        Some("1.2.840.10008.1.2") => false,
        Some(uid) => {
            let name = FOREIGN.iter().find(|known| known.0 == uid).map_or("not known to this program", |known| known.1);
            return Err(ScannerError::TransferSyntax { path: path.into(), uid: uid.into(), name });
        }
        None => return Err(cursor.fault(TRANSFER_SYNTAX, "missing", "a transfer syntax")),
    };
    cursor.elements(Some(bytes.len()), 0)
}

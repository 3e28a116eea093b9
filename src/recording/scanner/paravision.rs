//! Reconstructions of Bruker ParaVision (5 and later): `2dseq` with `visu_pars`, and `reco` and `method` beside them.
//!
//! `visu_pars` alone says what is in `2dseq` and where it lies: sizes, number type and byte order, slope and offset of
//! every frame, and frame groups, the first of which runs fastest. Where `reco` is there, it must agree. Positions are
//! the centres of the first voxels in the patient's frame of DICOM, the rows of an orientation the directions of the
//! image's indices in it.

use super::error::{ScannerError, StackFault};
use super::jcamp::Parameters;
use super::reader::{SeriesLine, VolumeReader};
use super::stack::{Plane, dot};
use crate::file::{ReadingMemory, open_regular};
use crate::recording::nifti::Image;
use std::fs;
use std::io::{Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};

/// Most voxels along an index, and most frames.
const MAX_COUNT: f64 = 1e6;
/// Why a reconstruction is not read whose slices lie backwards.
const SLICE_ORDER: &str = "disk_normal_slice_order; reconstruct it anew with slices in their order";

/// How the numbers of `2dseq` are stored.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Word {
    Uint8,
    Int16,
    Int32,
    Float32,
}

impl Word {
    const NAMES: [(&'static str, Word); 4] = [
        ("_8BIT_UNSGN_INT", Word::Uint8),
        ("_16BIT_SGN_INT", Word::Int16),
        ("_32BIT_SGN_INT", Word::Int32),
        ("_32BIT_FLOAT", Word::Float32),
    ];

    fn num_bytes(self) -> usize {
        match self {
            Word::Uint8 => 1,
            Word::Int16 => 2,
            Word::Int32 | Word::Float32 => 4,
        }
    }

    fn value(self, bytes: &[u8], is_big_endian: bool) -> f64 {
        let mut b = [0u8; 4];
        b[..bytes.len()].copy_from_slice(bytes);
        if is_big_endian {
            b[..bytes.len()].reverse();
        }
        match self {
            Word::Uint8 => f64::from(b[0]),
            Word::Int16 => f64::from(i16::from_le_bytes([b[0], b[1]])),
            Word::Int32 => f64::from(i32::from_le_bytes(b)),
            Word::Float32 => f64::from(f32::from_le_bytes(b)),
        }
    }
}

/// One reconstruction.
struct Reconstruction {
    name: String,
    path: PathBuf,
    description: String,
    kinds: Vec<String>,
    /// Voxels along the first two indices, and slices of a frame.
    size: [usize; 3],
    num_frames: usize,
    /// Slices that are frames of their own, and frames between neighbouring ones.
    slice_frames: (usize, usize),
    plane: Plane,
    /// Centres of the first voxel of every slice (LPS, mm), in the file's order.
    positions: Vec<[f64; 3]>,
    slopes: Vec<f64>,
    offsets: Vec<f64>,
    word: Word,
    is_big_endian: bool,
}

/// The reconstructions of a study.
pub struct ParavisionStudy {
    list: Vec<Reconstruction>,
}

/// A name of a folder.
fn folder_name(path: Option<&Path>) -> Option<String> {
    Some(path?.file_name()?.to_string_lossy().into_owned())
}

impl ParavisionStudy {
    /// Reads the parameters of every `2dseq` among `paths`. A reconstruction is called by the folders of its experiment
    /// and of its own, such as `5/1` for `5/pdata/1/2dseq`. Only files in `paths` are read.
    ///
    /// # Errors
    /// [`ScannerError`]; [`ScannerError::NoImage`] where there is no `2dseq`.
    pub fn open(paths: &[PathBuf], memory: &ReadingMemory) -> Result<ParavisionStudy, ScannerError> {
        let mut list = Vec::new();
        for path in paths.iter().filter(|p| p.file_name().is_some_and(|name| name == "2dseq")) {
            let folder = path.parent().unwrap_or(Path::new(""));
            let experiment = folder.parent().and_then(Path::parent);
            let beside = |at: PathBuf| -> Result<Option<Parameters>, ScannerError> {
                paths.contains(&at).then(|| Parameters::read(&at, memory)).transpose()
            };
            let visu = beside(folder.join("visu_pars"))?;
            let visu = visu.ok_or_else(|| ScannerError::NoImage { path: folder.into(), what: "visu_pars" })?;
            let reco = beside(folder.join("reco"))?;
            let method = match experiment {
                Some(experiment) => beside(experiment.join("method"))?,
                None => None,
            };
            let own = folder_name(Some(folder)).unwrap_or_default();
            let name = folder_name(experiment).map_or_else(|| own.clone(), |experiment| format!("{experiment}/{own}"));
            list.push(reconstruction_of(name, path, &visu, [reco, method], memory)?);
        }
        if list.is_empty() {
            let path = paths.first().cloned().unwrap_or_default();
            return Err(ScannerError::NoImage { path, what: "2dseq" });
        }
        Ok(ParavisionStudy { list })
    }
}

/// Whole numbers from 1 up.
fn counts(visu: &Parameters, name: &str, memory: &ReadingMemory) -> Result<Vec<usize>, ScannerError> {
    let numbers = visu.numbers(name, memory)?;
    let count = |x: &f64| (*x >= 1.0 && *x <= MAX_COUNT && x.fract() == 0.0).then_some(*x as usize);
    let found: Option<Vec<usize>> = numbers.iter().map(count).collect();
    found.ok_or_else(|| visu.fault(name, format!("{numbers:?}"), "whole numbers from 1 to 1000000"))
}

/// The frame groups: for frames that are slices, their number and the frames between neighbouring ones.
fn slice_frames(
    visu: &Parameters,
    num_frames: usize,
    num_places: usize,
    is_flat: bool,
) -> Result<(usize, usize), ScannerError> {
    const ORDER: &str = "VisuFGOrderDesc";
    let groups = visu.groups(ORDER);
    if groups.is_empty() {
        // Without groups every frame is a slice, where it has a place of its own.
        return Ok(if is_flat && num_places == num_frames { (num_frames, 1) } else { (1, 1) });
    }
    let (mut product, mut found) = (1usize, None);
    for group in &groups {
        let length = group.first().and_then(|l| l.parse::<usize>().ok()).filter(|l| *l > 0);
        let length =
            length.ok_or_else(|| visu.fault(ORDER, format!("{group:?}"), "groups that begin with a length"))?;
        if group.get(1).is_some_and(|name| name == "<FG_SLICE>") {
            found = Some((length, product));
        }
        product = product.saturating_mul(length);
    }
    if product != num_frames {
        let words = format!("{product} frames in its groups beside {num_frames} in VisuCoreFrameCount");
        return Err(visu.fault(ORDER, words, "groups whose lengths multiply to the number of frames"));
    }
    match found {
        Some(_) if !is_flat => Err(visu.fault(ORDER, "FG_SLICE", "without slices where frames are volumes")),
        found => Ok(found.unwrap_or((1, 1))),
    }
}

fn reconstruction_of(
    name: String,
    path: &Path,
    visu: &Parameters,
    [reco, method]: [Option<Parameters>; 2],
    memory: &ReadingMemory,
) -> Result<Reconstruction, ScannerError> {
    let in_series = |fault| ScannerError::Stack { series: name.clone(), fault };
    let size = counts(visu, "VisuCoreSize", memory)?;
    let (size, is_flat) = match size[..] {
        [nx, ny] => ([nx, ny, 1], true),
        [nx, ny, nz] => ([nx, ny, nz], false),
        _ => return Err(visu.fault("VisuCoreSize", format!("{size:?}"), "two or three sizes")),
    };
    let num_frames = match counts(visu, "VisuCoreFrameCount", memory)?[..] {
        [n] => n,
        ref found => return Err(visu.fault("VisuCoreFrameCount", format!("{found:?}"), "one number")),
    };
    if let Some(unit) = visu.words("VisuCoreUnits").into_iter().find(|unit| unit != "mm") {
        return Err(visu.fault("VisuCoreUnits", unit, "<mm>"));
    }
    if let Some(order) = visu.word("VisuCoreDiskSliceOrder").filter(|order| order != "disk_normal_slice_order") {
        return Err(visu.fault("VisuCoreDiskSliceOrder", order, SLICE_ORDER));
    }
    let (word, is_big_endian) = number_type(visu, reco.as_ref()).map_err(|error| match error {
        NumberFault::Entry(error) => error,
        NumberFault::Differ(fault) => in_series(fault),
    })?;
    let promised = size.iter().fold((num_frames * word.num_bytes()) as u64, |p, &n| p.saturating_mul(n as u64));
    let fail = |source: std::io::Error| ScannerError::File { path: path.into(), source: source.into() };
    let left = fs::metadata(path).map_err(fail)?.len();
    if promised > left {
        return Err(ScannerError::CutShort { path: path.into(), what: "2dseq".into(), wanted: promised, left });
    }
    if promised < left {
        let found = format!("a description of {promised} bytes beside {left} in 2dseq");
        return Err(visu.fault("VisuCoreSize and VisuCoreFrameCount", found, "those of 2dseq"));
    }
    let extent = visu.numbers("VisuCoreExtent", memory)?;
    if extent.len() != if is_flat { 2 } else { 3 } {
        return Err(visu.fault("VisuCoreExtent", format!("{extent:?}"), "as many numbers as VisuCoreSize has"));
    }
    let orientations = visu.numbers("VisuCoreOrientation", memory)?;
    let places = visu.numbers("VisuCorePosition", memory)?;
    let (Some(matrix), 0, 0) = (orientations.get(..9), orientations.len() % 9, places.len() % 3) else {
        let found = format!("{} numbers, with {} of VisuCorePosition", orientations.len(), places.len());
        return Err(visu.fault("VisuCoreOrientation", found, "nine numbers for each position of three"));
    };
    if let Some(other) = orientations.chunks(9).find(|o| o.iter().zip(matrix).any(|(a, b)| (a - b).abs() > 1e-3)) {
        let (a, b) = (format!("{matrix:?}"), format!("{other:?}"));
        return Err(in_series(StackFault::Differ { what: "orientation", a, b }));
    }
    let direction = |row: usize| [matrix[3 * row], matrix[3 * row + 1], matrix[3 * row + 2]];
    let thickness = visu.numbers("VisuCoreFrameThickness", memory).ok().and_then(|t| t.first().copied());
    let depth_mm = if is_flat { 0.0 } else { extent[2] / size[2] as f64 };
    let plane = Plane {
        along: [direction(0), direction(1)],
        spacing_mm: [extent[0] / size[0] as f64, extent[1] / size[1] as f64],
        thickness_mm: if is_flat { thickness } else { Some(depth_mm) },
    };
    plane.check().map_err(in_series)?;
    let slices = slice_frames(visu, num_frames, places.len() / 3, is_flat)?;
    let positions: Vec<[f64; 3]> = if is_flat {
        places.chunks_exact(3).map(|p| [p[0], p[1], p[2]]).collect()
    } else {
        // The planes of a volume follow one another along its third direction.
        let at = |c: usize, k: usize| places.get(c).copied().unwrap_or(f64::NAN) + k as f64 * depth_mm * matrix[6 + c];
        (0..size[2]).map(|k| [at(0, k), at(1, k), at(2, k)]).collect()
    };
    if is_flat && positions.len() != slices.0 {
        let found = format!("{} positions beside {} slices", positions.len(), slices.0);
        return Err(visu.fault("VisuCorePosition", found, "one position for each slice"));
    }
    let scale = |entry: &str| -> Result<Vec<f64>, ScannerError> {
        let numbers = visu.numbers(entry, memory)?;
        match numbers[..] {
            [one] => Ok(vec![one; num_frames]),
            _ if numbers.len() == num_frames => Ok(numbers),
            _ => Err(visu.fault(entry, format!("{} numbers", numbers.len()), "one number for each frame")),
        }
    };
    memory.take_values::<[f64; 2]>("slopes and offsets", num_frames as u64)?;
    let (slopes, offsets) = (scale("VisuCoreDataSlope")?, scale("VisuCoreDataOffs")?);
    let protocol = visu.word("VisuAcquisitionProtocol").unwrap_or_default();
    let method = method.and_then(|m| m.word("Method")).unwrap_or_default();
    let description = [protocol, method].into_iter().filter(|w| !w.is_empty()).collect::<Vec<_>>().join(", ");
    let kinds = visu.words("VisuCoreFrameType");
    Ok(Reconstruction {
        name: name.clone(),
        path: path.into(),
        description,
        kinds,
        size,
        num_frames,
        slice_frames: slices,
        plane,
        positions,
        slopes,
        offsets,
        word,
        is_big_endian,
    })
}

/// What can be wrong with how numbers are stored.
enum NumberFault {
    Entry(ScannerError),
    Differ(StackFault),
}

/// Type and byte order of the numbers; `reco`, where it is there, must say the same.
fn number_type(visu: &Parameters, reco: Option<&Parameters>) -> Result<(Word, bool), NumberFault> {
    const TYPE: &str = "VisuCoreWordType";
    let name = visu.word(TYPE).unwrap_or_else(|| "missing".into());
    let found = Word::NAMES.iter().find(|(known, _)| *known == name);
    let requirement = "_8BIT_UNSGN_INT, _16BIT_SGN_INT, _32BIT_SGN_INT or _32BIT_FLOAT";
    let word = found.ok_or_else(|| NumberFault::Entry(visu.fault(TYPE, name.clone(), requirement)))?.1;
    let order = visu.word("VisuCoreByteOrder").unwrap_or_else(|| "missing".into());
    let is_big_endian = match order.as_str() {
        "littleEndian" => false,
        "bigEndian" => true,
        _ => return Err(NumberFault::Entry(visu.fault("VisuCoreByteOrder", order, "littleEndian or bigEndian"))),
    };
    for (entry, what, said) in [
        ("RECO_wordtype", "number type (RECO_wordtype and VisuCoreWordType)", &name),
        ("RECO_byte_order", "byte order (RECO_byte_order and VisuCoreByteOrder)", &order),
    ] {
        if let Some(other) = reco.and_then(|reco| reco.word(entry)).filter(|other| other != said) {
            return Err(NumberFault::Differ(StackFault::Differ { what, a: other, b: said.clone() }));
        }
    }
    Ok((word, is_big_endian))
}

impl VolumeReader for ParavisionStudy {
    fn lines(&self) -> Vec<SeriesLine> {
        let line = |r: &Reconstruction| SeriesLine {
            name: r.name.clone(),
            identifier: r.path.display().to_string(),
            description: r.description.clone(),
            num_images: r.num_frames,
            num_volumes: Some(r.num_frames / r.slice_frames.0),
            kinds: r.kinds.clone(),
        };
        self.list.iter().map(line).collect()
    }

    /// A series is a reconstruction, named by its experiment and its own number, such as `5/1`. Volumes follow one
    /// another as the frame groups other than that of the slices do, the first of them fastest.
    fn volume(&self, name: &str, volume: usize, memory: &ReadingMemory) -> Result<Image, ScannerError> {
        let mut asked = self.list.iter().filter(|r| r.name == name);
        let (Some(r), None) = (asked.next(), asked.next()) else {
            return Err(ScannerError::NoSeries { series: name.into(), listing: SeriesLine::table(&self.lines()) });
        };
        let (num_slices, stride) = r.slice_frames;
        let num_volumes = r.num_frames / num_slices;
        let Some(volume) = volume.checked_sub(1).filter(|v| *v < num_volumes) else {
            return Err(ScannerError::NoVolume { series: name.into(), found: num_volumes, asked: volume });
        };
        let in_series = |fault| ScannerError::Stack { series: name.into(), fault };
        // Planes along the normal, each with its frame and its place in it.
        let normal = r.plane.normal();
        let [nx, ny, nz] = r.size;
        let mut planes: Vec<(usize, usize, [f64; 3])> = (0..r.positions.len())
            .map(|p| {
                let (slice, within) = (p / nz, p % nz);
                let frame = volume % stride + stride * (slice + num_slices * (volume / stride));
                (frame, within, r.positions[p])
            })
            .collect();
        planes.sort_by(|a, b| dot(a.2, normal).total_cmp(&dot(b.2, normal)));
        let positions: Vec<[f64; 3]> = planes.iter().map(|p| p.2).collect();
        let affine = r.plane.affine(&positions).map_err(in_series)?;
        let mut values: Vec<f64> = memory.list("a volume", (nx * ny * planes.len()) as u64)?;
        let num_bytes = nx * ny * r.word.num_bytes();
        let mut bytes: Vec<u8> = memory.list("a slice", num_bytes as u64)?;
        bytes.resize(num_bytes, 0);
        let fail = |source: std::io::Error| ScannerError::File { path: r.path.clone(), source: source.into() };
        let mut file = open_regular(&r.path).map_err(|source| ScannerError::File { path: r.path.clone(), source })?;
        for &(frame, within, _) in &planes {
            memory.check()?;
            file.seek(SeekFrom::Start((frame * nz + within) as u64 * num_bytes as u64)).map_err(fail)?;
            file.read_exact(&mut bytes).map_err(fail)?;
            let (slope, offset) = (r.slopes[frame], r.offsets[frame]);
            let words = bytes.chunks_exact(r.word.num_bytes());
            values.extend(words.map(|b| slope * r.word.value(b, r.is_big_endian) + offset));
        }
        memory.give_back_values::<u8>(num_bytes);
        Ok(Image { shape: [nx, ny, planes.len(), 1, 1], affine, intent: 0, values, unit_mm: Some(1.0) })
    }
}

//! NIfTI-1 images, one file, plain or gzip (`.nii`, `.nii.gz`).
//!
//! Reading is bounded: what a compressed file expands to is limited by what its header promises, and that by the memory
//! that the caller allows. Numbers are decoded piece by piece; the file's own bytes are never held as a whole.

use crate::file::{MemoryError, ReadingMemory};
use flate2::Compression;
use flate2::read::GzDecoder;
use flate2::write::GzEncoder;
use std::io::{self, Read, Write};

const HEADER_BYTES: usize = 348;
/// Intent of a displacement vector.
pub const INTENT_DISPLACEMENT: i16 = 1006;
const UNITS_MM: u8 = 2;
const FLOAT32: i16 = 16;
const UINT8: i16 = 2;
/// Headers may be followed by extensions up to here, bytes.
const MAX_OFFSET: f64 = 1048576.0;
/// Numbers that are decoded at a time.
const PIECE: usize = 1 << 14;

/// An image: numbers on a grid.
#[derive(Clone, Debug, PartialEq)]
pub struct Image {
    /// Voxels along x, y, z, time, and numbers per voxel.
    pub shape: [usize; 5],
    /// Rows of the affine: position (mm) = rows · (i, j, k, 1).
    pub affine: [[f64; 4]; 3],
    /// NIfTI intent code: 1006 for displacements, 0 for none.
    pub intent: i16,
    /// Values, x fastest, components slowest.
    pub values: Vec<f64>,
    /// The affine's unit of length in mm; `None` where the header names none.
    pub unit_mm: Option<f64>,
}

/// How the numbers of a written image are stored.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Samples {
    /// 32-bit floating point.
    Float32,
    /// Bytes.
    Uint8,
}

/// Why an image cannot be used.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum NiftiError {
    /// The file ends early or its compression is damaged.
    #[error("the file is damaged or cut short: {0}")]
    Damaged(io::Error),
    /// Not a NIfTI-1 file.
    #[error("not a NIfTI-1 file in one piece (magic n+1)")]
    NotNifti,
    /// A kind of number that is not read.
    #[error("data type {code} is not read; store float32, float64, int16, int32, uint8 or uint16")]
    DataType {
        /// NIfTI data type.
        code: i16,
    },
    /// Sizes that make no sense.
    #[error("dimensions {dim:?} are not those of an image")]
    Dimensions {
        /// The header's `dim`.
        dim: [i16; 8],
    },
    /// More numbers than memory is allowed for.
    #[error("the header promises more numbers than may be read: {0}")]
    Memory(#[from] MemoryError),
    /// The data begin at no place in the file.
    #[error("vox_offset is {offset}; data begin at a whole number of bytes from 352 to {MAX_OFFSET}")]
    Offset {
        /// The header's `vox_offset`.
        offset: f64,
    },
    /// Wrong intent.
    #[error("the intent is {found}; displacements have 1006")]
    Intent {
        /// The intent found.
        found: i16,
    },
    /// Wrong spatial unit.
    #[error("the spatial unit is code {code}; mm is code 2")]
    Units {
        /// NIfTI unit code.
        code: u8,
    },
    /// Wrong number of components or time points.
    #[error("the shape is {found:?}; (nx, ny, nz, {expected_time}, {expected_components}) is needed")]
    Shape {
        /// The shape found.
        found: [usize; 5],
        /// Time points needed.
        expected_time: usize,
        /// Components needed.
        expected_components: usize,
    },
    /// The grid is turned or mirrored against the specimen's frame.
    #[error(
        "the affine turns, mirrors or shears the grid; voxels must lie along the specimen's axes in increasing order"
    )]
    Orientation,
    /// The file has neither an sform nor a qform.
    #[error("neither sform nor qform says where the voxels lie")]
    NoAffine,
}

/// Numbers of the header at byte offsets, in the file's byte order.
struct Header {
    bytes: [u8; HEADER_BYTES],
    is_big_endian: bool,
}

impl Header {
    fn i16(&self, at: usize) -> i16 {
        let b = [self.bytes[at], self.bytes[at + 1]];
        if self.is_big_endian { i16::from_be_bytes(b) } else { i16::from_le_bytes(b) }
    }

    fn f32(&self, at: usize) -> f64 {
        let b = [0, 1, 2, 3].map(|n| self.bytes[at + n]);
        f64::from(if self.is_big_endian { f32::from_be_bytes(b) } else { f32::from_le_bytes(b) })
    }
}

impl Image {
    /// Reads an image from a plain or gzip stream into memory taken from `memory`.
    ///
    /// # Errors
    /// [`NiftiError`].
    pub fn read(stream: impl Read, memory: &ReadingMemory) -> Result<Image, NiftiError> {
        let (image, units) = Image::read_with_units(stream, memory)?;
        if units == UNITS_MM { Ok(image) } else { Err(NiftiError::Units { code: units }) }
    }

    /// The same in any unit of length, or in none.
    ///
    /// # Errors
    /// [`NiftiError`].
    pub fn read_any_unit(stream: impl Read, memory: &ReadingMemory) -> Result<Image, NiftiError> {
        Image::read_with_units(stream, memory).map(|(image, _)| image)
    }

    /// The image and the header's code of its unit of length.
    fn read_with_units(mut stream: impl Read, memory: &ReadingMemory) -> Result<(Image, u8), NiftiError> {
        let mut magic = [0u8; 2];
        stream.read_exact(&mut magic).map_err(NiftiError::Damaged)?;
        let whole = magic.as_slice().chain(stream);
        if magic == [0x1f, 0x8b] { read_plain(GzDecoder::new(whole), memory) } else { read_plain(whole, memory) }
    }

    /// Writes the image, compressed.
    ///
    /// # Errors
    /// What the stream says.
    pub fn write_gz(&self, stream: impl Write, samples: Samples) -> io::Result<()> {
        let mut out = GzEncoder::new(stream, Compression::default());
        let mut header = [0u8; HEADER_BYTES + 4];
        let mut put = |at: usize, bytes: &[u8]| header[at..at + bytes.len()].copy_from_slice(bytes);
        put(0, &(HEADER_BYTES as i32).to_le_bytes());
        let num_dims: i16 = if self.shape[3..] == [1, 1] { 3 } else { 5 };
        put(40, &num_dims.to_le_bytes());
        for (n, &size) in self.shape.iter().enumerate() {
            put(42 + 2 * n, &(size as i16).to_le_bytes());
        }
        for n in 6..8 {
            put(40 + 2 * n, &1i16.to_le_bytes());
        }
        put(68, &self.intent.to_le_bytes());
        let (code, bits) = match samples {
            Samples::Float32 => (FLOAT32, 32i16),
            Samples::Uint8 => (UINT8, 8),
        };
        put(70, &code.to_le_bytes());
        put(72, &bits.to_le_bytes());
        put(76, &1f32.to_le_bytes());
        for axis in 0..3 {
            let edge = (0..3).map(|i| self.affine[i][axis].powi(2)).sum::<f64>().sqrt() as f32;
            put(80 + 4 * axis, &edge.to_le_bytes());
        }
        put(92, &1f32.to_le_bytes());
        put(96, &1f32.to_le_bytes());
        put(108, &((HEADER_BYTES + 4) as f32).to_le_bytes());
        put(112, &1f32.to_le_bytes());
        put(123, &[UNITS_MM]);
        put(254, &1i16.to_le_bytes());
        for (i, row) in self.affine.iter().enumerate() {
            for (j, &x) in row.iter().enumerate() {
                put(280 + 16 * i + 4 * j, &(x as f32).to_le_bytes());
            }
        }
        put(344, b"n+1\0");
        out.write_all(&header)?;
        let mut data = Vec::with_capacity(4 * self.values.len());
        for &value in &self.values {
            match samples {
                Samples::Float32 => data.extend_from_slice(&(value as f32).to_le_bytes()),
                Samples::Uint8 => data.push(value.clamp(0.0, 255.0) as u8),
            }
        }
        out.write_all(&data)?;
        out.finish()?;
        Ok(())
    }
}

fn read_plain(mut stream: impl Read, memory: &ReadingMemory) -> Result<(Image, u8), NiftiError> {
    let mut bytes = [0u8; HEADER_BYTES];
    stream.read_exact(&mut bytes).map_err(NiftiError::Damaged)?;
    let size = [0, 1, 2, 3].map(|n| bytes[n]);
    let is_big_endian = i32::from_be_bytes(size) == HEADER_BYTES as i32;
    if !is_big_endian && i32::from_le_bytes(size) != HEADER_BYTES as i32 || &bytes[344..348] != b"n+1\0" {
        return Err(NiftiError::NotNifti);
    }
    let header = Header { bytes, is_big_endian };
    let mut dim = [0i16; 8];
    for (n, d) in dim.iter_mut().enumerate() {
        *d = header.i16(40 + 2 * n);
    }
    let num_dims = dim[0];
    if !(1..=5).contains(&num_dims) || dim[1..=num_dims as usize].iter().any(|d| *d < 1) {
        return Err(NiftiError::Dimensions { dim });
    }
    let mut shape = [1usize; 5];
    for (n, size) in shape.iter_mut().enumerate().take(num_dims as usize) {
        *size = dim[n + 1] as usize;
    }
    // Five numbers below 2¹⁵ may not fit in 64 bits; what does not is far above any limit.
    let num_values = shape.iter().fold(1u64, |product, &n| product.saturating_mul(n as u64));
    let code = header.i16(70);
    let width = match code {
        2 => 1,
        4 | 512 => 2,
        8 | 16 => 4,
        64 => 8,
        code => return Err(NiftiError::DataType { code }),
    };
    let units = header.bytes[123] & 7;
    let unit_mm = match units {
        0 => None,
        1 => Some(1e3),
        UNITS_MM => Some(1.0),
        3 => Some(1e-3),
        code => return Err(NiftiError::Units { code }),
    };
    let affine = affine_of(&header)?;
    // Some programs write 0 for "right after the header".
    let offset = if header.f32(108) == 0.0 { (HEADER_BYTES + 4) as f64 } else { header.f32(108) };
    if !(offset >= (HEADER_BYTES + 4) as f64 && offset <= MAX_OFFSET && offset.fract() == 0.0) {
        return Err(NiftiError::Offset { offset });
    }
    let skip = offset as u64 - HEADER_BYTES as u64;
    io::copy(&mut stream.by_ref().take(skip), &mut io::sink()).map_err(NiftiError::Damaged)?;
    // A slope of zero or NaN means none.
    let (slope, intercept) = (header.f32(112), header.f32(116));
    let (slope, intercept) = if slope.is_finite() && slope.abs() > 0.0 {
        (slope, if intercept.is_finite() { intercept } else { 0.0 })
    } else {
        (1.0, 0.0)
    };
    let mut values: Vec<f64> = memory.list("an image", num_values)?;
    let num_values = num_values as usize;
    let mut piece = vec![0u8; PIECE * width];
    while values.len() < num_values {
        memory.check()?;
        let bytes = &mut piece[..width * PIECE.min(num_values - values.len())];
        stream.read_exact(bytes).map_err(|error| {
            let message = format!("{error} after {} of {num_values} numbers", values.len());
            NiftiError::Damaged(io::Error::new(error.kind(), message))
        })?;
        values.extend(bytes.chunks_exact(width).map(|b| slope * number(code, b, is_big_endian) + intercept));
    }
    Ok((Image { shape, affine, intent: header.i16(68), values, unit_mm }, units))
}

fn number(code: i16, bytes: &[u8], is_big_endian: bool) -> f64 {
    let mut b = [0u8; 8];
    let n = bytes.len();
    b[..n].copy_from_slice(bytes);
    if is_big_endian {
        b[..n].reverse();
    }
    match code {
        2 => f64::from(b[0]),
        4 => f64::from(i16::from_le_bytes([b[0], b[1]])),
        512 => f64::from(u16::from_le_bytes([b[0], b[1]])),
        8 => f64::from(i32::from_le_bytes([b[0], b[1], b[2], b[3]])),
        16 => f64::from(f32::from_le_bytes([b[0], b[1], b[2], b[3]])),
        _ => f64::from_le_bytes(b),
    }
}

/// The sform, or the qform where there is none.
fn affine_of(header: &Header) -> Result<[[f64; 4]; 3], NiftiError> {
    if header.i16(254) > 0 {
        return Ok([0, 1, 2].map(|i| [0, 1, 2, 3].map(|j| header.f32(280 + 16 * i + 4 * j))));
    }
    if header.i16(252) <= 0 {
        return Err(NiftiError::NoAffine);
    }
    let [b, c, d] = [256, 260, 264].map(|at| header.f32(at));
    let a = (1.0 - b * b - c * c - d * d).max(0.0).sqrt();
    let rotation = [
        [a * a + b * b - c * c - d * d, 2.0 * (b * c - a * d), 2.0 * (b * d + a * c)],
        [2.0 * (b * c + a * d), a * a + c * c - b * b - d * d, 2.0 * (c * d - a * b)],
        [2.0 * (b * d - a * c), 2.0 * (c * d + a * b), a * a + d * d - b * b - c * c],
    ];
    let handedness = if header.f32(76) < 0.0 { -1.0 } else { 1.0 };
    let edges = [header.f32(80), header.f32(84), handedness * header.f32(88)];
    let offset = [268, 272, 276].map(|at| header.f32(at));
    Ok([0, 1, 2].map(|i| [rotation[i][0] * edges[0], rotation[i][1] * edges[1], rotation[i][2] * edges[2], offset[i]]))
}

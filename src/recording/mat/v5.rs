//! MAT-files of version 5 (MATLAB 5 to 7.2), after "MAT-File Format", The MathWorks.
//!
//! A file is a list of elements, each a tag (type, bytes) and data padded to eight bytes; compressed elements are zlib
//! streams of one element. What a stream expands to is read piece by piece, each taken from the caller's memory first.

use super::{MAX_DEPTH, MatError, MatValue, product, take_members};
use crate::file::ReadingMemory;
use flate2::read::ZlibDecoder;
use std::io::{self, Read};

const MI_MATRIX: u32 = 14;
const MI_UTF8: u32 = 16;
const MI_COMPRESSED: u32 = 15;
/// Pieces in which data are read: memory grows with what is there, not with what a tag promises.
const PIECE: u64 = 1 << 20;

pub(super) fn read(
    header: &[u8; 128],
    mut stream: impl Read,
    memory: &ReadingMemory,
) -> Result<Vec<(String, MatValue)>, MatError> {
    let is_big_endian = match &header[126..128] {
        b"IM" => false,
        b"MI" => true,
        _ => return Err(MatError::NotMat),
    };
    let reader = Reader { is_big_endian, memory };
    let mut variables = Vec::new();
    loop {
        let mut tag = [0u8; 8];
        match read_up_to(&mut stream, &mut tag)? {
            0 => return Ok(variables),
            8 => {}
            n => return Err(damaged(format!("{n} bytes where a tag of 8 should be"))),
        }
        let (kind, bytes) = (reader.u32(&tag[..4]), reader.u32(&tag[4..]));
        let found = match kind {
            MI_COMPRESSED => {
                let mut inner = ZlibDecoder::new((&mut stream).take(u64::from(bytes)));
                let mut tag = [0u8; 8];
                inner.read_exact(&mut tag).map_err(cut)?;
                let (kind, size) = (reader.u32(&tag[..4]), reader.u32(&tag[4..]));
                let found = if kind == MI_MATRIX { Some(reader.variable(&mut inner, size)?) } else { None };
                // The next tag follows the compressed bytes, read or not.
                let mut rest = inner.into_inner();
                io::copy(&mut rest, &mut io::sink()).map_err(cut)?;
                found
            }
            MI_MATRIX => {
                let found = reader.variable(&mut stream, bytes)?;
                skip(&mut stream, padding(bytes))?;
                Some(found)
            }
            // Other elements at the top are no variables.
            _ => {
                skip(&mut stream, u64::from(bytes) + padding(bytes))?;
                None
            }
        };
        // The subsystem's data have no name.
        if let Some((name, value)) = found
            && !name.is_empty()
        {
            take_members::<(String, MatValue)>(memory, 1)?;
            variables.push((name, value));
        }
    }
}

fn damaged(what: impl Into<String>) -> MatError {
    MatError::Damaged { what: what.into() }
}

fn cut(error: io::Error) -> MatError {
    damaged(error.to_string())
}

fn padding(bytes: u32) -> u64 {
    (8 - u64::from(bytes) % 8) % 8
}

/// Reads until the buffer is full or the stream ends.
fn read_up_to(stream: &mut impl Read, buffer: &mut [u8]) -> Result<usize, MatError> {
    let mut n = 0;
    while n < buffer.len() {
        match stream.read(&mut buffer[n..]).map_err(cut)? {
            0 => break,
            more => n += more,
        }
    }
    Ok(n)
}

fn skip(stream: &mut impl Read, bytes: u64) -> Result<(), MatError> {
    io::copy(&mut stream.take(bytes), &mut io::sink()).map(|_| ()).map_err(cut)
}

/// Exactly `bytes` bytes.
fn bytes_of(stream: &mut impl Read, bytes: u32, memory: &ReadingMemory) -> Result<Vec<u8>, MatError> {
    let wanted = u64::from(bytes);
    // All of it at once: a promise above the limit is refused before a byte of it is expanded.
    let mut data = memory.list("a variable of the file", wanted)?;
    while (data.len() as u64) < wanted {
        memory.check()?;
        let piece = PIECE.min(wanted - data.len() as u64);
        if stream.take(piece).read_to_end(&mut data).map_err(cut)? as u64 != piece {
            return Err(damaged(format!("{} of {wanted} bytes of a variable", data.len())));
        }
    }
    Ok(data)
}

struct Reader<'m> {
    is_big_endian: bool,
    memory: &'m ReadingMemory,
}

impl Reader<'_> {
    /// Name and value of a variable of `bytes` bytes; the bytes are given back.
    fn variable(&self, stream: &mut impl Read, bytes: u32) -> Result<(String, MatValue), MatError> {
        let data = bytes_of(stream, bytes, self.memory)?;
        let found = self.matrix(&data, 0);
        self.memory.give_back_values::<u8>(data.len());
        found
    }

    fn u32(&self, b: &[u8]) -> u32 {
        let b = [b[0], b[1], b[2], b[3]];
        if self.is_big_endian { u32::from_be_bytes(b) } else { u32::from_le_bytes(b) }
    }

    /// The first element of `data`: its type, its bytes, and what follows it.
    fn element<'a>(&self, data: &'a [u8]) -> Result<(u32, &'a [u8], &'a [u8]), MatError> {
        if data.len() < 8 {
            return Err(damaged("an element's tag is cut short"));
        }
        let first = self.u32(data);
        if first >> 16 != 0 {
            // A small element: up to four bytes within the tag.
            let (kind, bytes) = (first & 0xffff, (first >> 16) as usize);
            if bytes > 4 {
                return Err(damaged("a small element of more than four bytes"));
            }
            return Ok((kind, &data[4..4 + bytes], &data[8..]));
        }
        let bytes = self.u32(&data[4..]) as usize;
        let rest = &data[8..];
        if bytes > rest.len() {
            return Err(damaged(format!("an element of {bytes} bytes where {} are left", rest.len())));
        }
        let end = (bytes + padding(bytes as u32) as usize).min(rest.len());
        Ok((first, &rest[..bytes], &rest[end..]))
    }

    /// Name and value of a matrix.
    fn matrix(&self, data: &[u8], depth: usize) -> Result<(String, MatValue), MatError> {
        if depth > MAX_DEPTH {
            let (found, limit) = (depth as u64, MAX_DEPTH as u64);
            return Err(MatError::TooLarge { what: "cells within cells", found, limit });
        }
        // An empty matrix has no content at all.
        if data.is_empty() {
            return Ok((String::new(), MatValue::Numeric { dims: vec![0, 0], values: vec![], imaginary: None }));
        }
        let (_, flags, rest) = self.element(data)?;
        if flags.len() < 4 {
            return Err(damaged("array flags"));
        }
        let flags = self.u32(flags);
        let (class, is_complex) = (flags & 0xff, flags & 0x800 != 0);
        // Opaque objects have no sizes.
        if class == 17 {
            return Ok((String::new(), MatValue::Other("object")));
        }
        let (kind, sizes, rest) = self.element(rest)?;
        let mut dims = Vec::new();
        for size in self.numbers(kind, sizes)? {
            if !(0.0..=4e9).contains(&size) {
                return Err(damaged(format!("a size of {size}")));
            }
            dims.push(size as usize);
        }
        let count = product(&dims).ok_or_else(|| damaged("sizes overflow"))?;
        let (_, name, rest) = self.element(rest)?;
        self.memory.take("a variable's name", 3 * name.len() as u64)?;
        let name = String::from_utf8_lossy(name).into_owned();
        let wanted = (count as u64).saturating_mul(1 + u64::from(is_complex));
        let value = match class {
            1 => self.cell(dims, count, rest, depth)?,
            2 => self.structure(count, rest, depth)?,
            4 => {
                let (kind, text, _) = self.element(rest)?;
                MatValue::Text(if kind == MI_UTF8 {
                    String::from_utf8_lossy(text).into_owned()
                } else {
                    self.numbers(kind, text)?.iter().filter_map(|c| char::from_u32(*c as u32)).collect()
                })
            }
            6..=15 => {
                let (kind, real, rest) = self.element(rest)?;
                if real.len() as u64 > wanted.saturating_mul(8) {
                    return Err(damaged(format!(
                        "'{name}' has {} bytes, its sizes ask for {count} numbers",
                        real.len()
                    )));
                }
                let values = self.numbers(kind, real)?;
                let imaginary = if is_complex {
                    let (kind, imaginary, _) = self.element(rest)?;
                    Some(self.numbers(kind, imaginary)?)
                } else {
                    None
                };
                if values.len() != count || imaginary.as_ref().is_some_and(|i| i.len() != count) {
                    return Err(damaged(format!("'{name}' has {} numbers, its sizes ask for {count}", values.len())));
                }
                MatValue::Numeric { dims, values, imaginary }
            }
            3 => MatValue::Other("object"),
            5 => MatValue::Other("sparse matrix"),
            16 => MatValue::Other("function handle"),
            _ => MatValue::Other("unknown class"),
        };
        Ok((name, value))
    }

    fn cell(&self, dims: Vec<usize>, count: usize, mut rest: &[u8], depth: usize) -> Result<MatValue, MatError> {
        let mut members = Vec::new();
        for _ in 0..count {
            take_members::<MatValue>(self.memory, 1)?;
            let (kind, data, next) = self.element(rest)?;
            if kind != MI_MATRIX {
                return Err(damaged("a cell's member is no matrix"));
            }
            members.push(self.matrix(data, depth + 1)?.1);
            rest = next;
        }
        Ok(MatValue::Cell { dims, members })
    }

    fn structure(&self, count: usize, rest: &[u8], depth: usize) -> Result<MatValue, MatError> {
        let (kind, length, rest) = self.element(rest)?;
        let length = self.numbers(kind, length)?.first().copied().unwrap_or(0.0) as usize;
        let (_, names, mut rest) = self.element(rest)?;
        if count != 1 {
            return Ok(MatValue::Other("array of structures"));
        }
        if length == 0 {
            return Ok(MatValue::Struct(vec![]));
        }
        let mut fields = Vec::new();
        for name in names.chunks_exact(length) {
            take_members::<(String, MatValue)>(self.memory, 1)?;
            let end = name.iter().position(|b| *b == 0).unwrap_or(length);
            let (kind, data, next) = self.element(rest)?;
            if kind != MI_MATRIX {
                return Err(damaged("a structure's field is no matrix"));
            }
            fields.push((String::from_utf8_lossy(&name[..end]).into_owned(), self.matrix(data, depth + 1)?.1));
            rest = next;
        }
        Ok(MatValue::Struct(fields))
    }

    /// Numbers of any stored type.
    fn numbers(&self, kind: u32, data: &[u8]) -> Result<Vec<f64>, MatError> {
        let width = match kind {
            1 | 2 | 16 => 1,
            3 | 4 | 17 => 2,
            5 | 6 | 7 | 18 => 4,
            9 | 12 | 13 => 8,
            kind => return Err(damaged(format!("numbers of type {kind}"))),
        };
        let mut numbers = self.memory.list("numbers of a variable", (data.len() / width) as u64)?;
        numbers.extend(data.chunks_exact(width).map(|bytes| {
            let mut b = [0u8; 8];
            b[..width].copy_from_slice(bytes);
            if self.is_big_endian {
                b[..width].reverse();
            }
            let (two, four) = ([b[0], b[1]], [b[0], b[1], b[2], b[3]]);
            match kind {
                1 => f64::from(b[0] as i8),
                2 | 16 => f64::from(b[0]),
                3 => f64::from(i16::from_le_bytes(two)),
                4 | 17 => f64::from(u16::from_le_bytes(two)),
                5 => f64::from(i32::from_le_bytes(four)),
                6 | 18 => f64::from(u32::from_le_bytes(four)),
                7 => f64::from(f32::from_le_bytes(four)),
                12 => i64::from_le_bytes(b) as f64,
                13 => u64::from_le_bytes(b) as f64,
                _ => f64::from_le_bytes(b),
            }
        }));
        Ok(numbers)
    }
}

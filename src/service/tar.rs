//! Taking an uploaded tar file apart.
//!
//! Only regular files with plain names are taken; folders before a name are dropped, links and devices refused. The tar
//! file and its entries are never held as a whole.

use super::problem::Problem;
use super::recordings::{scratch_failed, unsafe_upload};
use crate::field::printable;
use std::collections::BTreeSet;
use std::io::Read;
use std::path::Path;

#[cfg(test)]
#[path = "../../tests/service_common/tar.rs"]
mod tar_writer;

/// Most files of a recording.
const MAX_FILES: usize = 2000;
/// Length of a tar block, bytes.
const BLOCK: usize = 512;

/// A file's own name: letters, digits, `.`, `_`, `-`, not starting with a dot, at most 100.
fn plain_name(name: &str) -> Result<String, Problem> {
    let last = name.rsplit('/').next().unwrap_or_default();
    let is_plain = (1..=100).contains(&last.len())
        && !last.starts_with('.')
        && last.bytes().all(|b| b.is_ascii_alphanumeric() || b"._-".contains(&b));
    let climbs = name.starts_with('/') || name.split('/').any(|part| part == "..") || name.contains('\\');
    if is_plain && !climbs {
        return Ok(last.into());
    }
    let shown = printable(name, 60);
    Err(unsafe_upload(format!("the name {shown:?} is not plain; use letters, digits, dots, hyphens and underscores")))
}

fn text_of(field: &[u8]) -> String {
    let end = field.iter().position(|b| *b == 0).unwrap_or(field.len());
    String::from_utf8_lossy(&field[..end]).into_owned()
}

/// Takes a tar file apart into `folder`; the names of its files.
///
/// # Errors
/// `unsafe-upload`, `too-large`.
pub fn unpack(mut stream: impl Read, folder: &Path, max_bytes: usize) -> Result<BTreeSet<String>, Problem> {
    let mut files = BTreeSet::new();
    let mut total = 0usize;
    loop {
        let mut header = [0u8; BLOCK];
        if let Err(error) = stream.read_exact(&mut header) {
            if error.kind() == std::io::ErrorKind::UnexpectedEof && !files.is_empty() {
                break;
            }
            return Err(unsafe_upload("the body is not a tar file"));
        }
        if header.iter().all(|b| *b == 0) {
            break;
        }
        let sum: u64 =
            header.iter().enumerate().map(|(i, b)| u64::from(if (148..156).contains(&i) { b' ' } else { *b })).sum();
        let octal = |field: &[u8]| u64::from_str_radix(text_of(field).trim(), 8).ok();
        if octal(&header[148..156]) != Some(sum) {
            return Err(unsafe_upload("the body is not a tar file: a header's checksum is wrong"));
        }
        let length = octal(&header[124..136]).ok_or_else(|| unsafe_upload("an entry has no length"))?;
        let length = usize::try_from(length).unwrap_or(usize::MAX / 2);
        total = total.saturating_add(length);
        if total > max_bytes {
            return Err(Problem::new("too-large", format!("the files hold more than {max_bytes} bytes")));
        }
        let mut sink: Box<dyn std::io::Write> = match header[156] {
            b'0' | 0 => {
                let name = plain_name(&text_of(&header[0..100]))?;
                if !files.insert(name.clone()) {
                    return Err(unsafe_upload(format!("{name} is there twice")));
                }
                if files.len() > MAX_FILES {
                    return Err(unsafe_upload(format!("more than {MAX_FILES} files")));
                }
                Box::new(std::fs::File::create_new(folder.join(name)).map_err(scratch_failed)?)
            }
            // Folders and extended headers hold nothing that is needed.
            b'5' | b'x' | b'g' => Box::new(std::io::sink()),
            _ => return Err(unsafe_upload("links and devices are refused")),
        };
        let padding = (length.div_ceil(BLOCK) * BLOCK - length) as u64;
        let read = std::io::copy(&mut stream.by_ref().take(length as u64), &mut sink).map_err(scratch_failed)?;
        let skipped =
            std::io::copy(&mut stream.by_ref().take(padding), &mut std::io::sink()).map_err(scratch_failed)?;
        if read < length as u64 || skipped < padding {
            return Err(unsafe_upload("the tar file ends in the middle of an entry"));
        }
    }
    Ok(files)
}

#[cfg(test)]
mod tests {
    use super::tar_writer::tar_entry as entry;
    use super::*;

    #[test]
    fn only_plain_files_are_taken() {
        let tar = [
            entry("a/", b'5', b""),
            entry("a/recording.json", b'0', b"{}"),
            entry("u_1.nii.gz", 0, b"xyz"),
            vec![0; 1024],
        ]
        .concat();
        let unpack = |bytes: &[u8], max| {
            let folder = tempfile::tempdir().unwrap();
            unpack(bytes, folder.path(), max).map(|names| (names, folder))
        };
        let (files, folder) = unpack(&tar[..], 1000).unwrap();
        assert_eq!(files.iter().collect::<Vec<_>>(), ["recording.json", "u_1.nii.gz"]);
        assert_eq!(std::fs::read(folder.path().join("u_1.nii.gz")).unwrap(), b"xyz");
        for name in ["../x", "/etc/passwd", ".hidden", "a/../b", "a\\b", "a b", "", "ü"] {
            assert_eq!(unpack(&entry(name, b'0', b"")[..], 1000).unwrap_err().status, 422, "{name:?}");
        }
        for kind in [b'1', b'2', b'3', b'6'] {
            assert_eq!(unpack(&entry("x", kind, b"")[..], 1000).unwrap_err().status, 422);
        }
        assert_eq!(unpack(&entry("x", b'0', &[0; 2000])[..], 1000).unwrap_err().status, 413);
        assert_eq!(unpack(&entry("x", b'0', &[0; 900])[..700], 1000).unwrap_err().status, 422);
        assert_eq!(unpack(&b"no tar"[..], 1000).unwrap_err().status, 422);
        let twice = [entry("x", b'0', b""), entry("y/x", b'0', b"")].concat();
        assert_eq!(unpack(&twice[..], 1000).unwrap_err().status, 422);
    }
}

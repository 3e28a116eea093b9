//! A writer of DICOM files for the tests: MR images, one frame each or enhanced with many.

use super::scene::Stored;

pub const EXPLICIT: &str = "1.2.840.10008.1.2.1";
pub const IMPLICIT: &str = "1.2.840.10008.1.2";

/// An element of a data set.
pub enum Element {
    Bytes(u32, &'static [u8; 2], Vec<u8>),
    Sequence(u32, Vec<Vec<Element>>),
}

fn text(tag: u32, kind: &'static [u8; 2], value: impl Into<String>) -> Element {
    let mut bytes = value.into().into_bytes();
    if bytes.len() % 2 == 1 {
        bytes.push(if kind == b"UI" { 0 } else { b' ' });
    }
    Element::Bytes(tag, kind, bytes)
}

fn number(tag: u32, value: u16) -> Element {
    Element::Bytes(tag, b"US", value.to_le_bytes().to_vec())
}

fn list(values: &[f64]) -> String {
    values.iter().map(|v| format!("{v}")).collect::<Vec<_>>().join("\\")
}

/// Bytes of elements; every second sequence ends with a delimiter in place of a length.
fn encode(elements: &[Element], is_explicit: bool, depth: usize) -> Vec<u8> {
    let mut out = Vec::new();
    let put_tag = |out: &mut Vec<u8>, tag: u32| {
        out.extend(((tag >> 16) as u16).to_le_bytes());
        out.extend((tag as u16).to_le_bytes());
    };
    for element in elements {
        match element {
            Element::Bytes(tag, kind, bytes) => {
                put_tag(&mut out, *tag);
                let length = bytes.len() as u32;
                match (is_explicit, *kind) {
                    (true, b"OW" | b"OB") => {
                        out.extend(**kind);
                        out.extend([0, 0]);
                        out.extend(length.to_le_bytes());
                    }
                    (true, _) => {
                        out.extend(**kind);
                        out.extend((length as u16).to_le_bytes());
                    }
                    (false, _) => out.extend(length.to_le_bytes()),
                }
                out.extend(bytes);
            }
            Element::Sequence(tag, items) => {
                put_tag(&mut out, *tag);
                if is_explicit {
                    out.extend(b"SQ\0\0");
                }
                let is_open = depth.is_multiple_of(2);
                let mut inside = Vec::new();
                for item in items {
                    let bytes = encode(item, is_explicit, depth + 1);
                    put_tag(&mut inside, 0xFFFE_E000);
                    inside.extend(if is_open { u32::MAX } else { bytes.len() as u32 }.to_le_bytes());
                    inside.extend(bytes);
                    if is_open {
                        put_tag(&mut inside, 0xFFFE_E00D);
                        inside.extend([0; 4]);
                    }
                }
                out.extend(if is_open { u32::MAX } else { inside.len() as u32 }.to_le_bytes());
                out.extend(inside);
                if is_open {
                    put_tag(&mut out, 0xFFFE_E0DD);
                    out.extend([0; 4]);
                }
            }
        }
    }
    out
}

/// A file of a transfer syntax.
pub fn file(syntax: &str, elements: &[Element]) -> Vec<u8> {
    let mut out = vec![0; 128];
    out.extend(b"DICM");
    out.extend(encode(&[text(0x0002_0010, b"UI", syntax)], true, 0));
    out.extend(encode(elements, syntax != IMPLICIT, 0));
    out
}

/// Slope and intercept.
pub type Rescale = Option<(f64, f64)>;

fn rescale(rescale: Rescale) -> Vec<Element> {
    rescale.map_or(Vec::new(), |(slope, intercept)| {
        vec![text(0x0028_1052, b"DS", intercept.to_string()), text(0x0028_1053, b"DS", slope.to_string())]
    })
}

fn orientation(volume: &Stored) -> Element {
    text(0x0020_0037, b"DS", list(&[volume.directions[0], volume.directions[1]].concat()))
}

fn spacing(volume: &Stored) -> Element {
    // Distance of rows first, then of columns.
    text(0x0028_0030, b"DS", list(&[volume.edges[1], volume.edges[0]]))
}

fn pixels(volume: &Stored, slices: &[&[u16]]) -> Vec<Element> {
    vec![
        number(0x0028_0010, volume.size[1] as u16),
        number(0x0028_0011, volume.size[0] as u16),
        number(0x0028_0100, 16),
        number(0x0028_0101, 12),
        number(0x0028_0102, 11),
        number(0x0028_0103, 0),
        Element::Bytes(0x7FE0_0010, b"OW", slices.concat().iter().flat_map(|v| v.to_le_bytes()).collect()),
    ]
}

/// A series of single frames; `kind` as in ImageType.
pub fn single_frames(volume: &Stored, number_of_series: usize, kind: &str, scale: Rescale) -> Vec<Vec<u8>> {
    let slices = (0..volume.size[2]).map(|k| {
        let (values, position) = volume.slice(k);
        let mut elements = vec![
            text(0x0008_0008, b"CS", format!("ORIGINAL\\PRIMARY\\{kind}")),
            text(0x0008_103E, b"LO", "pc3d"),
            text(0x0020_000E, b"UI", format!("1.2.3.{number_of_series}")),
            text(0x0020_0011, b"IS", number_of_series.to_string()),
            text(0x0020_0013, b"IS", (k + 1).to_string()),
            text(0x0020_0032, b"DS", list(&position)),
            orientation(volume),
            spacing(volume),
        ];
        elements.extend(rescale(scale));
        elements.extend(pixels(volume, &[values]));
        elements.sort_by_key(|e| match e {
            Element::Bytes(tag, ..) | Element::Sequence(tag, _) => *tag,
        });
        file(EXPLICIT, &elements)
    });
    slices.collect()
}

/// One file with all frames of some volumes, slice by slice, each slice of all volumes after one another.
pub fn enhanced(volumes: &[Stored], number_of_series: usize, syntax: &str, scale: Rescale) -> Vec<u8> {
    let first = &volumes[0];
    let (mut frames, mut slices) = (Vec::new(), Vec::new());
    for k in 0..first.size[2] {
        for volume in volumes {
            let (values, position) = volume.slice(k);
            slices.push(values);
            let mut items = vec![Element::Sequence(0x0020_9113, vec![vec![text(0x0020_0032, b"DS", list(&position))]])];
            items.extend(scale.map(|_| Element::Sequence(0x0028_9145, vec![rescale(scale)])));
            frames.push(items);
        }
    }
    let shared = vec![
        Element::Sequence(0x0020_9116, vec![vec![orientation(first)]]),
        Element::Sequence(0x0028_9110, vec![vec![spacing(first)]]),
    ];
    let mut elements = vec![
        text(0x0020_000E, b"UI", format!("1.2.3.{number_of_series}")),
        text(0x0020_0011, b"IS", number_of_series.to_string()),
        text(0x0028_0008, b"IS", slices.len().to_string()),
    ];
    let mut rest = pixels(first, &slices);
    let data = rest.pop().unwrap();
    elements.extend(rest);
    elements.push(Element::Sequence(0x5200_9229, vec![shared]));
    elements.push(Element::Sequence(0x5200_9230, frames));
    elements.push(data);
    file(syntax, &elements)
}

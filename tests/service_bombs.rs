//! Small inputs that promise, or expand to, far more than a machine has: every one is refused with a typed error, and
//! neither the service nor the command ever holds 1.5 GB.

mod service_common;

use flate2::Compression;
use flate2::write::{GzEncoder, ZlibEncoder};
use serde_json::{Value, json};
use service_common::tar::tar_entry;
use service_common::{Service, lambdak, shipped, tar_of};
use std::io::Write;
use std::path::Path;

/// Most memory that anything here may hold, bytes.
const MOST_BYTES: u64 = 1_500_000_000;

fn gzip(head: &[u8], zeros: usize) -> Vec<u8> {
    let mut packed = GzEncoder::new(Vec::new(), Compression::fast());
    packed.write_all(head).unwrap();
    zero_bytes(&mut packed, zeros);
    packed.finish().unwrap()
}

fn zero_bytes(out: &mut impl Write, mut count: usize) {
    let block = vec![0u8; 1 << 20];
    while count > 0 {
        let part = count.min(block.len());
        out.write_all(&block[..part]).unwrap();
        count -= part;
    }
}

/// A NIfTI header: sizes, components, data type and where the data begin.
fn header(shape: [i16; 3], components: i16, [code, bits]: [i16; 2], offset: f32) -> Vec<u8> {
    let mut bytes = vec![0u8; 352];
    let mut put = |at: usize, b: &[u8]| bytes[at..at + b.len()].copy_from_slice(b);
    put(0, &348i32.to_le_bytes());
    let dim = [if components == 1 { 3i16 } else { 5 }, shape[0], shape[1], shape[2], 1, components];
    for (n, value) in dim.into_iter().enumerate() {
        put(40 + 2 * n, &value.to_le_bytes());
    }
    put(68, &(if components == 3 { 1006i16 } else { 0 }).to_le_bytes());
    put(70, &code.to_le_bytes());
    put(72, &bits.to_le_bytes());
    put(108, &offset.to_le_bytes());
    put(123, &[2]);
    put(254, &1i16.to_le_bytes());
    for axis in 0..3 {
        put(280 + 20 * axis, &1f32.to_le_bytes());
        // The specimen's centre is the image's: it is not refused for lying elsewhere.
        put(292 + 16 * axis, &(0.5 - 0.5 * f32::from(shape[axis])).to_le_bytes());
    }
    put(344, b"n+1\0");
    bytes
}

const BYTES: [i16; 2] = [2, 8];

/// An image of ones or zeros of one byte each.
fn image(shape: [i16; 3], components: i16, value: u8) -> Vec<u8> {
    let mut head = header(shape, components, BYTES, 352.0);
    let count = shape.iter().map(|n| *n as usize).product::<usize>() * components as usize;
    if value == 0 {
        return gzip(&head, count);
    }
    head.resize(head.len() + count, value);
    gzip(&head, 0)
}

fn recording(steps: &[Value]) -> Value {
    json!({
        "schema": "mru-recording/1", "id": "bomb", "specimen": shipped("solid-shear.json"), "mask": "mask.nii.gz",
        "acquisition": { "voxel_mm": [1.0, 1.0, 1.0] }, "steps": steps,
    })
}

fn displacement_step() -> Value {
    json!({ "drive_mm": 1.0, "displacement": "u.nii.gz" })
}

fn raw_step() -> Value {
    let raw =
        json!({ "phase": ["u.nii.gz", "u.nii.gz", "u.nii.gz"], "magnitude": "u.nii.gz", "mm_per_radian": [1, 1, 1] });
    json!({ "drive_mm": 1.0, "raw": raw })
}

/// A recording whose `recording.json` is `text`.
fn with_text(text: &[u8], mask: &[u8], u: &[u8]) -> Vec<u8> {
    tar_of(&[("recording.json", text), ("mask.nii.gz", mask), ("u.nii.gz", u)])
}

fn with_steps(steps: &[Value], mask: &[u8], u: &[u8]) -> Vec<u8> {
    with_text(recording(steps).to_string().as_bytes(), mask, u)
}

/// Uploads that are bombs.
fn uploads() -> Vec<(String, Vec<u8>)> {
    let small_mask = image([4, 4, 4], 1, 1);
    let step = displacement_step();
    let large = [230i16; 3];
    let mut list = vec![
        (
            "many steps name one large image".to_string(),
            with_steps(&vec![step.clone(); 24], &image(large, 1, 1), &image(large, 3, 0)),
        ),
        (
            "many raw steps name one large image".into(),
            with_steps(&vec![raw_step(); 24], &image(large, 1, 1), &image(large, 1, 0)),
        ),
        ("a mask of 500³".into(), with_steps(std::slice::from_ref(&step), &image([500; 3], 1, 0), &small_mask)),
        (
            "an image of 600³".into(),
            with_steps(std::slice::from_ref(&step), &small_mask, &gzip(&header([600; 3], 3, BYTES, 352.0), 1 << 26)),
        ),
        ("a hundred thousand steps".into(), with_steps(&vec![step.clone(); 100_000], &small_mask, &small_mask)),
        ("a load curve of ten million lines".into(), {
            let mut head = recording(std::slice::from_ref(&step));
            head["load"] = json!("load.csv");
            let curve = format!("time_s,drive_mm,force_n\n{}", "0,0,0\n".repeat(10_000_000));
            tar_of(&[
                ("recording.json", head.to_string().as_bytes()),
                ("mask.nii.gz", &small_mask),
                ("load.csv", curve.as_bytes()),
            ])
        }),
        ("a load curve with a line of fifty million commas".into(), {
            let mut head = recording(std::slice::from_ref(&step));
            head["load"] = json!("load.csv");
            let curve = format!("time_s,drive_mm,force_n\n0,0,0\n{}", ",".repeat(50_000_000));
            tar_of(&[
                ("recording.json", head.to_string().as_bytes()),
                ("mask.nii.gz", &small_mask),
                ("load.csv", curve.as_bytes()),
            ])
        }),
        ("gzip in gzip".into(), with_steps(std::slice::from_ref(&step), &gzip(&gzip(&[], 1 << 28), 0), &small_mask)),
        ("gzip of nothing but zeros".into(), with_steps(std::slice::from_ref(&step), &gzip(&[], 1 << 28), &small_mask)),
        (
            "JSON brackets in recording.json".into(),
            with_text("[".repeat(20 << 20).as_bytes(), &small_mask, &small_mask),
        ),
        (
            "JSON objects in recording.json".into(),
            with_text(format!("[{}0]", r#"{"":0},"#.repeat(6 << 20)).as_bytes(), &small_mask, &small_mask),
        ),
        (
            "a wide array in recording.json".into(),
            with_text(format!("[{}0]", "0,".repeat(40 << 20)).as_bytes(), &small_mask, &small_mask),
        ),
        ("three thousand files".into(), {
            (0..3000).flat_map(|n| tar_entry(&format!("file{n}"), b'0', b"")).collect()
        }),
        ("a tar entry of eight gigabytes".into(), {
            let mut long = tar_entry("u.nii.gz", b'0', b"");
            long[124..135].copy_from_slice(b"77777777777");
            long[148..156].fill(b' ');
            let sum: u64 = long.iter().map(|b| u64::from(*b)).sum();
            long[148..154].copy_from_slice(format!("{sum:06o}").as_bytes());
            long[154] = 0;
            long
        }),
    ];
    for (code, bits) in [(2, 8), (4, 16), (512, 16), (8, 32), (16, 32), (64, 64)] {
        for shape in [[32767i16; 3], [2000, 2000, 20]] {
            let bomb = gzip(&header(shape, 1, [code, bits], 352.0), 1 << 24);
            let name = format!("a mask of {shape:?} numbers of type {code}");
            list.push((name, with_steps(std::slice::from_ref(&step), &bomb, &small_mask)));
        }
    }
    for offset in [f32::NAN, f32::INFINITY, -1.0, 1e30, 353.5] {
        let bomb = gzip(&header([4; 3], 1, BYTES, offset), 1 << 20);
        let name = format!("data that begin at {offset}");
        list.push((name, with_steps(std::slice::from_ref(&step), &bomb, &small_mask)));
    }
    list
}

/// JSON bodies that are bombs.
fn bodies() -> Vec<(&'static str, String)> {
    let many = 4 << 20;
    vec![
        ("brackets", "[".repeat(many)),
        ("closed brackets", format!("{}{}", "[".repeat(many / 2), "]".repeat(many / 2))),
        ("objects in objects", r#"{"a":"#.repeat(many / 5)),
        ("a wide array of zeros", format!("[{}0]", "0,".repeat(many / 2 - 2))),
        ("a wide array of arrays", format!("[{}0]", "[],".repeat(many / 3 - 2))),
        ("a wide array of objects", format!("[{}0]", r#"{"":0},"#.repeat(many / 7 - 2))),
        ("drives without end", format!(r#"{{"drive_mm":[{}1]}}"#, "1,".repeat(many / 2 - 20))),
        ("a number of four million digits", "9".repeat(many - 1)),
        ("one key again and again", format!("{{{}\"a\":0}}", r#""a":0,"#.repeat(many / 6 - 3))),
        ("a text of four million characters", format!("{{\"name\":\"{}\"}}", "x".repeat(many - 20))),
    ]
}

fn peak_bytes(process: u32) -> Option<u64> {
    let status = std::fs::read_to_string(format!("/proc/{process}/status")).ok()?;
    let line = status.lines().find(|line| line.starts_with("VmHWM:"))?;
    Some(line.split_whitespace().nth(1)?.parse::<u64>().ok()? * 1024)
}

#[test]
fn bombs_do_not_end_the_service() {
    let folder = tempfile::tempdir().unwrap();
    let service = Service::start(folder.path(), &["--slots", "0"]);
    let mut count = 0;
    for (name, body) in uploads() {
        let reply = service.call("POST", "/v1/recordings", &[("content-type", "application/x-tar")], &body);
        let cause = reply.cause();
        assert!(matches!(reply.status, 413 | 422), "{name}: {} {cause}", reply.status);
        assert!(matches!(cause.as_str(), "too-large" | "unsafe-upload"), "{name}: {cause}");
        count += 1;
    }
    // Files of other programs with the request of their import.
    for (name, ending, bytes) in files() {
        let file = format!("bomb.{ending}");
        let form = if ending == "mat" { "matlab" } else { "points" };
        let request =
            json!({ "files": [file], "form": form, "specimen": shipped("two-hole-shear.json"), "drive_mm": [1.0] });
        let body = tar_of(&[("import.json", request.to_string().as_bytes()), (&file, &bytes)]);
        let reply = service.call("POST", "/v1/recordings", &[("content-type", "application/x-tar")], &body);
        assert!(matches!(reply.status, 400 | 413 | 422), "{name}: {} {}", reply.status, reply.cause());
        count += 1;
    }
    // Many at a time, as nobody sends them by mistake.
    let bodies = bodies();
    std::thread::scope(|scope| {
        for (name, body) in &bodies {
            for address in ["/v1/evaluations", "/v1/sweeps", "/v1/specimens/check"] {
                let service = &service;
                scope.spawn(move || {
                    let reply = loop {
                        let json = ("content-type", "application/json");
                        let reply = service.call("POST", address, &[json], body.as_bytes());
                        // Others hold the memory or the places: what a client does then is to come back.
                        if !matches!(reply.status, 429 | 503) {
                            break reply;
                        }
                        assert!(reply.header("retry-after").is_some(), "{name}");
                        std::thread::sleep(std::time::Duration::from_millis(200));
                    };
                    assert!(matches!(reply.status, 400 | 413 | 422), "{name} to {address}: {}", reply.status);
                    let _ = reply.cause();
                });
            }
        }
    });
    count += bodies.len();
    assert_eq!(service.get("/healthz").status, 200);
    assert_eq!(service.get("/v1/recordings").json()["recordings"].as_array().unwrap().len(), 0);
    assert!(count >= 40, "{count}");
    if let Some(peak) = peak_bytes(service.child.id()) {
        eprintln!("{count} bombs; the service held at most {} MB", peak / 1_000_000);
        assert!(peak < MOST_BYTES, "{peak}");
    }
}

/// An element of a MAT-file of version 5.
fn element(kind: u32, data: &[u8]) -> Vec<u8> {
    let mut bytes = [kind.to_le_bytes(), (data.len() as u32).to_le_bytes()].concat();
    bytes.extend_from_slice(data);
    bytes.resize(bytes.len().div_ceil(8) * 8, 0);
    bytes
}

fn mat_file(element: &[u8]) -> Vec<u8> {
    let mut bytes = vec![b' '; 124];
    bytes.extend_from_slice(&[0, 1, b'I', b'M']);
    bytes.extend_from_slice(element);
    bytes
}

/// The beginning of a matrix: class, sizes, name.
fn matrix_head(class: u32, sizes: &[i32], name: &[u8]) -> Vec<u8> {
    let flags: Vec<u8> = [class, 0].iter().flat_map(|n| n.to_le_bytes()).collect();
    let sizes: Vec<u8> = sizes.iter().flat_map(|n| n.to_le_bytes()).collect();
    [element(6, &flags), element(5, &sizes), element(1, name)].concat()
}

/// A compressed matrix: its head, a block of bytes so many times, and the length that its tag tells.
fn packed(head: &[u8], block: &[u8], times: usize, told: u32) -> Vec<u8> {
    let mut inner = ZlibEncoder::new(Vec::new(), Compression::fast());
    inner.write_all(&[14u32.to_le_bytes(), told.to_le_bytes()].concat()).unwrap();
    inner.write_all(head).unwrap();
    for _ in 0..times {
        inner.write_all(block).unwrap();
    }
    let inner = inner.finish().unwrap();
    mat_file(&[&15u32.to_le_bytes()[..], &(inner.len() as u32).to_le_bytes(), &inner].concat())
}

/// Files of laboratories that are bombs: name, form, content.
fn files() -> Vec<(&'static str, &'static str, Vec<u8>)> {
    let block = vec![0u8; 1 << 20];
    let numbers = |times: usize| {
        let mut head = matrix_head(6, &[1024, 1024, times as i32], b"U_t");
        // Numbers of one byte become numbers of eight.
        head.extend([1u32, (times << 20) as u32].iter().flat_map(|n| n.to_le_bytes()));
        packed(&head, &block, times, (head.len() + (times << 20)) as u32)
    };
    let cells = |count: usize| {
        let head = matrix_head(1, &[count as i32, 1], b"U_t");
        let empties = element(14, &[]).repeat(1 << 17);
        packed(&head, &empties, count >> 17, (head.len() + 8 * count) as u32)
    };
    let mut nested = matrix_head(6, &[0, 0], b"");
    for _ in 0..2000 {
        nested = [matrix_head(1, &[1, 1], b""), element(14, &nested)].concat();
    }
    let named = matrix_head(6, &[1, 1], &vec![b'n'; 300 << 20]);
    let mut list = vec![
        ("300 million numbers of a byte", "mat", numbers(300)),
        ("900 million numbers of a byte", "mat", numbers(900)),
        ("a promise of four gigabytes", "mat", packed(&[], &block, 16, u32::MAX - 16)),
        ("sixteen million empty cells", "mat", cells(1 << 24)),
        ("a hundred million empty cells", "mat", cells(100 << 20)),
        ("cells within cells", "mat", mat_file(&element(14, &nested))),
        ("sizes whose product overflows", "mat", mat_file(&element(14, &matrix_head(6, &[i32::MAX; 5], b"U_t")))),
        ("a name of 300 million letters", "mat", packed(&named, &[], 0, named.len() as u32)),
        ("ten million columns", "csv", "x,".repeat(10_000_000).into_bytes()),
        ("a line of a hundred million commas", "csv", {
            format!("x,y,z,ux,uy,uz\n{}", ",".repeat(100_000_000)).into_bytes()
        }),
        ("twenty million points", "csv", {
            format!("x,y,z,ux,uy,uz\n{}", "0,0,0,0,0,0\n".repeat(20_000_000)).into_bytes()
        }),
    ];
    // HDF5 without checksums: the sizes of a dataset (slowest first) are changed to other ones.
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/import/v73.mat");
    let whole = std::fs::read(path).unwrap();
    let sizes = |n: [u64; 3]| n.iter().flat_map(|n| n.to_le_bytes()).collect::<Vec<u8>>();
    let old = sizes([5, 4, 6]);
    let places: Vec<usize> = (0..whole.len() - 24).filter(|&at| whole[at..at + 24] == old).collect();
    assert!(!places.is_empty());
    for new in [[5, 4, 1 << 40], [1 << 20, 1 << 20, 1 << 20], [5, 1 << 30, 6], [u64::MAX, 4, 6], [500, 1000, 1000]] {
        let mut bytes = whole.clone();
        for &at in &places {
            bytes[at..at + 24].copy_from_slice(&sizes(new));
        }
        list.push(("HDF5 with other sizes", "mat", bytes));
    }
    list
}

/// The command within so much address space: what asks for more dies by a signal, and with no exit code of ours.
fn limited(arguments: &[&str]) -> std::process::Output {
    let program = lambdak().get_program().to_owned();
    let mut command = std::process::Command::new("sh");
    let script = format!("ulimit -v {}; exec \"$@\"", MOST_BYTES / 1024);
    command.args(["-c", &script, "sh"]).arg(program).args(arguments).output().unwrap()
}

#[cfg(target_os = "linux")]
#[test]
fn bombs_do_not_end_the_command() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out").to_string_lossy().into_owned();
    let specimen = format!("{}/geometries/solid-shear.json", env!("CARGO_MANIFEST_DIR"));
    for (name, form, content) in files() {
        let path = folder.path().join(format!("bomb.{form}"));
        std::fs::write(&path, &content).unwrap();
        let path = path.to_string_lossy();
        let found = limited(&["import", &path, "--specimen", &specimen, "--threads", "1", "--out", &out]);
        let said = String::from_utf8_lossy(&found.stderr);
        assert_eq!(found.status.code(), Some(2), "{name}: {said}");
        assert!(!said.contains("panicked"), "{name}: {said}");
    }
    for (name, text) in [
        ("brackets", "[".repeat(50 << 20)),
        ("objects", format!("[{}0]", r#"{"":0},"#.repeat(20 << 20))),
        ("a wide array", format!("[{}0]", "0,".repeat(100 << 20))),
    ] {
        let path = folder.path().join("bomb.json");
        std::fs::write(&path, text).unwrap();
        let path = path.to_string_lossy();
        for arguments in [vec!["solve", &path], vec!["run", "solve", &path], vec!["compare", &path, &path]] {
            let found = limited(&[arguments, vec!["--threads", "1", "--out", &out]].concat());
            let said = String::from_utf8_lossy(&found.stderr);
            assert_eq!(found.status.code(), Some(2), "{name}: {said}");
        }
    }
}

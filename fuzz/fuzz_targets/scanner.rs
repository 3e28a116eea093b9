//! A scanner's files: one DICOM file, and a ParaVision reconstruction whose four files stand one after the other.
#![no_main]

use lambdak::recording::{DicomFiles, ParavisionStudy, VolumeReader};
use lambdak_fuzz::{file, memory, parts};
use libfuzzer_sys::fuzz_target;

/// Reads the first volumes of every series.
fn read(reader: &dyn VolumeReader) {
    for line in reader.lines() {
        for volume in 1..=2 {
            let _ = reader.volume(&line.name, volume, &memory());
        }
    }
}

fuzz_target!(|data: &[u8]| {
    if let Ok(series) = DicomFiles::open(vec![file("image.dcm", data)], 1 << 20, &memory()) {
        read(&series);
    }
    let [visu, reco, method, image] = parts::<4>(data);
    let paths = [("visu_pars", visu), ("reco", reco), ("2dseq", image)]
        .map(|(name, contents)| file(&format!("5/pdata/1/{name}"), contents));
    let mut paths = paths.to_vec();
    paths.push(file("5/method", method));
    if let Ok(study) = ParavisionStudy::open(&paths, &memory()) {
        read(&study);
    }
});

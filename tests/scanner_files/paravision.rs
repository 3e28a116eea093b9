//! A writer of ParaVision reconstructions for the tests.

use super::scene::Stored;
use std::path::Path;

/// How a reconstruction stores its volumes.
#[derive(Clone, Copy, Debug)]
pub struct Storage {
    /// Slices as frames of their own, or whole volumes.
    pub is_flat: bool,
    /// In the order of slices, the frame group of the volumes comes before that of the slices.
    pub has_volumes_first: bool,
    pub is_big_endian: bool,
    /// `_16BIT_SGN_INT` or `_32BIT_SGN_INT`.
    pub word: &'static str,
    pub slope: f64,
    pub offset: f64,
}

fn list(values: impl IntoIterator<Item = f64>) -> String {
    values.into_iter().map(|v| format!("{v}")).collect::<Vec<_>>().join(" ")
}

/// Writes volumes on one grid as an experiment `number` of a study.
pub fn write(study: &Path, number: usize, volumes: &[Stored], storage: Storage) {
    let folder = study.join(format!("{number}/pdata/1"));
    std::fs::create_dir_all(&folder).unwrap();
    let first = &volumes[0];
    let [nx, ny, nz] = first.size;
    let n = nx * ny;
    let order: Vec<(usize, usize)> = if storage.has_volumes_first {
        (0..nz).flat_map(|k| (0..volumes.len()).map(move |v| (v, k))).collect()
    } else {
        (0..volumes.len()).flat_map(|v| (0..nz).map(move |k| (v, k))).collect()
    };
    let mut data = Vec::new();
    for (v, k) in order {
        for value in &volumes[v].values[k * n..(k + 1) * n] {
            let wide = i32::from(*value);
            match (storage.word, storage.is_big_endian) {
                ("_16BIT_SGN_INT", true) => data.extend((wide as i16).to_be_bytes()),
                ("_16BIT_SGN_INT", false) => data.extend((wide as i16).to_le_bytes()),
                (_, true) => data.extend(wide.to_be_bytes()),
                (_, false) => data.extend(wide.to_le_bytes()),
            }
        }
    }
    std::fs::write(folder.join("2dseq"), data).unwrap();
    let num_frames = volumes.len() * if storage.is_flat { nz } else { 1 };
    let extent = |i: usize| first.size[i] as f64 * first.edges[i];
    let places = if storage.is_flat { nz } else { 1 };
    let (size, extents) = if storage.is_flat {
        (format!("( 2 )\n{nx} {ny}"), format!("( 2 )\n{}", list([extent(0), extent(1)])))
    } else {
        (format!("( 3 )\n{nx} {ny} {nz}"), format!("( 3 )\n{}", list([extent(0), extent(1), extent(2)])))
    };
    let cycle = format!("({}, <FG_CYCLE>, <>, 0, 0)", volumes.len());
    let groups = match (storage.is_flat, storage.has_volumes_first) {
        (true, true) => format!("( 2 )\n{cycle} ({nz}, <FG_SLICE>, <>, 0, 2)"),
        (true, false) => format!("( 2 )\n({nz}, <FG_SLICE>, <>, 0, 2) {cycle}"),
        (false, _) => format!("( 1 )\n{cycle}"),
    };
    let orientation = list((0..places).flat_map(|_| first.directions.concat()));
    let positions = list((0..places).flat_map(|k| first.slice(k).1));
    let order = if storage.is_big_endian { "bigEndian" } else { "littleEndian" };
    let visu = format!(
        "##TITLE=Parameter List\n##JCAMPDX=4.24\n$$ written by a test\n##$VisuCoreFrameCount={num_frames}\n\
         ##$VisuCoreDim={}\n##$VisuCoreSize={size}\n##$VisuCoreExtent={extents}\n\
         ##$VisuCoreFrameThickness=( 1 )\n{}\n##$VisuCoreUnits=( 2, 65 )\n<mm> <mm>\n\
         ##$VisuCoreOrientation=( {places}, 9 )\n{orientation}\n##$VisuCorePosition=( {places}, 3 )\n{positions}\n\
         ##$VisuCoreDataOffs=( {num_frames} )\n@{num_frames}*({})\n##$VisuCoreDataSlope=( {num_frames} )\n{}\n\
         ##$VisuCoreFrameType=PHASE_IMAGE\n##$VisuCoreWordType={}\n##$VisuCoreByteOrder={order}\n\
         ##$VisuCoreDiskSliceOrder=disk_normal_slice_order\n##$VisuFGOrderDescDim=2\n##$VisuFGOrderDesc={groups}\n\
         ##$VisuAcquisitionProtocol=( 65 )\n<FLOWMAP>\n##END=\n",
        if storage.is_flat { 2 } else { 3 },
        first.edges[2],
        storage.offset,
        list((0..num_frames).map(|_| storage.slope)),
        storage.word,
    );
    std::fs::write(folder.join("visu_pars"), visu).unwrap();
    let reco =
        format!("##TITLE=Parameter List\n##$RECO_wordtype={}\n##$RECO_byte_order={order}\n##END=\n", storage.word);
    std::fs::write(folder.join("reco"), reco).unwrap();
    let method = "##TITLE=Parameter List\n##$Method=<Bruker:FLOWMAP>\n##END=\n";
    std::fs::write(study.join(format!("{number}/method")), method).unwrap();
}

//! What a planner should do after a search: what to make, how to scan it and why, how precise that is, and what the
//! figures assume.

use super::entry::DesignEntry;
use super::findings::Equals;
use super::search::Found;
use super::study::Study;
use super::tolerances::in_words;
use super::vary_scan::ChosenScan;
use super::words::{listed, plates_in_words, sample_in_words, short_number};
use crate::material::symbol_of_parameter;
use crate::sensitivity::{GridPlace, Protocol, ScanSettings};
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// What to do, in words.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct Recommendation {
    /// What to make, how to scan it, and why.
    pub make: String,
    /// How precisely one scan of it tells the parameters.
    pub precision: String,
    /// What these figures assume of scanner, load cell and blocks.
    pub assumptions: String,
    /// How exactly it is to be made; empty where that is not known.
    #[serde(default)]
    pub dimensions: String,
}

/// What is assumed of a scan that was found.
const SAME_TIME: &str = " The scan takes the time of the study's: its noise follows from that one's by the voxels' volume and \
                         the displacement per phase.";

impl Recommendation {
    /// Of the design that is simplest to make of those equal to the best.
    pub(super) fn new(
        study: &Study,
        base: &DesignEntry,
        ranked: &[DesignEntry],
        equals: Equals,
        found: &Found,
    ) -> Recommendation {
        let scan = found.scan.as_ref();
        let Some(chosen) = ranked.get(equals.simplest).or(ranked.first()) else { return Recommendation::default() };
        let advice = if chosen.is_design_of(base) {
            let found = match scan {
                Some(_) => because(base, ranked, equals, chosen, scan),
                None => "No design within the limits was found to be better.".into(),
            };
            format!("Keep the base specimen. {} {found}", scan_like_this(study, chosen))
        } else {
            let number = if equals.simplest == 0 {
                String::new()
            } else {
                format!(", number {} of the list", equals.simplest + 1)
            };
            format!(
                "Make \"{}\"{number}: {}. {} {}{}",
                chosen.specimen.name,
                shape(chosen),
                scan_like_this(study, chosen),
                because(base, ranked, equals, chosen, scan),
                found.gain_anywhere.map_or(String::new(), |gain| if_the_grid_moves(chosen, gain.recommended))
            )
        };
        Recommendation {
            make: advice,
            precision: precision(base, chosen),
            assumptions: assumptions(study, chosen, scan),
            dimensions: in_words(&found.tolerances),
        }
    }
}

/// Every sample's block and holes.
fn shape(entry: &DesignEntry) -> String {
    let samples = entry.specimen.samples();
    match samples.as_slice() {
        [one] => sample_in_words(one),
        several => {
            let of_each = several.iter().enumerate().map(|(n, s)| format!("sample {} {}", n + 1, sample_in_words(s)));
            listed(&of_each.collect::<Vec<_>>())
        }
    }
}

fn drive_mm(entry: &DesignEntry) -> f64 {
    entry.specimen.drive_mm.last().copied().unwrap_or(0.0)
}

fn scan_like_this(study: &Study, entry: &DesignEntry) -> String {
    let blocks = match study.protocol.blocks_scanned {
        1 => String::new(),
        n => format!(", {n} blocks together"),
    };
    let forces = study.protocol.on_the_way_to(drive_mm(entry)).force_drives_mm();
    let on_the_way = if forces.is_empty() {
        String::new()
    } else {
        let drives: Vec<String> = forces.iter().map(|d| short_number(*d)).collect();
        format!(", and read the force at {} mm on the way to it", listed(&drives))
    };
    let scans = match &entry.evaluation.scan_share[..] {
        [] => format!("once at a drive of {} mm", short_number(drive_mm(entry))),
        shares => {
            let steps = entry.evaluation.steps.iter().zip(shares);
            let each = steps.map(|(step, share)| {
                format!("at {} mm in {:.0} % of the time of one scan", short_number(step.drive_mm), 100.0 * share)
            });
            listed(&each.collect::<Vec<_>>())
        }
    };
    let plates = plates_in_words(&entry.specimen).map_or(String::new(), |plates| format!(", its {plates} before"));
    format!("Scan it {scans}{plates}{blocks}{on_the_way}{}.", in_voxels(study, &entry.evaluation.scan))
}

/// Voxels and encoding, where they are not the study's.
fn in_voxels(study: &Study, scan: &ScanSettings) -> String {
    if *scan == study.scan {
        return String::new();
    }
    let triple = |values: [f64; 3], between: &str| values.map(short_number).join(between);
    let phase = scan.mm_per_radian.map_or(String::new(), |scale| {
        format!(", encoded with {} mm of displacement per radian along x, y and z", triple(scale, ", "))
    });
    format!(", in voxels of {} mm{phase}", triple(scan.voxel_mm, " × "))
}

fn because(
    base: &DesignEntry,
    ranked: &[DesignEntry],
    equals: Equals,
    chosen: &DesignEntry,
    scan: Option<&ChosenScan>,
) -> String {
    let open = chosen.objective * chosen.mesh_relative_sd;
    let gain = match open < 5e-4 {
        true => format!("{:.3} times (± less than 0.001)", chosen.objective),
        false => format!("{:.3} ± {open:.3} times", chosen.objective),
    };
    let way = if scan.is_some() { "as the study says" } else { "in the same way" };
    let scanned = format!("the base specimen scanned {way} at {} mm", short_number(drive_mm(base)));
    let of_scan = scan.and_then(|s| s.base_objective);
    let of_scan =
        of_scan.map_or(String::new(), |factor| format!(" The scan alone makes the base {factor:.3} times as good."));
    let why = match ranked.first() {
        Some(best) if equals.simplest > 0 => format!(
            "Why: it is simpler to make than the best that was found, and as good within what meshes leave open ({gain} as good as \
             {scanned} by the study's objective; the best: {:.3}).",
            best.objective
        ),
        _ => format!(
            "Why: by the study's objective it is {gain} as good as {scanned}, and nothing better was found within the limits."
        ),
    };
    why + &of_scan
}

/// Factors that differ by less than this part of them hardly differ.
const HARDLY_APART: f64 = 0.02;

/// What is left of the chosen design's factor where the scan's grid is not placed as assumed.
fn if_the_grid_moves(chosen: &DesignEntry, anywhere: f64) -> String {
    if anywhere > (1.0 - HARDLY_APART) * chosen.objective {
        return String::new();
    }
    let worth = if anywhere <= 1.0 {
        ", no better than the base specimen"
    } else if anywhere <= 1.0 + HARDLY_APART {
        ", hardly better than the base specimen"
    } else {
        ""
    };
    format!(
        " Place the scan's grid on the middle of the sample: on average over all places where it may lie the factor is \
         {anywhere:.3}{worth}."
    )
}

/// Relative standard deviations of every μᵢ and αᵢ of each material, those of the base beside them.
fn precision(base: &DesignEntry, chosen: &DesignEntry) -> String {
    let percent = |sd: Option<f64>| sd.map_or("not at all".to_string(), |sd| format!("{} %", short_number(100.0 * sd)));
    let of_materials = chosen.by_material.iter().zip(&base.by_material).map(|(own, of_base)| {
        let shear = own.evaluation.promised_sd.iter().filter(|p| p.is_of_shear());
        let each = shear.map(|p| {
            let there = of_base.evaluation.promised_sd.iter().find(|b| b.parameter == p.parameter);
            let there = there.and_then(|b| b.relative_sd);
            format!("{} to {} (base: {})", symbol_of_parameter(&p.parameter), percent(p.relative_sd), percent(there))
        });
        format!("of material \"{}\" {}", own.material, listed(&each.collect::<Vec<_>>()))
    });
    format!(
        "One such scan promises, as one standard deviation of a fit of all parameters: {}.",
        of_materials.collect::<Vec<_>>().join("; ")
    )
}

/// The scan and the load cell that the figures are of.
fn assumptions(study: &Study, entry: &DesignEntry, chosen: Option<&ChosenScan>) -> String {
    let (scan, protocol) = (&entry.evaluation.scan, &study.protocol);
    let [x, y, z] = scan.voxel_mm.map(short_number);
    let [a, b, c] = scan.noise_sd_mm.map(short_number);
    let noise = if a == b && b == c {
        format!("{a} mm along every axis")
    } else {
        format!("{a}, {b} and {c} mm along x, y and z")
    };
    let grid = match scan.grid {
        GridPlace::Centred => "on a grid centred on each sample",
        GridPlace::Anywhere => "on a grid that lies anywhere (the mean over its places)",
    };
    let num_samples = entry.specimen.num_samples();
    let blocks = match (protocol.blocks_scanned, num_samples) {
        (1, 1) => "one sample, which is scanned".to_string(),
        (blocks, _) => format!("{blocks} of {num_samples} samples scanned"),
    };
    format!(
        "Assumed are voxels of {x} × {y} × {z} mm {grid}, whose displacement has a noise of {noise}, a force of all samples together \
         read to {} N{}, and {blocks}.{}",
        short_number(scan.force_sd_n),
        set_up(protocol),
        chosen.map_or("", |_| SAME_TIME)
    )
}

/// What is not known of the set-up.
fn set_up(protocol: &Protocol) -> String {
    let mut unknown = Vec::new();
    if protocol.force_gain_sd > 0.0 {
        unknown.push(format!("gain is known to {} %", short_number(100.0 * protocol.force_gain_sd)));
    }
    if protocol.force_zero_sd_n > 0.0 {
        unknown.push(format!("zero is known to {} N", short_number(protocol.force_zero_sd_n)));
    }
    let cell = if unknown.is_empty() {
        " by a perfect load cell".to_string()
    } else {
        format!(" by a load cell whose {}", listed(&unknown))
    };
    let drive = if protocol.drive_zero_sd_mm > 0.0 {
        format!(", a drive whose zero is known to {} mm", short_number(protocol.drive_zero_sd_mm))
    } else {
        String::new()
    };
    let plate = if protocol.plate_tilt_sd_deg > 0.0 {
        format!(", a moved plate whose angles are known to {}°", short_number(protocol.plate_tilt_sd_deg))
    } else {
        String::new()
    };
    format!("{cell}{drive}{plate}")
}

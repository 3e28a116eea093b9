//! Cards against the strain energies of the programs' manuals: the numbers are read back from the text of each card,
//! put into the energy as that manual states it, and differentiated.

use super::*;
use crate::homogeneous::{HomogeneousTest, StressUnit, respond};
use crate::material::{LawKind, Material, OgdenTerm, energy_density, first_piola_kirchhoff_stress, laws};

/// Materials with one to three of Ogden's terms, and with each law in the first invariant.
fn materials() -> Vec<Material> {
    let make = |bulk_kpa, terms: &[(f64, f64)]| Material {
        bulk_kpa,
        terms: terms.iter().map(|&(mu_kpa, alpha)| OgdenTerm { mu_kpa, alpha }).collect(),
        law: None,
    };
    let ogden = [
        make(2173.0, &[(17.0, 1.91)]),
        make(2200.0, &[(16.0, 1.9), (0.35, 8.0)]),
        make(900.0, &[(12.0, 2.5), (-3.0, -2.0), (0.001, 14.0)]),
    ];
    let of_law = |law| Material { bulk_kpa: 2100.0, terms: vec![], law: Some(law) };
    ogden.into_iter().chain(laws().map(of_law)).collect()
}

fn kind(material: &Material) -> Option<LawKind> {
    material.law.map(|law| law.kind())
}

/// The materials that each program has.
fn cases() -> Vec<(Material, MaterialFormat)> {
    let has = |(material, format): &(Material, MaterialFormat)| format.convention(kind(material)).is_some();
    let all = materials().into_iter().flat_map(|m| MaterialFormat::ALL.map(|format| (m.clone(), format)));
    all.filter(has).collect()
}

fn volumetric_law(material: &Material, format: MaterialFormat) -> VolumetricLaw {
    format.convention(kind(material)).unwrap().law
}

/// What a card says: the constants of the change of shape in their order, and the volumetric constant.
struct Read {
    shape: Vec<f64>,
    volumetric: f64,
}

fn numbers(text: &str, separators: &[char]) -> Vec<f64> {
    text.split(separators).filter_map(|word| word.trim().parse().ok()).collect()
}

/// Constants of a law in the first invariant, and coefficients of the volumetric energy, as the manuals list them.
fn counts(law: LawKind) -> (usize, usize) {
    match law {
        LawKind::NeoHookean => (1, 1),
        LawKind::MooneyRivlin => (2, 1),
        LawKind::Yeoh => (3, 3),
        LawKind::Gent | LawKind::ArrudaBoyce => (2, 1),
    }
}

/// The constants in the text of a card, as the program that it is for finds them.
fn read(card: &str, format: MaterialFormat, law: Option<LawKind>) -> Read {
    let without = |mark: char| card.lines().filter(|l| !l.starts_with(mark)).collect::<Vec<_>>().join("\n");
    let split = |all: &[f64], num_shape: usize| Read { shape: all[..num_shape].to_vec(), volumetric: all[num_shape] };
    match format {
        MaterialFormat::Abaqus | MaterialFormat::Calculix => {
            let data: String = card.lines().filter(|l| !l.starts_with('*')).collect::<Vec<_>>().join(",");
            let keyword = card.lines().find(|l| l.starts_with("*HYPERELASTIC")).unwrap();
            let all = numbers(&data, &[',']);
            let (num_shape, num_volumetric) = match law {
                None => {
                    let order: usize = keyword.strip_prefix("*HYPERELASTIC, OGDEN, N=").unwrap().parse().unwrap();
                    (2 * order, order)
                }
                Some(law) => {
                    let name = ["NEO HOOKE", "MOONEY-RIVLIN", "YEOH", "", "ARRUDA-BOYCE"][law as usize];
                    assert_eq!(keyword, format!("*HYPERELASTIC, {name}"));
                    counts(law)
                }
            };
            assert_eq!(all.len(), num_shape + num_volumetric, "{card}");
            // CalculiX takes a number of its own for zero.
            let further = if format == MaterialFormat::Calculix { 1e6 * all[num_shape] } else { 0.0 };
            // Thirteen digits are written.
            let is_left_out = |d: &f64| (d - further).abs() <= 1e-12 * further;
            assert!(all[num_shape + 1..].iter().all(is_left_out), "only D_1: {card}");
            split(&all, num_shape)
        }
        MaterialFormat::Ansys => {
            let plain = without('!');
            let (head, data) = plain.split_once('\n').unwrap();
            let fields: Vec<&str> = head.split(',').collect();
            let order = fields[4].parse::<usize>();
            let (option, num_shape, num_volumetric) = match law {
                None => ("OGDEN", 2 * order.clone().unwrap(), order.unwrap()),
                Some(law) => {
                    let stated = match law {
                        LawKind::MooneyRivlin => Some(2),
                        LawKind::Yeoh => Some(3),
                        _ => None,
                    };
                    assert_eq!(order.ok(), stated, "{head}");
                    let (num_shape, num_volumetric) = counts(law);
                    (["NEO", "MOONEY", "YEOH", "GENT", "BOYCE"][law as usize], num_shape, num_volumetric)
                }
            };
            assert_eq!((fields[0], fields[1], fields[5]), ("TB", "HYPER", option));
            let mut all = vec![0.0; num_shape + num_volumetric];
            for line in data.lines() {
                let fields = numbers(line, &[',']);
                let start = fields[0] as usize - 1;
                all[start..start + fields.len() - 1].copy_from_slice(&fields[1..]);
            }
            split(&all, num_shape)
        }
        MaterialFormat::Comsol => {
            let value = |line: &str| {
                let text = line.split(' ').nth(1).unwrap();
                text.split('[').next().unwrap().parse::<f64>().unwrap()
            };
            let all: Vec<f64> = without('%').lines().map(value).collect();
            split(&all, all.len() - 1)
        }
        MaterialFormat::Febio => {
            let tag = |name: &str| {
                let rest = card.split_once(&format!("<{name}>"))?.1;
                rest.split_once("</")?.0.parse::<f64>().ok()
            };
            let (kind, names): (&str, Vec<String>) = match law {
                None => ("Ogden", (1..=6).flat_map(|i| [format!("c{i}"), format!("m{i}")]).collect()),
                Some(LawKind::NeoHookean) => ("Mooney-Rivlin", vec!["c1".into()]),
                Some(LawKind::MooneyRivlin) => ("Mooney-Rivlin", vec!["c1".into(), "c2".into()]),
                Some(LawKind::Yeoh) => ("Yeoh", (1..=6).map(|i| format!("c{i}")).collect()),
                Some(LawKind::Gent) => ("Gent", vec!["G".into(), "Jm".into()]),
                Some(LawKind::ArrudaBoyce) => ("Arruda-Boyce", vec!["mu".into(), "N".into()]),
            };
            assert!(card.contains(&format!("type=\"{kind}\"")), "{card}");
            Read { shape: names.iter().map_while(|name| tag(name)).collect(), volumetric: tag("k").unwrap() }
        }
    }
}

/// The energy of the program's manual, in the card's unit of stress.
fn energy(read: &Read, format: MaterialFormat, law: Option<LawKind>, stretches: [f64; 3]) -> f64 {
    use MaterialFormat::{Abaqus, Ansys, Calculix, Comsol, Febio};
    let j: f64 = stretches.iter().product();
    let powers = |exponent: f64| stretches.iter().map(|l| (l / j.cbrt()).powf(exponent)).sum::<f64>() - 3.0;
    let (c, v, x) = (&read.shape, read.volumetric, powers(2.0));
    let sum = |factor: &dyn Fn(f64, f64) -> f64| c.chunks(2).map(|t| factor(t[0], t[1]) * powers(t[1])).sum::<f64>();
    // The five terms of the inverse Langevin function, with the square of the locking stretch.
    let chains = |mu: f64, links: f64| {
        let i1 = x + 3.0;
        mu * (0.5 * (i1 - 3.0)
            + (i1.powi(2) - 9.0) / (20.0 * links)
            + 11.0 * (i1.powi(3) - 27.0) / (1050.0 * links.powi(2))
            + 19.0 * (i1.powi(4) - 81.0) / (7000.0 * links.powi(3))
            + 519.0 * (i1.powi(5) - 243.0) / (673_750.0 * links.powi(4)))
    };
    let of_shape = match (law, format) {
        (None, Abaqus | Calculix) => sum(&|mu, alpha| 2.0 * mu / alpha.powi(2)),
        (None, Ansys | Comsol) => sum(&|mu, alpha| mu / alpha),
        (None, Febio) => sum(&|c, m| c / m.powi(2)),
        (Some(LawKind::NeoHookean), Ansys | Comsol) => 0.5 * c[0] * x,
        (Some(LawKind::NeoHookean), Abaqus | Calculix | Febio) => c[0] * x,
        (Some(LawKind::MooneyRivlin), _) => c[0] * x + c[1] * powers(-2.0),
        (Some(LawKind::Yeoh), _) => c[0] * x + c[1] * x.powi(2) + c[2] * x.powi(3),
        (Some(LawKind::Gent), _) => -0.5 * c[0] * c[1] * (1.0 - x / c[1]).ln(),
        (Some(LawKind::ArrudaBoyce), Abaqus | Ansys | Calculix) => chains(c[0], c[1].powi(2)),
        (Some(LawKind::ArrudaBoyce), Comsol | Febio) => chains(c[0], c[1]),
    };
    let of_volume = match (law, format) {
        (None | Some(LawKind::NeoHookean | LawKind::MooneyRivlin | LawKind::Yeoh), Abaqus | Ansys | Calculix) => {
            (j - 1.0).powi(2) / v
        }
        (Some(LawKind::Gent | LawKind::ArrudaBoyce), Abaqus | Ansys | Calculix) => (0.5 * (j * j - 1.0) - j.ln()) / v,
        (_, Comsol) => 0.5 * v * (j - 1.0).powi(2),
        (_, Febio) => 0.5 * v * j.ln().powi(2),
    };
    of_shape + of_volume
}

/// ∂W/∂λ by a difference of fourth order.
fn slope(of: &dyn Fn(f64) -> f64) -> f64 {
    let h = 3e-4;
    (8.0 * (of(h) - of(-h)) - (of(2.0 * h) - of(-2.0 * h))) / (12.0 * h)
}

/// The nominal stress of a stretched strip whose sides are free, in the card's unit.
fn uniaxial(energy: &dyn Fn([f64; 3]) -> f64, stretch: f64) -> f64 {
    let at = |along: f64, side: f64| energy([along, side, side]);
    let (mut low, mut high) = (0.8 * stretch.powf(-0.5), 1.2 * stretch.powf(-0.5));
    for _ in 0..80 {
        let middle = 0.5 * (low + high);
        // The sides' stress rises with their stretch.
        if slope(&|h| at(stretch, middle + h)) < 0.0 { low = middle } else { high = middle }
    }
    slope(&|h| at(stretch + h, low))
}

fn card(material: &Material, format: MaterialFormat, unit: StressUnit) -> String {
    let origin = Origin { name: "test -- 1", version: "0", input_hash: "0" };
    material_card(material, format, unit, &origin).unwrap()
}

/// Uniaxial nominal stresses at several stretches. Where the volumetric law is ours, they agree to the error of the
/// difference quotient: 3e-4⁴ × the fifth derivative (14⁵ of the last term's part of the stress), 1e-8. Where it is
/// another one, the volumes differ by up to 3/2 (p/κ)² and the stresses by no more than the shear stiffness times that;
/// the pressure p is a third of the true stress.
#[test]
fn uniaxial_stresses_are_ours() {
    for (material, format) in cases() {
        let law = kind(&material);
        for unit in [StressUnit::Pa, StressUnit::KPa, StressUnit::MPa] {
            let read = read(&card(&material, format, unit), format, law);
            for stretch in [0.6, 0.9, 1.02, 1.4, 2.0] {
                let ours = respond(&material, &HomogeneousTest::Uniaxial.at(stretch)).unwrap();
                let ours = ours.nominal_stress_kpa[0];
                let theirs = uniaxial(&|stretches| energy(&read, format, law, stretches), stretch) * unit.in_kpa();
                let volume = (stretch * ours / (3.0 * material.bulk_kpa)).powi(2);
                let allowed = match volumetric_law(&material, format) {
                    VolumetricLaw::Logarithmic => 1e-7 * ours.abs(),
                    VolumetricLaw::Quadratic | VolumetricLaw::Mixed => {
                        1e-7 * ours.abs() + 1.5 * volume * 3.0 * ours.abs().max(60.0)
                    }
                };
                assert!(
                    (ours - theirs).abs() <= allowed,
                    "{format:?} {law:?} {stretch}: {ours} {theirs} ({allowed:e})"
                );
            }
        }
    }
}

/// The stress of simple shear, where the volume does not change: ours in every convention.
#[test]
fn shear_stresses_are_ours() {
    for (material, format) in cases() {
        let law = kind(&material);
        let read = read(&card(&material, format, StressUnit::MPa), format, law);
        for shear in [0.05, 0.4, 0.8, 1.5] {
            let f = [[1.0, shear, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
            let ours = first_piola_kirchhoff_stress(&material, &f)[0][1];
            let theirs = 1e3
                * slope(&|h| {
                    // λ − 1/λ = γ.
                    let stretch = (0.5 * (shear + h)).asinh().exp();
                    energy(&read, format, law, [stretch, 1.0 / stretch, 1.0])
                });
            assert!((ours - theirs).abs() < 1e-7 * ours, "{format:?} {law:?} {shear}: {ours} {theirs}");
        }
    }
}

/// Initial moduli: W'' of a small shear is G, of a small change of volume κ. Differences with a step of 1e-3 err by
/// 1e-6 of a fourth derivative (14² of the second at most).
#[test]
fn initial_moduli_are_ours() {
    for (material, format) in cases() {
        let law = kind(&material);
        let read = read(&card(&material, format, StressUnit::KPa), format, law);
        let h = 1e-3;
        let curvature = |of: &dyn Fn(f64) -> f64| (of(h) + of(-h) - 2.0 * of(0.0)) / (h * h);
        let volume = curvature(&|e| energy(&read, format, law, [(1.0 + e).cbrt(); 3]));
        assert!((volume / material.bulk_kpa - 1.0).abs() < 1e-5, "{format:?} {law:?} {volume}");
        let shear = curvature(&|g| {
            let stretch = (0.5 * g).asinh().exp();
            energy(&read, format, law, [stretch, 1.0 / stretch, 1.0])
        });
        assert!((shear / material.initial_shear_modulus_kpa() - 1.0).abs() < 1e-4, "{format:?} {law:?} {shear}");
    }
}

/// The whole energy is ours where the volumetric law is, also far from rest; elsewhere it is without what the
/// volumetric laws differ by, which is what [`VolumetricLaw`] says of them.
#[test]
fn energies_are_ours_but_for_the_volume() {
    for (material, format) in cases() {
        let law = kind(&material);
        let read = read(&card(&material, format, StressUnit::KPa), format, law);
        for stretches in [[1.3, 0.9, 0.95], [2.0, 0.7, 0.8], [0.5, 1.5, 1.2]] {
            let j: f64 = stretches.iter().product();
            let of_volume = match volumetric_law(&material, format) {
                VolumetricLaw::Logarithmic => j.ln().powi(2),
                VolumetricLaw::Quadratic => (j - 1.0).powi(2),
                VolumetricLaw::Mixed => 0.5 * (j * j - 1.0) - j.ln(),
            };
            let apart = 0.5 * material.bulk_kpa * (of_volume - j.ln().powi(2));
            let (ours, theirs) = (energy_density(&material, stretches), energy(&read, format, law, stretches) - apart);
            // Constants are written with 13 digits.
            assert!((ours - theirs).abs() < 1e-11 * ours.abs().max(1.0), "{format:?} {law:?} {ours} {theirs}");
        }
    }
}

/// At a relative change of volume of one per cent the pressures differ by what a card says: 1.5 and one per cent, to
/// the next order in that change.
#[test]
fn pressures_differ_as_cards_say() {
    let (j, h): (f64, f64) = (1.01, 1e-6);
    for (material, format) in cases() {
        let (law, convention) = (kind(&material), format.convention(kind(&material)).unwrap());
        let read = read(&card(&material, format, StressUnit::KPa), format, law);
        let theirs = (energy(&read, format, law, [(j + h).cbrt(); 3])
            - energy(&read, format, law, [(j - h).cbrt(); 3]))
            / (2.0 * h);
        let (said, words) = match convention.law {
            VolumetricLaw::Logarithmic => (0.0, "lambdak's"),
            VolumetricLaw::Quadratic => (0.015, "by 1.5 per cent"),
            VolumetricLaw::Mixed => (0.01, "by one per cent"),
        };
        let found = theirs / (material.bulk_kpa * j.ln() / j) - 1.0;
        assert!((found - said).abs() < 3e-4, "{format:?} {law:?} {found} {said}");
        assert!(convention.law.meaning().ends_with(words));
    }
}

#[test]
fn what_a_program_cannot_read_is_refused() {
    let terms = (1..=4).map(|i| OgdenTerm { mu_kpa: 1.0, alpha: f64::from(i) }).collect();
    let material = Material { bulk_kpa: 1e3, terms, law: None };
    let refused =
        |material: &Material, format: MaterialFormat| format.convert(material, StressUnit::MPa).err().unwrap();
    let found = refused(&material, MaterialFormat::Calculix);
    assert_eq!(found, ExportError::TooManyTerms { program: "CalculiX", count: 4, limit: 3 });
    // Eight numbers a line: four pairs, then D_1 to D_4.
    let text = card(&material, MaterialFormat::Abaqus, StressUnit::MPa);
    let lines: Vec<usize> = text.lines().filter(|l| !l.starts_with('*')).map(|l| l.split(',').count()).collect();
    assert_eq!(lines, [8, 4]);
    let gent = Material { bulk_kpa: 1e3, terms: vec![], law: Some(laws()[1]) };
    for format in [MaterialFormat::Abaqus, MaterialFormat::Calculix] {
        let others = vec!["Ansys", "COMSOL", "FEBio"];
        assert_eq!(refused(&gent, format), ExportError::NoSuchLaw { program: format.program(), law: "Gent", others });
    }
    let said = refused(&gent, MaterialFormat::Abaqus).to_string();
    assert_eq!(
        said,
        "Abaqus has no law of Gent; write the material for Ansys, COMSOL, FEBio, or fit another law for Abaqus"
    );
}

//! Cards against the strain energies of the programs' manuals: the numbers are read back from the text of each card,
//! put into the energy as that manual states it, and differentiated.

use super::*;
use crate::homogeneous::{HomogeneousTest, StressUnit, respond};
use crate::material::{Ogden, OgdenTerm, energy_density, first_piola_kirchhoff_stress};

fn materials() -> Vec<Ogden> {
    let make = |bulk_kpa, terms: &[(f64, f64)]| Ogden {
        bulk_kpa,
        terms: terms.iter().map(|&(mu_kpa, alpha)| OgdenTerm { mu_kpa, alpha }).collect(),
        law: None,
    };
    vec![
        make(2173.0, &[(17.0, 1.91)]),
        make(2200.0, &[(16.0, 1.9), (0.35, 8.0)]),
        make(900.0, &[(12.0, 2.5), (-3.0, -2.0), (0.001, 14.0)]),
    ]
}

/// What a card says: factors and exponents, and the volumetric constant.
struct Read {
    terms: Vec<[f64; 2]>,
    volumetric: f64,
}

fn numbers(text: &str, separators: &[char]) -> Vec<f64> {
    text.split(separators).filter_map(|word| word.trim().parse().ok()).collect()
}

/// The constants in the text of a card, as the program that it is for finds them.
fn read(card: &str, format: MaterialFormat) -> Read {
    let without = |mark: char| card.lines().filter(|l| !l.starts_with(mark)).collect::<Vec<_>>().join("\n");
    let paired = |all: &[f64], num_terms: usize| Read {
        terms: all[..2 * num_terms].chunks(2).map(|t| [t[0], t[1]]).collect(),
        volumetric: all[2 * num_terms],
    };
    match format {
        MaterialFormat::Abaqus | MaterialFormat::Calculix => {
            let data: String = card.lines().filter(|l| !l.starts_with('*')).collect::<Vec<_>>().join(",");
            let order: usize = card.split("N=").last().unwrap().lines().next().unwrap().parse().unwrap();
            let all = numbers(&data, &[',']);
            assert_eq!(all.len(), 3 * order, "{card}");
            assert!(all[2 * order + 1..].iter().all(|d| *d == 0.0), "only D_1: {card}");
            paired(&all, order)
        }
        MaterialFormat::Ansys => {
            let plain = without('!');
            let (head, data) = plain.split_once('\n').unwrap();
            let order: usize = head.split(',').nth(4).unwrap().parse().unwrap();
            let mut all = vec![0.0; 3 * order];
            for line in data.lines() {
                let fields = numbers(line, &[',']);
                let start = fields[0] as usize - 1;
                all[start..start + fields.len() - 1].copy_from_slice(&fields[1..]);
            }
            paired(&all, order)
        }
        MaterialFormat::Comsol => {
            let value = |line: &str| {
                let text = line.split(' ').nth(1).unwrap();
                text.split('[').next().unwrap().parse::<f64>().unwrap()
            };
            let all: Vec<f64> = without('%').lines().map(value).collect();
            paired(&all, all.len() / 2)
        }
        MaterialFormat::Febio => {
            let tag = |name: &str| {
                let rest = card.split_once(&format!("<{name}>"))?.1;
                rest.split_once("</")?.0.parse::<f64>().ok()
            };
            let terms = (1..=6).map_while(|i| Some([tag(&format!("c{i}"))?, tag(&format!("m{i}"))?])).collect();
            Read { terms, volumetric: tag("k").unwrap() }
        }
    }
}

/// The energy of the program's manual, in the card's unit of stress.
fn energy(read: &Read, format: MaterialFormat, stretches: [f64; 3]) -> f64 {
    let j: f64 = stretches.iter().product();
    let powers = |exponent: f64| stretches.iter().map(|l| (l / j.cbrt()).powf(exponent)).sum::<f64>() - 3.0;
    let sum = |factor: &dyn Fn(f64, f64) -> f64| read.terms.iter().map(|&[f, a]| factor(f, a) * powers(a)).sum::<f64>();
    let v = read.volumetric;
    match format {
        MaterialFormat::Abaqus | MaterialFormat::Calculix => {
            sum(&|mu, alpha| 2.0 * mu / alpha.powi(2)) + (j - 1.0).powi(2) / v
        }
        MaterialFormat::Ansys => sum(&|mu, alpha| mu / alpha) + (j - 1.0).powi(2) / v,
        MaterialFormat::Comsol => sum(&|mu, alpha| mu / alpha) + 0.5 * v * (j - 1.0).powi(2),
        MaterialFormat::Febio => sum(&|c, m| c / m.powi(2)) + 0.5 * v * j.ln().powi(2),
    }
}

/// ∂W/∂λ by a difference of fourth order.
fn slope(of: &dyn Fn(f64) -> f64) -> f64 {
    let h = 3e-4;
    (8.0 * (of(h) - of(-h)) - (of(2.0 * h) - of(-2.0 * h))) / (12.0 * h)
}

/// The nominal stress of a stretched strip whose sides are free, in the card's unit.
fn uniaxial(read: &Read, format: MaterialFormat, stretch: f64) -> f64 {
    let at = |along: f64, side: f64| energy(read, format, [along, side, side]);
    let (mut low, mut high) = (0.8 * stretch.powf(-0.5), 1.2 * stretch.powf(-0.5));
    for _ in 0..80 {
        let middle = 0.5 * (low + high);
        // The sides' stress rises with their stretch.
        if slope(&|h| at(stretch, middle + h)) < 0.0 { low = middle } else { high = middle }
    }
    slope(&|h| at(stretch + h, low))
}

fn card(material: &Ogden, format: MaterialFormat, unit: StressUnit) -> String {
    let origin = Origin { name: "test -- 1", version: "0", input_hash: "0" };
    material_card(material, format, unit, &origin).unwrap()
}

/// Uniaxial nominal stresses at several stretches. Where the volumetric law is ours, they agree to the error of the
/// difference quotient: 3e-4⁴ × the fifth derivative (14⁵ of the last term's part of the stress), 1e-8. Where it is
/// another one, the volumes differ by 3/2 (p/κ)² and the stresses by no more than the shear stiffness times that; the
/// pressure p is a third of the true stress.
#[test]
fn uniaxial_stresses_are_ours() {
    for material in materials() {
        for format in MaterialFormat::ALL {
            for unit in [StressUnit::Pa, StressUnit::KPa, StressUnit::MPa] {
                let read = read(&card(&material, format, unit), format);
                assert_eq!(read.terms.len(), material.terms.len());
                for stretch in [0.6, 0.9, 1.02, 1.4, 2.0] {
                    let ours = respond(&material, &HomogeneousTest::Uniaxial.at(stretch)).unwrap();
                    let ours = ours.nominal_stress_kpa[0];
                    let theirs = uniaxial(&read, format, stretch) * unit.in_kpa();
                    let volume = (stretch * ours / (3.0 * material.bulk_kpa)).powi(2);
                    let allowed = match format.convention().law {
                        VolumetricLaw::Logarithmic => 1e-7 * ours.abs(),
                        VolumetricLaw::Quadratic => 1e-7 * ours.abs() + 1.5 * volume * 3.0 * ours.abs().max(60.0),
                    };
                    assert!((ours - theirs).abs() <= allowed, "{format:?} {stretch}: {ours} {theirs} ({allowed:e})");
                }
            }
        }
    }
}

/// The stress of simple shear, where the volume does not change: ours in every convention.
#[test]
fn shear_stresses_are_ours() {
    for material in materials() {
        for format in MaterialFormat::ALL {
            let read = read(&card(&material, format, StressUnit::MPa), format);
            for shear in [0.05, 0.4, 0.8, 1.5] {
                let f = [[1.0, shear, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
                let ours = first_piola_kirchhoff_stress(&material, &f)[0][1];
                let theirs = 1e3
                    * slope(&|h| {
                        // λ − 1/λ = γ.
                        let stretch = (0.5 * (shear + h)).asinh().exp();
                        energy(&read, format, [stretch, 1.0 / stretch, 1.0])
                    });
                assert!((ours - theirs).abs() < 1e-7 * ours, "{format:?} {shear}: {ours} {theirs}");
            }
        }
    }
}

/// Initial moduli: W'' of a small shear is G, of a small change of volume κ. Differences with a step of 1e-3 err by
/// 1e-6 of a fourth derivative (14² of the second at most).
#[test]
fn initial_moduli_are_ours() {
    for material in materials() {
        for format in MaterialFormat::ALL {
            let read = read(&card(&material, format, StressUnit::KPa), format);
            let h = 1e-3;
            let curvature = |of: &dyn Fn(f64) -> f64| (of(h) + of(-h) - 2.0 * of(0.0)) / (h * h);
            let volume = curvature(&|e| energy(&read, format, [(1.0 + e).cbrt(); 3]));
            assert!((volume / material.bulk_kpa - 1.0).abs() < 1e-5, "{format:?} {volume}");
            let shear = curvature(&|g| {
                let stretch = (0.5 * g).asinh().exp();
                energy(&read, format, [stretch, 1.0 / stretch, 1.0])
            });
            assert!((shear / material.initial_shear_modulus_kpa() - 1.0).abs() < 1e-4, "{format:?} {shear}");
        }
    }
}

/// The whole energy is ours where the volumetric law is, also far from rest.
#[test]
fn energies_agree_where_they_are_said_to() {
    for material in materials() {
        for format in MaterialFormat::ALL.into_iter().filter(|f| f.convention().law == VolumetricLaw::Logarithmic) {
            let read = read(&card(&material, format, StressUnit::KPa), format);
            for stretches in [[1.3, 0.9, 0.95], [2.0, 0.7, 0.8], [0.5, 1.5, 1.2]] {
                let (ours, theirs) = (energy_density(&material, stretches), energy(&read, format, stretches));
                // Constants are written with 13 digits.
                assert!((ours - theirs).abs() < 1e-11 * ours.abs().max(1.0), "{format:?} {ours} {theirs}");
            }
        }
    }
}

#[test]
fn what_a_program_cannot_read_is_refused() {
    let terms = (1..=4).map(|i| OgdenTerm { mu_kpa: 1.0, alpha: f64::from(i) }).collect();
    let material = Ogden { bulk_kpa: 1e3, terms, law: None };
    let found = MaterialFormat::Calculix.convention().constants(&material, StressUnit::MPa);
    assert_eq!(found, Err(ExportError::TooManyTerms { program: "CalculiX", count: 4, limit: 3 }));
    // Eight numbers a line: four pairs, then D_1 to D_4.
    let text = card(&material, MaterialFormat::Abaqus, StressUnit::MPa);
    let lines: Vec<usize> = text.lines().filter(|l| !l.starts_with('*')).map(|l| l.split(',').count()).collect();
    assert_eq!(lines, [8, 4]);
}

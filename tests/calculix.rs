//! Exported materials and models, run in CalculiX: an independent code with elements of its own.
//!
//! Without `ccx` (Debian and Ubuntu: `apt-get install calculix-ccx`) every test is ignored.

#[path = "common/prerequisites.rs"]
mod prerequisites;

use lambdak::export::{MaterialFormat, Model, ModelFormat, Origin, VolumetricLaw, material_card, model_file};
use lambdak::fem::{Equilibrium, ForwardModel, SolveOptions};
use lambdak::homogeneous::{HomogeneousTest, StressUnit, respond};
use lambdak::kinematics::decompose;
use lambdak::material::{
    ArrudaBoyce, InvariantLaw, Material, MooneyRivlin, NeoHookean, OgdenTerm, Yeoh, first_piola_kirchhoff_stress,
};
use lambdak::mesh::MeshOptions;
use lambdak::specimen::Specimen;
use prerequisites::Missing;
use std::path::Path;
use std::process::Command;

fn ogden(bulk_kpa: f64, terms: &[(f64, f64)]) -> Material {
    Material { bulk_kpa, terms: terms.iter().map(|&(mu_kpa, alpha)| OgdenTerm { mu_kpa, alpha }).collect(), law: None }
}

/// Runs the input file `name.inp` of `folder`, and gives time and total force (N) of each increment.
fn run(folder: &Path, name: &str) -> Vec<(f64, [f64; 3])> {
    let output = Command::new("ccx").env("OMP_NUM_THREADS", "1").current_dir(folder).arg(name).output().unwrap();
    let said = String::from_utf8_lossy(&output.stdout);
    assert!(output.status.success() && !said.contains("*ERROR"), "{said}");
    let printed = std::fs::read_to_string(folder.join(name).with_extension("dat")).unwrap();
    let lines: Vec<&str> = printed.lines().filter(|l| !l.trim().is_empty()).collect();
    let number = |word: &str| word.parse::<f64>().unwrap();
    let pair = |pair: &[&str]| {
        let force: Vec<f64> = pair[1].split_whitespace().map(number).collect();
        (number(pair[0].split_whitespace().last().unwrap()), [force[0], force[1], force[2]])
    };
    lines.chunks(2).map(pair).collect()
}

/// The forces at the ends of the steps, which end at the times 1, 2, …
fn at_ends(found: &[(f64, [f64; 3])], num_steps: usize) -> Vec<[f64; 3]> {
    let at = |step: usize| found.iter().find(|(t, _)| (t - step as f64).abs() < 1e-6).expect("the step ends").1;
    (1..=num_steps).map(at).collect()
}

/// A cube of 1 mm of one quadratic element, pulled to `stretches` with free sides, or with sides that stay where they
/// are.
fn cube(card: &str, stretches: &[f64], is_confined: bool) -> String {
    // Corners of the bottom, of the top, middles of the bottom's edges, of the top's, of the uprights.
    let corners = [[0, 0], [2, 0], [2, 2], [0, 2]];
    let middles = [[1, 0], [2, 1], [1, 2], [0, 1]];
    let levels = [(corners, 0), (corners, 2), (middles, 0), (middles, 2), (corners, 1)];
    let nodes: Vec<[i32; 3]> = levels.iter().flat_map(|(xy, z)| xy.map(|[x, y]| [x, y, *z])).collect();
    let mut text = String::from("*NODE, NSET=ALL\n");
    for (n, x) in nodes.iter().enumerate() {
        let [x, y, z] = x.map(|c| 0.5 * f64::from(c));
        text += &format!("{}, {x}, {y}, {z}\n", n + 1);
    }
    text += "*ELEMENT, TYPE=C3D20, ELSET=SPECIMEN\n1, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15,\n16, 17, 18, 19, 20\n";
    for (name, axis, place) in [("X0", 0, 0), ("Y0", 1, 0), ("Z0", 2, 0), ("X1", 0, 2)] {
        text += &format!("*NSET, NSET={name}\n");
        for n in (0..20).filter(|&n| nodes[n][axis] == place) {
            text += &format!("{},\n", n + 1);
        }
    }
    text += card;
    text += "*SOLID SECTION, ELSET=SPECIMEN, MATERIAL=cube\n*BOUNDARY\nX0, 1, 1\nY0, 2, 2\nZ0, 3, 3\n";
    if is_confined {
        text += "ALL, 2, 3\n";
    }
    for stretch in stretches {
        // A residual of 1e-8 of the mean force instead of half a per cent.
        text += "*STEP, NLGEOM, INC=500\n*STATIC\n0.1, 1.0, 1.0e-5, 0.2\n*CONTROLS, PARAMETERS=FIELD\n1.0e-8, 1.0e-8\n";
        text += &format!("*BOUNDARY\nX1, 1, 1, {}\n*NODE PRINT, NSET=X1, TOTALS=ONLY\nRF\n*END STEP\n", stretch - 1.0);
    }
    text
}

/// Nominal stresses of one, two and three terms and of the laws that CalculiX has in uniaxial tension. CalculiX'
/// volumetric energy is κ/2 (J − 1)², with Arruda and Boyce's law κ/2 ((J² − 1)/2 − ln J): the stress differs by the
/// shear stiffness times 3/2 (p/κ)² at most, and seven digits are printed.
fn a_card_gives_our_stresses() -> Result<(), Missing> {
    prerequisites::calculix()?;
    let folder = tempfile::tempdir().unwrap();
    let materials = [
        ogden(2173.0, &[(17.0, 1.91)]),
        ogden(2200.0, &[(16.0, 1.9), (0.35, 8.0)]),
        ogden(900.0, &[(12.0, 2.5), (-3.0, -2.0), (0.5, 5.0)]),
        Material::of_law(2100.0, InvariantLaw::NeoHookean(NeoHookean { mu_kpa: 16.0 })).unwrap(),
        Material::of_law(2100.0, InvariantLaw::MooneyRivlin(MooneyRivlin { coefficients_kpa: [6.0, 2.0] })).unwrap(),
        Material::of_law(2100.0, InvariantLaw::Yeoh(Yeoh { coefficients_kpa: [8.0, -0.3, 0.05] })).unwrap(),
        Material::of_law(2100.0, InvariantLaw::ArrudaBoyce(ArrudaBoyce { mu_kpa: 15.0, locking_stretch: 1.8 }))
            .unwrap(),
    ];
    let stretches = [1.2, 1.6, 2.0];
    for (index, material) in materials.iter().enumerate() {
        let name = format!("cube-{index}");
        let origin = Origin { name: "cube", version: "0", input_hash: "0" };
        let card = material_card(material, MaterialFormat::Calculix, StressUnit::MPa, &origin).unwrap();
        std::fs::write(folder.path().join(format!("{name}.inp")), cube(&card, &stretches, false)).unwrap();
        let forces = at_ends(&run(folder.path(), &name), stretches.len());
        for (stretch, force) in stretches.iter().zip(forces) {
            let ours = respond(material, &HomogeneousTest::Uniaxial.at(*stretch)).unwrap().nominal_stress_kpa[0];
            // N on 1 mm² are MPa.
            let theirs = 1e3 * force[0];
            let volume = 1.5 * (stretch * ours / (3.0 * material.bulk_kpa)).powi(2);
            let allowed = 1e-6 + 3.0 * volume;
            println!("{name} at {stretch}: {ours:.5} and {theirs:.5} kPa (allowed {allowed:.1e} of it)");
            assert!((theirs / ours - 1.0).abs() < allowed, "{name} {stretch}: {ours} {theirs}");
        }
    }
    Ok(())
}

/// The volumetric energies that the cards state, in confined compression and tension: our stress with the pressure of
/// their energy in the place of ours. Seven digits are printed.
fn a_card_states_its_volumetric_energy() -> Result<(), Missing> {
    prerequisites::calculix()?;
    let folder = tempfile::tempdir().unwrap();
    let materials = [
        ogden(200.0, &[(16.0, 1.9), (0.35, 8.0)]),
        Material::of_law(200.0, InvariantLaw::MooneyRivlin(MooneyRivlin { coefficients_kpa: [6.0, 2.0] })).unwrap(),
        Material::of_law(200.0, InvariantLaw::Yeoh(Yeoh { coefficients_kpa: [8.0, -0.3, 0.05] })).unwrap(),
        Material::of_law(200.0, InvariantLaw::ArrudaBoyce(ArrudaBoyce { mu_kpa: 15.0, locking_stretch: 1.8 })).unwrap(),
    ];
    let stretches = [0.9, 1.1];
    for (index, material) in materials.iter().enumerate() {
        let name = format!("confined-{index}");
        let origin = Origin { name: "cube", version: "0", input_hash: "0" };
        let card = material_card(material, MaterialFormat::Calculix, StressUnit::MPa, &origin).unwrap();
        std::fs::write(folder.path().join(format!("{name}.inp")), cube(&card, &stretches, true)).unwrap();
        let law = MaterialFormat::Calculix.convert(material, StressUnit::MPa).unwrap().convention.law;
        let forces = at_ends(&run(folder.path(), &name), stretches.len());
        for (&j, force) in stretches.iter().zip(forces) {
            let pressure = match law {
                VolumetricLaw::Quadratic => j - 1.0,
                VolumetricLaw::Mixed => 0.5 * (j - 1.0 / j),
                VolumetricLaw::Logarithmic => j.ln() / j,
            };
            let f = [[j, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
            let apart = material.bulk_kpa * (pressure - j.ln() / j);
            let ours = first_piola_kirchhoff_stress(material, &f)[0][0] + apart;
            let theirs = 1e3 * force[0];
            println!("{name} at {j}: {ours:.5} and {theirs:.5} kPa, {apart:.5} of the volume");
            assert!((theirs / ours - 1.0).abs() < 1e-6, "{name} {j}: {ours} {theirs}");
            // What is told apart is far more.
            assert!(apart.abs() > 1e-3 * ours.abs());
        }
    }
    Ok(())
}

/// A specimen, its material and drives.
struct Case {
    specimen: &'static str,
    material: Material,
    drives_mm: [f64; 2],
    /// Triangles extruded to prisms in place of hexahedra.
    has_prisms: bool,
    /// How far the plates are pressed together before they are driven, mm.
    precompression_mm: f64,
}

/// The force along the drive and the one along +y on the moved face, N, and what the other volumetric law may change
/// of each, as a part of it.
struct Forces {
    force_n: [f64; 2],
    of_law: [f64; 2],
}

/// Element sizes as factors on the standard one: a mesh, and one of half its size.
const COARSE: f64 = 1.8;
const FINE: f64 = 0.9;

impl Case {
    fn specimen(&self) -> Specimen {
        let geometry = Path::new(env!("CARGO_MANIFEST_DIR")).join("geometries").join(self.specimen);
        let specimen = Specimen::from_json(&std::fs::read_to_string(geometry).unwrap()).unwrap();
        Specimen { precompression_mm: self.precompression_mm, drive_mm: self.drives_mm.to_vec(), ..specimen }
    }

    fn model(&self, factor: f64) -> ForwardModel {
        let specimen = self.specimen();
        let options = MeshOptions { force_prisms: self.has_prisms, ..MeshOptions::scaled(&specimen, factor) };
        ForwardModel::of_specimen(&specimen, &options).unwrap()
    }

    /// Our forces. Where the volume changes by e, the laws' volumes differ by 3/2 e², which is a strain of a third of
    /// that, and the least strain of the tests is 0.05: that counts for the force along the drive. What plates that
    /// are pressed together feel is mostly the pressure, of which 3/2 e² is the part 3/2 e.
    fn ours(&self, factor: f64) -> Vec<Forces> {
        let mut model = self.model(factor);
        let path = model.solve_path(&self.material, &self.drives_mm, &SolveOptions::default(), &|| false).unwrap();
        let of_laws = |state: &Equilibrium| {
            let (mut squares, mut amounts, mut volume) = (0.0, 0.0, 0.0);
            for q in model.quadrature_fields(&self.material, state) {
                let e = decompose(&q.deformation_gradient).jacobian - 1.0;
                squares += q.volume_mm3 * e * e;
                amounts += q.volume_mm3 * e.abs();
                volume += q.volume_mm3;
            }
            [1.5 * squares / volume / 3.0 / 0.05, 1.5 * squares / amounts]
        };
        path.iter().map(|e| Forces { force_n: [e.force_n, e.normal_force_n], of_law: of_laws(e) }).collect()
    }

    /// Writes the model for CalculiX into `folder`, by the command where it can; gives what reactions are multiplied
    /// by.
    fn write(&self, folder: &Path, factor: f64) -> f64 {
        if self.has_prisms {
            let forward = self.model(factor);
            let (mesh, multiplicity) = (forward.mesh(), forward.multiplicity());
            let model = Model {
                mesh,
                material: &self.material,
                drives_mm: &self.drives_mm,
                direction: [1.0, 0.0, 0.0],
                beside_drive_mm: self.specimen().displacement_before_drive_mm(),
                multiplicity,
            };
            let origin = Origin { name: "prisms", version: "0", input_hash: "0" };
            let text = model_file(&model, ModelFormat::Calculix, &origin).unwrap();
            assert!(text.contains("TYPE=C3D15,"));
            std::fs::write(folder.join("model-calculix.inp"), text).unwrap();
            return multiplicity;
        }
        let [material, specimen] = ["material.json", "specimen.json"].map(|name| folder.join(name));
        std::fs::write(&material, self.material.to_json()).unwrap();
        std::fs::write(&specimen, self.specimen().to_json()).unwrap();
        let output = Command::new(env!("CARGO_BIN_EXE_lambdak"))
            .args(["export", "model", "--format", "calculix", "--mesh", &factor.to_string(), "--out", "."])
            .arg("--material")
            .args([&material, &specimen])
            .current_dir(folder)
            .output()
            .unwrap();
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        let text = std::fs::read_to_string(folder.join("export-model.json")).unwrap();
        let result: serde_json::Value = serde_json::from_str(&text).unwrap();
        result["reaction_multiplier"].as_f64().unwrap()
    }

    /// The forces of CalculiX along the drive and along +y, N.
    fn theirs(&self, factor: f64) -> Vec<[f64; 2]> {
        let folder = tempfile::tempdir().unwrap();
        let multiplier = self.write(folder.path(), factor);
        let along = |f: &[f64; 3]| [multiplier * f[0], multiplier * f[1]];
        at_ends(&run(folder.path(), "model-calculix"), 2).iter().map(along).collect()
    }
}

/// Forces of whole specimens. Elements without a pressure of their own converge slowly next to bonded edges where the
/// material hardly changes its volume; the bulk modulus is therefore twenty times the shear modulus, and twice for the
/// fully integrated prisms.
///
/// What is allowed is the error of both meshes, and what the volumetric law changes. The forces of bonded blocks
/// converge at least with the first order (the stress at the edges is singular with an exponent of about -0.4, and the
/// energy converges twice as fast as the stress): what is left at half the element size is then no more than the change
/// from the whole one. Plates that were pressed together or pulled apart before also have a force across them.
fn forces_are_ours() -> Result<(), Missing> {
    prerequisites::calculix()?;
    let soft = ogden(324.7, &[(17.0, 1.91)]);
    let two = ogden(330.0, &[(16.0, 1.9), (0.35, 4.0)]);
    let foam = ogden(33.0, &[(17.0, 1.91)]);
    let case = |specimen, material: &Material, drives_mm| Case {
        specimen,
        material: material.clone(),
        drives_mm,
        has_prisms: false,
        precompression_mm: 0.0,
    };
    let cases = [
        case("two-hole-shear.json", &soft, [2.0, 4.0]),
        Case { precompression_mm: 0.3, ..case("solid-shear.json", &soft, [2.0, 4.0]) },
        Case { precompression_mm: -0.6, ..case("two-hole-shear.json", &two, [2.0, 4.0]) },
        case("uniaxial-bar.json", &two, [4.0, 8.0]),
        case("iso37-type4.json", &soft, [1.5, 3.0]),
        Case { has_prisms: true, ..case("solid-shear.json", &foam, [1.0, 2.0]) },
    ];
    for case in &cases {
        let [ours, our_coarse] = [FINE, COARSE].map(|f| case.ours(f));
        let [theirs, their_coarse] = [FINE, COARSE].map(|f| case.theirs(f));
        // Without it the force across is small, and where y is a mirror the mesh has another one.
        let names = if case.precompression_mm.abs() > 0.0 { &["along", "across"][..] } else { &["along"] };
        for (step, drive) in case.drives_mm.iter().enumerate() {
            for (way, name) in names.iter().enumerate() {
                let change = |fine: f64, coarse: f64| (coarse / fine - 1.0).abs();
                let (force, of_law) = (ours[step].force_n[way], ours[step].of_law[way]);
                let other = theirs[step][way];
                let of_meshes = change(force, our_coarse[step].force_n[way]) + change(other, their_coarse[step][way]);
                let difference = other / force - 1.0;
                println!(
                    "{} pressed by {} mm, {name} at {drive} mm: ours {force:.5} N, CalculiX {other:.5} N: {:+.3} % \
                     (meshes {:.3} %, law {:.3} %)",
                    case.specimen,
                    case.precompression_mm,
                    100.0 * difference,
                    100.0 * of_meshes,
                    100.0 * of_law
                );
                assert!(difference.abs() < of_meshes + of_law, "{} {name} at {drive} mm: {difference}", case.specimen);
            }
        }
    }
    Ok(())
}

prerequisites::test_binary!(a_card_gives_our_stresses, a_card_states_its_volumetric_energy, forces_are_ours);

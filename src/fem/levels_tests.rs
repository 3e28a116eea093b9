use super::equilibrium::Equilibrium;
use super::mesh_model::MeshModel;
use super::options::SolveOptions;
use crate::material::Material;
use crate::mesh::{MeshOptions, Refinement, mesh_specimen, refined};
use crate::specimen::Specimen;

fn specimen() -> Specimen {
    Specimen::from_json(include_str!("../../geometries/two-hole-shear.json")).unwrap()
}

/// The coarse model of a mesh of `factor` times the standard element size, and its refinement.
fn coarse_and_refinement(factor: f64) -> (MeshModel, Refinement) {
    let specimen = specimen();
    let mesh = mesh_specimen(&specimen, &MeshOptions::scaled(&specimen, factor)).unwrap();
    let refinement = refined(&mesh).unwrap();
    (MeshModel::new(mesh, &specimen, &|_, _| false).unwrap(), refinement)
}

/// Forces that change from node to node, the same in every run.
fn rough(n: usize) -> Vec<f64> {
    (0..n).map(|i| ((i * 7919 % 1009) as f64 / 504.0 - 1.0) * if i % 7 == 0 { 3.0 } else { 1.0 }).collect()
}

/// Both preconditioners find the same equilibrium and the same solution of a system there: to what conjugate gradients
/// were asked, 1e-9, times the condition of the matrix that the residual does not see (κ/μ = 128).
#[test]
fn both_methods_find_the_same() {
    let material = Material::new(2173.0, [(17.0, 1.91)]).unwrap();
    let (coarse, refinement) = coarse_and_refinement(2.6);
    let options = SolveOptions { tolerance: 1e-9, ..SolveOptions::default() };
    let mut by_levels = MeshModel::refining(&coarse, &refinement, &specimen()).unwrap();
    assert!(!by_levels.linearisation.system.gains_digits_at_once(), "there are levels");
    let mut direct = MeshModel::new(refinement.mesh.clone(), &specimen(), &|_, _| false).unwrap();
    let first = by_levels.newton(&material, &options, &|| false).solve(5.0, None).unwrap();
    let second = direct.newton(&material, &options, &|| false).solve(5.0, None).unwrap();
    assert!((first.force_n / second.force_n - 1.0).abs() < 1e-7, "{} {}", first.force_n, second.force_n);
    for (a, b) in first.displacement.iter().zip(&second.displacement) {
        assert!((0..3).all(|i| (a[i] - b[i]).abs() < 1e-6), "{a:?} {b:?}");
    }
    let right = by_levels.assembler.collect(&by_levels.assembler.spread(&rough(3 * refinement.mesh.nodes.len())), 1.0);
    let solve = |model: &mut MeshModel, at: &Equilibrium| {
        let mut tangent = model.tangent(&material, at).unwrap();
        tangent.solve_all(&[right.clone(), rough(right.len())], 1e-10).unwrap()
    };
    let (by_levels, direct) = (solve(&mut by_levels, &first), solve(&mut direct, &second));
    for (a, b) in by_levels.iter().zip(&direct) {
        let scale = b.iter().fold(0.0f64, |s, x| s.max(x.abs()));
        let apart = a.iter().zip(b).fold(0.0f64, |s, (x, y)| s.max((x - y).abs()));
        assert!(apart < 1e-5 * scale, "{apart} of {scale}");
    }
}

/// Neither finer meshes nor less compressible materials make the preconditioner much worse: what patches and a coarse
/// space of least energy are for.
#[test]
fn iterations_grow_neither_with_the_mesh_nor_with_the_bulk_modulus() {
    let iterations = |factor: f64, bulk_kpa: f64| {
        let material = Material::new(bulk_kpa, [(17.0, 1.91)]).unwrap();
        let (coarse, refinement) = coarse_and_refinement(factor);
        let mut model = MeshModel::refining(&coarse, &refinement, &specimen()).unwrap();
        let rest = Equilibrium::at_rest(refinement.mesh.nodes.len(), refinement.mesh.num_elements());
        model.assembler.linearise(&material, &rest, &mut model.linearisation).unwrap();
        model.linearisation.system.factorise().unwrap();
        let right =
            model.assembler.collect(&model.assembler.spread(&rough(model.linearisation.system.num_unknowns())), 1.0);
        let solves_in = |limit: usize| model.linearisation.system.solves_within(&right, 1e-6, limit);
        // More iterations never solve less.
        let limits: Vec<usize> = (1..300).collect();
        limits[limits.partition_point(|&limit| !solves_in(limit))]
    };
    let coarse = iterations(3.2, 200.0);
    let [finer, harder] = [iterations(2.0, 200.0), iterations(3.2, 20_000.0)];
    assert!(coarse < 60, "{coarse} iterations for six digits");
    assert!(finer < 3 * coarse / 2, "{coarse} iterations, {finer} of a finer mesh");
    assert!(harder < 2 * coarse, "{coarse} iterations, {harder} of a material a hundred times less compressible");
}

//! scratch
use lambdak::{fem::*, material::*, mesh::*, specimen::*};
use std::time::Instant;
fn main() {
    let args: Vec<String> = std::env::args().collect();
    let reference: serde_json::Value = serde_json::from_str(&std::fs::read_to_string(&args[1]).unwrap()).unwrap();
    let specimen: Specimen = serde_json::from_value(reference["specimen"].clone()).unwrap();
    let material: Ogden = serde_json::from_value(reference["material"].clone()).unwrap();
    let mirror = args.get(3).is_none_or(|s| s != "full");
    for f in args[2].split(',') {
        let f: f64 = f.parse().unwrap();
        let mut o = MeshOptions::scaled(&specimen, f);
        o.use_mirror = mirror;
        if let Some(g) = args.get(4) {
            o.grading = g.parse().unwrap();
        }
        let t = Instant::now();
        let mesh = mesh_specimen(&specimen, &o).unwrap();
        let tm = t.elapsed();
        let t = Instant::now();
        let n = mesh.num_elements();
        let kind = mesh.element_kind;
        let mut model = ForwardModel::new(mesh, &specimen).unwrap();
        let ts = t.elapsed();
        let t = Instant::now();
        let path = model.solve_path(&material, &specimen.drive_mm, &SolveOptions::default(), &|| false);
        let path = match path {
            Ok(p) => p,
            Err(e) => {
                println!("{f} {e}");
                continue;
            }
        };
        let tp = t.elapsed();
        let d = specimen.drive_mm[1];
        let t = Instant::now();
        let e = model.solve(&material, d, None, &SolveOptions::default(), &|| false).unwrap();
        let t1 = t.elapsed();
        let st = model.statistics();
        let t = Instant::now();
        let s = model.material_sensitivities(&material, &e).unwrap();
        let tse = t.elapsed();
        let errs: Vec<String> = path
            .iter()
            .zip(reference["extrapolated"].as_array().unwrap())
            .map(|(p, r)| {
                format!(
                    "{:.5} ({:+.3}%)",
                    p.force_n,
                    100.0 * (p.force_n / r["force_x_n"]["value"].as_f64().unwrap() - 1.0)
                )
            })
            .collect();
        println!(
            "f={f} {kind:?} el={n} dofs={} mesh {tm:.1?} setup {ts:.1?} path {tp:.1?} single {t1:.1?} {st:?} sens {tse:.1?} F={errs:?} imb={:.1e} dF={:?}",
            model.num_unknowns(),
            e.reaction_imbalance,
            s.iter().map(|s| s.force_n).collect::<Vec<_>>()
        );
    }
}

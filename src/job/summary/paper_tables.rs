//! Tables like the paper's as text.

use super::num;
use crate::calibration::StandIn;
use crate::homogeneous::UniaxialStandIn;
use crate::recording::Filter;

/// All of them.
pub(in crate::job) fn paper_tables(uniaxial: &UniaxialStandIn, all: &[StandIn]) -> String {
    uniaxial_table(uniaxial) + &tables(all)
}

/// A table like the paper's 1.
fn uniaxial_table(found: &UniaxialStandIn) -> String {
    let mut text = format!(
        "like Table 1: fits of a dumb-bell's curve (moduli in kPa; truth mu {}; gauge stretches within {})\n  stretch  terms  mu       terms (mu, alpha)                                              relative squares\n",
        num(found.true_initial_shear_modulus_kpa, 4),
        num(found.stretch_error, 4)
    );
    for row in &found.rows {
        let terms: Vec<String> = row
            .fit
            .parameters
            .chunks(2)
            .map(|t| {
                format!("({}, {}{})", num(t[0].value, 4), num(t[1].value, 4), if t[1].held { " held" } else { "" })
            })
            .collect();
        text += &format!(
            "  1-{:<6} {:<6} {:<8} {:<62} {}\n",
            row.largest_stretch,
            row.fit.num_terms,
            num(row.fit.initial_shear_modulus_kpa.value, 4),
            terms.join(" "),
            num(row.relative_squares, 2)
        );
    }
    text + "\n"
}

/// Tables like the paper's 2 and 3.
fn tables(all: &[StandIn]) -> String {
    let mut text = String::from(
        "like Table 2: fits by l_u + beta l_F (moduli in kPa)\n  drive  filter  kappa        mu       terms (mu, alpha)                                   l x 1000   decrement x 1000\n",
    );
    for s in all {
        for row in &s.calibration.selection.rows {
            let terms: Vec<String> =
                row.values[1..].chunks(2).map(|t| format!("({}, {})", num(t[0], 4), num(t[1], 4))).collect();
            text += &format!(
                "  {:<6} {:<7} {:<12} {:<8} {:<51} {:<10} {}\n",
                s.drive_mm,
                if s.filter == Filter::None { "N" } else { "Y" },
                num(row.values[0], 5),
                num(row.initial_shear_modulus_kpa, 4),
                terms.join(" "),
                num(1e3 * row.paper_loss, 5),
                row.decrement.map_or("".into(), |d| num(1e3 * d, 5))
            );
        }
    }
    text += "\nlike Table 3: means over drives and numbers of terms (kPa)\n  filter  kappa                    mu                  Poisson's ratio\n";
    for filter in [Filter::None, Filter::Hamming2] {
        let rows = || all.iter().filter(|s| s.filter == filter).flat_map(|s| &s.calibration.selection.rows);
        let statistics = |values: Vec<f64>| {
            let n = values.len().max(1) as f64;
            let mean = values.iter().sum::<f64>() / n;
            (mean, (values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / (n - 1.0).max(1.0)).sqrt())
        };
        let (kappa, kappa_sd) = statistics(rows().map(|r| r.values[0]).collect());
        let (mu, mu_sd) = statistics(rows().map(|r| r.initial_shear_modulus_kpa).collect());
        let ratio = |k: f64, g: f64| (3.0 * k - 2.0 * g) / (2.0 * (3.0 * k + g));
        text += &format!(
            "  {:<7} {:>8} ± {:<12} {:>7} ± {:<9} {}\n",
            if filter == Filter::None { "N" } else { "Y" },
            num(kappa, 4),
            num(kappa_sd, 4),
            num(mu, 4),
            num(mu_sd, 4),
            num(ratio(kappa, mu), 5)
        );
    }
    text
}

//! Pictures and files of solutions and evaluations.

use super::{
    BarGroup, ColorMap, CorrelationPlot, DeformedShape, DensityPanel, DensityPlot, GroupedBars, ReportError,
    SolutionField, VoxelField, VoxelMaps, Vtu, nodal_values, surface_quads, symbol_of_parameter,
};
use crate::fem::{Equilibrium, ForwardModel};
use crate::kinematics::{Decomposition, decompose};
use crate::material::Material;
use crate::mesh::Mesh;
use crate::sensitivity::{Evaluation, SampleMaps};

/// The deformed specimen, coloured by the largest principal stretch.
///
/// # Errors
/// [`ReportError`] for a mesh that does not fit its fields.
pub fn deformed_picture(model: &ForwardModel, material: &Material, state: &Equilibrium) -> Result<String, ReportError> {
    let fields = model.quadrature_fields(material, state);
    let stretches: Vec<f64> =
        fields.iter().map(|q| decompose(&q.deformation_gradient).principal_stretches[0]).collect();
    let nodal = nodal_values(model.mesh(), &stretches)?;
    let value_of =
        |_: usize, corners: [u32; 4]| corners.iter().map(|&v| nodal[v as usize]).sum::<f64>() / corners.len() as f64;
    let shape = DeformedShape {
        title: format!("Drive {:.2} mm, force {:.2} N", state.drive_mm, state.force_n),
        value_label: "largest principal stretch".into(),
        quads: surface_quads(model.mesh(), &state.displacement, value_of),
        ..DeformedShape::default()
    };
    Ok(shape.to_svg())
}

/// Fields of an equilibrium on its mesh for ParaView.
///
/// # Errors
/// [`ReportError`].
pub fn vtu_of(mesh: &Mesh, fields: &[SolutionField]) -> Result<String, ReportError> {
    let mut vtu = Vtu::new(mesh)?;
    for field in fields {
        vtu.field(field)?;
    }
    Ok(vtu.to_xml())
}

/// The (λ, k) histograms of several specimens or drives side by side: (title, states of the voxels).
pub fn histogram_picture(panels: &[(String, &[Decomposition])]) -> String {
    // One λ axis for all: the panels' own axes end at different stretches, so the voxels are binned anew.
    let (num_stretch, num_mode) = (60, 50);
    let states = |list: &[Decomposition]| -> Vec<(f64, f64)> {
        list.iter().filter_map(|s| Some((s.stretch_amplitude, s.deformation_mode?))).collect()
    };
    let largest = panels.iter().flat_map(|(_, list)| states(list)).fold(1.1f64, |s, x| s.max(x.0));
    let high = (largest * 10.0).ceil() / 10.0;
    let panels = panels
        .iter()
        .map(|(title, list)| {
            let mut density = vec![0.0; num_stretch * num_mode];
            for (stretch, mode) in states(list) {
                let i = (((stretch - 1.0) / (high - 1.0) * num_stretch as f64) as usize).min(num_stretch - 1);
                let j = ((mode * num_mode as f64) as usize).min(num_mode - 1);
                density[i + num_stretch * j] += 1.0;
            }
            let mut all: Vec<f64> = states(list).into_iter().map(|s| s.0).collect();
            all.sort_by(f64::total_cmp);
            DensityPanel { title: title.clone(), density, median_stretch: all.get(all.len() / 2).copied() }
        })
        .collect();
    DensityPlot {
        stretch_range: [1.0, high],
        num_stretch_bins: num_stretch,
        mode_range: [0.0, 1.0],
        num_mode_bins: num_mode,
        density_label: "voxels per bin".into(),
        panels,
        map: ColorMap::Viridis,
    }
    .to_svg()
}

/// Maps of λ, k and every S_ξ of a scanned sample at the last drive.
pub fn map_pictures(sample: &SampleMaps) -> Vec<(String, String)> {
    let (Some(drive), Some(mask)) = (sample.drives.last(), &sample.mask) else { return Vec::new() };
    let spread = |values: &[f64]| mask.spread(values, f64::NAN);
    let grid = &mask.grid;
    let picture = |fields: Vec<VoxelField>| {
        VoxelMaps { shape: grid.shape, origin_mm: grid.origin_mm, voxel_mm: grid.voxel_mm, fields }.to_svg()
    };
    let field = |title: String, unit: &str, values: &[f64], map: ColorMap| VoxelField {
        title,
        unit: unit.into(),
        values: spread(values),
        map,
        range: None,
    };
    let stretch: Vec<f64> = drive.states.iter().map(|s| s.stretch_amplitude).collect();
    let mode: Vec<f64> = drive.states.iter().map(|s| s.deformation_mode.unwrap_or(f64::NAN)).collect();
    let mut pictures = vec![(
        "map-stretch-and-mode".to_string(),
        picture(vec![
            field("stretch amplitude λ".into(), "", &stretch, ColorMap::Viridis),
            field("deformation mode k".into(), "", &mode, ColorMap::Viridis),
        ]),
    )];
    if let Some(signal) = &drive.signal {
        // Voxels that tell nothing stay empty.
        let left = |axis: usize| signal.iter().map(|s| if s[axis] > 0.0 { s[axis] } else { f64::NAN }).collect();
        let fields = ["x", "y", "z"].into_iter().enumerate().map(|(axis, name)| {
            let values: Vec<f64> = left(axis);
            let title = format!("signal left in the image of displacement along {name}");
            VoxelField { range: Some([0.0, 1.0]), ..field(title, "", &values, ColorMap::Viridis) }
        });
        pictures.push(("map-signal".into(), picture(fields.collect())));
    }
    for (parameter, values) in &drive.sensitivities {
        let name = parameter.name();
        let unit = if parameter.is_modulus() { "" } else { "kPa" };
        let title = format!("sensitivity to {}", symbol_of_parameter(&name));
        pictures.push((format!("map-sensitivity-{name}"), picture(vec![field(title, unit, values, ColorMap::Magma)])));
    }
    pictures
}

/// Bars of the integrated sensitivities of every drive, relative to the first drive, and of the promised relative
/// standard deviations.
pub fn bar_pictures(evaluation: &Evaluation) -> Vec<(String, String)> {
    let mut pictures = Vec::new();
    let series: Vec<String> = evaluation.steps.iter().map(|s| format!("{} mm", s.drive_mm)).collect();
    if let Some(first) = evaluation.steps.first() {
        let groups = first
            .integrated_sensitivity
            .iter()
            .enumerate()
            .map(|(i, s)| BarGroup {
                label: symbol_of_parameter(&s.parameter),
                values: evaluation.steps.iter().map(|step| step.integrated_sensitivity[i].sum).collect(),
            })
            .collect();
        let bars = GroupedBars {
            title: "Integrated sensitivity, sum over voxels".into(),
            axis_label: "1 for μ, kPa for α".into(),
            series: series.clone(),
            groups,
            is_log: true,
            ..GroupedBars::default()
        };
        pictures.push(("integrated-sensitivity".into(), bars.to_svg()));
    }
    let mut groups = Vec::new();
    for (i, p) in evaluation.promised_sd.iter().enumerate() {
        let percent = |r: Option<f64>| r.map_or(f64::NAN, |r| 100.0 * r);
        let mut values: Vec<f64> = evaluation.steps.iter().map(|s| percent(s.promised_sd[i].relative_sd)).collect();
        values.push(percent(p.relative_sd));
        groups.push(BarGroup { label: symbol_of_parameter(&p.parameter), values });
    }
    let mut all = series;
    all.push("all drives".into());
    let bars = GroupedBars {
        title: "Promised standard deviation".into(),
        axis_label: "% of the parameter".into(),
        series: all,
        groups,
        is_log: true,
        missing_label: "not determined".into(),
        ..GroupedBars::default()
    };
    pictures.push(("promised-sd".into(), bars.to_svg()));
    let n = evaluation.promised_sd.len();
    let correlation = CorrelationPlot {
        title: "Correlation of the estimates, all drives".into(),
        labels: evaluation.promised_sd.iter().map(|p| symbol_of_parameter(&p.parameter)).collect(),
        values: (0..n * n).map(|i| evaluation.correlation[i / n][i % n].unwrap_or(f64::NAN)).collect(),
    };
    pictures.push(("correlation".into(), correlation.to_svg()));
    pictures
}

//! The report room: pictures as SVG, fields for ParaView and one page of HTML that a person reads.
//!
//! Every picture is a plain structure (labels, units, numbers) with a `to_svg` method. The SVG stands alone, holds no
//! identifiers and no style sheet, and so can be put inline into a page any number of times. Pictures never fail:
//! without data they say so, and what is not finite is left out or named as missing. The same data give the same bytes.
//!
//! | Picture | Structure |
//! |---|---|
//! | where the voxels lie in (λ, k) | [`DensityPlot`] |
//! | sections through and means of voxel fields | [`VoxelMaps`] |
//! | values per parameter, base beside best | [`GroupedBars`] |
//! | information against force | [`ParetoPlot`] |
//! | best-so-far over evaluations | [`HistoryPlot`] |
//! | spread found beside spread promised | [`SpreadPlot`] |
//! | correlation of the parameters | [`CorrelationPlot`] |
//! | the deformed specimen | [`DeformedShape`] |
//! | every design of a sweep across its variables | [`ParallelPlot`] |
//! | what each variable of a sweep does | [`MainEffectsPlot`] |
//! | how far each limit is | [`LimitsPlot`] |
//! | curves and histograms of residuals | [`LinePlot`] |
//! | losses over two parameters | [`ContourPlot`] |
//! | two rankings of the same designs | [`RankingPlot`] |
//! | the smallest errors that would be named | [`detectable_picture`] |
//! | measured curves with their fits and residuals | [`CurvesPlot`] |
//!
//! Files: [`Vtu`] for ParaView, [`Report`] for the browser.

mod axis;
mod bars;
mod base64;
mod calibration_curves;
mod calibration_report;
mod color;
mod confusion;
mod contour_map;
mod correlation;
mod curve_pictures;
mod curves;
mod density;
mod design_detection;
mod design_report;
mod design_verification;
mod detectable;
mod detection;
mod diagnosis_pictures;
mod diagnosis_report;
mod error;
mod frame;
mod history;
mod html;
mod html_parts;
mod labels;
mod limits;
mod lines;
mod main_effects;
mod maps;
mod next_report;
mod number;
mod parallel;
mod pareto;
mod plain_words;
mod pvd;
mod ranking;
mod scan_pictures;
mod shape;
mod shown_mesh;
mod solution_field;
mod solution_fields;
mod specimen_pictures;
mod spread;
mod surface;
mod surface_json;
mod svg;
mod sweep_report;
mod text;
mod together_report;
mod vtu;
mod vtu_cells;

#[cfg(test)]
mod gallery_tests;
#[cfg(test)]
mod test_xml;

pub use crate::material::symbol_of_parameter;
pub use bars::{BarGroup, GroupedBars};
pub use calibration_report::{calibration_report, contour_panels};
pub use color::ColorMap;
pub use confusion::confusion_picture;
pub use contour_map::{ContourPanel, ContourPlot};
pub use correlation::CorrelationPlot;
pub use curve_pictures::{fit_picture, law_picture, load_curve_pictures};
pub use curves::{CurveSeries, CurvesPlot};
pub use density::{DensityPanel, DensityPlot};
pub use design_detection::{ComparedSize, compared_sizes};
pub use design_report::{DesignPictures, design_report};
pub use detectable::{detectable_picture, telling, which_of};
pub use detection::detection_picture;
pub use diagnosis_pictures::diagnosis_pictures;
pub use diagnosis_report::diagnosis_report;
pub use error::ReportError;
pub use history::{HistoryPlot, HistoryPoint};
pub use html::{Report, ReportHeader};
pub use html_parts::{Align, CalloutKind, Column, Table};
pub use limits::{LimitBar, LimitsPlot};
pub use lines::{Line, LinePlot, residual_histogram};
pub use main_effects::{MainEffect, MainEffectsPlot};
pub use maps::{VoxelField, VoxelMaps};
pub use next_report::next_report;
pub use number::{plain_number, significant};
pub use parallel::{ParallelAxis, ParallelPlot};
pub use pareto::{ParetoPlot, ParetoPoint, PointKind};
pub use pvd::pvd;
pub use ranking::{RankedItem, RankingPlot};
pub use scan_pictures::{displacement_picture, raw_picture};
pub use shape::{DeformedShape, ShapeQuad};
pub use shown_mesh::ShownMesh;
pub use solution_field::{FieldPlace, SolutionField};
pub use solution_fields::solution_fields;
pub use specimen_pictures::{bar_pictures, deformed_picture, histogram_picture, map_pictures, vtu_of};
pub use spread::{SpreadPlot, SpreadRow};
pub use surface::{nodal_values, surface_quads};
pub use surface_json::surface_json;
pub use sweep_report::sweep_report;
pub use together_report::{in_words, together_pictures, together_report};
pub use vtu::{Vtu, element_means};
pub use vtu_cells::nodes_in_vtk_order;

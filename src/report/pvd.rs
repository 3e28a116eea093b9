//! A series of field files for ParaView (`.pvd`): which file shows which drive.

use crate::field::escape_xml;

/// The series of files over drives (mm), which stand for ParaView's time.
///
/// ```
/// let series = lambdak::report::pvd(&[(2.5, "solution_1.vtu".into()), (5.0, "solution_2.vtu".into())]);
/// assert!(series.contains("<DataSet timestep=\"5\" part=\"0\" file=\"solution_2.vtu\"/>"));
/// ```
pub fn pvd(files: &[(f64, String)]) -> String {
    let entries: String = files
        .iter()
        .map(|(drive, file)| format!("<DataSet timestep=\"{drive}\" part=\"0\" file=\"{}\"/>\n", escape_xml(file)))
        .collect();
    format!(
        "<?xml version=\"1.0\"?>\n<VTKFile type=\"Collection\" version=\"1.0\" byte_order=\"LittleEndian\">\n<Collection>\n\
         {entries}</Collection>\n</VTKFile>\n"
    )
}

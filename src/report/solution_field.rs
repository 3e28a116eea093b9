//! A field of an equilibrium as files hold it.

/// Where a field's values belong.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FieldPlace {
    /// One value per node of the mesh.
    Nodes,
    /// One value per element: the mean over it.
    Elements,
}

/// A field of an equilibrium.
#[derive(Clone, Debug, PartialEq)]
pub struct SolutionField {
    /// Name, which ends in the unit where there is one.
    pub name: &'static str,
    /// Unit; `1` where there is none.
    pub unit: &'static str,
    /// What it is.
    pub about: &'static str,
    /// Where its values belong.
    pub place: FieldPlace,
    /// Names of a value's indices: none of a number, one of a vector, two of a tensor (row, column); each from 0 to 2.
    pub axes: &'static [&'static str],
    /// All values, place after place; of a tensor row after row: F_xX, F_xY, F_xZ, F_yX, …
    pub values: Vec<f64>,
}

impl SolutionField {
    /// Numbers of one value.
    pub fn num_components(&self) -> usize {
        3usize.pow(self.axes.len() as u32)
    }
}

//! Results as named arrays with units and axes: the one model of what files for other tools hold.
//!
//! A file is a tree of arrays, texts and lists of names. Every array has one order of indices, which is that of its
//! axes: `displacement_mm(x, y, z, component, drive)`. Each format keeps it as its users count: MATLAB from 1 with the
//! first index fastest in memory, Python from 0 with the last one fastest.

/// Numbers of an array, the first index fastest.
#[derive(Clone, Debug, PartialEq)]
pub enum Values {
    /// Real numbers; NaN where there is none.
    Real(Vec<f64>),
    /// Yes or no.
    Logical(Vec<bool>),
    /// Indices into another array, here from 0; files count as their users do.
    Index(Vec<u32>),
}

impl Values {
    /// How many.
    pub fn len(&self) -> usize {
        match self {
            Values::Real(v) => v.len(),
            Values::Logical(v) => v.len(),
            Values::Index(v) => v.len(),
        }
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
}

impl From<Vec<f64>> for Values {
    fn from(values: Vec<f64>) -> Values {
        Values::Real(values)
    }
}

impl From<Vec<bool>> for Values {
    fn from(values: Vec<bool>) -> Values {
        Values::Logical(values)
    }
}

/// An axis of an array: what its index counts, and how far.
pub type Axis = (&'static str, usize);

/// An array.
#[derive(Clone, Debug, PartialEq)]
pub struct Array {
    /// What it is.
    pub about: String,
    /// Unit; `1` where there is none.
    pub unit: &'static str,
    /// Its axes, in the order of the indices; empty for a single number.
    pub axes: Vec<Axis>,
    /// Its numbers.
    pub values: Values,
}

/// What stands under a name.
#[derive(Clone, Debug, PartialEq)]
pub enum Member {
    /// Further members.
    Tree(Tree),
    /// An array.
    Array(Array),
    /// A text.
    Text(String),
    /// Names, such as those of parameters: labels of an axis.
    Names(Vec<String>),
}

/// Named members, in order.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Tree {
    /// Names (letters, digits, underscores; they begin with a letter) and what stands under them.
    pub members: Vec<(String, Member)>,
}

impl Tree {
    /// Adds an array.
    pub fn array(
        &mut self,
        name: impl Into<String>,
        unit: &'static str,
        about: impl Into<String>,
        axes: &[Axis],
        values: impl Into<Values>,
    ) {
        let array = Array { about: about.into(), unit, axes: axes.to_vec(), values: values.into() };
        self.members.push((name.into(), Member::Array(array)));
    }

    /// Adds a text.
    pub fn text(&mut self, name: &str, text: impl Into<String>) {
        self.members.push((name.into(), Member::Text(text.into())));
    }

    /// Adds names.
    pub fn names(&mut self, name: &str, names: Vec<String>) {
        self.members.push((name.into(), Member::Names(names)));
    }

    /// Adds further members under a name.
    pub fn tree(&mut self, name: impl Into<String>, tree: Tree) {
        self.members.push((name.into(), Member::Tree(tree)));
    }
}

/// Vectors, one per place, as numbers with the place fastest and the component after it.
pub fn components_last(vectors: &[[f64; 3]]) -> Vec<f64> {
    (0..3).flat_map(|c| vectors.iter().map(move |v| v[c])).collect()
}

/// Numbers that may be missing; NaN where they are.
pub fn or_nan(values: impl IntoIterator<Item = Option<f64>>) -> Vec<f64> {
    values.into_iter().map(|v| v.unwrap_or(f64::NAN)).collect()
}

//! What a request names for its job to read.

/// What a job reads under a name.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum InputForm {
    /// A recording of displacements.
    Displacements,
    /// A recording of wrapped phases.
    RawPhases,
    /// A file of a laboratory's own format, or a folder of such files.
    File,
}

/// Something that a request names and the job reads.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct InputUse {
    /// JSON pointer to the name.
    pub pointer: String,
    /// The name: a path for the command, an identifier for the service.
    pub name: String,
    /// What is read.
    pub form: InputForm,
}

impl InputUse {
    /// `names`, which stand in a list at `pointer`.
    pub fn of_list(pointer: &str, names: &[String], form: InputForm) -> Vec<InputUse> {
        let of = |(index, name): (usize, &String)| InputUse {
            pointer: format!("{pointer}/{index}"),
            name: name.clone(),
            form,
        };
        names.iter().enumerate().map(of).collect()
    }
}

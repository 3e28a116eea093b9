//! Why a table is refused.

/// A column of a file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct CsvColumn {
    /// Its number, from 1.
    pub number: usize,
    /// Its name as the header has it.
    pub name: String,
}

/// `1 "Time [s]", 2 "Load [N]"`.
fn listed(columns: &[CsvColumn]) -> String {
    columns.iter().map(|c| format!("{} {:?}", c.number, c.name)).collect::<Vec<_>>().join(", ")
}

/// Why a CSV is refused.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum CsvError {
    /// No header or no rows.
    #[error("the file has no {what}; the first line names the columns, numbers follow")]
    Empty {
        /// What is missing.
        what: &'static str,
    },
    /// A needed column is not there.
    #[error("no column for the {what} among {}; give its name or number with an option", listed(found))]
    NoColumn {
        /// What is looked for.
        what: &'static str,
        /// The header.
        found: Vec<CsvColumn>,
    },
    /// There is no column of this name or number.
    #[error("{wanted:?} is neither name nor number of a column for the {what}; there are {}", listed(found))]
    UnknownColumn {
        /// What was asked for.
        wanted: String,
        /// What it was asked for.
        what: &'static str,
        /// The header.
        found: Vec<CsvColumn>,
    },
    /// Several columns may be meant.
    #[error("the columns {} may all be the {what}; give name or number of one with an option", listed(found))]
    Ambiguous {
        /// What is looked for.
        what: &'static str,
        /// The columns.
        found: Vec<CsvColumn>,
    },
    /// A stretch whose sign should be turned.
    #[error("column {column:?} holds stretches, which are positive; turn the sign of the stress alone")]
    TurnedStretch {
        /// The column.
        column: String,
    },
    /// A cell is not a number.
    #[error(
        "line {line}: {text:?} is not a number; numbers have no signs between thousands, and one decimal sign in the \
         whole file"
    )]
    NotANumber {
        /// Line, from 1.
        line: usize,
        /// The cell.
        text: String,
    },
    /// A row of another length than the header.
    #[error(
        "line {line} has {found} cells, the header {expected}; part cells by semicolons or tabs where numbers have \
         decimal commas, and leave out lines after the table"
    )]
    RowLength {
        /// Line, from 1.
        line: usize,
        /// Cells found.
        found: usize,
        /// Cells of the header.
        expected: usize,
    },
    /// The unit of a column cannot be told.
    #[error("column {column:?} does not say its unit; end its name in one, such as {examples}")]
    NoUnit {
        /// The column.
        column: String,
        /// Endings that would fit, and what else can be done.
        examples: &'static str,
    },
    /// The unit of a column is not that of what it holds.
    #[error("column {column:?} is taken for the {what}, and its unit is not one of it; name another column")]
    WrongUnit {
        /// The column.
        column: String,
        /// What it is taken for.
        what: &'static str,
    },
    /// Too many rows.
    #[error("more than {limit} rows; thin the recording")]
    TooLong {
        /// The limit.
        limit: usize,
    },
    /// A length or area that cannot be.
    #[error("{name} is {value}; it must be positive")]
    NotPositive {
        /// Which.
        name: &'static str,
        /// Its value.
        value: f64,
    },
}

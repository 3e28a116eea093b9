//! Why something cannot be written for another program.

/// What another program cannot hold.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum ExportError {
    /// The program does not have the material's law.
    #[error(
        "{program} has no law of {law}; write the material for {}, or fit another law for {program}",
        others.join(", ")
    )]
    NoSuchLaw {
        /// The program.
        program: &'static str,
        /// The law.
        law: &'static str,
        /// The programs that have it.
        others: Vec<&'static str>,
    },
    /// The material has more terms than the program reads.
    #[error("the material has {count} Ogden terms and {program} reads at most {limit}; fit fewer terms")]
    TooManyTerms {
        /// The program.
        program: &'static str,
        /// Terms of the material.
        count: usize,
        /// Most terms that the program reads.
        limit: usize,
    },
}

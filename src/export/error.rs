//! Why something cannot be written for another program.

/// What another program cannot hold.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum ExportError {
    /// The material is a law in the first invariant.
    #[error(
        "cards for {program} are written of Ogden's terms only; fit Ogden terms, or set its constants down by hand"
    )]
    NotOgden {
        /// The program.
        program: &'static str,
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

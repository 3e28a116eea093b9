//! The `lambdak` command.

use std::process::ExitCode;

fn main() -> ExitCode {
    lambdak::cli::run()
}

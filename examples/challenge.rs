//! The public challenge: recordings in which several causes are concealed, and the score of what a program says of them.
//!
//! ```text
//! cargo run --release --example challenge -- make DIR [RECORDINGS CONTROLS UNKNOWN SEED]
//! cargo run --release --example challenge -- score ANSWERS [RECORDINGS CONTROLS UNKNOWN SEED]
//! ```
//!
//! docs/challenge.md tells how to take part.

use lambdak::proof::{
    Answer, SeveralOptions, SeveralScored, conceal, score_answer, several_experiments, specimen_of, sum_up,
    unknown_cause,
};
use lambdak::specimen::Specimen;
use rayon::prelude::*;
use std::error::Error;
use std::path::Path;

const USAGE: &str = "usage: challenge (make DIR | score ANSWERS) [RECORDINGS CONTROLS UNKNOWN SEED]";

fn main() -> Result<(), Box<dyn Error + Send + Sync>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [what, folder, numbers @ ..] = &arguments[..] else { return Err(USAGE.into()) };
    let numbers: Vec<u64> = numbers.iter().map(|n| n.parse()).collect::<Result<_, _>>()?;
    let number = |place: usize, default: u64| numbers.get(place).copied().unwrap_or(default);
    let options = SeveralOptions {
        num_recordings: number(0, 300) as usize,
        num_controls: number(1, 100) as usize,
        num_unknown: number(2, 60) as usize,
        seed: number(3, 1),
        mesh_factor: 1.0,
    };
    let specimen = Specimen::from_json(include_str!("../geometries/two-hole-shear.json"))?;
    match what.as_str() {
        "make" => make(&specimen, &options, Path::new(folder)),
        "score" => score(&specimen, &options, Path::new(folder)),
        _ => Err(USAGE.into()),
    }
}

/// Writes a folder `NNN` for every recording and a list of what is not to be supposed in it.
fn make(specimen: &Specimen, options: &SeveralOptions, folder: &Path) -> Result<(), Box<dyn Error + Send + Sync>> {
    std::fs::create_dir_all(folder)?;
    let all = several_experiments(options);
    all.par_iter().enumerate().try_for_each(|(n, (kind, experiment))| {
        let name = format!("{n:03}");
        match conceal(&specimen_of(specimen, experiment), experiment) {
            Ok(made) => made.recording.write(&folder.join(&name))?,
            // Some drawn specimens have no equilibrium; the score leaves them out, too.
            Err(error) => eprintln!("{name}: not made: {error}"),
        }
        if let Some(cause) = unknown_cause(*kind, experiment) {
            std::fs::write(folder.join(&name).with_extension("without.txt"), cause.as_str())?;
        }
        eprintln!("{name} of {}", all.len());
        Ok(())
    })
}

/// Scores the answers `NNN.json` of a folder; a recording without one is left out.
fn score(specimen: &Specimen, options: &SeveralOptions, folder: &Path) -> Result<(), Box<dyn Error + Send + Sync>> {
    let all = several_experiments(options);
    let scored = all
        .par_iter()
        .enumerate()
        .filter_map(|(n, (kind, experiment))| {
            let path = folder.join(format!("{n:03}.json"));
            let text = std::fs::read_to_string(&path).ok()?;
            let answer: Result<Answer, _> = serde_json::from_str(&text);
            Some(answer.map_err(|error| format!("{}: {error}", path.display()).into()).and_then(|answer| {
                score_answer(specimen, *kind, experiment, &answer).map_err(|error| error.to_string().into())
            }))
        })
        .collect::<Result<Vec<_>, Box<dyn Error + Send + Sync>>>()?;
    let proof = sum_up(scored, options);
    for scored in &proof.scored {
        println!("{}", line_of(scored));
    }
    let share = |[part, whole]: [usize; 2]| format!("{part} of {whole}");
    println!("recordings scored                                  {}", proof.scored.len());
    println!("all detectable causes named                        {}", share(proof.all_named));
    println!("named causes that were not hidden                  {}", share(proof.false_of_named));
    println!("controls without an alarm                          {}", share(proof.quiet_controls));
    println!("unknown causes left unexplained                    {}", share(proof.unexplained_of_unknown));
    println!("unknown causes located                             {}", share(proof.located_of_unknown));
    println!("intervals that hold the truth                      {}", share(proof.covered));
    for c in &proof.causes {
        println!(
            "{:<16} hidden {:>3}, detectable {:>3}, named {:>3}, falsely {:>3}",
            c.cause.name(),
            c.num_hidden,
            c.num_detectable,
            c.num_named,
            c.num_false
        );
    }
    Ok(())
}

/// What was hidden in a recording, how large each cause's own effect is, and what was said of it.
fn line_of(scored: &SeveralScored) -> String {
    let hidden = scored.causes.iter().map(|c| {
        let state = match (c.is_named, c.is_detectable) {
            (true, _) => "named",
            (false, true) => "missed",
            (false, false) => "too small to see",
        };
        format!("{} ({:.4} mm, {state})", c.cause.name(), c.own_effect_rms_mm)
    });
    let hidden = hidden.collect::<Vec<_>>().join(", ");
    let verdict = scored.verdict.map_or_else(|| "failed".to_owned(), |v| format!("{v:?}"));
    format!("hidden: {hidden}; {verdict}, falsely named: {}", scored.false_names.join(", "))
}

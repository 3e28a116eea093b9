//! The array's script.

use super::error::SlurmError;
use std::path::{Path, PathBuf};

/// What each task asks for.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Resources {
    /// Partition; the cluster's default without one.
    pub partition: Option<String>,
    /// Time limit, as `sbatch` reads it (`30`, `02:00:00`, `1-00:00:00`).
    pub time: Option<String>,
    /// Memory per task, as `sbatch` reads it (`2G`).
    pub memory: Option<String>,
    /// Account to charge.
    pub account: Option<String>,
    /// Threads per task.
    pub threads: usize,
    /// Further options of `sbatch`, each as `--name=value`.
    pub others: Vec<String>,
}

/// A job array: the same command for every task, with the task's number in it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ArrayJob {
    /// Name in the queue.
    pub name: String,
    /// Folder of script, logs and the record of submitted jobs; it must be the same on all nodes.
    pub folder: PathBuf,
    /// Program and arguments; `{task}` in an argument becomes the number of the task.
    pub command: Vec<String>,
    /// What each task asks for.
    pub resources: Resources,
}

/// Characters of options that may stand in a script unquoted.
fn is_plain(text: &str) -> bool {
    !text.is_empty() && text.chars().all(|c| c.is_ascii_alphanumeric() || "_.,:+=@/-[]*%&|".contains(c))
}

/// A word of the shell: single quotes protect everything but themselves.
fn quoted(word: &str) -> String {
    format!("'{}'", word.replace('\'', "'\\''"))
}

/// Consecutive numbers as ranges: `1-3,7`.
fn ranges(tasks: &[usize]) -> String {
    let mut parts: Vec<(usize, usize)> = Vec::new();
    for &task in tasks {
        match parts.last_mut() {
            Some((_, end)) if *end + 1 == task => *end = task,
            _ => parts.push((task, task)),
        }
    }
    let show = |&(a, b): &(usize, usize)| if a == b { a.to_string() } else { format!("{a}-{b}") };
    parts.iter().map(show).collect::<Vec<_>>().join(",")
}

impl ArrayJob {
    /// The script for some tasks, ascending.
    ///
    /// # Errors
    /// [`SlurmError::BadValue`].
    pub fn script(&self, tasks: &[usize]) -> Result<String, SlurmError> {
        let r = &self.resources;
        let name: String = self.name.chars().map(|c| if c.is_ascii_alphanumeric() { c } else { '-' }).collect();
        let mut lines = vec![
            format!("--job-name={name}"),
            format!("--array={}", ranges(tasks)),
            "--output=task-%a.log".into(),
            "--open-mode=append".into(),
            "--requeue".into(),
            "--ntasks=1".into(),
            format!("--cpus-per-task={}", r.threads.max(1)),
        ];
        let named = [("partition", &r.partition), ("time", &r.time), ("mem", &r.memory), ("account", &r.account)];
        for (option, value) in named {
            if let Some(value) = value {
                if !is_plain(value) {
                    return Err(SlurmError::BadValue { option: option.into(), value: value.clone() });
                }
                lines.push(format!("--{option}={value}"));
            }
        }
        for other in &r.others {
            if !(other.starts_with("--") && is_plain(other)) {
                return Err(SlurmError::BadValue { option: "slurm-option".into(), value: other.clone() });
            }
            lines.push(other.clone());
        }
        let command: Vec<String> =
            self.command.iter().map(|w| quoted(w).replace("{task}", "'\"$SLURM_ARRAY_TASK_ID\"'")).collect();
        let directives: String = lines.iter().map(|l| format!("#SBATCH {l}\n")).collect();
        Ok(format!(
            "#!/bin/bash\n# Written by lambdak. By hand: sbatch --chdir={} {}\n{directives}exec {}\n",
            quoted(&self.folder.display().to_string()).replace('\n', " "),
            quoted(&self.script_path().display().to_string()).replace('\n', " "),
            command.join(" ")
        ))
    }

    /// Where the script is.
    pub fn script_path(&self) -> PathBuf {
        self.folder.join("array.sh")
    }

    /// A task's log.
    pub fn log_path(&self, task: usize) -> PathBuf {
        self.folder.join(format!("task-{task}.log"))
    }

    /// Writes the script.
    ///
    /// # Errors
    /// [`SlurmError`].
    pub fn write_script(&self, tasks: &[usize]) -> Result<PathBuf, SlurmError> {
        let text = self.script(tasks)?;
        write_whole(&self.script_path(), &text)?;
        Ok(self.script_path())
    }
}

/// Writes a file through a temporary one.
pub(super) fn write_whole(path: &Path, text: &str) -> Result<(), SlurmError> {
    let fail = |source| SlurmError::Write { path: path.into(), source };
    if let Some(folder) = path.parent() {
        std::fs::create_dir_all(folder).map_err(fail)?;
    }
    let temporary = path.with_extension("part");
    std::fs::write(&temporary, text).map_err(fail)?;
    std::fs::rename(&temporary, path).map_err(fail)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn job(command: &[&str]) -> ArrayJob {
        ArrayJob {
            name: "a sweep".into(),
            folder: "/a b/slurm".into(),
            command: command.iter().map(|s| (*s).to_string()).collect(),
            resources: Resources { time: Some("01:00:00".into()), threads: 2, ..Resources::default() },
        }
    }

    #[test]
    fn the_script_asks_for_what_was_asked() {
        let script = job(&["/bin/it", "--shard", "{task}/4"]).script(&[1, 2, 4]).expect("plain values");
        for line in
            ["#SBATCH --array=1-2,4", "#SBATCH --time=01:00:00", "#SBATCH --cpus-per-task=2", "#SBATCH --requeue"]
        {
            assert!(script.lines().any(|l| l == line), "{line} in\n{script}");
        }
        assert!(!script.contains("--partition"));
    }

    /// The shell sees every argument as it was meant, whatever is in it.
    #[test]
    fn arguments_survive_the_shell() {
        let awkward = ["printf", "%s\\n", "it's {task}/4", "a \"b\" $HOME `id`", "two\nlines"];
        let script = job(&awkward).script(&[3]).expect("plain values");
        let output = std::process::Command::new("bash")
            .env("SLURM_ARRAY_TASK_ID", "3")
            .args(["-c", &script])
            .output()
            .expect("bash runs");
        assert_eq!(String::from_utf8_lossy(&output.stdout), "it's 3/4\na \"b\" $HOME `id`\ntwo\nlines\n");
    }

    #[test]
    fn values_that_would_end_a_directive_are_refused() {
        let mut bad = job(&["x"]);
        bad.resources.partition = Some("main\n#SBATCH --uid=0".into());
        assert!(matches!(bad.script(&[1]), Err(SlurmError::BadValue { .. })));
        bad.resources.partition = None;
        bad.resources.others = vec!["nodes=3".into()];
        assert!(matches!(bad.script(&[1]), Err(SlurmError::BadValue { .. })));
    }
}

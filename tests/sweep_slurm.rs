//! The same sweep through a real Slurm, with one array task killed and requeued.

mod design_common;
#[path = "common/prerequisites.rs"]
mod prerequisites;
mod sweep_common;

use prerequisites::Missing;
use std::process::Command;
use std::time::{Duration, Instant};
use sweep_common::*;

/// Processes that run a shard into a folder.
fn processes_of(out: &std::path::Path, shard: &str) -> Vec<String> {
    let out = out.canonicalize().expect("it is there");
    let is_it = |command: &[u8]| {
        let words: Vec<&[u8]> = command.split(|b| *b == 0).collect();
        words.contains(&shard.as_bytes()) && words.contains(&out.as_os_str().as_encoded_bytes())
    };
    let entries = std::fs::read_dir("/proc").expect("Slurm runs on Linux");
    entries
        .flatten()
        .filter(|e| std::fs::read(e.path().join("cmdline")).is_ok_and(|c| is_it(&c)))
        .map(|e| e.file_name().to_string_lossy().into_owned())
        .collect()
}

fn wait_until(what: &str, mut condition: impl FnMut() -> bool) {
    let start = Instant::now();
    while !condition() {
        // Far longer than a small sweep takes on a loaded machine.
        assert!(start.elapsed() < Duration::from_secs(600), "{what}");
        std::thread::sleep(Duration::from_millis(20));
    }
}

fn an_array_with_a_lost_task_gives_the_same_table() -> Result<(), Missing> {
    prerequisites::slurm()?;
    let folder = tempfile::tempdir().expect("a folder");
    let study = write_study(folder.path(), 18, 5);
    let (whole, array) = (folder.path().join("whole"), folder.path().join("array of tasks"));
    assert_success(&sweep(&study, &whole, &[]));
    let options = ["--slurm", "--tasks", "3", "--time", "30", "--mem", "500M", "--poll", "0.3"];
    let follower = std::thread::scope(|scope| {
        let running = scope.spawn(|| sweep(&study, &array, &options));
        // Once the second task has a result, all of its processes are killed, as a dying node would.
        let second = array.join("shard-2-of-3.jsonl");
        wait_until("the second task begins", || {
            running.is_finished()
                || std::fs::read(&second).is_ok_and(|b| b.iter().filter(|c| **c == b'\n').count() >= 2)
        });
        // `scancel` would say that someone wants it to end; a dead node says nothing.
        for process in processes_of(&array, "2/3") {
            let killed = Command::new("kill").args(["-9", &process]).status();
            assert!(killed.is_ok_and(|s| s.success()), "task 2 was over too early to be killed");
        }
        running.join().expect("it ends")
    });
    let message = String::from_utf8_lossy(&follower.stderr).into_owned();
    assert!(follower.status.success(), "{message}");
    assert!(message.contains("array task 2") && message.contains("requeued"), "{message}");
    assert_same_tables(&whole, &array);
    assert_eq!(num_lines(&array), 18 + 3, "each task has one result, each shard a header");
    // Run again: nothing is submitted.
    let again = sweep(&study, &array, &options);
    assert_success(&again);
    assert!(!String::from_utf8_lossy(&again.stderr).contains("submitted"));
    Ok(())
}

/// Searches from two seeds as an array give the better of the two searches alone.
fn a_design_search_runs_as_an_array() -> Result<(), Missing> {
    prerequisites::slurm()?;
    let folder = tempfile::tempdir().expect("a folder");
    let study = design_common::write_study(folder.path());
    let out = folder.path().join("array");
    let options = ["--slurm", "--tasks", "2", "--time", "30", "--mem", "500M", "--poll", "0.3"];
    let output = design_common::design(&study, &out, &options);
    assert_success(&output);
    let alone: Vec<f64> = (0..2)
        .map(|n| {
            let seed = design_common::json(&study)["seed"].as_u64().expect("a seed") + n;
            let out = folder.path().join(format!("seed-{seed}"));
            assert_success(&design_common::design(&study, &out, &["--seed", &seed.to_string(), "--threads", "1"]));
            design_common::json(&out.join("design.json"))["best"]["objective"].as_f64().expect("a number")
        })
        .collect();
    // The same program with the same seed on the same machine: to the bit.
    let first = design_common::json(&study)["seed"].as_u64().expect("a seed");
    for (n, objective) in alone.iter().enumerate() {
        let found = design_common::json(&out.join(format!("seed-{}/design.json", first + n as u64)));
        assert_eq!(found["best"]["objective"].as_f64(), Some(*objective), "seed {n}");
    }
    let winner = first + u64::from(alone[1] > alone[0]);
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(said.contains(&format!("best: seed {winner} ")), "{said}");
    Ok(())
}

/// With `--cancel` Ctrl-C takes the jobs back; the same command goes on later.
fn ctrl_c_cancels_the_jobs() -> Result<(), Missing> {
    prerequisites::slurm()?;
    let folder = tempfile::tempdir().expect("a folder");
    let study = write_study(folder.path(), 160, 8);
    let out = folder.path().join("out");
    let options = ["--slurm", "--tasks", "2", "--time", "30", "--poll", "0.3", "--cancel"];
    let mut child = start(&study, &out, &options);
    wait_until("a task begins", || {
        child.try_wait().is_ok_and(|c| c.is_some())
            || std::fs::read(out.join("shard-1-of-2.jsonl")).is_ok_and(|b| b.contains(&b'\n'))
    });
    let told = Command::new("kill").args(["-INT", &child.id().to_string()]).status();
    assert!(told.is_ok_and(|s| s.success()));
    assert_eq!(child.wait().expect("it ends").code(), Some(130), "it was over before it could be stopped");
    wait_until("no task is at work any more", || (1..=2).all(|n| processes_of(&out, &format!("{n}/2")).is_empty()));
    assert_success(&sweep(&study, &out, &options));
    Ok(())
}

/// What sbatch refuses is told in its words.
fn a_refused_job_is_told() -> Result<(), Missing> {
    prerequisites::slurm()?;
    let folder = tempfile::tempdir().expect("a folder");
    let study = write_study(folder.path(), 4, 6);
    let output = sweep(&study, &folder.path().join("out"), &["--slurm", "--partition", "no-such-partition"]);
    let message = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(3), "{message}");
    assert!(message.contains("sbatch failed") && message.contains("partition"), "{message}");
    Ok(())
}

/// A task that never gets anywhere is given up with the end of its log, not started again for ever.
fn a_task_that_always_fails_is_given_up() -> Result<(), Missing> {
    prerequisites::slurm()?;
    use lambdak::slurm::{ArrayJob, FollowSettings, Resources, SlurmError, TaskProgress, follow};
    let folder = tempfile::tempdir().expect("a folder");
    let job = ArrayJob {
        name: "failing".into(),
        folder: folder.path().join("slurm"),
        command: ["bash", "-c", "echo out of luck in task $0; exit 7", "{task}"].map(String::from).into(),
        resources: Resources { threads: 1, ..Resources::default() },
    };
    let settings = FollowSettings { poll: Duration::from_millis(300), max_restarts: 1, cancel_jobs: true };
    let never = |_| Ok(TaskProgress { done: 0, total: 1 });
    let ended = follow(&job, &[1], &settings, &never, &|_| {}, &|| false, &std::thread::sleep);
    match ended {
        Err(SlurmError::TaskFails { attempts: 2, log, .. }) => assert!(log.contains("out of luck in task 1"), "{log}"),
        other => panic!("{other:?}"),
    }
    Ok(())
}

prerequisites::test_binary!(
    an_array_with_a_lost_task_gives_the_same_table,
    a_design_search_runs_as_an_array,
    ctrl_c_cancels_the_jobs,
    a_refused_job_is_told,
    a_task_that_always_fails_is_given_up,
);

use super::*;

fn failed(reason: &str) -> Outcome {
    Outcome::Failed { kind: "mesh".into(), reason: reason.into() }
}

fn filled(folder: &Path, shard: Shard, tasks: &[usize]) -> PathBuf {
    let mut writer = ShardWriter::open(folder, shard, "hash", 20).expect("writable");
    for &task in tasks {
        writer.append(task, failed(&format!("reason \"{task}\"\nline"))).expect("room");
    }
    shard_path(folder, shard)
}

/// Wherever a kill cuts the file, the whole lines are kept and the rest is written anew: no result twice, none lost.
#[test]
fn a_file_cut_anywhere_is_taken_up() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = filled(folder.path(), Shard::WHOLE, &[3, 1, 4]);
    let whole = std::fs::read(&path).expect("readable");
    for length in 0..=whole.len() {
        std::fs::write(&path, &whole[..length]).expect("writable");
        let lines = whole[..length].iter().filter(|b| **b == b'\n').count();
        let known = read_shard(&path, "hash").expect("a torn line is no error").outcomes;
        assert_eq!(known.len(), lines.saturating_sub(1), "cut at {length}");
        drop(ShardWriter::open(folder.path(), Shard::WHOLE, "hash", 20).expect("taken up"));
        let mut writer = ShardWriter::open(folder.path(), Shard::WHOLE, "hash", 20).expect("and again");
        for task in [3, 1, 4] {
            if !known.contains_key(&task) {
                writer.append(task, failed(&format!("reason \"{task}\"\nline"))).expect("room");
            }
        }
        drop(writer);
        assert_eq!(std::fs::read(&path).expect("readable"), whole, "cut at {length}");
    }
}

/// Any byte that is flipped inside the file is noticed, unless it tears the last line or joins the one before to it.
#[test]
fn damage_is_noticed() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = filled(folder.path(), Shard::WHOLE, &[0, 1, 2]);
    let whole = std::fs::read(&path).expect("readable");
    let last = whole[..whole.len() - 1].iter().rposition(|b| *b == b'\n').expect("several lines") + 1;
    for position in 0..whole.len() {
        let mut bytes = whole.clone();
        bytes[position] ^= 0x04;
        std::fs::write(&path, &bytes).expect("writable");
        let read = read_shard(&path, "hash");
        if position == last - 1 {
            // The end of the line before: both lines are one torn line, and are computed again.
            assert_eq!(read.expect("a torn end").outcomes.len(), 1, "byte {position}");
        } else if position < last {
            assert!(read.is_err(), "byte {position}");
        } else {
            assert_eq!(read.expect("only the last line is lost").outcomes.len(), 2, "byte {position}");
        }
    }
    let mut bytes = whole.clone();
    bytes[last - 20] ^= 0x04;
    std::fs::write(&path, &bytes).expect("writable");
    let message = read_shard(&path, "hash").expect_err("damaged").to_string();
    assert!(message.contains("line 3 is damaged") && message.contains("remove that line"), "{message}");
}

#[test]
fn other_files_and_other_studies_are_left_alone() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = filled(folder.path(), Shard::WHOLE, &[0]);
    let text = std::fs::read(&path).expect("readable");
    let other = ShardWriter::open(folder.path(), Shard::WHOLE, "another", 20);
    assert!(matches!(other, Err(StoreError::OtherStudy { .. })));
    assert_eq!(std::fs::read(&path).expect("readable"), text);
    for notes in ["milk\n", "milk", "{\"key\":\"study\"}\n"] {
        std::fs::write(&path, notes).expect("writable");
        let refused = ShardWriter::open(folder.path(), Shard::WHOLE, "hash", 20);
        assert!(matches!(refused, Err(StoreError::NotAShard { .. })), "{notes:?}");
        assert_eq!(std::fs::read_to_string(&path).expect("readable"), notes);
    }
}

#[test]
fn a_shard_has_one_writer() {
    let folder = tempfile::tempdir().expect("a folder");
    let first = ShardWriter::open(folder.path(), Shard::WHOLE, "hash", 20).expect("free");
    let second = ShardWriter::open(folder.path(), Shard::WHOLE, "hash", 20);
    assert!(matches!(second, Err(StoreError::Locked { .. })));
    drop(first);
    assert!(ShardWriter::open(folder.path(), Shard::WHOLE, "hash", 20).is_ok());
}

#[test]
fn shards_are_collected_and_what_is_missing_is_named() {
    let folder = tempfile::tempdir().expect("a folder");
    let shard = |index| Shard { index, count: 4 };
    for index in [1, 2, 4] {
        filled(folder.path(), shard(index), &shard(index).tasks(20).collect::<Vec<_>>());
    }
    let all = collect(&[folder.path()], "hash").expect("three good files");
    assert_eq!(all.outcomes.len(), 15);
    let message = all.check_complete(20).expect_err("a shard is missing").to_string();
    assert!(message.contains("5 of 20") && message.contains("first is task 2"), "{message}");
    assert!(message.contains("--shard 3/4") && !message.contains("--shard 1/4"), "{message}");
    // The same result in two files is one result; two different ones are a conflict.
    filled(folder.path(), Shard::WHOLE, &(0..20).collect::<Vec<_>>());
    assert!(collect(&[folder.path()], "hash").expect("equal results").check_complete(20).is_ok());
    let mut writer = ShardWriter::open(folder.path(), shard(3), "hash", 20).expect("writable");
    writer.append(2, failed("something else")).expect("room");
    let conflict = collect(&[folder.path()], "hash");
    assert!(matches!(conflict, Err(StoreError::Conflict { task: 2, .. })), "{conflict:?}");
}

//! Damaged files and interrupted writers.

use std::error::Error as _;
use std::fs;
use std::path::Path;

use dempm::trajectory::{Frame, Header, Trajectory, TrajectoryError, TrajectoryWriter};
use proptest::prelude::*;
use tempfile::tempdir;

use crate::synthetic::Collapse;

/// Reads all there is, as text. Any error will do; a panic or worse will not.
fn read_all(path: &Path) -> Result<String, TrajectoryError> {
    let t = Trajectory::open(path)?;
    // Debug text, as absent boxes are NaN; the shortest decimals tell all other numbers apart.
    let mut text = format!("{:?}", (t.header(), t.points(), t.time(), t.status()));
    text += &format!("{:?}", (t.budget(), t.wall_time(), t.fields().collect::<Vec<_>>()));
    for index in 0..t.frames() {
        text += &format!("{:?}", t.frame(index)?);
    }
    Ok(text)
}

fn intact() -> Vec<u8> {
    let directory = tempdir().unwrap();
    let path = directory.path().join("run.h5");
    // The same bytes in every run of the tests.
    let header = Header { created: String::new(), ..Collapse::new(3).header() };
    Collapse::new(3).write_with(&path, &header, 3);
    fs::read(&path).unwrap()
}

/// What reading `bytes` as a file gives.
fn outcome(bytes: &[u8]) -> Result<String, TrajectoryError> {
    let directory = tempdir().unwrap();
    let path = directory.path().join("damaged.h5");
    fs::write(&path, bytes).unwrap();
    read_all(&path)
}

#[test]
fn other_files_are_named_in_the_error() {
    for bytes in [&b""[..], b"title = \"a scene, not a trajectory\"", &[0; 4096]] {
        let error = outcome(bytes).unwrap_err().to_string();
        assert!(error.ends_with("damaged.h5: this is not an HDF5 file"), "{error}");
    }
    let missing = Trajectory::open(Path::new("no/such/file.h5")).unwrap_err();
    assert!(missing.to_string().contains("no/such/file.h5"), "{missing}");

    let directory = tempdir().unwrap();
    let path = directory.path().join("other.h5");
    hdf5::File::create(&path).unwrap().close().unwrap();
    assert!(matches!(Trajectory::open(&path), Err(TrajectoryError::NotATrajectory { .. })));
    let resumed = TrajectoryWriter::resume(&path, 0);
    assert!(matches!(resumed, Err(TrajectoryError::NotATrajectory { .. })));
}

/// Opens a good file, spoils it with `spoil` and reports what reading says then.
pub fn spoiled(spoil: impl FnOnce(&hdf5::File)) -> String {
    let directory = tempdir().unwrap();
    let path = directory.path().join("spoiled.h5");
    fs::write(&path, intact()).unwrap();
    let file = hdf5::File::open_rw(&path).unwrap();
    spoil(&file);
    file.close().unwrap();
    let error = read_all(&path).unwrap_err();
    let cause = error.source().map(ToString::to_string).unwrap_or_default();
    format!("{error}: {cause}")
}

#[test]
fn contradictions_name_file_and_dataset() {
    let later = spoiled(|file| file.attr("format_version").unwrap().write_scalar(&99_u64).unwrap());
    assert!(later.contains("spoiled.h5") && later.contains("format 99"), "{later}");

    let short = spoiled(|file| file.dataset("stress").unwrap().resize((2, 9, 4)).unwrap());
    assert!(short.contains("stress") && short.contains("[2, 9, 4]"), "{short}");

    let missing = spoiled(|file| file.unlink("velocity").unwrap());
    assert!(missing.contains("velocity"), "{missing}");

    let text = spoiled(|file| {
        file.unlink("time").unwrap();
        let words = "one two".parse::<hdf5::types::VarLenUnicode>().unwrap();
        file.new_dataset_builder().with_data(&[words]).create("time").unwrap();
    });
    assert!(text.contains("time"), "{text}");

    // More frames than any memory holds, in a file of a few kilobytes.
    let vast = spoiled(|file| file.dataset("time").unwrap().resize(1 << 50).unwrap());
    assert!(vast.contains("time") && vast.contains("fits into the file"), "{vast}");
}

#[test]
fn a_file_cut_short_is_refused() {
    let bytes = intact();
    // The signature has 8 bytes.
    for length in (8..bytes.len()).step_by(97) {
        let error = outcome(&bytes[..length]).expect_err("accepted").to_string();
        let named = error.ends_with("damaged.h5: the end of this HDF5 file is missing");
        assert!(named, "at {length} of {} bytes: {error}", bytes.len());
    }
}

/// The heap of texts has no checksums, and a heap of zeros sends HDF5 into an endless loop: nothing is read
/// from it.
#[test]
fn the_heap_of_texts_is_not_needed() {
    let mut bytes = intact();
    let whole = outcome(&bytes).unwrap();
    let starts = |k: &usize| bytes[*k..].starts_with(b"GCOL");
    let heaps: Vec<usize> = (0..bytes.len()).filter(starts).collect();
    assert!(!heaps.is_empty());
    // A heap has 4096 bytes or more, of which 16 are its header.
    for heap in heaps {
        bytes[heap + 16..heap + 4096].fill(0);
    }
    assert!(outcome(&bytes).unwrap() == whole);
}

/// Files of earlier versions have texts of fixed length and no copies.
#[test]
fn older_files_are_read_and_resumed() {
    let directory = tempdir().unwrap();
    let path = directory.path().join("old.h5");
    fs::write(&path, intact()).unwrap();
    let whole = read_all(&path).unwrap();
    let file = hdf5::File::open_rw(&path).unwrap();
    for (place, copies) in [("/", "texts"), ("versions", "texts/versions")] {
        let (group, copies) = (file.group(place).unwrap(), file.group(copies).unwrap());
        for name in copies.attr_names().unwrap() {
            type Text = hdf5::types::FixedUnicode<256>;
            let text: Text = copies.attr(&name).unwrap().read_scalar().unwrap();
            group.delete_attr(&name).unwrap();
            group.new_attr::<Text>().create(&*name).unwrap().write_scalar(&text).unwrap();
        }
    }
    file.unlink("texts").unwrap();
    file.close().unwrap();
    assert!(read_all(&path).unwrap() == whole);
    let mut writer = TrajectoryWriter::resume(&path, 3).unwrap();
    writer.push(Frame { time: 4.0, ..Collapse::new(3).frame(300) }).unwrap();
    writer.finish("finished later").unwrap();
    let resumed = Trajectory::open(&path).unwrap();
    assert_eq!((resumed.status(), resumed.frames()), ("finished later", 4));
    assert_eq!(resumed.header().title, "Synthetic column collapse");
}

/// Wherever a byte changes, the file is refused, or the byte was in a gap and nothing read has changed.
#[test]
fn a_changed_byte_is_an_error_or_changes_nothing() {
    /// The headers of the file and of the groups that are made first.
    const METADATA: usize = 2500;
    let bytes = intact();
    let whole = outcome(&bytes).unwrap();
    let mut random = 0x9e37_79b9_7f4a_7c15_u64;
    for place in 0..bytes.len() {
        random = random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
        if place > METADATA && (random >> 57) > 2 {
            continue;
        }
        let mut damaged = bytes.clone();
        damaged[place] ^= ((random >> 33) % 255) as u8 + 1;
        match outcome(&damaged) {
            Ok(read) => assert!(read == whole, "byte {place} changes what is read, silently"),
            Err(error) => assert!(error.to_string().contains("damaged.h5"), "{error}"),
        }
    }
}

/// Not a test of its own: the process that [`a_killed_writer_leaves_a_whole_file`] kills.
#[test]
fn write_until_killed() {
    let Some(path) = std::env::var_os(VICTIM) else { return };
    let path = Path::new(&path);
    let collapse = Collapse::new(VICTIM_ROWS);
    let (mut writer, first) = match Trajectory::open(path) {
        Ok(old) => (TrajectoryWriter::resume(path, old.frames()).unwrap(), old.frames()),
        Err(_) => {
            let (header, points) = (collapse.header(), collapse.points());
            (TrajectoryWriter::create(path, &header, &points).unwrap(), 0)
        }
    };
    for index in first.. {
        writer.push(collapse.frame(index)).unwrap();
        writer.commit().unwrap();
    }
}

const VICTIM: &str = "DEMPM_TEST_WRITE_UNTIL_KILLED";
const VICTIM_ROWS: usize = 24;

#[test]
fn a_killed_writer_leaves_a_whole_file() {
    let directory = tempdir().unwrap();
    let path = directory.path().join("run.h5");
    let collapse = Collapse::new(VICTIM_ROWS);
    for round in 0..12 {
        let mut victim = std::process::Command::new(std::env::current_exe().unwrap())
            .args(["--exact", "damage::write_until_killed"])
            .env(VICTIM, &path)
            .stdout(std::process::Stdio::null())
            .spawn()
            .unwrap();
        // Times that fall into all stages of a commit, which takes some milliseconds.
        std::thread::sleep(std::time::Duration::from_micros(60_000 + 3_700 * round));
        victim.kill().unwrap();
        victim.wait().unwrap();
        if !path.exists() {
            continue;
        }
        let trajectory = Trajectory::open(&path).unwrap();
        for index in 0..trajectory.frames() {
            let (read, written) = (trajectory.frame(index).unwrap(), collapse.frame(index));
            assert_eq!(format!("{read:?}"), format!("{written:?}"), "round {round}");
        }
    }
    assert!(Trajectory::open(&path).unwrap().frames() > 0, "the writer never came to a commit");
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(500) })]

    #[test]
    fn flipped_bits_never_end_the_program(
        flips in prop::collection::vec((any::<prop::sample::Index>(), 0..8_u32), 1..8),
    ) {
        let mut bytes = INTACT.with(Clone::clone);
        for (place, bit) in flips {
            let place = place.index(bytes.len());
            bytes[place] ^= 1 << bit;
        }
        // Either an error or, where the flip hit a gap in the file, the data.
        let _ = outcome(&bytes);
    }

    #[test]
    fn overwritten_stretches_never_end_the_program(
        start in any::<prop::sample::Index>(),
        junk in prop::collection::vec(any::<u8>(), 1..64),
    ) {
        let mut bytes = INTACT.with(Clone::clone);
        let start = start.index(bytes.len());
        for (byte, junk) in bytes[start..].iter_mut().zip(junk) {
            *byte = junk;
        }
        let _ = outcome(&bytes);
    }
}

thread_local! {
    static INTACT: Vec<u8> = intact();
}

#[test]
fn a_lock_of_another_process_does_not_matter() {
    let directory = tempdir().unwrap();
    let path = directory.path().join("run.h5");
    Collapse::new(3).write(&path, 3);
    let lock = fs::File::open(&path).unwrap();
    lock.lock().unwrap();
    read_all(&path).unwrap();
}

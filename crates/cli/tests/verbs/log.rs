//! `bikebot info` and `bikebot log`: recordings read and saved.

use std::fs;

use crate::common::{call, err, folder, good, json, out};

#[test]
fn info_and_log_check_read_what_run_wrote() {
    let folder = folder();
    let run = json(&good(folder.path(), "run short.toml -o a.mcap --json"));
    let info = json(&good(folder.path(), "info a.mcap --json"));
    assert_eq!(info["outcome"], "arrived");
    assert_eq!(info["result_hash"], run["result_hash"]);
    assert_eq!(info["scenario"], "short");
    assert!(good(folder.path(), "info a.mcap").contains("short"));
    assert!(good(folder.path(), "log check a.mcap").contains("whole"));
}

#[test]
fn a_cut_recording_is_saved_with_losses_and_what_is_saved_is_whole() {
    let folder = folder();
    good(folder.path(), "run short.toml -o a.mcap");
    let bytes = fs::read(folder.path().join("a.mcap")).unwrap();
    let mut saved = 0;
    for eighth in 1..8 {
        let cut = folder.path().join("cut.mcap.part");
        fs::write(&cut, &bytes[..bytes.len() * eighth / 8]).unwrap();
        assert_eq!(
            call(folder.path(), "log check cut.mcap.part").status.code(),
            Some(3)
        );
        let output = call(
            folder.path(),
            "log recover cut.mcap.part -o saved.mcap --force",
        );
        // 0 where only the index behind the last message was lost.
        let expected = if out(&output).contains("lost        nothing") {
            0
        } else {
            3
        };
        assert_eq!(
            output.status.code(),
            Some(expected),
            "{}{}",
            out(&output),
            err(&output)
        );
        if folder.path().join("saved.mcap").exists() {
            good(folder.path(), "log check saved.mcap");
            saved += 1;
        }
    }
    assert!(saved >= 4, "only {saved} of 7 cuts left anything");
    // A whole one loses nothing.
    good(folder.path(), "log recover a.mcap -o copy.mcap");
    good(folder.path(), "log check copy.mcap");
}

//! Pictures kept to be compared with.

/// Demands that `now` is, byte for byte, the picture kept as `tests/golden/NAME`; `BLESS=1` keeps it instead.
#[track_caller]
pub(crate) fn assert_is_as_kept(now: &str, name: &str) {
    let golden = format!("{}/tests/golden/{name}", env!("CARGO_MANIFEST_DIR"));
    if std::env::var_os("BLESS").is_some() {
        std::fs::write(&golden, now).unwrap();
    }
    let wanted = std::fs::read_to_string(&golden).unwrap();
    assert!(
        now == wanted,
        "{golden} differs; BLESS=1 writes it anew: look at it first"
    );
}

//! What is left of a recording that was misused, cut, killed, or met a full disk.

use std::io::{self, Cursor, Seek, SeekFrom, Write};

use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::super::log::{LogError, check, inspect, read_trace, recover};
use super::*;

#[test]
fn misuse_is_an_error_and_leaves_the_recording_whole() {
    let mut recorder = McapRecorder::begin(
        Cursor::new(Vec::new()),
        &run_info(),
        &RecordOptions::default(),
    )
    .unwrap();
    let grid = GridSample {
        width: usize::MAX,
        height: 2,
        resolution: 1.0,
        origin: [0.0; 2],
        yaw: 0.0,
        cells: &[CellState::Free],
    };
    let map = MapEvent {
        bounds: [[0.0; 2], [1.0; 2]],
        shapes: &[],
        grid: Some(grid),
    };
    let late = SimTime::from_seconds(1.0);
    assert!(matches!(
        recorder.record(late, &Event::Map(map)),
        Err(RecordError::GridSize { .. })
    ));
    let state = StateSample::default();
    assert!(matches!(
        recorder.record(SimTime::ZERO, &Event::State(&state)),
        Err(RecordError::TimeWentBack { .. })
    ));
    let data = vec![0; wire::RECORD_LIMIT as usize];
    let event = Event::Attachment {
        name: "large",
        media_type: "",
        data: &data,
    };
    assert!(matches!(
        recorder.record(late, &event),
        Err(RecordError::AttachmentTooLarge { .. })
    ));
    recorder.record(late, &Event::State(&state)).unwrap();
    recorder.finish(&result_info()).unwrap();
    assert!(matches!(
        recorder.record(late, &Event::State(&state)),
        Err(RecordError::Finished)
    ));
    recorder.flush().unwrap();
    let bytes = recorder.into_inner().into_inner();
    assert!(check(&mut Cursor::new(&bytes)).unwrap().is_whole());
}

/// Fails at its n-th write, and from then on or that once only.
struct Failing {
    inner: Cursor<Vec<u8>>,
    writes_left: usize,
    heals: bool,
    failed: bool,
}

impl Write for Failing {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        if self.writes_left == 0 && !(self.failed && self.heals) {
            self.failed = true;
            return Err(io::Error::new(io::ErrorKind::StorageFull, "no space left"));
        }
        self.writes_left = self.writes_left.saturating_sub(1);
        self.inner.write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

impl Seek for Failing {
    fn seek(&mut self, position: SeekFrom) -> io::Result<u64> {
        self.inner.seek(position)
    }
}

#[test]
fn a_failing_disk_is_reported_once_and_again_at_the_end_and_nothing_follows_the_tear() {
    let whole = recording(1.2);
    let mut succeeded = false;
    for writes_left in 0..800 {
        let heals = writes_left % 2 == 0;
        let mut failing = Failing {
            inner: Cursor::new(Vec::new()),
            writes_left,
            heals,
            failed: false,
        };
        let options = RecordOptions::default();
        let mut recorder = match McapRecorder::begin(&mut failing, &run_info(), &options) {
            Ok(recorder) => recorder,
            Err(error) => {
                assert!(matches!(error, RecordError::Write { .. }), "{error}");
                continue;
            }
        };
        let mut reported = 0;
        // A loop that goes on whatever the recorder says.
        struct Counting<'r, R>(&'r mut R, &'r mut usize);
        impl<R: Recorder> Recorder for Counting<'_, R> {
            fn record(&mut self, time: SimTime, event: &Event<'_>) -> Result<(), RecordError> {
                if let Err(error) = self.0.record(time, event) {
                    assert!(matches!(error, RecordError::Write { .. }), "{error}");
                    *self.1 += 1;
                }
                Ok(())
            }
        }
        ride(&mut Counting(&mut recorder, &mut reported), 1.2).unwrap();
        let end = recorder.finish(&result_info());
        let again = recorder.finish(&result_info());
        let written = recorder.bytes_written();
        // Not even a recorder that goes out of scope may write any more.
        drop(recorder);
        let bytes = failing.inner.into_inner();
        assert_eq!(written, bytes.len() as u64);
        match end {
            Ok(()) => {
                assert_eq!(reported, 0);
                assert!(again.is_ok());
                assert_eq!(bytes, whole);
                succeeded = true;
                break;
            }
            Err(RecordError::Incomplete { reason }) => {
                assert_eq!(reported, 1);
                assert!(reason.contains("no space left"), "{reason}");
            }
            Err(RecordError::Write { .. }) => assert_eq!(reported, 0),
            Err(other) => panic!("{other}"),
        }
        assert!(matches!(again, Err(RecordError::Incomplete { .. })) || again.is_ok());
        assert_eq!(
            bytes,
            whole[..bytes.len()],
            "nothing but the beginning of the whole file"
        );
        if bytes.len() >= 8 {
            let saved = recover(&mut Cursor::new(&bytes), &mut Cursor::new(Vec::new())).unwrap();
            assert!(saved.written.is_whole());
        }
    }
    assert!(succeeded, "the file takes fewer writes than were tried");
}

#[test]
fn a_file_cut_anywhere_is_read_up_to_its_last_whole_chunk() {
    let bytes = recording(4.0);
    let whole = inspect(&mut Cursor::new(&bytes)).unwrap();
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let mut cuts: Vec<usize> = (0..150)
        .map(|_| (rng.next_u64() % bytes.len() as u64) as usize)
        .collect();
    cuts.extend([
        0,
        1,
        7,
        8,
        9,
        16,
        bytes.len() - 1,
        bytes.len() - 8,
        bytes.len() - 9,
    ]);
    let mut best = 0;
    for cut in cuts {
        let part = &bytes[..cut];
        if cut < 8 {
            assert!(
                matches!(check(&mut Cursor::new(part)), Err(LogError::NotMcap)),
                "{cut}"
            );
            continue;
        }
        let report = check(&mut Cursor::new(part)).unwrap();
        assert!(!report.is_whole(), "{cut}");
        assert!(report.problems[0].offset <= cut as u64);
        let _ = read_trace(&mut Cursor::new(part), Trace::default()).unwrap();
        let mut output = Cursor::new(Vec::new());
        let saved = recover(&mut Cursor::new(part), &mut output).unwrap();
        assert_eq!(saved.written.problems, [], "cut at {cut}");
        assert_eq!(saved.messages, saved.written.info.messages);
        assert_eq!(saved.messages, report.decoded);
        assert_eq!(saved.source_bytes, cut as u64);
        let stopped = saved.stopped.unwrap();
        assert_eq!(stopped, report.problems[0]);
        if saved.nothing_lost {
            assert_eq!(saved.messages, whole.messages);
            assert_eq!(saved.written.info.result(), whole.result());
        }
        best = best.max(saved.messages);
        let recovered = output.into_inner();
        assert_eq!(
            inspect(&mut Cursor::new(&recovered)).unwrap().metadata["bikebot.recovered"]["stopped_at_byte"],
            stopped.offset.to_string()
        );
        // mcap's own reader agrees.
        let count = mcap::MessageStream::new(&recovered)
            .unwrap()
            .map(Result::unwrap)
            .count();
        assert_eq!(count as u64, saved.messages);
    }
    assert_eq!(best, whole.messages);
}

#[test]
fn a_killed_program_loses_no_more_than_the_last_second() {
    // So little is recorded that no chunk fills up: what counts is the clock.
    let sparse = RecordOptions {
        state: 20.0,
        frames: 20.0,
        pose: 10.0,
        scene: 1.0,
        belief: 1.0,
        flush: 1.0,
    };
    for options in [sparse, RecordOptions::default()] {
        for killed_at in [1.2, 2.995, 3.7] {
            let output = Cursor::new(Vec::new());
            let mut recorder = McapRecorder::begin(output, &run_info(), &options).unwrap();
            ride(&mut recorder, killed_at).unwrap();
            let on_disk = recorder.bytes_written() as usize;
            recorder.finish(&result_info()).unwrap();
            let bytes = recorder.into_inner().into_inner();
            let mut part = Cursor::new(&bytes[..on_disk]);
            let saved = recover(&mut part, &mut Cursor::new(Vec::new())).unwrap();
            let (_, last) = saved.written.info.span.unwrap();
            let lost = SimTime::from_seconds(killed_at).seconds_since(last);
            // A second, and the last sample before it was flushed is up to one period old.
            assert!(
                lost <= 1.0 + 1.0 / options.state,
                "{lost} s of {killed_at} s"
            );
        }
    }
}

#[test]
fn recovering_a_whole_file_loses_nothing_and_keeps_its_messages() {
    let bytes = recording(1.5);
    let mut output = Cursor::new(Vec::new());
    let saved = recover(&mut Cursor::new(&bytes), &mut output).unwrap();
    assert_eq!(saved.stopped, None);
    assert!(saved.nothing_lost && saved.written.is_whole());
    // Written by the same writer in the same chunks: the same file.
    assert_eq!(sha256_hex(&output.into_inner()), sha256_hex(&bytes));
}

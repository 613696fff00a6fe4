//! Files that may hold anything: what they claim is believed only as far as it can be seen.

use std::collections::BTreeMap;
use std::io::Cursor;

use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::super::log::{LogError, check, inspect, read_attachment, read_run, read_trace, recover};
use super::*;

#[test]
fn any_changed_byte_is_noticed_and_none_is_fatal() {
    let bytes = recording(0.6);
    let mut rng = ChaCha8Rng::seed_from_u64(2);
    for _ in 0..250 {
        let at = (rng.next_u64() % bytes.len() as u64) as usize;
        let flip = (rng.next_u64() % 255 + 1) as u8;
        let mut changed = bytes.clone();
        changed[at] ^= flip;
        match check(&mut Cursor::new(&changed)) {
            Ok(report) => assert!(!report.is_whole(), "byte {at} xor {flip:02x}"),
            Err(LogError::NotMcap) => assert!(at < 8),
            Err(other) => panic!("{other}"),
        }
        let _ = read_run(&mut Cursor::new(&changed));
        let _ = read_trace(&mut Cursor::new(&changed), Trace::with_scans());
        let mut output = Cursor::new(Vec::new());
        if let Ok(saved) = recover(&mut Cursor::new(&changed), &mut output) {
            // A changed message may be saved as it is; the container is whole.
            let count = mcap::MessageStream::new(output.get_ref()).unwrap();
            assert_eq!(count.map(Result::unwrap).count() as u64, saved.messages);
        }
    }
}

/// A file of the given records, unframed.
fn raw_file(records: &[(u8, Vec<u8>)]) -> Vec<u8> {
    let mut bytes = mcap::MAGIC.to_vec();
    for (opcode, body) in records {
        bytes.push(*opcode);
        bytes.extend((body.len() as u64).to_le_bytes());
        bytes.extend(body);
    }
    bytes
}

fn string(text: &str) -> Vec<u8> {
    [&(text.len() as u32).to_le_bytes()[..], text.as_bytes()].concat()
}

#[test]
fn declared_lengths_are_believed_only_as_far_as_the_file_reaches() {
    use mcap::records::op;
    let huge = u64::MAX.to_le_bytes();
    let chunk = |size: u64, compression: &str, length: u64, records: &[u8]| {
        let mut body = vec![0; 16];
        body.extend(size.to_le_bytes());
        body.extend([0; 4]);
        body.extend(string(compression));
        body.extend(length.to_le_bytes());
        body.extend(records);
        (op::CHUNK, body)
    };
    let header = (op::HEADER, [string("bikebot"), string("x")].concat());
    let mut files = vec![
        // A record longer than the file, and than anything.
        [mcap::MAGIC, &[op::MESSAGE], &huge].concat(),
        [mcap::MAGIC, &[op::CHUNK], &(u64::MAX - 8).to_le_bytes()].concat(),
        raw_file(&[(op::METADATA, [string("a"), vec![0xff; 4]].concat())]),
        raw_file(&[(op::CHANNEL, vec![0xff; 12])]),
        raw_file(&[(
            op::SCHEMA,
            [vec![1, 0], string("a"), string("b"), vec![0xff; 4]].concat(),
        )]),
        raw_file(&[(op::ATTACHMENT, vec![0; 3])]),
        raw_file(&[(
            op::ATTACHMENT,
            [vec![0; 16], string("a"), string("b"), huge.to_vec()].concat(),
        )]),
        raw_file(&[(op::FOOTER, vec![0; 3])]),
        raw_file(&[(op::DATA_END, vec![])]),
    ];
    for compression in ["", "zstd", "lz4", "nonsense"] {
        // A chunk that claims more than it has, inside and out.
        files.push(raw_file(&[chunk(u64::MAX, compression, 4, &[1, 2, 3, 4])]));
        files.push(raw_file(&[chunk(60 << 20, compression, 4, &[1, 2, 3, 4])]));
        files.push(raw_file(&[chunk(
            9,
            compression,
            9,
            &[op::MESSAGE, 255, 255, 255, 3, 0, 0, 0, 0],
        )]));
        files.push(raw_file(&[chunk(
            5,
            compression,
            5,
            &[op::MESSAGE, 40, 0, 0, 0],
        )]));
        files.push(raw_file(&[chunk(5, compression, u64::MAX, &[])]));
    }
    for mut records in files {
        let with_header = raw_file(std::slice::from_ref(&header));
        records.splice(..8, with_header);
        let report = check(&mut Cursor::new(&records)).unwrap();
        assert!(!report.is_whole());
        let saved = recover(&mut Cursor::new(&records), &mut Cursor::new(Vec::new())).unwrap();
        assert_eq!(saved.messages, 0);
        assert!(read_run(&mut Cursor::new(&records)).is_err());
    }
    assert!(matches!(
        inspect(&mut Cursor::new(b"ROSBAG")),
        Err(LogError::NotMcap)
    ));
    assert!(matches!(
        inspect(&mut Cursor::new(b"")),
        Err(LogError::NotMcap)
    ));
}

#[test]
fn a_chunk_that_unpacks_to_too_much_is_not_opened() {
    let options = mcap::WriteOptions::new()
        .chunk_size(None)
        .compression_threads(0);
    let mut writer = options.create(Cursor::new(Vec::new())).unwrap();
    let channel = writer
        .add_channel(0, "/zeros", "", &BTreeMap::new())
        .unwrap();
    let header = mcap::records::MessageHeader {
        channel_id: channel,
        sequence: 0,
        log_time: 0,
        publish_time: 0,
    };
    let mebibyte = vec![0; 1 << 20];
    for _ in 0..80 {
        writer.write_to_known_channel(&header, &mebibyte).unwrap();
    }
    writer.finish().unwrap();
    let bytes = writer.into_inner().into_inner();
    assert!(bytes.len() < 1 << 20);
    let report = check(&mut Cursor::new(&bytes)).unwrap();
    assert!(
        report.problems[0].text.contains("more than"),
        "{}",
        report.problems[0]
    );
    assert_eq!(report.info.messages, 0);
}

/// Asks everything of a file that may be anything.
fn ask_everything(bytes: &[u8]) {
    let _ = inspect(&mut Cursor::new(bytes));
    let _ = check(&mut Cursor::new(bytes));
    let _ = read_run(&mut Cursor::new(bytes));
    let _ = read_attachment(&mut Cursor::new(bytes), "plan.json");
    let _ = read_trace(&mut Cursor::new(bytes), Trace::with_scans());
    let mut output = Cursor::new(Vec::new());
    if let Ok(saved) = recover(&mut Cursor::new(bytes), &mut output) {
        assert_eq!(saved.messages, saved.written.info.messages);
    }
}

/// The recording with chunks packed so, and without their CRCs: what is inside is
/// believed and read.
fn repacked_without_crcs(bytes: &[u8], compression: Option<mcap::Compression>) -> Vec<u8> {
    let options = mcap::WriteOptions::new()
        .compression(compression)
        .compression_threads(0)
        .chunk_size(Some(20_000))
        .calculate_chunk_crcs(false)
        .calculate_data_section_crc(false);
    let mut writer = options.create(Cursor::new(Vec::new())).unwrap();
    for message in mcap::MessageStream::new(bytes).unwrap() {
        writer.write(&message.unwrap()).unwrap();
    }
    writer.finish().unwrap();
    writer.into_inner().into_inner()
}

#[test]
fn whatever_stands_in_a_chunk_does_no_harm() {
    let bytes = recording(0.3);
    let mut rng = ChaCha8Rng::seed_from_u64(3);
    let packed = [
        None,
        Some(mcap::Compression::Zstd),
        Some(mcap::Compression::Lz4),
    ];
    for (compression, rounds) in packed.into_iter().zip([300, 150, 150]) {
        let file = repacked_without_crcs(&bytes, compression);
        assert_eq!(check(&mut Cursor::new(&file)).unwrap().problems, []);
        for _ in 0..rounds {
            let mut changed = file.clone();
            for _ in 0..1 + rng.next_u64() % 8 {
                let at = (rng.next_u64() % changed.len() as u64) as usize;
                // Lengths and counts above all: large, small, or anything.
                changed[at] = [0, 0xff, 0x7f, rng.next_u64() as u8][(rng.next_u64() % 4) as usize];
            }
            ask_everything(&changed);
        }
    }
}

#[test]
fn the_crc_of_a_chunk_is_checked_however_it_is_packed() {
    let bytes = recording(0.1);
    let packed = [
        None,
        Some(mcap::Compression::Zstd),
        Some(mcap::Compression::Lz4),
    ];
    for compression in packed {
        let options = mcap::WriteOptions::new()
            .compression(compression)
            .compression_threads(0)
            .calculate_data_section_crc(false);
        let mut writer = options.create(Cursor::new(Vec::new())).unwrap();
        for message in mcap::MessageStream::new(&bytes).unwrap() {
            writer.write(&message.unwrap()).unwrap();
        }
        writer.finish().unwrap();
        let mut file = writer.into_inner().into_inner();
        assert_eq!(check(&mut Cursor::new(&file)).unwrap().problems, []);
        // The one chunk begins after the header; this lies well inside.
        file[500] ^= 1;
        let report = check(&mut Cursor::new(&file)).unwrap();
        assert!(!report.is_whole());
        assert_eq!(
            report.info.messages, 0,
            "nothing of a broken chunk is believed"
        );
    }
}

proptest::proptest! {
    #![proptest_config(proptest::prelude::ProptestConfig::with_cases(300))]

    #[test]
    fn records_of_any_content_do_no_harm(
        records in proptest::collection::vec(
            (0u8..20, proptest::collection::vec(proptest::prelude::any::<u8>(), 0..80)),
            0..8,
        ),
        zeros in 0usize..80,
    ) {
        let mut records: Vec<(u8, Vec<u8>)> = records;
        for (_, body) in &mut records {
            // Small lengths are what gets a reader far into a record.
            for byte in body.iter_mut().take(zeros) {
                *byte &= 3;
            }
        }
        ask_everything(&raw_file(&records));
    }
}

//! Twenty thousand broken scenarios and maps: refused or read, never a panic.
//!
//! Sound files are damaged at random (bytes flipped, pieces cut, doubled and moved, hostile
//! words and numbers put in) and go through the same library calls as on the command line:
//! parse, resolve, check. The damage is a function of the case's number alone.

use std::collections::BTreeMap;
use std::panic::{AssertUnwindSafe, catch_unwind};

use bikebot_sim::{ScenarioFile, Setup};
use bikebot_world::formats::{self, MapOptions};

const CASES: u64 = 20_000;

/// Words that hurt where they land.
const WORDS: [&str; 40] = [
    "nan",
    "inf",
    "-inf",
    ".nan",
    "-1",
    "0",
    "1e308",
    "-1e308",
    "1e-320",
    "1e400",
    "9223372036854775807",
    "18446744073709551616",
    "4294967296",
    "2147483648",
    "true",
    "\"\"",
    "''",
    "[",
    "]",
    "[[",
    "]]",
    "{",
    "}",
    "=",
    ":",
    ",",
    "#",
    "\n",
    "\0",
    "\u{feff}",
    "é",
    "\"\"\"",
    "'''",
    "\\u0000",
    "[]",
    "1979-05-27",
    "image: x",
    "width",
    "P5\n",
    "\t",
];

/// SplitMix64: small, and the same everywhere.
struct Chance(u64);

impl Chance {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    fn below(&mut self, limit: usize) -> usize {
        (self.next() % limit.max(1) as u64) as usize
    }

    /// A piece of at most 24 bytes of something `length` long.
    fn piece(&mut self, length: usize) -> std::ops::Range<usize> {
        let start = self.below(length + 1);
        let end = (start + self.below(24)).min(length);
        start..end
    }
}

fn damage(bytes: &mut Vec<u8>, chance: &mut Chance) {
    for _ in 0..=chance.below(4) {
        match chance.below(8) {
            0 if !bytes.is_empty() => {
                let at = chance.below(bytes.len());
                bytes[at] ^= 1 << chance.below(8);
            }
            1 => {
                let piece = chance.piece(bytes.len());
                bytes.drain(piece);
            }
            2 => {
                let piece = bytes[chance.piece(bytes.len())].to_vec();
                let at = chance.below(bytes.len() + 1);
                bytes.splice(at..at, piece);
            }
            3 | 4 => {
                let piece = chance.piece(bytes.len());
                let word = WORDS[chance.below(WORDS.len())];
                bytes.splice(piece, word.bytes());
            }
            5 => number(bytes, chance),
            6 => lines(bytes, chance),
            _ => {
                let end = chance.below(bytes.len() + 1);
                if chance.below(8) == 0 {
                    bytes.truncate(end);
                }
            }
        }
    }
}

/// Puts a hostile number where a number stands: the damage that gets furthest.
fn number(bytes: &mut Vec<u8>, chance: &mut Chance) {
    let is_digit = |byte: &u8| byte.is_ascii_digit();
    let starts: Vec<usize> = (0..bytes.len())
        .filter(|&at| is_digit(&bytes[at]) && (at == 0 || !is_digit(&bytes[at - 1])))
        .collect();
    if starts.is_empty() {
        return;
    }
    let start = starts[chance.below(starts.len())];
    let end = (start..bytes.len())
        .find(|&at| !(is_digit(&bytes[at]) || bytes[at] == b'.'))
        .unwrap_or(bytes.len());
    let word = WORDS[chance.below(13)];
    bytes.splice(start..end, word.bytes());
}

/// Drops, doubles or swaps lines.
fn lines(bytes: &mut Vec<u8>, chance: &mut Chance) {
    let mut lines: Vec<Vec<u8>> = bytes
        .split(|byte| *byte == b'\n')
        .map(<[u8]>::to_vec)
        .collect();
    let (a, b) = (chance.below(lines.len()), chance.below(lines.len()));
    match chance.below(3) {
        0 => {
            lines.remove(a);
        }
        1 => lines.insert(b, lines[a].clone()),
        _ => lines.swap(a, b),
    }
    *bytes = lines.join(&b'\n');
}

/// A one-bit-deep grey PNG of 3 x 2 cells, without compression.
fn png() -> Vec<u8> {
    fn crc(bytes: &[u8]) -> u32 {
        !bytes.iter().fold(!0, |mut crc, byte| {
            crc ^= u32::from(*byte);
            for _ in 0..8 {
                crc = (crc >> 1) ^ (0xedb8_8320 & 0_u32.wrapping_sub(crc & 1));
            }
            crc
        })
    }
    fn chunk(png: &mut Vec<u8>, name: &[u8; 4], data: &[u8]) {
        png.extend((data.len() as u32).to_be_bytes());
        let body = [name, data].concat();
        png.extend(&body);
        png.extend(crc(&body).to_be_bytes());
    }
    let rows = [0, 0xff, 0x00, 0xff, 0, 0xff, 0xff, 0xff];
    let (mut a, mut b) = (1_u32, 0_u32);
    for byte in rows {
        a = (a + byte) % 65521;
        b = (b + a) % 65521;
    }
    let mut zlib = vec![
        0x78,
        0x01,
        0x01,
        rows.len() as u8,
        0,
        !(rows.len() as u8),
        0xff,
    ];
    zlib.extend(rows.map(|byte| byte as u8));
    zlib.extend(((b << 16) | a).to_be_bytes());
    let mut png = b"\x89PNG\r\n\x1a\n".to_vec();
    chunk(&mut png, b"IHDR", &[0, 0, 0, 3, 0, 0, 0, 2, 8, 0, 0, 0, 0]);
    chunk(&mut png, b"IDAT", &zlib);
    chunk(&mut png, b"IEND", &[]);
    png
}

/// A 24-bit BMP of 2 x 2 cells.
fn bmp() -> Vec<u8> {
    let mut bmp = b"BM".to_vec();
    for word in [
        70_u32,
        0,
        54,
        40,
        2,
        2,
        0x0018_0001,
        0,
        16,
        2835,
        2835,
        0,
        0,
    ] {
        bmp.extend(word.to_le_bytes());
    }
    bmp.extend([
        255, 255, 255, 0, 0, 0, 0, 0, 255, 255, 255, 255, 255, 255, 0, 0,
    ]);
    bmp
}

const YAML: &str = "image: yard.pgm\nresolution: 0.5\norigin: [0.0, 0.0, 0.0]\noccupied_thresh: 0.65\nfree_thresh: 0.196\nnegate: 0\nmode: trinary\n";

fn maps() -> Vec<(&'static str, Vec<u8>)> {
    let mut binary = b"P5\n# a comment\n6 4\n255\n".to_vec();
    binary.extend([254; 20]);
    binary.extend([0, 205, 100, 254]);
    vec![
        ("yard.yaml", YAML.into()),
        ("yard.pgm", binary),
        ("text.pgm", b"P2\n4 3\n255\n254 254 0 254\n254 205 254 254\n254 254 254 254\n".to_vec()),
        ("yard.png", png()),
        ("yard.bmp", bmp()),
        ("yard.map", b"type octile\nheight 3\nwidth 5\nmap\n.....\n..@T.\nSGW..\n".to_vec()),
        (
            "yard.json",
            br#"{"name": "yard", "unit": "m", "width": 10, "height": 8, "start": [1, 1, 0], "goal": [8, 7, 90],
"obstacles": [{"polygon": [[4, 0], [5, 0], [5, 4], [4, 4]], "label": "wall"}, {"polygon": [[1, 5], [2, 6], [1, 6]]}]}"#
                .to_vec(),
        ),
    ]
}

const SCENARIOS: [&str; 6] = [
    include_str!("../templates/scenario.toml"),
    "format = 1\nname = \"file\"\n[map]\nfile = \"yard.yaml\"\nscale = 10.0\n[start]\nx_m = 4\ny_m = 4\n[goal]\nx_m = 20\ny_m = 15\n",
    "format = 1\nname = \"scene\"\nmap.file = \"yard.json\"\nplanner.footprint = \"capsule:1.8x0.6\"\n[laser]\nenabled = true\n[noise]\n",
    "format = 1\nname = \"path\"\n[path]\nwaypoints = [[1.0, 1.0, 0.0], [4.8, 2.2, 55.0], [8, 8, 90]]\ntangent_per_chord = 1.2\n[plant.bike]\nm1_kg = 48\n[[bike.mode_change]]\ntime_s = 2\nmode = \"balancer\"\nduration_s = 3\n",
    "format = 1\nname = \"course\"\nmap = { bounds_m = [0, 0, 30, 30], disc = [{ center_m = [5, 5], radius_m = 1 }] }\n[path]\nfile = \"track.csv\"\n[expect]\noutcome = \"timed_out\"\nroll_max_deg = 30\n",
    "format = 1\nname = \"traffic\"\nmap = { bounds_m = [0, 0, 30, 30] }\nstart = { x_m = 3, y_m = 3, heading_deg = 20 }\ngoal = { x_m = 25, y_m = 25 }\n[laser]\nmount_pitch_deg = 5\nlatency_s = 0.1\n[[obstacle]]\nshape = \"disc:0.3\"\nwaypoints_m = [[9, 1], [9, 20], [4, 7]]\nrepeat = \"loop\"\n[[obstacle]]\nshape = \"box:1.0x0.6\"\nwaypoints_m = [[8, 8]]\nheading_deg = 30\n[[obstacle]]\nshape = \"polygon:0,0;2,0;1,1\"\nwaypoints_m = [[20, 8]]\nappear_s = 3\ndisappear_s = 9\nheight_m = 1\n",
];

const TRACK: &str = "# x_m,y_m\n0,0\n1,0\n2,0.5\n3,1\n4,1\n";

/// Counts how far the damaged files got, so that the test cannot become idle unseen.
#[derive(Debug, Default)]
struct Reached {
    parsed: u64,
    resolved: u64,
    checked: u64,
    maps: u64,
}

fn one(number: u64, reached: &mut Reached) {
    let mut chance = Chance(number);
    let mut files: BTreeMap<&str, Vec<u8>> = maps().into_iter().collect();
    files.insert("track.csv", TRACK.into());
    let mut text = SCENARIOS[chance.below(SCENARIOS.len())].as_bytes().to_vec();

    // A map alone, a scenario alone, or a scenario with a damaged map.
    let what = chance.below(3);
    if what != 1 {
        let names: Vec<&str> = files.keys().copied().collect();
        let name = names[chance.below(names.len())];
        let bytes = files.get_mut(name).expect("it is one of the keys");
        damage(bytes, &mut chance);
        let options = MapOptions {
            meters_per_cell: (chance.below(8) > 0).then_some(0.5),
            unknown_is_free: chance.below(4) == 0,
            ..MapOptions::default()
        };
        let mut read = |inner: &str| {
            files
                .get(inner)
                .cloned()
                .ok_or_else(|| "no such file".into())
        };
        let loaded = formats::load(name, &files[name], &options, &mut read);
        reached.maps += u64::from(loaded.is_ok());
    }
    if what != 0 {
        if what == 1 || chance.below(2) == 0 {
            damage(&mut text, &mut chance);
        }
        let text = String::from_utf8_lossy(&text);
        let Ok(file) = ScenarioFile::parse(&text, &[]) else {
            return;
        };
        reached.parsed += 1;
        assert!(!file.explain().is_empty());
        let mut read = |inner: &str| {
            files
                .get(inner)
                .cloned()
                .ok_or_else(|| "no such file".into())
        };
        let Ok(setup) = Setup::resolve(&file, &mut read) else {
            return;
        };
        reached.resolved += 1;
        if let Some(problem) = setup.problem() {
            reached.checked += u64::from(problem.check(setup.planner.margin).is_ok());
        }
    }
}

#[test]
fn no_damage_to_scenario_or_map_makes_a_panic() {
    let mut reached = Reached::default();
    let mut panics = Vec::new();
    std::panic::set_hook(Box::new(|_| {}));
    for number in 0..CASES {
        if catch_unwind(AssertUnwindSafe(|| one(number, &mut reached))).is_err() {
            panics.push(number);
        }
    }
    let _ = std::panic::take_hook();
    assert!(
        panics.is_empty(),
        "{} cases panic, such as {:?}",
        panics.len(),
        &panics[..panics.len().min(5)]
    );
    // A tenth of the damage at least is survived, so all stages are reached.
    assert!(reached.parsed > CASES / 20, "{reached:?}");
    assert!(reached.resolved > CASES / 40, "{reached:?}");
    assert!(reached.checked > CASES / 100, "{reached:?}");
    assert!(reached.maps > CASES / 25, "{reached:?}");
}

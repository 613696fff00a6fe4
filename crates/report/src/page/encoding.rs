//! Numbers as text that a page carries: columns, lines, beliefs and scans, small and with a precision that is stated.
//!
//! | what | how | precision |
//! |---|---|---|
//! | time | base64 of `f64`, little-endian | exact |
//! | a column | base64 of `i16` steps of its own range where a hundred steps or more fit into its typical spread, of `f32` otherwise | 1/65 534 of its range, or 6e-8 of the value |
//! | a belief | what changed since the one before, in runs of cells | exact |
//! | a scan | base64 of `u16` steps of the longest range | 1/131 068 of that |

use bikebot_sim::record::trace::{BeliefTrace, ScanTrace};
use bikebot_world::{Cell, OccupancyGrid};
use serde::Serialize;

/// `i16` that stands for "no number".
const ABSENT: i16 = i16::MIN;
/// Steps of an `i16` column.
const STEPS: f64 = 65_534.0;

/// The usual alphabet, padded.
pub(super) fn base64(bytes: &[u8]) -> String {
    const ALPHABET: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let mut text = String::with_capacity(bytes.len().div_ceil(3) * 4);
    for group in bytes.chunks(3) {
        let word = group
            .iter()
            .chain([0, 0].iter())
            .take(3)
            .fold(0_u32, |word, byte| word << 8 | u32::from(*byte));
        for place in 0..4 {
            if place <= group.len() {
                let index = word >> (18 - 6 * place) & 63;
                text.push(char::from(ALPHABET[index as usize]));
            } else {
                text.push('=');
            }
        }
    }
    text
}

/// Times, s: exact.
pub(super) fn times(values: &[f64]) -> String {
    let bytes: Vec<u8> = values.iter().flat_map(|it| it.to_le_bytes()).collect();
    base64(&bytes)
}

/// Numbers of one kind.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(untagged)]
pub(super) enum Column {
    /// All the same.
    Constant {
        /// That number; nothing where there is none.
        c: Option<f64>,
    },
    /// `o + s * i`, where `i` is the i16; the least one means none.
    Steps {
        /// Offset.
        o: f64,
        /// Step.
        s: f64,
        /// Base64.
        q: String,
    },
    /// As they are, rounded to f32; NaN means none.
    Floats {
        /// Base64.
        f: String,
    },
}

impl Column {
    /// Packs `values`; what is not finite becomes none.
    pub(super) fn of(values: &[f64]) -> Self {
        let mut finite: Vec<f64> = values.iter().copied().filter(|it| it.is_finite()).collect();
        let (low, high) = finite
            .iter()
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), it| {
                (low.min(*it), high.max(*it))
            });
        if finite.is_empty() {
            return Self::Constant { c: None };
        }
        if low == high && finite.len() == values.len() {
            return Self::Constant { c: Some(low) };
        }
        let step = (high - low) / STEPS;
        let spread = typical_spread(&mut finite);
        // A column of spikes would lose its quiet parts.
        if step.is_finite() && step > 0.0 && 100.0 * step <= spread {
            let offset = 0.5 * (low + high);
            let bytes: Vec<u8> = values
                .iter()
                .map(|value| {
                    if value.is_finite() {
                        ((value - offset) / step).round().clamp(-32_767.0, 32_767.0) as i16
                    } else {
                        ABSENT
                    }
                })
                .flat_map(i16::to_le_bytes)
                .collect();
            return Self::Steps {
                o: offset,
                s: step,
                q: base64(&bytes),
            };
        }
        let bytes: Vec<u8> = values
            .iter()
            .map(|value| {
                if value.is_finite() {
                    *value as f32
                } else {
                    f32::NAN
                }
            })
            .flat_map(f32::to_le_bytes)
            .collect();
        Self::Floats { f: base64(&bytes) }
    }
}

/// Median distance from the median.
fn typical_spread(values: &mut [f64]) -> f64 {
    let middle = values.len() / 2;
    let median = *values.select_nth_unstable_by(middle, f64::total_cmp).1;
    for value in values.iter_mut() {
        *value = (*value - median).abs();
    }
    *values.select_nth_unstable_by(middle, f64::total_cmp).1
}

/// A line on the ground, as two columns.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(super) struct Line {
    /// How many points.
    n: usize,
    x: Column,
    y: Column,
}

impl Line {
    /// Through `points`, m.
    pub(super) fn of(points: &[[f64; 2]]) -> Self {
        let part = |axis: usize| points.iter().map(|p| p[axis]).collect::<Vec<_>>();
        Self {
            n: points.len(),
            x: Column::of(&part(0)),
            y: Column::of(&part(1)),
        }
    }
}

/// Leaves out points that lie within `tolerance` (m) of the line through those that stay; both ends stay.
pub(super) fn thinned(points: &[[f64; 2]], tolerance: f64) -> Vec<[f64; 2]> {
    /// Points that one leg may pass over: keeps the search linear.
    const REACH: usize = 64;
    let mut kept = Vec::new();
    let mut from = 0;
    while from < points.len() {
        kept.push(points[from]);
        let mut to = from + 1;
        while to + 1 < points.len()
            && to - from < REACH
            && points[from + 1..=to]
                .iter()
                .all(|p| distance(*p, points[from], points[to + 1]) <= tolerance)
        {
            to += 1;
        }
        from = to;
    }
    kept
}

/// From `p` to the line piece from `a` to `b`.
fn distance(p: [f64; 2], a: [f64; 2], b: [f64; 2]) -> f64 {
    let (ux, uy) = (b[0] - a[0], b[1] - a[1]);
    let (vx, vy) = (p[0] - a[0], p[1] - a[1]);
    let square = ux * ux + uy * uy;
    let share = if square > 0.0 {
        ((ux * vx + uy * vy) / square).clamp(0.0, 1.0)
    } else {
        0.0
    };
    (vx - share * ux).hypot(vy - share * uy)
}

/// Beliefs on one grid.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(super) struct BeliefSheet {
    width: usize,
    height: usize,
    resolution: f64,
    /// Lower left corner and yaw: x, y in m, rad.
    origin: [f64; 3],
    /// s.
    time: Vec<f64>,
    /// What changed since the belief before; before the first all is unknown.
    changes: Vec<String>,
}

/// Packs beliefs; where they take more than `budget` bytes, every second one is left out, and again.
pub(super) fn beliefs(all: &[BeliefTrace], budget: usize) -> Vec<BeliefSheet> {
    let mut every = 1;
    loop {
        let some: Vec<&BeliefTrace> = all.iter().rev().step_by(every).collect();
        let sheets = sheets(some.into_iter().rev());
        let size: usize = sheets
            .iter()
            .flat_map(|sheet| &sheet.changes)
            .map(String::len)
            .sum();
        if size <= budget || every > all.len() {
            return sheets;
        }
        every *= 2;
    }
}

fn sheets<'a>(beliefs: impl Iterator<Item = &'a BeliefTrace>) -> Vec<BeliefSheet> {
    let mut sheets: Vec<BeliefSheet> = Vec::new();
    let mut last: Vec<u8> = Vec::new();
    for belief in beliefs {
        let grid = &belief.grid;
        let origin = [
            grid.origin.position.x,
            grid.origin.position.y,
            grid.origin.heading,
        ];
        let fits = sheets.last().is_some_and(|sheet| {
            (sheet.width, sheet.height) == (grid.width, grid.height)
                && sheet.resolution == grid.resolution
                && sheet.origin == origin
        });
        if !fits {
            sheets.push(BeliefSheet {
                width: grid.width,
                height: grid.height,
                resolution: grid.resolution,
                origin,
                time: Vec::new(),
                changes: Vec::new(),
            });
            last = vec![0; grid.cells.len()];
        }
        let now = verdicts(grid);
        if let Some(sheet) = sheets.last_mut() {
            sheet.time.push(belief.time_s);
            sheet.changes.push(base64(&changes(&last, &now)));
        }
        last = now;
    }
    sheets
}

/// 0 unknown, 1 free, 2 occupied.
fn verdicts(grid: &OccupancyGrid) -> Vec<u8> {
    let verdict = |cell: &Cell| match cell {
        Cell::Unknown => 0,
        Cell::Free => 1,
        Cell::Occupied => 2,
    };
    grid.cells.iter().map(verdict).collect()
}

/// Runs of changed cells: how many stay, then `3 * length + verdict`, both as variable-length integers.
fn changes(last: &[u8], now: &[u8]) -> Vec<u8> {
    let mut bytes = Vec::new();
    let (mut at, mut written) = (0, 0);
    while at < now.len() {
        if now[at] == last[at] {
            at += 1;
            continue;
        }
        let from = at;
        while at < now.len() && now[at] == now[from] && now[at] != last[at] {
            at += 1;
        }
        put(&mut bytes, from - written);
        put(&mut bytes, 3 * (at - from) + usize::from(now[from]));
        written = at;
    }
    bytes
}

/// Seven bits a byte, the lowest first; the top bit says that more follow.
fn put(bytes: &mut Vec<u8>, mut number: usize) {
    while number >= 0x80 {
        bytes.push((number & 0x7f) as u8 | 0x80);
        number >>= 7;
    }
    bytes.push(number as u8);
}

/// Sweeps of the laser, some of them and some of their beams.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(super) struct Scans {
    /// Of each scan: its middle, s.
    time: Vec<f64>,
    /// Every so many-th scan of the recording is here.
    pub(super) every: usize,
    /// Of so many beams of a scan one is here.
    pub(super) every_beam: usize,
    /// Beams of each scan.
    beams: usize,
    /// Bearing of the first beam in the laser's frame, rad, and from one to the next.
    start: f64,
    step: f64,
    /// A range is so many m times its u16; 65 535 means that nothing came back.
    scale: f64,
    ranges: String,
}

/// Packs scans of equal beams, at most 361 beams of each: all scans where their text keeps to `most_bytes`, else every n-th.
pub(super) fn scans(all: &[ScanTrace], most_bytes: usize) -> Option<Scans> {
    const BEAMS: usize = 361;
    const NOTHING: u16 = u16::MAX;
    let first = all.iter().find(|scan| !scan.ranges.is_empty())?;
    let count = first.ranges.len();
    // The middle one of each group of beams.
    let every = count.div_ceil(BEAMS);
    let picked: Vec<usize> = (every / 2..count).step_by(every).collect();
    let alike: Vec<&ScanTrace> = all
        .iter()
        .filter(|scan| scan.ranges.len() == count && scan.start_angle == first.start_angle)
        .collect();
    // Two bytes a beam, and four letters for three bytes.
    let each = (8 * picked.len()).div_ceil(3);
    let of = alike.len();
    let step = (of * each).div_ceil(most_bytes.max(each)).max(1);
    let kept: Vec<&ScanTrace> = alike.into_iter().step_by(step).collect();
    let beams = || {
        kept.iter()
            .flat_map(|scan| picked.iter().map(|i| scan.ranges[*i]))
    };
    let longest = beams().filter(|it| it.is_finite()).fold(0.0, f64::max);
    let scale = if longest > 0.0 { longest / STEPS } else { 1.0 };
    let bytes: Vec<u8> = beams()
        .map(|range| {
            if range.is_finite() && range >= 0.0 {
                (range / scale).round() as u16
            } else {
                NOTHING
            }
        })
        .flat_map(u16::to_le_bytes)
        .collect();
    Some(Scans {
        time: kept.iter().map(|scan| scan.time_s).collect(),
        every: step,
        every_beam: every,
        beams: picked.len(),
        start: first.start_angle + first.angle_step * (every / 2) as f64,
        step: first.angle_step * every as f64,
        scale,
        ranges: base64(&bytes),
    })
}

/// What a page's script does with the texts, done here: the tests of both meet in the browser test.
#[cfg(test)]
pub(super) mod unpack {
    use super::{ABSENT, Column};

    pub fn base64(text: &str) -> Vec<u8> {
        let value = |c: u8| match c {
            b'A'..=b'Z' => c - b'A',
            b'a'..=b'z' => c - b'a' + 26,
            b'0'..=b'9' => c - b'0' + 52,
            b'+' => 62,
            _ => 63,
        };
        let mut bytes = Vec::new();
        for group in text.as_bytes().chunks(4) {
            let count = group.iter().filter(|c| **c != b'=').count();
            let word = group.iter().fold(0_u32, |word, c| {
                word << 6 | u32::from(if *c == b'=' { 0 } else { value(*c) })
            });
            bytes.extend_from_slice(&word.to_be_bytes()[1..count]);
        }
        bytes
    }

    pub fn column(column: &Column, count: usize) -> Vec<f64> {
        match column {
            Column::Constant { c } => vec![c.unwrap_or(f64::NAN); count],
            Column::Steps { o, s, q } => base64(q)
                .chunks_exact(2)
                .map(|it| i16::from_le_bytes([it[0], it[1]]))
                .map(|it| {
                    if it == ABSENT {
                        f64::NAN
                    } else {
                        o + s * f64::from(it)
                    }
                })
                .collect(),
            Column::Floats { f } => base64(f)
                .chunks_exact(4)
                .map(|it| f64::from(f32::from_le_bytes([it[0], it[1], it[2], it[3]])))
                .collect(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use bikebot_geometry::Pose2;
    use proptest::prelude::*;

    #[test]
    fn base64_is_the_usual_one() {
        // The test vectors of RFC 4648, section 10.
        for (bytes, text) in [
            ("", ""),
            ("f", "Zg=="),
            ("fo", "Zm8="),
            ("foo", "Zm9v"),
            ("foob", "Zm9vYg=="),
            ("fooba", "Zm9vYmE="),
            ("foobar", "Zm9vYmFy"),
        ] {
            assert_eq!(base64(bytes.as_bytes()), text);
            assert_eq!(unpack::base64(text), bytes.as_bytes());
        }
    }

    proptest! {
        #[test]
        fn a_column_comes_back_within_its_stated_precision(
            values in prop::collection::vec(prop_oneof![9 => -50.0..50.0_f64, 1 => Just(f64::NAN)], 1..200)
        ) {
            let column = Column::of(&values);
            let back = unpack::column(&column, values.len());
            let finite = values.iter().filter(|it| it.is_finite());
            let (low, high) = finite.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(*v), h.max(*v)));
            // Half a step, or half a unit in the last place of an f32.
            let within = 0.5 * ((high - low) / STEPS).max(6e-8 * high.abs().max(low.abs())) * 1.001;
            prop_assert_eq!(back.len(), values.len());
            for (value, back) in values.iter().zip(back) {
                if value.is_finite() {
                    prop_assert!((value - back).abs() <= within, "{} {}", value, back);
                } else {
                    prop_assert!(back.is_nan());
                }
            }
        }
    }

    #[test]
    fn a_spike_does_not_cost_the_quiet_part_its_detail() {
        let mut values: Vec<f64> = (0..1000).map(|i| 1e-3 * f64::from(i % 7)).collect();
        values[500] = 1e6;
        let column = Column::of(&values);
        assert!(matches!(column, Column::Floats { .. }));
        let back = unpack::column(&column, values.len());
        assert!(
            values
                .iter()
                .zip(&back)
                .all(|(v, b)| (v - b).abs() <= 6e-8 * v.abs())
        );
        let same = Column::of(&[2.5; 9]);
        assert_eq!(same, Column::Constant { c: Some(2.5) });
        assert_eq!(Column::of(&[f64::NAN; 3]), Column::Constant { c: None });
        assert_eq!(Column::of(&[]), Column::Constant { c: None });
    }

    #[test]
    fn a_thinned_line_stays_within_its_tolerance() {
        let line: Vec<[f64; 2]> = (0..=400)
            .map(|i| {
                let angle = 0.01 * f64::from(i);
                [3.0 * angle.cos(), 3.0 * angle.sin()]
            })
            .collect();
        let few = thinned(&line, 0.002);
        assert!(few.len() < line.len() / 4 && few.len() > 10);
        assert_eq!((few.first(), few.last()), (line.first(), line.last()));
        for point in &line {
            let off = few.windows(2).map(|it| distance(*point, it[0], it[1]));
            assert!(off.fold(f64::INFINITY, f64::min) <= 0.002 + 1e-12);
        }
        assert!(thinned(&[], 1.0).is_empty());
    }

    #[test]
    fn beliefs_come_back_from_their_changes() {
        let mut grid =
            OccupancyGrid::filled(30, 20, 0.5, Pose2::new(1.0, 2.0, 0.3), Cell::Unknown).unwrap();
        let mut all = Vec::new();
        for tick in 0..12_usize {
            for x in 0..2 * tick {
                grid.set(
                    x,
                    tick,
                    if x % 5 == 0 {
                        Cell::Occupied
                    } else {
                        Cell::Free
                    },
                );
            }
            // What was seen may be doubted again.
            grid.set(tick, 3, Cell::Unknown);
            all.push(BeliefTrace {
                time_s: 0.5 * tick as f64,
                grid: grid.clone(),
            });
        }
        let sheets = beliefs(&all, usize::MAX);
        let [sheet] = &sheets[..] else {
            panic!("one grid")
        };
        assert_eq!(sheet.time.len(), 12);
        let mut cells = vec![0_u8; 600];
        for (text, belief) in sheet.changes.iter().zip(&all) {
            let bytes = unpack::base64(text);
            let mut next = bytes.iter();
            let mut number = || {
                let (mut value, mut shift) = (0_usize, 0);
                loop {
                    let byte = *next.next()?;
                    value |= usize::from(byte & 0x7f) << shift;
                    shift += 7;
                    if byte < 0x80 {
                        return Some(value);
                    }
                }
            };
            let mut at = 0;
            while let (Some(skip), Some(run)) = (number(), number()) {
                at += skip;
                for cell in &mut cells[at..at + run / 3] {
                    *cell = (run % 3) as u8;
                }
                at += run / 3;
            }
            assert_eq!(cells, verdicts(&belief.grid));
        }
        // A budget leaves some out, never the last.
        let few = beliefs(&all, 60);
        assert!(few[0].time.len() < 12);
        assert_eq!(few[0].time.last(), Some(&5.5));
        assert!(beliefs(&[], 1).is_empty());
    }

    #[test]
    fn scans_keep_some_beams_where_they_were() {
        let all: Vec<ScanTrace> = (0..100)
            .map(|i| ScanTrace {
                time_s: 0.05 * f64::from(i),
                start_angle: -2.0,
                angle_step: 0.004,
                ranges: (0..1001)
                    .map(|beam| {
                        if beam % 10 == 0 {
                            f64::INFINITY
                        } else {
                            0.01 * f64::from(beam)
                        }
                    })
                    .collect(),
            })
            .collect();
        // 1001 beams in groups of three; all scans where there is room.
        let packed = scans(&all, 1_000_000).unwrap();
        assert_eq!((packed.beams, packed.time.len()), (334, 100));
        assert_eq!((packed.every, packed.every_beam), (1, 3));
        let few = scans(&all, 25 * 891).unwrap();
        assert_eq!((few.every, few.time.len()), (4, 25));
        assert!(few.ranges.len() <= 25 * 891);
        let one = scans(&all, 0).unwrap();
        assert_eq!(one.time.len(), 1);
        let bytes = unpack::base64(&packed.ranges);
        assert_eq!(bytes.len(), 2 * 334 * 100);
        for (index, pair) in bytes.chunks_exact(2).take(334).enumerate() {
            let beam = 1 + 3 * index;
            let angle = packed.start + packed.step * index as f64;
            assert!((angle - (-2.0 + 0.004 * beam as f64)).abs() < 1e-12);
            let code = u16::from_le_bytes([pair[0], pair[1]]);
            let wanted = all[0].ranges[beam];
            if wanted.is_finite() {
                assert!((packed.scale * f64::from(code) - wanted).abs() <= packed.scale);
            } else {
                assert_eq!(code, u16::MAX);
            }
        }
        assert!(scans(&[], 10).is_none());
    }
}

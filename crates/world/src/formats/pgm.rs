//! PGM images: P2 (plain) and P5 (binary), 8 or 16 bits, comments in the header.

use super::error::{MapError, MapProblem, quoted};
use super::image::{Image, check_size};

pub(crate) fn decode(name: &str, bytes: &[u8]) -> Result<Image, MapError> {
    let magic = &bytes[..bytes.len().min(2)];
    let binary = match magic {
        b"P2" => false,
        b"P5" => true,
        other => {
            return Err(MapError::at_line(
                name,
                1,
                MapProblem::Unsupported {
                    found: format!("a {} image", String::from_utf8_lossy(other)),
                    instead: "save it as a grey PGM (P5 or P2)",
                },
            ));
        }
    };
    let mut tokens = Tokens {
        name,
        bytes,
        at: 2,
        line: 1,
    };
    let width = tokens.number("the width")?;
    let height = tokens.number("the height")?;
    let maximum = tokens.number("the largest grey value")?;
    check_size(name, width, height)?;
    if !(1..=65_535).contains(&maximum) {
        return Err(MapError::at_line(
            name,
            tokens.line,
            MapProblem::Malformed {
                found: format!("a largest grey value of {maximum}"),
                expected: "1 to 65535".into(),
            },
        ));
    }
    let maximum = maximum as u32;
    let widen = |v: u32| ((v * 65_535 + maximum / 2) / maximum) as u16;
    let count = (width * height) as usize;
    let (width, height) = (width as usize, height as usize);
    let too_bright = |line: Option<usize>, index: usize, v: u32| MapError {
        line,
        ..MapError::new(
            name,
            MapProblem::Malformed {
                found: format!(
                    "grey value {v} at column {}, row {}",
                    index % width + 1,
                    index / width + 1
                ),
                expected: format!("at most {maximum}, as the header says"),
            },
        )
    };
    let mut shade = Vec::with_capacity(count.min(bytes.len()));
    if binary {
        // Exactly one white space character separates the header from the raster.
        let raster = bytes.get(tokens.at + 1..).unwrap_or_default();
        let depth = if maximum > 255 { 2 } else { 1 };
        if raster.len() < count * depth {
            return Err(MapError::new(
                name,
                MapProblem::Short {
                    what: "pixels",
                    expected: (count * depth) as u64,
                    found: raster.len() as u64,
                },
            ));
        }
        for (index, pixel) in raster.chunks_exact(depth).take(count).enumerate() {
            let v = match pixel {
                [high, low] => u32::from(*high) << 8 | u32::from(*low),
                [v] => u32::from(*v),
                _ => 0,
            };
            if v > maximum {
                return Err(too_bright(None, index, v));
            }
            shade.push(widen(v));
        }
    } else {
        for index in 0..count {
            let Some(token) = tokens.next() else {
                return Err(MapError::at_line(
                    name,
                    tokens.line,
                    MapProblem::Malformed {
                        found: format!("{index} grey values"),
                        expected: format!("{count}, {width} x {height} as the header says"),
                    },
                ));
            };
            let v = tokens.parse(token, "a grey value")?;
            if v > u64::from(maximum) {
                let shown = v.min(u64::from(u32::MAX)) as u32;
                return Err(too_bright(Some(tokens.line), index, shown));
            }
            shade.push(widen(v as u32));
        }
    }
    Ok(Image {
        width,
        height,
        shade,
        transparent: Vec::new(),
    })
}

/// White-space separated words, comments skipped.
struct Tokens<'a> {
    name: &'a str,
    bytes: &'a [u8],
    at: usize,
    line: usize,
}

impl<'a> Tokens<'a> {
    fn next(&mut self) -> Option<&'a [u8]> {
        loop {
            match self.bytes.get(self.at)? {
                b'\n' => {
                    self.line += 1;
                    self.at += 1;
                }
                b'#' => {
                    while self.bytes.get(self.at).is_some_and(|b| *b != b'\n') {
                        self.at += 1;
                    }
                }
                b if b.is_ascii_whitespace() => self.at += 1,
                _ => break,
            }
        }
        let start = self.at;
        while self
            .bytes
            .get(self.at)
            .is_some_and(|b| !b.is_ascii_whitespace() && *b != b'#')
        {
            self.at += 1;
        }
        Some(&self.bytes[start..self.at])
    }

    fn parse(&self, token: &[u8], what: &str) -> Result<u64, MapError> {
        let text = String::from_utf8_lossy(&token[..token.len().min(64)]);
        if token.iter().all(u8::is_ascii_digit)
            && let Ok(v) = text.parse()
        {
            return Ok(v);
        }
        Err(MapError::at_line(
            self.name,
            self.line,
            MapProblem::Malformed {
                found: quoted(&text),
                expected: format!("{what}, a whole number"),
            },
        ))
    }

    fn number(&mut self, what: &str) -> Result<u64, MapError> {
        match self.next() {
            // A number far beyond any size only has to stay beyond it.
            Some(token) => self.parse(token, what).map(|v| v.min(u64::from(u32::MAX))),
            None => Err(MapError::at_line(
                self.name,
                self.line,
                MapProblem::Malformed {
                    found: "the end of the file".into(),
                    expected: format!("{what}, a whole number"),
                },
            )),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn plain_and_binary_of_either_depth_read_alike() {
        let plain = decode(
            "m",
            b"P2 # a comment\n2 2 # another\n255\n0 255\n# more\n205 1\n",
        );
        let binary = decode("m", b"P5\n# c\n2 2\n255\n\x00\xff\xcd\x01");
        let deep = decode("m", b"P5 2 2 65535\n\x00\x00\xff\xff\xcd\xcd\x01\x01");
        let expected = vec![0, 65_535, 205 * 257, 257];
        for image in [plain, binary, deep] {
            let image = image.expect("valid");
            assert_eq!((image.width, image.height), (2, 2));
            assert_eq!(image.shade, expected);
        }
        let narrow = decode("m", b"P2 3 1 2 0 1 2").expect("valid");
        assert_eq!(narrow.shade, [0, 32_768, 65_535]);
    }

    #[test]
    fn short_and_absurd_files_are_refused_with_counts() {
        let short = decode("m.pgm", b"P5 4 4 255\n123").expect_err("short");
        assert_eq!(
            short.problem,
            MapProblem::Short {
                what: "pixels",
                expected: 16,
                found: 3
            }
        );
        for absurd in [
            &b"P5 2147483648 2147483648 255\n"[..],
            b"P5 99999999999999999999 1 255\n",
            b"P5 16385 1 255\n",
            b"P5 16384 16384 255\n",
            b"P5 0 4 255\n",
            b"P5 4 -4 255\n",
            b"P5 4 4 0\n",
            b"P5 4 4 65536\n",
            b"P5 4",
            b"P2 2 1 255 7",
            b"P2 2 1 255 7 x",
            b"P2 2 1 9 7 10",
            b"P5 2 1 9\n\x07\x0a",
            b"P6 1 1 255\n123",
        ] {
            assert!(decode("m.pgm", absurd).is_err(), "{absurd:?}");
        }
        let late = decode("m.pgm", b"P2\n2 2\n255\n1 2\n3 zebra\n").expect_err("a word");
        assert_eq!(late.line, Some(5));
    }
}

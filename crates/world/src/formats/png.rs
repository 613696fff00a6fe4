//! PNG images of every colour type, 1 to 16 bits.

use std::io::Cursor;

use ::png::{ColorType, Decoder, DecodingError, Limits, Reader, Transformations};

use super::error::{MapError, MapProblem, shorten};
use super::image::{Image, check_size, mean, widen};

/// Memory (bytes) the decoder may use beside our own rows; ancillary chunks count against it.
const DECODER_BYTES: usize = 16 * 1024 * 1024;

/// Largest picture (bytes) of an interlaced file, which must be held whole.
const INTERLACED_BYTES: usize = 128 * 1024 * 1024;

pub(crate) fn decode(name: &str, bytes: &[u8]) -> Result<Image, MapError> {
    // The header is read by hand first, so that no decoder sees an absurd size.
    let header: &[u8; 33] = bytes.first_chunk().ok_or_else(|| {
        MapError::new(
            name,
            MapProblem::Short {
                what: "PNG header",
                expected: 33,
                found: bytes.len() as u64,
            },
        )
    })?;
    if &header[1..4] != b"PNG" || &header[12..16] != b"IHDR" {
        return Err(malformed(name, "no PNG header (IHDR) at its place".into()));
    }
    let number = |at: usize| {
        u64::from(u32::from_be_bytes([
            header[at],
            header[at + 1],
            header[at + 2],
            header[at + 3],
        ]))
    };
    let (width, height) = (number(16), number(20));
    check_size(name, width, height)?;
    let (width, height) = (width as usize, height as usize);

    let limits = Limits {
        bytes: DECODER_BYTES,
    };
    let mut decoder = Decoder::new_with_limits(Cursor::new(bytes), limits);
    decoder.set_ignore_text_chunk(true);
    decoder.set_ignore_iccp_chunk(true);
    // Palettes and fewer than 8 bits become plain channels; tRNS becomes alpha.
    decoder.set_transformations(Transformations::EXPAND);
    let mut reader = decoder
        .read_info()
        .map_err(|e| failed(name, &e, 0, height))?;
    if reader.info().is_animated() {
        return Err(MapError::new(
            name,
            MapProblem::Unsupported {
                found: "an animated PNG".into(),
                instead: "save a single picture",
            },
        ));
    }
    let (colour, depth) = reader.output_color_type();
    let mut image = Image {
        width,
        height,
        shade: Vec::new(),
        transparent: Vec::new(),
    };
    let layout = Layout {
        channels: colour.samples(),
        colour: matches!(colour, ColorType::Rgb | ColorType::Rgba),
        alpha: matches!(colour, ColorType::Rgba | ColorType::GrayscaleAlpha),
        deep: depth == ::png::BitDepth::Sixteen,
    };
    let row_bytes = width * layout.channels * if layout.deep { 2 } else { 1 };
    if reader.info().interlaced {
        interlaced(name, &mut reader, row_bytes, &layout, &mut image)?;
    } else {
        for row in 0..height {
            let data = match reader.next_row() {
                Ok(Some(data)) if data.data().len() == row_bytes => data,
                Ok(_) => return Err(malformed(name, format!("{row} of {height} rows"))),
                Err(e) => return Err(failed(name, &e, row, height)),
            };
            layout.append(data.data(), &mut image);
        }
    }
    if !image.transparent.contains(&true) {
        image.transparent = Vec::new();
    }
    Ok(image)
}

fn interlaced(
    name: &str,
    reader: &mut Reader<Cursor<&[u8]>>,
    row_bytes: usize,
    layout: &Layout,
    image: &mut Image,
) -> Result<(), MapError> {
    let wanted = row_bytes * image.height;
    if wanted > INTERLACED_BYTES || reader.output_buffer_size() != Some(wanted) {
        return Err(MapError::new(
            name,
            MapProblem::Unsupported {
                found: format!("an interlaced PNG of {wanted} bytes"),
                instead: "save it without interlacing",
            },
        ));
    }
    let mut picture = vec![0; wanted];
    reader
        .next_frame(&mut picture)
        .map_err(|e| failed(name, &e, 0, image.height))?;
    for row in picture.chunks_exact(row_bytes) {
        layout.append(row, image);
    }
    Ok(())
}

/// Where the channels of a decoded row are.
struct Layout {
    channels: usize,
    colour: bool,
    alpha: bool,
    deep: bool,
}

impl Layout {
    fn append(&self, row: &[u8], image: &mut Image) {
        let sample = |pixel: &[u8], channel: usize| {
            if self.deep {
                u16::from_be_bytes([pixel[2 * channel], pixel[2 * channel + 1]])
            } else {
                widen(pixel[channel])
            }
        };
        let stride = self.channels * if self.deep { 2 } else { 1 };
        for pixel in row.chunks_exact(stride) {
            image.shade.push(if self.colour {
                mean(sample(pixel, 0), sample(pixel, 1), sample(pixel, 2))
            } else {
                sample(pixel, 0)
            });
            if self.alpha {
                let opaque = sample(pixel, self.channels - 1) == u16::MAX;
                image.transparent.push(!opaque);
            }
        }
    }
}

fn malformed(name: &str, found: String) -> MapError {
    MapError::new(
        name,
        MapProblem::Malformed {
            found,
            expected: "a whole PNG image".into(),
        },
    )
}

fn failed(name: &str, error: &DecodingError, rows: usize, height: usize) -> MapError {
    match error {
        DecodingError::LimitsExceeded => MapError::new(
            name,
            MapProblem::Unsupported {
                found: "a PNG whose chunks need more than 16 MiB beside the picture".into(),
                instead: "save it without metadata",
            },
        ),
        other => malformed(
            name,
            format!(
                "{} after {rows} of {height} rows",
                shorten(&other.to_string())
            ),
        ),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A chunk with its checksum (CRC-32, bit by bit).
    fn chunk(kind: &[u8; 4], data: &[u8]) -> Vec<u8> {
        let mut crc = u32::MAX;
        for byte in kind.iter().chain(data) {
            crc ^= u32::from(*byte);
            for _ in 0..8 {
                crc = (crc >> 1) ^ (0xEDB8_8320 & (crc & 1).wrapping_neg());
            }
        }
        let mut out = (data.len() as u32).to_be_bytes().to_vec();
        out.extend(kind);
        out.extend(data);
        out.extend((!crc).to_be_bytes());
        out
    }

    fn header(width: u32, height: u32) -> Vec<u8> {
        let mut file = b"\x89PNG\r\n\x1a\n".to_vec();
        let mut ihdr = width.to_be_bytes().to_vec();
        ihdr.extend(height.to_be_bytes());
        ihdr.extend([8, 0, 0, 0, 0]);
        file.extend(chunk(b"IHDR", &ihdr));
        file
    }

    #[test]
    fn a_tiny_file_that_claims_a_gigabyte_is_refused() {
        for (w, h) in [(1 << 30, 1), (32_768, 32_768), (0, 1), (u32::MAX, u32::MAX)] {
            let mut file = header(w, h);
            file.extend(chunk(b"IDAT", b"\x78\x9c\x03\x00\x00\x00\x00\x01"));
            assert!(decode("m.png", &file).is_err());
        }
    }

    #[test]
    fn a_bomb_in_an_ancillary_chunk_does_no_harm() {
        // zlib stream of zeros claimed compressed text: whatever it holds is not inflated.
        let mut file = header(1, 1);
        let mut text = b"k\0\x01\0\0\0".to_vec();
        text.extend(std::iter::repeat_n(0x55, 1_000));
        file.extend(chunk(b"iTXt", &text));
        file.extend(chunk(
            b"IDAT",
            b"\x78\x01\x01\x02\x00\xfd\xff\x00\xff\x01\x01\x01\x00",
        ));
        file.extend(chunk(b"IEND", b""));
        let _ = decode("m.png", &file);
    }

    #[test]
    fn a_picture_cut_short_says_after_how_many_rows() {
        let mut file = header(4, 4);
        file.extend(chunk(
            b"IDAT",
            b"\x78\x01\x01\x05\x00\xfa\xff\x00\x01\x02\x03\x04",
        ));
        let error = decode("m.png", &file).expect_err("cut");
        assert!(error.to_string().contains("rows"), "{error}");
        assert!(decode("m.png", &file[..20]).is_err());
    }
}

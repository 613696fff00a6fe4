//! Uncompressed BMP images of 1, 8, 24 or 32 bits.

use super::error::{MapError, MapProblem};
use super::image::{Image, check_size, mean, widen};

/// The channel masks of the common 32-bit layout: blue, green, red, then a byte that is not used.
const BGR_MASKS: [u32; 3] = [0x00FF_0000, 0x0000_FF00, 0x0000_00FF];

pub(crate) fn decode(name: &str, bytes: &[u8]) -> Result<Image, MapError> {
    let short = |what, expected: usize| {
        MapError::new(
            name,
            MapProblem::Short {
                what,
                expected: expected as u64,
                found: bytes.len() as u64,
            },
        )
    };
    let unsupported =
        |found: String, instead| MapError::new(name, MapProblem::Unsupported { found, instead });
    if bytes.len() < 54 {
        return Err(short("BMP header", 54));
    }
    let u16_at = |at: usize| u16::from_le_bytes([bytes[at], bytes[at + 1]]);
    let u32_at =
        |at: usize| u32::from_le_bytes([bytes[at], bytes[at + 1], bytes[at + 2], bytes[at + 3]]);
    let pixels_at = u32_at(10) as usize;
    let header = u32_at(14) as usize;
    if !(40..=124).contains(&header) {
        return Err(unsupported(
            format!("a BMP with a header of {header} bytes"),
            "save it as a Windows BMP (version 3 or later)",
        ));
    }
    let (width, height) = (u32_at(18) as i32, u32_at(22) as i32);
    let top_down = height < 0;
    if width < 0 {
        return Err(unsupported(
            format!("a BMP of width {width}"),
            "save it as a Windows BMP",
        ));
    }
    check_size(
        name,
        u64::from(width.unsigned_abs()),
        u64::from(height.unsigned_abs()),
    )?;
    let (width, height) = (width as usize, height.unsigned_abs() as usize);
    let bits = usize::from(u16_at(28));
    if !matches!(bits, 1 | 8 | 24 | 32) {
        return Err(unsupported(
            format!("a BMP of {bits} bits per pixel"),
            "save it with 1, 8, 24 or 32 bits",
        ));
    }
    match u32_at(30) {
        0 => {}
        3 if bits == 32 => {
            if bytes.len() < 66 {
                return Err(short("BMP channel masks", 66));
            }
            if [u32_at(54), u32_at(58), u32_at(62)] != BGR_MASKS {
                return Err(unsupported(
                    "a BMP with unusual channel masks".into(),
                    "save it with 8 bits each for red, green and blue",
                ));
            }
        }
        1 | 2 => {
            return Err(unsupported(
                "a run-length encoded BMP".into(),
                "save it without compression",
            ));
        }
        other => {
            return Err(unsupported(
                format!("BMP compression {other}"),
                "save it without compression",
            ));
        }
    }

    let palette = if bits <= 8 {
        let most = 1_usize << bits;
        let count = match u32_at(46) as usize {
            0 => most,
            n => n.min(most),
        };
        let start = 14 + header;
        let end = start + 4 * count;
        let entries = bytes
            .get(start..end)
            .ok_or_else(|| short("BMP palette", end))?;
        entries
            .chunks_exact(4)
            .map(|c| mean(widen(c[2]), widen(c[1]), widen(c[0])))
            .collect()
    } else {
        Vec::new()
    };

    // Rows are padded to a multiple of four bytes.
    let stride = (width * bits).div_ceil(32) * 4;
    let end = pixels_at.saturating_add(stride * height);
    let raster = bytes
        .get(pixels_at..end)
        .ok_or_else(|| short("BMP up to the last pixel", end))?;
    let mut shade = Vec::with_capacity(width * height);
    for row in 0..height {
        let stored = if top_down { row } else { height - 1 - row };
        let line = &raster[stored * stride..(stored + 1) * stride];
        for x in 0..width {
            shade.push(match bits {
                24 | 32 => {
                    let at = x * bits / 8;
                    mean(widen(line[at + 2]), widen(line[at + 1]), widen(line[at]))
                }
                _ => {
                    let index = if bits == 8 {
                        usize::from(line[x])
                    } else {
                        usize::from(line[x / 8] >> (7 - x % 8) & 1)
                    };
                    *palette.get(index).ok_or_else(|| {
                        MapError::new(
                            name,
                            MapProblem::Malformed {
                                found: format!(
                                    "palette entry {index} at column {}, row {}",
                                    x + 1,
                                    row + 1
                                ),
                                expected: format!("one of the {} entries there are", palette.len()),
                            },
                        )
                    })?
                }
            });
        }
    }
    Ok(Image {
        width,
        height,
        shade,
        // The fourth byte of a 32-bit pixel is reserved; programs leave anything in it.
        transparent: Vec::new(),
    })
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;

    /// A BMP file; `rows` in stored order, each already padded.
    pub(crate) fn bmp(
        width: i32,
        height: i32,
        bits: u16,
        compression: u32,
        extra: &[u8],
        rows: &[u8],
    ) -> Vec<u8> {
        let start = 54 + extra.len() as u32;
        let mut file = b"BM".to_vec();
        file.extend((start + rows.len() as u32).to_le_bytes());
        file.extend([0; 4]);
        file.extend(start.to_le_bytes());
        file.extend(40_u32.to_le_bytes());
        file.extend(width.to_le_bytes());
        file.extend(height.to_le_bytes());
        file.extend(1_u16.to_le_bytes());
        file.extend(bits.to_le_bytes());
        file.extend(compression.to_le_bytes());
        file.extend((rows.len() as u32).to_le_bytes());
        file.extend([0; 8]);
        let colours = if bits <= 8 { extra.len() as u32 / 4 } else { 0 };
        file.extend(colours.to_le_bytes());
        file.extend([0; 4]);
        file.extend(extra);
        file.extend(rows);
        file
    }

    #[test]
    fn every_depth_and_row_order_reads_the_same_picture() {
        // Top row black white white, bottom row white black white.
        let expected = vec![0, 65_535, 65_535, 65_535, 0, 65_535];
        let two = [0, 0, 0, 0, 255, 255, 255, 0];
        let one_bit = bmp(
            3,
            2,
            1,
            0,
            &two,
            &[0b1010_0000, 0, 0, 0, 0b0110_0000, 0, 0, 0],
        );
        let eight = bmp(3, 2, 8, 0, &two, &[1, 0, 1, 0, 0, 1, 1, 0]);
        let down = bmp(3, -2, 8, 0, &two, &[0, 1, 1, 0, 1, 0, 1, 0]);
        let (w, k) = ([255_u8; 3], [0_u8; 3]);
        let pad = [0; 3];
        let deep = [&w[..], &k, &w, &pad, &k, &w, &w, &pad].concat();
        let deep = bmp(3, 2, 24, 0, &[], &deep);
        let wide: Vec<u8> = [w, k, w, k, w, w]
            .iter()
            .flat_map(|c| [c[0], c[1], c[2], 7])
            .collect();
        let masks: Vec<u8> = BGR_MASKS.iter().flat_map(|m| m.to_le_bytes()).collect();
        let masked = bmp(3, 2, 32, 3, &masks, &wide);
        let wide = bmp(3, 2, 32, 0, &[], &wide);
        for file in [one_bit, eight, down, deep, wide, masked] {
            let image = decode("m.bmp", &file).expect("valid");
            assert_eq!((image.width, image.height), (3, 2));
            assert_eq!(image.shade, expected);
        }
    }

    #[test]
    fn compressed_absurd_and_short_bitmaps_are_refused() {
        for file in [
            bmp(3, 2, 8, 1, &[], &[0; 8]),
            bmp(3, 2, 4, 2, &[], &[0; 8]),
            bmp(3, 2, 16, 0, &[], &[0; 16]),
            bmp(i32::MAX, i32::MAX, 24, 0, &[], &[]),
            bmp(3, i32::MIN, 24, 0, &[], &[]),
            bmp(-3, 2, 24, 0, &[], &[0; 24]),
            bmp(3, 2, 24, 0, &[], &[0; 23]),
            bmp(3, 2, 8, 0, &[0, 0, 0, 0], &[1; 8]),
            bmp(0, 2, 8, 0, &[], &[]),
            b"BM".to_vec(),
        ] {
            assert!(decode("m.bmp", &file).is_err());
        }
    }
}

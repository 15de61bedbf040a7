//! Images: PNG and PGM as pixels of lightness and opacity.
//!
//! Which of both it is, the first bytes say and not the name of the file. What the header announces is looked at before
//! anything of its size is allocated, and a decoder gets no more memory than a map may take.

use axle_schema::Refusal;
use axle_schema::map::{MAX_CELLS, check_size};

/// The most bytes of an image file.
pub const MAX_BYTES: usize = 128 * 1024 * 1024;

/// An image, row by row from the uppermost one.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Image {
    /// Pixels of a row.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Lightness and opacity of each pixel, 0 to 255.
    pub pixels: Vec<(u8, u8)>,
}

/// Reads a PNG or PGM file.
///
/// # Errors
/// Says what it is not, or what is wrong with it.
pub fn read(bytes: &[u8]) -> Result<Image, Refusal> {
    if bytes.len() > MAX_BYTES {
        let what = "image of a map in bytes".into();
        return Err(Refusal::TooLarge { what, got: bytes.len() as u64, limit: MAX_BYTES as u64 });
    }
    if bytes.starts_with(b"\x89PNG\r\n\x1a\n") {
        read_png(bytes)
    } else if bytes.starts_with(b"P5") || bytes.starts_with(b"P2") {
        read_pgm(bytes)
    } else {
        let first: Vec<u8> = bytes.iter().take(4).copied().collect();
        Err(Refusal::malformed(
            "image of a map",
            format_args!("it is neither PNG nor PGM; it begins with {first:02x?}"),
        ))
    }
}

fn read_png(bytes: &[u8]) -> Result<Image, Refusal> {
    let wrong =
        |fault: png::DecodingError| Refusal::malformed("image of a map", format_args!("PNG: {fault}"));
    // Memory for the rows of the largest map, at 16 bits and four channels.
    let limits = png::Limits { bytes: MAX_CELLS * 8 + (1 << 20) };
    let mut decoder = png::Decoder::new_with_limits(std::io::Cursor::new(bytes), limits);
    let (width, height) = {
        let header = decoder.read_header_info().map_err(wrong)?;
        (header.width, header.height)
    };
    check_size(u64::from(width), u64::from(height))?;
    // Palettes become colours, few bits become eight, and sixteen become eight.
    decoder.set_transformations(png::Transformations::normalize_to_color8());
    let mut reader = decoder.read_info().map_err(wrong)?;
    let size = reader
        .output_buffer_size()
        .filter(|&size| size <= MAX_CELLS * 4)
        .ok_or_else(|| Refusal::malformed("image of a map", "PNG: its rows do not fit into memory"))?;
    let mut buffer = vec![0; size];
    let frame = reader.next_frame(&mut buffer).map_err(wrong)?;
    let pixels: Vec<(u8, u8)> = match frame.color_type {
        png::ColorType::Grayscale => buffer.iter().map(|&light| (light, 255)).collect(),
        png::ColorType::GrayscaleAlpha => buffer.chunks_exact(2).map(|p| (p[0], p[1])).collect(),
        png::ColorType::Rgb => buffer.chunks_exact(3).map(|p| (mean(p), 255)).collect(),
        png::ColorType::Rgba => buffer.chunks_exact(4).map(|p| (mean(&p[..3]), p[3])).collect(),
        png::ColorType::Indexed => {
            return Err(Refusal::malformed("image of a map", "PNG: its palette cannot be read"));
        }
    };
    let (width, height) = (width as usize, height as usize);
    if pixels.len() < width * height {
        return Err(Refusal::malformed("image of a map", "PNG: rows are missing"));
    }
    Ok(Image { width, height, pixels })
}

/// The lightness of a colour, as map_server takes it: the mean of red, green and blue.
fn mean(colours: &[u8]) -> u8 {
    let sum: u32 = colours.iter().map(|&colour| u32::from(colour)).sum();
    u8::try_from(sum / 3).unwrap_or(u8::MAX)
}

/// Portable grey map: "P5" with bytes or "P2" with words; width, height, the value of white, the pixels.
fn read_pgm(bytes: &[u8]) -> Result<Image, Refusal> {
    let wrong = |why: &str| Refusal::malformed("image of a map", format_args!("PGM: {why}"));
    let is_plain = bytes.starts_with(b"P2");
    let mut rest = bytes.get(2..).unwrap_or_default();
    let mut header = [0_u32; 3];
    for (value, name) in header.iter_mut().zip(["width", "height", "value of white"]) {
        *value = word(&mut rest).ok_or_else(|| wrong(&format!("its {name} is not a number")))?;
    }
    let [width, height, white] = header;
    check_size(u64::from(width), u64::from(height))?;
    if !(1..=65_535).contains(&white) {
        return Err(Refusal::out_of_range("value of white of a PGM", white, "1 to 65535"));
    }
    let (width, height) = (width as usize, height as usize);
    let lightness =
        |value: u32| (value <= white).then(|| u8::try_from(value * 255 / white).unwrap_or(u8::MAX));
    let dark = || wrong("a pixel is lighter than white");
    let mut pixels = Vec::with_capacity(width * height);
    if is_plain {
        for index in 0..width * height {
            let value = word(&mut rest)
                .ok_or_else(|| wrong(&format!("it ends after {index} of {} pixels", width * height)))?;
            pixels.push((lightness(value).ok_or_else(dark)?, 255));
        }
    } else {
        // One blank stands between the header and the bytes.
        let data = rest.split_first().filter(|(blank, _)| blank.is_ascii_whitespace()).map(|(_, data)| data);
        let data = data.ok_or_else(|| wrong("no blank stands behind its header"))?;
        let size = if white < 256 { 1 } else { 2 };
        if data.len() < width * height * size {
            let has = data.len() / size;
            return Err(wrong(&format!("it ends after {has} of {} pixels", width * height)));
        }
        for pixel in data.chunks_exact(size).take(width * height) {
            let value = pixel.iter().fold(0, |value, &byte| value * 256 + u32::from(byte));
            pixels.push((lightness(value).ok_or_else(dark)?, 255));
        }
    }
    Ok(Image { width, height, pixels })
}

/// The next number behind blanks and comments.
fn word(rest: &mut &[u8]) -> Option<u32> {
    loop {
        match rest.first()? {
            byte if byte.is_ascii_whitespace() => *rest = rest.get(1..)?,
            b'#' => {
                let end = rest.iter().position(|&byte| byte == b'\n')?;
                *rest = rest.get(end..)?;
            }
            _ => break,
        }
    }
    let length = rest.iter().position(|byte| !byte.is_ascii_digit()).unwrap_or(rest.len());
    let (digits, after) = rest.split_at_checked(length)?;
    *rest = after;
    std::str::from_utf8(digits).ok()?.parse().ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn refused(bytes: &[u8], words: &str) {
        let refusal = read(bytes).expect_err(words).to_string();
        assert!(refusal.contains(words), "{refusal:?} does not say {words:?}");
    }

    /// A PNG of the given kind.
    fn png(colour: png::ColorType, depth: png::BitDepth, width: u32, data: &[u8], palette: &[u8]) -> Vec<u8> {
        let mut bytes = Vec::new();
        let mut encoder = png::Encoder::new(&mut bytes, width, 1);
        encoder.set_color(colour);
        encoder.set_depth(depth);
        if !palette.is_empty() {
            encoder.set_palette(palette.to_vec());
        }
        let mut writer = encoder.write_header().expect("a header");
        writer.write_image_data(data).expect("rows");
        writer.finish().expect("an end");
        bytes
    }

    #[test]
    fn every_kind_of_png_becomes_lightness() {
        use png::{BitDepth::*, ColorType::*};
        let check =
            |bytes: &[u8], pixels: &[(u8, u8)]| assert_eq!(read(bytes).expect("an image").pixels, pixels);
        check(&png(Grayscale, Eight, 3, &[0, 205, 254], &[]), &[(0, 255), (205, 255), (254, 255)]);
        check(&png(Grayscale, One, 3, &[0b1010_0000], &[]), &[(255, 255), (0, 255), (255, 255)]);
        check(&png(Grayscale, Sixteen, 1, &[205, 17], &[]), &[(205, 255)]);
        check(&png(GrayscaleAlpha, Eight, 1, &[9, 0], &[]), &[(9, 0)]);
        check(&png(Rgb, Eight, 1, &[30, 60, 90], &[]), &[(60, 255)]);
        check(&png(Rgba, Eight, 1, &[255, 255, 255, 128], &[]), &[(255, 128)]);
        check(&png(Indexed, Eight, 2, &[1, 0], &[0, 0, 0, 3, 3, 3]), &[(3, 255), (0, 255)]);
    }

    #[test]
    fn both_kinds_of_pgm_are_read() {
        let check = |bytes: &[u8], pixels: &[u8]| {
            let image = read(bytes).expect("an image");
            assert_eq!((image.width, image.height), (2, 1));
            assert_eq!(image.pixels.iter().map(|pixel| pixel.0).collect::<Vec<_>>(), pixels);
        };
        check(b"P5\n# made by hand\n2 1\n255\n\x00\xcd", &[0, 205]);
        check(b"P5 2 1 65535\n\x00\x00\xff\xff", &[0, 255]);
        check(b"P2\n2 1\n#c\n15\n0 15\n", &[0, 255]);
    }

    #[test]
    fn what_is_no_image_is_refused_with_the_reason() {
        refused(b"GIF89a", "neither PNG nor PGM; it begins with [47, 49, 46, 38]");
        refused(b"", "neither PNG nor PGM");
        refused(b"P5\n2 x\n255\n", "its height is not a number");
        refused(b"P5\n2 1\n255\n\x00", "it ends after 1 of 2 pixels");
        refused(b"P2\n2 1\n255\n0", "it ends after 1 of 2 pixels");
        refused(b"P2\n2 1\n15\n0 16", "a pixel is lighter than white");
        refused(b"P5\n2 1\n0\n\x00\x00", "value of white");
        refused(b"P5\n0 1\n255\n", "width of a map in cells is out of range: 0");
        refused(b"P5 99999999999 1 255\n", "its width is not a number");
        refused(b"P5 20000 20000 255\n", "map of 20000 x 20000 cells is too large: 400000000");
        refused(b"\x89PNG\r\n\x1a\nnothing", "PNG:");
        let whole = png(png::ColorType::Grayscale, png::BitDepth::Eight, 3, &[0, 1, 2], &[]);
        for end in 8..whole.len() {
            // The chunk that ends the file may be missing; nothing else.
            if let Ok(image) = read(&whole[..end]) {
                assert!(end + 12 >= whole.len() && image.pixels.len() == 3, "{end} of {} bytes", whole.len());
            }
        }
    }

    #[test]
    fn a_png_that_announces_too_much_is_refused_by_its_header() {
        let mut bytes = png(png::ColorType::Grayscale, png::BitDepth::Eight, 3, &[0, 1, 2], &[]);
        bytes[16..24].copy_from_slice(&[0, 0, 0x4e, 0x20, 0, 0, 0x4e, 0x20]);
        let crc = crc(&bytes[12..29]);
        bytes[29..33].copy_from_slice(&crc.to_be_bytes());
        refused(&bytes, "map of 20000 x 20000 cells is too large: 400000000");
    }

    /// The checksum of a chunk, as PNG has it.
    fn crc(bytes: &[u8]) -> u32 {
        !bytes.iter().fold(!0_u32, |crc, &byte| {
            (0..8)
                .fold(crc ^ u32::from(byte), |c, _| if c & 1 == 1 { 0xedb8_8320 ^ (c >> 1) } else { c >> 1 })
        })
    }
}

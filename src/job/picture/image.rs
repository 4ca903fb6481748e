//! A finished picture, as PNG and as a data URI.

use super::palette::indexed;

/// Pixels with straight alpha, row by row from the top.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Image {
    /// Pixels across, at least 1.
    pub width: usize,
    /// Pixels down, at least 1.
    pub height: usize,
    /// Red, green, blue, alpha.
    pub pixels: Vec<[u8; 4]>,
}

impl Image {
    /// The picture as a PNG file; without an alpha channel where nothing is transparent.
    pub fn png(&self) -> Vec<u8> {
        let opaque = self.pixels.iter().all(|p| p[3] == u8::MAX);
        let kept = if opaque { 3 } else { 4 };
        let mut bytes = Vec::with_capacity(self.pixels.len() * kept);
        for pixel in &self.pixels {
            bytes.extend_from_slice(&pixel[..kept]);
        }
        self.encode(&bytes, |encoder| {
            encoder.set_color(if opaque {
                png::ColorType::Rgb
            } else {
                png::ColorType::Rgba
            });
            encoder.set_filter(png::Filter::Adaptive);
        })
    }

    /// The picture as a PNG file of at most 256 colours, for pages: a third of the size. Transparency is lost.
    pub fn small_png(&self) -> Vec<u8> {
        let (palette, numbers) = indexed(&self.pixels);
        self.encode(&numbers, |encoder| {
            encoder.set_color(png::ColorType::Indexed);
            encoder.set_palette(palette.concat());
            // Numbers of colours have no neighbourhood that a filter could use.
            encoder.set_filter(png::Filter::NoFilter);
        })
    }

    fn encode(
        &self,
        bytes: &[u8],
        set: impl FnOnce(&mut png::Encoder<'_, &mut Vec<u8>>),
    ) -> Vec<u8> {
        let mut file = Vec::new();
        let mut encoder = png::Encoder::new(&mut file, self.width as u32, self.height as u32);
        encoder.set_depth(png::BitDepth::Eight);
        encoder.set_compression(png::Compression::Balanced);
        set(&mut encoder);
        let written = encoder
            .write_header()
            .and_then(|mut writer| writer.write_image_data(bytes));
        debug_assert!(
            written.is_ok(),
            "a vector takes every byte, and there are as many as announced"
        );
        file
    }

    /// The small PNG as a `data:` URI for a page that stands alone.
    pub fn data_uri(&self) -> String {
        format!("data:image/png;base64,{}", base64(&self.small_png()))
    }
}

/// RFC 4648, with padding.
fn base64(bytes: &[u8]) -> String {
    const DIGITS: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let mut text = String::with_capacity(bytes.len().div_ceil(3) * 4);
    for group in bytes.chunks(3) {
        let number = (0..3).fold(0u32, |n, k| {
            n << 8 | u32::from(group.get(k).copied().unwrap_or(0))
        });
        for k in 0..4 {
            if k <= group.len() {
                text.push(char::from(DIGITS[(number >> (18 - 6 * k)) as usize & 63]));
            } else {
                text.push('=');
            }
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn base64_gives_the_vectors_of_the_rfc() {
        for (plain, coded) in [
            ("", ""),
            ("f", "Zg=="),
            ("fo", "Zm8="),
            ("foo", "Zm9v"),
            ("foob", "Zm9vYg=="),
            ("fooba", "Zm9vYmE="),
            ("foobar", "Zm9vYmFy"),
        ] {
            assert_eq!(base64(plain.as_bytes()), coded);
        }
    }

    #[test]
    fn a_small_png_reads_back_with_its_palette() {
        let image = Image {
            width: 2,
            height: 2,
            pixels: vec![[255; 4], [255; 4], [9, 80, 200, 255], [0, 0, 0, 255]],
        };
        let file = image.small_png();
        let mut decoder = png::Decoder::new(std::io::Cursor::new(&file));
        decoder.set_transformations(png::Transformations::EXPAND);
        let mut reader = decoder.read_info().unwrap();
        let mut bytes = vec![0; reader.output_buffer_size().unwrap()];
        reader.next_frame(&mut bytes).unwrap();
        for (read, pixel) in bytes.chunks(3).zip(&image.pixels) {
            assert_eq!(read, &pixel[..3]);
        }
        assert!(
            image
                .data_uri()
                .starts_with("data:image/png;base64,iVBORw0KGgo")
        );
    }

    #[test]
    fn a_png_reads_back_as_it_was_with_and_without_alpha() {
        for alpha in [255, 40] {
            let image = Image {
                width: 3,
                height: 2,
                pixels: (0..6u8)
                    .map(|i| [i * 40, 255 - i, i, if i == 4 { alpha } else { 255 }])
                    .collect(),
            };
            let file = image.png();
            let mut reader = png::Decoder::new(std::io::Cursor::new(&file))
                .read_info()
                .unwrap();
            let mut bytes = vec![0; reader.output_buffer_size().unwrap()];
            let info = reader.next_frame(&mut bytes).unwrap();
            let channels = if alpha == 255 { 3 } else { 4 };
            assert_eq!((info.width, info.height), (3, 2));
            assert_eq!(bytes.len(), 6 * channels);
            for (read, pixel) in bytes.chunks(channels).zip(&image.pixels) {
                assert_eq!(read, &pixel[..channels]);
            }
        }
    }
}

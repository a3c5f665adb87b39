//! The pictures that slicers put into a file's comments, in base64: PNG or JPEG, for a list of files or a printer's screen.
//!
//! Decodes no picture: the browser does. Looks at its first bytes only, so that what is handed out is of a kind and a size
//! that can be shown. Bounded: at most [`THUMBNAILS_MAX`] of [`THUMBNAIL_BYTES_MAX`]; what is more, or no picture, is left
//! out. Sources: RFC 4648 (base64), PNG 1.2 section 11.2.2 (`IHDR`), ITU T.81 annex B (JPEG's markers).

use gcode::PictureLine;

/// So many of a file are taken.
pub const THUMBNAILS_MAX: usize = 8;
/// The largest that is taken.
pub const THUMBNAIL_BYTES_MAX: usize = 1 << 20;
/// Its longest side, in pixels.
pub const THUMBNAIL_SIDE_MAX: u32 = 2048;
const PNG_BEGINNING: &[u8] = b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR";
const JPEG_BEGINNING: &[u8] = b"\xff\xd8\xff";

/// How a picture is written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PictureFormat {
    /// PNG.
    Png,
    /// JPEG.
    Jpeg,
}

/// A picture of the print.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Thumbnail {
    /// How it is written.
    pub format: PictureFormat,
    /// Pixels across and down, by the picture itself.
    pub size: [u32; 2],
    /// The picture's file.
    pub bytes: Vec<u8>,
}

/// Turns base64 into bytes, line by line.
#[derive(Debug, Default)]
struct Decoder {
    bytes: Vec<u8>,
    /// Bits that do not make a byte yet.
    bits: u32,
    count: u32,
    /// Padding has been seen: nothing may follow.
    ended: bool,
    failed: bool,
}

impl Decoder {
    fn read(&mut self, text: &[u8]) {
        for &letter in text {
            let value = match letter {
                b'A'..=b'Z' => letter - b'A',
                b'a'..=b'z' => letter - b'a' + 26,
                b'0'..=b'9' => letter - b'0' + 52,
                b'+' => 62,
                b'/' => 63,
                b'=' => {
                    self.ended = true;
                    continue;
                }
                _ => {
                    self.failed = true;
                    return;
                }
            };
            if self.ended || self.bytes.len() >= THUMBNAIL_BYTES_MAX {
                self.failed = true;
                return;
            }
            self.bits = self.bits << 6 | u32::from(value);
            self.count += 6;
            if self.count >= 8 {
                self.count -= 8;
                self.bytes.push((self.bits >> self.count) as u8);
                self.bits &= (1 << self.count) - 1;
            }
        }
    }

    fn finish(self) -> Option<Thumbnail> {
        if self.failed {
            return None;
        }
        let (format, size) = kind_of(&self.bytes)?;
        let is_showable = size.iter().all(|side| (1..=THUMBNAIL_SIDE_MAX).contains(side));
        is_showable.then_some(Thumbnail { format, size, bytes: self.bytes })
    }
}

/// A whole number of two or four bytes, the highest first.
fn number(bytes: &[u8], at: usize, length: usize) -> Option<u32> {
    let bytes = bytes.get(at..at.checked_add(length)?)?;
    Some(bytes.iter().fold(0, |number, byte| number << 8 | u32::from(*byte)))
}

fn kind_of(bytes: &[u8]) -> Option<(PictureFormat, [u32; 2])> {
    if bytes.starts_with(PNG_BEGINNING) {
        let at = PNG_BEGINNING.len();
        return Some((PictureFormat::Png, [number(bytes, at, 4)?, number(bytes, at + 4, 4)?]));
    }
    bytes.starts_with(JPEG_BEGINNING).then(|| Some((PictureFormat::Jpeg, jpeg_size(bytes)?)))?
}

/// Goes from marker to marker up to that of the frame.
fn jpeg_size(bytes: &[u8]) -> Option<[u32; 2]> {
    let mut at = 2;
    loop {
        let &[0xff, marker] = bytes.get(at..at + 2)? else { return None };
        match marker {
            // A marker may be preceded by any number of these.
            0xff => at += 1,
            0xc4 | 0xc8 | 0xcc => at += 2 + number(bytes, at + 2, 2)? as usize,
            0xc0..=0xcf => return Some([number(bytes, at + 7, 2)?, number(bytes, at + 5, 2)?]),
            _ => at += 2 + number(bytes, at + 2, 2)? as usize,
        }
    }
}

/// Takes pictures out of comments.
#[derive(Debug, Default)]
pub(super) struct Pictures {
    reading: Option<Decoder>,
    whole: Vec<Thumbnail>,
    count: usize,
}

impl Pictures {
    pub(super) fn read(&mut self, line: &PictureLine) {
        match line {
            PictureLine::Begin => self.reading = (self.count < THUMBNAILS_MAX).then(Decoder::default),
            PictureLine::Text(text) => {
                if let Some(decoder) = self.reading.as_mut().filter(|decoder| !decoder.failed) {
                    decoder.read(text);
                }
            }
            PictureLine::End => {
                let picture = self.reading.take().and_then(Decoder::finish);
                self.count += usize::from(picture.is_some());
                self.whole.extend(picture);
            }
        }
    }

    /// Those that are whole, since the last call.
    pub(super) fn take(&mut self) -> Vec<Thumbnail> {
        core::mem::take(&mut self.whole)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const LETTERS: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";

    fn base64(bytes: &[u8]) -> Vec<u8> {
        let mut out = Vec::new();
        for chunk in bytes.chunks(3) {
            let bits =
                chunk.iter().chain([&0; 2]).take(3).fold(0u32, |bits, byte| bits << 8 | u32::from(*byte));
            let letters = [18, 12, 6, 0].map(|shift| LETTERS[(bits >> shift & 63) as usize]);
            out.extend_from_slice(&letters[..=chunk.len()]);
            out.resize(out.len() + 3 - chunk.len(), b'=');
        }
        out
    }

    fn png(width: u32, height: u32, length: usize) -> Vec<u8> {
        let mut bytes = PNG_BEGINNING.to_vec();
        bytes.extend([width, height].map(u32::to_be_bytes).concat());
        bytes.resize(bytes.len() + length, 7);
        bytes
    }

    fn read(files: &[Vec<u8>]) -> Vec<Thumbnail> {
        let mut pictures = Pictures::default();
        for bytes in files {
            pictures.read(&PictureLine::Begin);
            base64(bytes).chunks(78).for_each(|line| pictures.read(&PictureLine::Text(line.into())));
            pictures.read(&PictureLine::End);
        }
        pictures.take()
    }

    #[test]
    fn pngs_and_jpegs_are_taken_with_their_own_size() {
        let jpeg = [
            b"\xff\xd8\xff\xe0\0\x04ab\xff\xff\xc4\0\x02\xff\xc2\0\x11\x08".as_slice(),
            &[1, 44, 2, 88, 3, 1, 0, 0, 9],
        ]
        .concat();
        let files =
            [png(160, 120, 100), jpeg.clone(), b"qoif....".to_vec(), png(2049, 1, 0), png(1, 0, 0), vec![]];
        let found = read(&files);
        assert_eq!(found.len(), 2);
        assert_eq!((found[0].format, found[0].size), (PictureFormat::Png, [160, 120]));
        assert_eq!(found[0].bytes, files[0]);
        assert_eq!((found[1].format, found[1].size), (PictureFormat::Jpeg, [600, 300]));
        assert_eq!(found[1].bytes, jpeg);
    }

    #[test]
    fn what_is_too_much_is_left_out() {
        let found = read(&[png(1, 1, THUMBNAIL_BYTES_MAX), png(1, 1, 9)]);
        assert_eq!(found.len(), 1);
        assert_eq!(read(&vec![png(1, 1, 9); 100]).len(), THUMBNAILS_MAX);
    }

    #[test]
    fn what_is_no_base64_is_left_out() {
        for text in [b"iVBOR!".as_slice(), b"iVBORw0KGgo=iVBORw0KGgo"] {
            let mut pictures = Pictures::default();
            pictures.read(&PictureLine::Begin);
            pictures.read(&PictureLine::Text(base64(&png(1, 1, 0)).into()));
            pictures.read(&PictureLine::Text(text.into()));
            pictures.read(&PictureLine::End);
            assert_eq!(pictures.take(), []);
        }
    }

    proptest! {
        #[test]
        fn base64_comes_back(bytes: Vec<u8>) {
            let mut decoder = Decoder::default();
            decoder.read(&base64(&bytes));
            prop_assert!(!decoder.failed);
            prop_assert_eq!(decoder.bytes, bytes);
        }

        #[test]
        fn no_bytes_make_it_panic(bytes: Vec<u8>, of_jpeg: bool) {
            let beginning = if of_jpeg { JPEG_BEGINNING } else { PNG_BEGINNING };
            let _ = kind_of(&[beginning, &bytes].concat());
        }
    }
}

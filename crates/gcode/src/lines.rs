//! Splits chunks of bytes into lines, in bounded memory.
//!
//! Knows nothing of what a line says. Line ends are `\n` or `\r\n`; a last line needs none.

/// The longest line that is read whole. Real ones are below 100 bytes, but for the polygons of `EXCLUDE_OBJECT_DEFINE` and
/// the slicer's settings, which follow as comments.
pub const LINE_BYTES_MAX: usize = 16 * 1024;

/// A line of a file, counted from 1 as editors do.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[repr(transparent)]
pub struct LineNumber(pub u32);

/// One line without its line end.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Line<'a> {
    /// Counted from 1.
    pub number: LineNumber,
    /// Where in the file the line begins, in bytes.
    pub offset: u64,
    /// At most [`LINE_BYTES_MAX`] + 1 bytes: that one byte too many says that the line was longer and is cut off here.
    pub bytes: &'a [u8],
}

/// A splitter of chunks into lines.
///
/// Pull form: [`feed`](Self::feed) a chunk, then take lines with [`next`](Self::next) until there are none, then feed
/// again. Memory: the chunk, and at most one unfinished line of [`LINE_BYTES_MAX`].
#[derive(Clone, Debug, Default)]
pub struct Lines {
    buffer: Vec<u8>,
    /// Where in `buffer` the next line begins.
    start: usize,
    /// How far behind `start` there is known to be no line end, so that small chunks are not searched twice.
    searched: usize,
    /// Where in the file `start` lies.
    offset: u64,
    /// Lines given out so far, less one while the rest of an overlong line is thrown away.
    count: u32,
    /// The rest of a line that was too long is being thrown away.
    skipping: bool,
    ended: bool,
}

impl Lines {
    /// A splitter at the beginning of a file.
    pub fn new() -> Self {
        Self::default()
    }

    /// Takes a chunk in. Lines not yet taken are kept, so take them all before the next chunk.
    pub fn feed(&mut self, chunk: &[u8]) {
        self.buffer.drain(..self.start);
        self.start = 0;
        self.buffer.extend_from_slice(chunk);
    }

    /// Bytes taken in and not yet given out as lines.
    pub fn buffered(&self) -> usize {
        self.buffer.len() - self.start
    }

    /// The number of the line that comes next.
    pub const fn next_number(&self) -> LineNumber {
        LineNumber(self.count.saturating_add(1))
    }

    /// Says that nothing follows: what is left is the last line.
    pub fn end(&mut self) {
        self.ended = true;
    }

    /// The next whole line, or `None` until more is fed.
    // Not an iterator: the line borrows the splitter's buffer.
    #[allow(clippy::should_implement_trait)]
    pub fn next(&mut self) -> Option<Line<'_>> {
        if self.skipping {
            self.skip_overlong();
        }
        let rest = &self.buffer[self.start..];
        let (length, consumed) = match memchr::memchr(b'\n', &rest[self.searched..]) {
            Some(found) => (self.searched + found, self.searched + found + 1),
            // One more than too many, so that a `\r` just behind the limit is judged alike however the chunks fall.
            None if rest.len() > LINE_BYTES_MAX + 1 => {
                self.skipping = true;
                (rest.len(), rest.len())
            }
            None if self.ended && !rest.is_empty() => (rest.len(), rest.len()),
            None => {
                self.searched = rest.len();
                return None;
            }
        };
        self.searched = 0;
        let offset = self.offset;
        let start = self.start;
        self.start += consumed;
        self.offset += consumed as u64;
        self.count = self.count.saturating_add(1);
        let line = &self.buffer[start..start + length];
        let line = line.strip_suffix(b"\r").unwrap_or(line);
        let bytes = &line[..line.len().min(LINE_BYTES_MAX + 1)];
        Some(Line { number: LineNumber(self.count), offset, bytes })
    }

    /// Push form: takes a chunk in and hands every line that is now whole to `each`.
    pub fn push(&mut self, chunk: &[u8], mut each: impl FnMut(LineNumber, u64, &[u8])) {
        self.feed(chunk);
        while let Some(line) = self.next() {
            each(line.number, line.offset, line.bytes);
        }
    }

    /// Push form: hands the last line, if the file did not end with a line end, to `each`.
    pub fn finish(&mut self, mut each: impl FnMut(LineNumber, u64, &[u8])) {
        self.end();
        while let Some(line) = self.next() {
            each(line.number, line.offset, line.bytes);
        }
    }

    /// Throws away up to the end of the line whose beginning was already given out.
    fn skip_overlong(&mut self) {
        let rest = &self.buffer[self.start..];
        let dropped = match memchr::memchr(b'\n', rest) {
            Some(end) => {
                self.skipping = false;
                end + 1
            }
            None => rest.len(),
        };
        self.start += dropped;
        self.offset += dropped as u64;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn split(chunks: &[&[u8]]) -> Vec<(u32, u64, Vec<u8>)> {
        let mut lines = Lines::new();
        let mut out = Vec::new();
        let mut each = |n: LineNumber, at: u64, bytes: &[u8]| out.push((n.0, at, bytes.to_vec()));
        for chunk in chunks {
            lines.push(chunk, &mut each);
        }
        lines.finish(&mut each);
        assert_eq!(lines.buffered(), 0);
        out
    }

    #[test]
    fn lines_are_numbered_and_placed_across_chunks() {
        let expected = vec![
            (1, 0, b"G28".to_vec()),
            (2, 4, b"G1 X1".to_vec()),
            (3, 11, vec![]),
            (4, 12, b"M84".to_vec()),
        ];
        assert_eq!(split(&[b"G28\nG1 X1\r\n\nM84"]), expected);
        assert_eq!(split(&[b"G2", b"8\nG1 X", b"1\r", b"\n\nM8", b"4"]), expected);
    }

    #[test]
    fn a_line_too_long_costs_no_memory_and_later_lines_keep_their_places() {
        let mut lines = Lines::new();
        let mut seen = Vec::new();
        for _ in 0..1000 {
            lines.push(&[b'X'; 1000], |n, at, bytes| seen.push((n.0, at, bytes.len())));
            assert!(lines.buffered() <= LINE_BYTES_MAX + 1000);
        }
        lines.push(b"\nG28\n", |n, at, bytes| seen.push((n.0, at, bytes.len())));
        assert_eq!(seen, [(1, 0, LINE_BYTES_MAX + 1), (2, 1_000_001, 3)]);
    }

    proptest! {
        #[test]
        fn how_a_file_is_cut_into_chunks_changes_nothing(
            text in proptest::collection::vec(prop_oneof![Just(b'\n'), Just(b'\r'), any::<u8>()], 0..400),
            cuts in proptest::collection::vec(0usize..400, 0..8),
        ) {
            let mut cuts: Vec<usize> = cuts.into_iter().map(|c| c.min(text.len())).collect();
            cuts.push(text.len());
            cuts.sort_unstable();
            let mut from = 0;
            let chunks: Vec<&[u8]> = cuts.iter().map(|&to| { let c = &text[from..to]; from = to; c }).collect();
            prop_assert_eq!(split(&chunks), split(&[&text]));
        }
    }
}

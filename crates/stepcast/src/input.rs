//! A G-code file, read in chunks: plain or gzip, told apart by content, never held as a whole.
//!
//! Knows bytes, not G-code. What cannot be read is a [`PrinterError`] that says what to do.

use std::{
    cell::Cell,
    fs::File,
    io::{self, Read},
    path::{Path, PathBuf},
    rc::Rc,
    sync::Arc,
};

use flate2::read::MultiGzDecoder;
use gcode::{FileKind, SNIFF_BYTES, sniff};
use printer::error::{ErrorCode, PrinterError};

/// How much is read at once.
const CHUNK_BYTES: usize = 64 * 1024;

/// Counts what is read from the file itself, so that progress is known for compressed files too.
struct Counting {
    file: File,
    read: Rc<Cell<u64>>,
}

impl Read for Counting {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let count = self.file.read(buffer)?;
        self.read.set(self.read.get() + count as u64);
        Ok(count)
    }
}

/// An opened file.
pub(crate) struct Input {
    path: PathBuf,
    reader: Box<dyn Read>,
    compressed: bool,
    /// What was read to tell the file's kind and has not been given out.
    head: Vec<u8>,
    buffer: Vec<u8>,
    size: u64,
    read: Rc<Cell<u64>>,
    given_out: u64,
    /// How many times it is to be read anew at its end.
    again: u32,
}

impl Input {
    /// Opens a file and makes sure from its first bytes that it can be G-code.
    pub(crate) fn open(path: &Path) -> Result<Self, PrinterError> {
        let cannot = |error: &io::Error| unreadable(path, error);
        let file = File::open(path).map_err(|error| cannot(&error))?;
        let about = file.metadata().map_err(|error| cannot(&error))?;
        if about.is_dir() {
            let detail = format!("{} is a directory", path.display());
            return Err(PrinterError::new(ErrorCode::FileUnreadable, detail));
        }
        let read = Rc::new(Cell::new(0));
        let mut input = Self {
            path: path.to_owned(),
            reader: Box::new(Counting { file, read: Rc::clone(&read) }),
            compressed: false,
            head: Vec::new(),
            buffer: Vec::new(),
            size: about.len(),
            read,
            given_out: 0,
            again: 0,
        };
        input.fill_head()?;
        let name = path.file_name().and_then(|name| name.to_str());
        let mut kind = sniff(&input.head, name);
        if kind == FileKind::Gzip {
            let head = io::Cursor::new(std::mem::take(&mut input.head));
            let plain = std::mem::replace(&mut input.reader, Box::new(io::empty()));
            input.reader = Box::new(MultiGzDecoder::new(head.chain(plain)));
            input.compressed = true;
            input.fill_head()?;
            // The name is that of the compressed file.
            kind = sniff(&input.head, None);
        }
        match kind {
            FileKind::Gcode => Ok(input),
            FileKind::Empty => {
                Err(PrinterError::new(ErrorCode::FileEmpty, format!("{} is empty", path.display())))
            }
            other => Err(not_gcode(path, input.compressed, other)),
        }
    }

    /// Opens a file that is to be read so many times, one after the other.
    pub(crate) fn repeated(path: &Path, times: u32) -> Result<Self, PrinterError> {
        let mut input = Self::open(path)?;
        input.again = times.saturating_sub(1);
        input.size *= u64::from(times);
        Ok(input)
    }

    fn reopen(&mut self) -> Result<(), PrinterError> {
        let fresh = Self::open(&self.path)?;
        let (size, given_out, again) = (self.size, self.given_out, self.again - 1);
        let read_before = self.read.get();
        *self = Self { size, given_out, again, ..fresh };
        self.read.set(self.read.get() + read_before);
        // The last line of what has been read may have no end.
        self.head.insert(0, b'\n');
        Ok(())
    }

    /// The next bytes, at most `max` and at most a chunk; none at the end of the file.
    pub(crate) fn next(&mut self, max: usize) -> Result<&[u8], PrinterError> {
        let max = max.min(CHUNK_BYTES);
        self.buffer.clear();
        if self.head.is_empty() {
            self.buffer.resize(max, 0);
            let count = read_some(&mut self.reader, &mut self.buffer).map_err(|error| self.broken(&error))?;
            self.buffer.truncate(count);
            if count == 0 && max > 0 && self.again > 0 {
                self.reopen()?;
                return self.next(max);
            }
        } else {
            let count = max.min(self.head.len());
            self.buffer.extend(self.head.drain(..count));
        }
        self.given_out += self.buffer.len() as u64;
        Ok(&self.buffer)
    }

    /// The next chunk; none at the end of the file.
    pub(crate) fn next_chunk(&mut self) -> Result<&[u8], PrinterError> {
        self.next(CHUNK_BYTES)
    }

    /// The file's size in bytes, as it lies on the disk.
    pub(crate) fn size(&self) -> u64 {
        self.size
    }

    /// How many of these bytes have been read.
    pub(crate) fn position(&self) -> u64 {
        self.read.get()
    }

    /// G-code from memory, under a name for messages.
    pub(crate) fn memory(name: &str, gcode: Arc<[u8]>) -> Self {
        Self {
            path: PathBuf::from(name),
            size: gcode.len() as u64,
            reader: Box::new(io::Cursor::new(gcode)),
            compressed: false,
            head: Vec::new(),
            buffer: Vec::new(),
            read: Rc::default(),
            given_out: 0,
            again: 0,
        }
    }

    fn fill_head(&mut self) -> Result<(), PrinterError> {
        let mut head = vec![0; SNIFF_BYTES];
        let mut filled = 0;
        while filled < head.len() {
            let count =
                read_some(&mut self.reader, &mut head[filled..]).map_err(|error| self.broken(&error))?;
            if count == 0 {
                break;
            }
            filled += count;
        }
        head.truncate(filled);
        self.head = head;
        Ok(())
    }

    fn broken(&self, error: &io::Error) -> PrinterError {
        if !self.compressed {
            return unreadable(&self.path, error);
        }
        let path = self.path.display();
        match error.kind() {
            io::ErrorKind::UnexpectedEof => PrinterError::new(
                ErrorCode::FileCutOff,
                format!("the gzip file {path} stops after {} bytes of G-code", self.given_out),
            ),
            io::ErrorKind::InvalidData | io::ErrorKind::InvalidInput => PrinterError::new(
                ErrorCode::FileUnreadable,
                format!("the gzip file {path} is damaged after {} bytes of G-code ({error})", self.given_out),
            ),
            _ => unreadable(&self.path, error),
        }
    }
}

fn read_some(reader: &mut impl Read, buffer: &mut [u8]) -> io::Result<usize> {
    loop {
        match reader.read(buffer) {
            Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
            result => return result,
        }
    }
}

fn unreadable(path: &Path, error: &io::Error) -> PrinterError {
    PrinterError::new(ErrorCode::FileUnreadable, format!("{}: {error}", path.display()))
}

fn not_gcode(path: &Path, compressed: bool, kind: FileKind) -> PrinterError {
    let inside = if compressed { "inside the gzip file " } else { "" };
    let advice = kind.advice().unwrap_or("This is compressed twice. Unpack it once").trim_end_matches('.');
    PrinterError::new(ErrorCode::FileBinary, format!("{inside}{}: {advice}", path.display()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use flate2::{Compression, write::GzEncoder};
    use std::io::Write;

    struct Scratch(PathBuf);

    impl Scratch {
        fn new(name: &str, bytes: &[u8]) -> Self {
            let path = std::env::temp_dir().join(format!("stepcast-input-{}-{name}", std::process::id()));
            std::fs::write(&path, bytes).unwrap();
            Self(path)
        }
    }

    impl Drop for Scratch {
        fn drop(&mut self) {
            let _ = std::fs::remove_file(&self.0);
        }
    }

    fn gcode() -> Vec<u8> {
        (0..20_000)
            .flat_map(|line| format!("G1 X{} Y{}\n", line % 97, line * 7919 % 83).into_bytes())
            .collect()
    }

    fn gzip(bytes: &[u8]) -> Vec<u8> {
        let mut encoder = GzEncoder::new(Vec::new(), Compression::default());
        encoder.write_all(bytes).unwrap();
        encoder.finish().unwrap()
    }

    fn read_all(path: &Path, max: usize) -> Result<Vec<u8>, PrinterError> {
        let mut input = Input::open(path)?;
        let mut all = Vec::new();
        loop {
            let chunk = input.next(max)?;
            if chunk.is_empty() {
                return Ok(all);
            }
            assert!(chunk.len() <= max);
            all.extend_from_slice(chunk);
        }
    }

    fn failure(name: &str, bytes: &[u8]) -> PrinterError {
        let file = Scratch::new(name, bytes);
        read_all(&file.0, 1000).unwrap_err()
    }

    #[test]
    fn plain_and_gzip_give_the_same_bytes_whatever_the_name() {
        let plain = gcode();
        let mut two_members = gzip(&plain[..1234]);
        two_members.extend(gzip(&plain[1234..]));
        for (name, bytes) in [("a.gcode", plain.clone()), ("b.gcode", gzip(&plain)), ("c.gz", two_members)] {
            let file = Scratch::new(name, &bytes);
            for max in [7, 4096, usize::MAX] {
                assert!(read_all(&file.0, max).unwrap() == plain, "{name} in pieces of {max}");
            }
        }
    }

    #[test]
    fn a_file_can_be_read_again_and_again() {
        for bytes in [gcode(), gzip(&gcode())] {
            let file = Scratch::new("again.gcode", &bytes);
            let mut input = Input::repeated(&file.0, 3).unwrap();
            let mut all = Vec::new();
            while let chunk = input.next(1000).unwrap()
                && !chunk.is_empty()
            {
                all.extend_from_slice(chunk);
            }
            let one = gcode();
            assert!(all == [&one[..], b"\n", &one, b"\n", &one].concat());
            assert_eq!((input.size(), input.position()), (3 * bytes.len() as u64, 3 * bytes.len() as u64));
        }
    }

    #[test]
    fn progress_is_that_of_the_file_on_the_disk() {
        let bytes = gzip(&gcode());
        let file = Scratch::new("progress.gz", &bytes);
        let mut input = Input::open(&file.0).unwrap();
        assert_eq!(input.size(), bytes.len() as u64);
        while !input.next_chunk().unwrap().is_empty() {}
        assert_eq!(input.position(), bytes.len() as u64);
    }

    #[test]
    fn a_cut_off_gzip_file_is_told_from_a_damaged_one() {
        let bytes = gzip(&gcode());
        let error = failure("cut.gz", &bytes[..bytes.len() / 2]);
        assert_eq!(error.code, ErrorCode::FileCutOff);
        assert!(error.what_happened().contains("stops after"), "{error}");
        // Even where only the trailing checksum is missing.
        assert_eq!(failure("tail.gz", &bytes[..bytes.len() - 5]).code, ErrorCode::FileCutOff);
        let mut damaged = bytes.clone();
        let last = damaged.len() - 6;
        damaged[last] ^= 0x55;
        assert_eq!(failure("damaged.gz", &damaged).code, ErrorCode::FileUnreadable);
    }

    #[test]
    fn what_is_no_gcode_is_named_with_advice() {
        for (bytes, word) in [
            (&b"GCDE\x01\0\0\0\0\0"[..], "bgcode"),
            (b"PK\x03\x04part.gcode", "zip"),
            (b"solid cube\n facet normal 0 0 1\n", "STL"),
            (&gzip(b"PK\x03\x04[Content_Types].xml"), "3MF"),
            (&gzip(&gzip(b"G28\n")), "twice"),
            (&[0u8, 1, 2, 3, 255, 254][..], "not text"),
        ] {
            let error = failure("kind", bytes);
            assert_eq!(error.code, ErrorCode::FileBinary);
            assert!(error.what_happened().contains(word), "{error}");
        }
        assert_eq!(failure("empty.gcode", b"").code, ErrorCode::FileEmpty);
        assert_eq!(failure("empty.gz", &gzip(b"")).code, ErrorCode::FileEmpty);
    }

    #[test]
    fn what_is_not_there_is_said() {
        let error = Input::open(Path::new("/nowhere/at/all.gcode")).err().unwrap();
        assert_eq!(error.code, ErrorCode::FileUnreadable);
        assert!(error.detail.contains("/nowhere/at/all.gcode"), "{error}");
        assert_eq!(Input::open(&std::env::temp_dir()).err().unwrap().code, ErrorCode::FileUnreadable);
    }
}

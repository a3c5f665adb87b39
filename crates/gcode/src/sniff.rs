//! Tells files apart by their first bytes, because names lie.

/// How many first bytes are worth showing to [`sniff`]; fewer do for short files.
pub const SNIFF_BYTES: usize = 4096;

/// What a file is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum FileKind {
    /// Text that may be G-code.
    Gcode,
    /// gzip, hopefully with G-code inside.
    Gzip,
    /// Prusa's binary G-code.
    BinaryGcode,
    /// A 3MF project.
    ThreeMf,
    /// A model, binary or text.
    Stl,
    /// A zip archive.
    Zip,
    /// Text of another kind (a web page, JSON, STEP, OBJ).
    OtherText,
    /// Anything else that is no text.
    OtherBinary,
    /// Nothing at all.
    Empty,
}

impl FileKind {
    /// A stable kebab-case name.
    pub const fn as_str(self) -> &'static str {
        match self {
            Self::Gcode => "gcode",
            Self::Gzip => "gzip",
            Self::BinaryGcode => "binary-gcode",
            Self::ThreeMf => "3mf",
            Self::Stl => "stl",
            Self::Zip => "zip",
            Self::OtherText => "other-text",
            Self::OtherBinary => "other-binary",
            Self::Empty => "empty",
        }
    }

    /// What the file is and what to do instead, for a person; `None` for what can be read.
    pub const fn advice(self) -> Option<&'static str> {
        Some(match self {
            Self::Gcode | Self::Gzip => return None,
            Self::BinaryGcode => {
                "This is binary G-code (.bgcode). In PrusaSlicer, switch off Preferences > Other > \"Use binary G-code when \
                 the printer supports it\" (or Printer Settings > General > Firmware > \"Supports binary G-code\") and export \
                 again; or convert it with `bgcode FILE`."
            }
            Self::ThreeMf => {
                "This is a 3MF project, not G-code. Open it in your slicer, slice it, and choose \"Export G-code\" (in Orca \
                 Slicer and Bambu Studio: \"Export G-code file\", not \"Export plate sliced file\")."
            }
            Self::Stl => {
                "This is a 3D model (STL). Open it in a slicer such as PrusaSlicer or Cura, slice it, and export G-code."
            }
            Self::Zip => "This is a zip archive. Unpack it and open the .gcode file inside.",
            Self::OtherText => {
                "This text is no G-code. Export G-code from your slicer (Marlin or Klipper flavour) and open that file."
            }
            Self::OtherBinary => {
                "This file is not text, so it is no G-code. Export plain G-code from your slicer (Marlin or Klipper flavour)."
            }
            Self::Empty => {
                "The file is empty. Export it again from your slicer, and check that the disk is not full."
            }
        })
    }
}

/// Tells what a file is from its first bytes (see [`SNIFF_BYTES`]) and, where those leave a choice, from its name.
pub fn sniff(head: &[u8], name: Option<&str>) -> FileKind {
    const ARCHIVES_AND_MEDIA: [&[u8]; 9] = [
        b"7z\xbc\xaf",
        b"Rar!",
        b"\xfd7zXZ",
        b"BZh",
        b"\x28\xb5\x2f\xfd",
        b"\x89PNG",
        b"\xff\xd8\xff",
        b"%PDF",
        b"\x7fELF",
    ];
    let named = |extension: &str| name.is_some_and(|name| ends_with_ignore_case(name, extension));
    let text = head.strip_prefix(b"\xef\xbb\xbf").unwrap_or(head).trim_ascii();
    if text.is_empty() {
        return FileKind::Empty;
    }
    if head.starts_with(b"\x1f\x8b") {
        return FileKind::Gzip;
    }
    if head.starts_with(b"GCDE") {
        return FileKind::BinaryGcode;
    }
    if head.starts_with(b"PK\x03\x04") || head.starts_with(b"PK\x05\x06") {
        let is_3mf =
            named(".3mf") || contains(head, b"3D/3dmodel.model") || contains(head, b"[Content_Types].xml");
        return if is_3mf { FileKind::ThreeMf } else { FileKind::Zip };
    }
    if is_ascii_stl(text) || is_binary_stl(head, named(".stl")) {
        return FileKind::Stl;
    }
    if ARCHIVES_AND_MEDIA.iter().any(|magic| head.starts_with(magic)) || !is_text(head) {
        return FileKind::OtherBinary;
    }
    if is_other_text(text) { FileKind::OtherText } else { FileKind::Gcode }
}

fn ends_with_ignore_case(name: &str, extension: &str) -> bool {
    let (name, extension) = (name.as_bytes(), extension.as_bytes());
    name.len() >= extension.len() && name[name.len() - extension.len()..].eq_ignore_ascii_case(extension)
}

fn contains(haystack: &[u8], needle: &[u8]) -> bool {
    memchr::memmem::find(haystack, needle).is_some()
}

fn is_ascii_stl(text: &[u8]) -> bool {
    text.starts_with(b"solid") && contains(text, b"facet")
}

/// 80 bytes of anything, the number of triangles, then 50 bytes each: a normal of length 1 (or 0), three corners, two bytes
/// that are always zero. G-code has no zero bytes at all.
fn is_binary_stl(head: &[u8], named_stl: bool) -> bool {
    let Some(triangle) = head.get(84..134) else { return named_stl && !is_text(head) };
    if is_text(head) {
        return false;
    }
    let float = |at: usize| {
        f64::from(f32::from_le_bytes([triangle[at], triangle[at + 1], triangle[at + 2], triangle[at + 3]]))
    };
    let length_squared: f64 = [0, 4, 8].map(|at| float(at) * float(at)).iter().sum();
    let normal = length_squared == 0.0 || (0.9..1.1).contains(&length_squared);
    named_stl || (normal && triangle[48..] == [0, 0] && (0..12).all(|i| float(i * 4).abs() < 1e6))
}

/// No zero bytes, and nearly no other control characters. Comments may be in any 8-bit character set.
fn is_text(head: &[u8]) -> bool {
    let control = head.iter().filter(|&&b| b < b' ' && !matches!(b, b'\n' | b'\r' | b'\t')).count();
    !head.contains(&0) && control * 100 <= head.len()
}

fn is_other_text(text: &[u8]) -> bool {
    const STARTS: [&[u8]; 6] = [b"<", b"{", b"ISO-10303-21", b"mtllib", b"solid ", b"#!"];
    STARTS.iter().any(|start| text.starts_with(start))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn binary_stl() -> Vec<u8> {
        let mut stl = vec![0; 80];
        stl[..5].copy_from_slice(b"solid");
        stl.extend(1u32.to_le_bytes());
        for value in [0.0f32, 0.0, 1.0, 0.0, 0.0, 0.0, 10.0, 0.0, 0.0, 0.0, 10.0, 0.0] {
            stl.extend(value.to_le_bytes());
        }
        stl.extend([0, 0]);
        stl
    }

    #[test]
    fn kinds_are_told_by_content_whatever_the_name() {
        for (head, kind) in [
            (&b"; generated by PrusaSlicer\nG28\n"[..], FileKind::Gcode),
            (b"\xef\xbb\xbfG28 ; \xb0C\n", FileKind::Gcode),
            (b"\x1f\x8b\x08\0", FileKind::Gzip),
            (b"GCDE\x01\0\0\0", FileKind::BinaryGcode),
            (b"PK\x03\x04....[Content_Types].xml", FileKind::ThreeMf),
            (b"PK\x03\x04....part.gcode", FileKind::Zip),
            (b"solid cube\n facet normal 0 0 1\n", FileKind::Stl),
            (&binary_stl(), FileKind::Stl),
            (b"<!DOCTYPE html>", FileKind::OtherText),
            (b"ISO-10303-21;\nHEADER;", FileKind::OtherText),
            (b"\x89PNG\r\n\x1a\n", FileKind::OtherBinary),
            (b"G28\nG1 X\0\0\0\0", FileKind::OtherBinary),
            (b"", FileKind::Empty),
            (b"\n \r\n", FileKind::Empty),
        ] {
            assert_eq!(sniff(head, Some("part.gcode")), kind);
            assert_eq!(sniff(head, None), kind);
        }
        assert_eq!(sniff(b"PK\x03\x04", Some("Part.3MF")), FileKind::ThreeMf);
    }

    #[test]
    fn only_what_can_be_read_needs_no_advice() {
        assert!(FileKind::Gcode.advice().is_none() && FileKind::Gzip.advice().is_none());
        for kind in
            [FileKind::BinaryGcode, FileKind::ThreeMf, FileKind::Stl, FileKind::Zip, FileKind::OtherText]
        {
            assert!(kind.advice().unwrap().contains("G-code") || kind == FileKind::Zip);
        }
    }
}

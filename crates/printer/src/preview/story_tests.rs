//! What a file tells besides its moves: objects, changes of tool and filament, pauses, lines, pictures.

use std::fmt::Write as _;

use super::vertex::{Flags, Vertex};
use super::*;

/// Vertices, the line of each, and the preview at the file's end.
fn read(gcode: &str, piece: usize) -> (Vec<Vertex>, Vec<u32>, Preview) {
    let mut preview = Preview::new(None);
    let (mut words, mut marks, mut steps) = (Vec::new(), Vec::new(), Vec::new());
    for piece in gcode.as_bytes().chunks(piece) {
        assert_eq!(preview.feed(piece), piece.len());
        while preview.run(&mut words) {}
        marks.extend(preview.take_marks());
        steps.extend(preview.take_line_steps());
    }
    preview.end();
    while preview.run(&mut words) {}
    marks.extend(preview.take_marks());
    steps.extend(preview.take_line_steps());
    let vertices: Vec<Vertex> = words.as_chunks().0.iter().map(|words| Vertex::unpack(*words)).collect();
    assert_eq!(steps.len(), vertices.len());
    let marks = marks.as_chunks::<2>().0;
    let line_of = |vertex: usize| {
        let at = marks.partition_point(|[_, marked]| *marked as usize <= vertex) - 1;
        let [line, marked] = marks[at];
        line + steps[marked as usize + 1..=vertex].iter().map(|step| u32::from(*step)).sum::<u32>()
    };
    let lines = (0..vertices.len()).map(line_of).collect();
    (vertices, lines, preview)
}

#[test]
fn objects_of_both_dialects_reach_the_vertices_and_the_report() {
    let text = "EXCLUDE_OBJECT_DEFINE NAME=far CENTER=10,20 POLYGON=[[0,0],[1,0]]\nEXCLUDE_OBJECT_DEFINE NAME=near\n\
                G90\nM83\nG1 X1 F6000\nEXCLUDE_OBJECT_START NAME=near\nG1 X5 E1\nG1 X6\nEXCLUDE_OBJECT_END NAME=near\n\
                G1 X7\nEXCLUDE_OBJECT_START NAME=far\nG1 X9 E2\nEXCLUDE_OBJECT_END NAME=far\nG1 X10 E3\n";
    let (vertices, _, preview) = read(text, usize::MAX);
    let objects: Vec<u8> = vertices.iter().map(|vertex| vertex.object).collect();
    assert_eq!(objects, [0, 0, 2, 2, 0, 1, 0]);
    let object = |name: &str, centre_mm, filament| ObjectReport {
        name: name.into(),
        centre_mm,
        filament: Mm(filament),
    };
    assert_eq!(preview.finish().objects, [object("far", Some([10.0, 20.0]), 2.0), object("near", None, 1.0)]);

    let text =
        "M486 T2\nG90\nM83\nM486 S1\nM486 AShape-Box\nG1 X1 E1 F6000\nM486 S-1\nG1 X2\nM486 S0\nG1 X3 E1\n";
    let (vertices, _, preview) = read(text, usize::MAX);
    let objects: Vec<u8> = vertices.iter().map(|vertex| vertex.object).collect();
    assert_eq!(objects, [1, 1, 0, 2]);
    assert_eq!(preview.finish().objects, [object("Shape-Box", None, 1.0), object("#0", None, 1.0)]);
}

#[test]
fn changes_and_pauses_are_told_where_they_happen() {
    let text = "T1\nM0\nG28\nG90\nM83\nG1 X1 F6000\nT1\nG1 X2 E1\nT0\nG1 X3\nM600\nG1 X4\nPAUSE\nG28 X\nM601\nG1 X5\nM25\n";
    let (vertices, _, preview) = read(text, usize::MAX);
    assert_eq!(preview.finish().tools, [ToolReport { tool: 1, filament: Mm(1.0) }]);
    let begin = Flags::BREAK.and(Flags::TRAVEL).and(Flags::PAUSE);
    let refill = Flags::TRAVEL.and(Flags::PAUSE).and(Flags::FILAMENT_CHANGE);
    let pause = Flags::TRAVEL.and(Flags::PAUSE);
    let flags: Vec<Flags> = vertices.iter().map(|vertex| vertex.flags).collect();
    assert_eq!(flags, [begin, Flags::TRAVEL, Flags::TOOL_CHANGE, refill, pause, begin, pause]);
    assert_eq!(vertices.iter().map(|vertex| vertex.tool).collect::<Vec<_>>(), [1, 1, 1, 0, 0, 0, 0]);
    // A file that ends before anything moves has no place for a pause.
    assert_eq!(read("G28\nM0\n", usize::MAX).0, []);
}

#[test]
fn every_vertex_has_the_line_that_it_comes_from() {
    let mut text = "G90\nM83\n".to_owned();
    let (mut expected, mut at) = (vec![3], 3);
    for number in 0..2000u32 {
        // Now none, now some, now too many lines between two moves; x says which line it is.
        let gap = [0, 1, 0, 30, 254, 255, 253, 1000][number as usize % 8];
        text.push_str(&"; nothing\n".repeat(gap));
        at += gap as u32;
        writeln!(text, "G1 X{} E1 F6000", f64::from(at) / 1000.0).unwrap();
        expected.push(at);
        at += 1;
    }
    // The first move's start is a vertex of its own, of the same line.
    let (vertices, lines, preview) = read(&text, 1000);
    assert_eq!(lines, expected);
    for (vertex, line) in vertices.iter().zip(&lines).skip(1) {
        let x = preview.grid().place(vertex.steps)[0];
        assert!((x * 1000.0 - f64::from(*line)).abs() <= 500.0 * preview.grid().step_mm + 1e-6, "{x} {line}");
    }
    // An arc's chords all come from its line.
    let (vertices, lines, _) = read("G90\nG1 X10 F6000\n\nG3 X-10 I-10 E1\nG1 X0\n", usize::MAX);
    assert_eq!((lines[0], lines[1], lines[2], lines[vertices.len() - 2]), (2, 2, 4, 4));
    assert_eq!(lines.last(), Some(&5));
    assert!(lines.is_sorted());
}

#[test]
fn pictures_are_handed_out_once_and_only_whole() {
    // One black pixel.
    let png = "iVBORw0KGgoAAAANSUhEUgAAAAEAAAABCAAAAAA6fptVAAAACklEQVR4nGNgAAAAAgABSK+kcQAAAABJRU5ErkJggg==";
    let (first, second) = png.split_at(40);
    let text = format!(
        "; THUMBNAIL_BLOCK_START\n;\n; thumbnail begin 1x1 {}\n; {first}\n; {second}\n; thumbnail end\n;\n\
         ; THUMBNAIL_BLOCK_END\nG1 X1 F600\n; thumbnail begin 1x1 92\n; {first}\n",
        png.len()
    );
    for piece in [1, 7, 4096] {
        let (_, _, mut preview) = read(&text, piece);
        let thumbnails = preview.take_thumbnails();
        assert_eq!(thumbnails.len(), 1);
        assert_eq!((thumbnails[0].format, thumbnails[0].size), (PictureFormat::Png, [1, 1]));
        assert!(thumbnails[0].bytes.ends_with(b"IEND\xaeB`\x82"));
        assert_eq!(preview.take_thumbnails(), []);
    }
}

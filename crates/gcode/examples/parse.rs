//! Reads G-code from standard input and prints what it found: the benchmark of this crate.
//!
//! `gzip -dc FILE | cargo run --release -p gcode --example parse`; instructions a byte with
//! `valgrind --tool=callgrind`.

use std::io::Read;

use gcode::{Action, Interpreter, LineNumber, Lines, Settings};

fn main() -> std::io::Result<()> {
    let mut lines = Lines::new();
    let mut interpreter = Interpreter::new(Settings::default());
    let mut actions = Vec::new();
    let mut diagnostics = Vec::new();
    let (mut bytes, mut count, mut moves, mut arcs, mut others) = (0usize, 0u32, 0u64, 0u64, 0u64);
    let mut chunk = vec![0; 64 * 1024];
    let mut each = |number: LineNumber, _offset: u64, line: &[u8]| {
        interpreter.line(number, line, &mut actions, &mut diagnostics);
        for action in actions.drain(..) {
            match action {
                Action::Move(_) => moves += 1,
                Action::Arc(_) => arcs += 1,
                _ => others += 1,
            }
        }
        for diagnostic in diagnostics.drain(..) {
            println!("{diagnostic}");
        }
        count = number.0;
    };
    loop {
        let length = std::io::stdin().read(&mut chunk)?;
        bytes += length;
        if length == 0 {
            break;
        }
        lines.push(&chunk[..length], &mut each);
    }
    lines.finish(&mut each);
    println!("{bytes} bytes, {count} lines, {moves} moves, {arcs} arcs, {others} other actions");
    println!("{:?}", interpreter.position());
    Ok(())
}

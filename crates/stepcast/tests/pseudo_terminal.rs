//! The virtual printer on a pseudo-terminal, as another program meets it.
#![cfg(unix)]

use std::{
    fs::{self, File, OpenOptions},
    io::{Read, Write},
    path::{Path, PathBuf},
    process::{Child, Command, Stdio},
    sync::mpsc,
    thread,
    time::{Duration, Instant},
};

/// For a loaded machine; usually everything takes milliseconds.
const PATIENCE: Duration = Duration::from_secs(30);

struct Served(Child);

impl Drop for Served {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

fn serve(link: &Path) -> Served {
    let child = Command::new(env!("CARGO_BIN_EXE_stepcast"))
        .args(["virtual-printer", "--speed", "10", "--pty"])
        .arg(link)
        .stderr(Stdio::null())
        .spawn()
        .expect("the command runs");
    wait_until(|| link.exists());
    Served(child)
}

fn wait_until(condition: impl Fn() -> bool) {
    let began = Instant::now();
    while !condition() {
        assert!(began.elapsed() < PATIENCE, "waited too long");
        thread::sleep(Duration::from_millis(5));
    }
}

/// `identify offset=0 count=40` in a block with this sequence number.
fn identify(sequence: u8) -> Vec<u8> {
    wire::block::Block::new(sequence, &[1, 0, 40]).as_bytes().to_vec()
}

/// The first 40 bytes of the dictionary, once the block that brings them has come.
fn dictionary_start(bytes: &[u8]) -> Option<Vec<u8>> {
    // `identify_response offset=0 data=…`, a zlib stream; behind it the end of the block.
    let at = bytes.windows(4).position(|window| window == [0, 0, 40, 0x78])? + 3;
    let end = bytes.get(at + 40..at + 43)?;
    (end[2] == 0x7e).then(|| bytes[at..at + 40].to_vec())
}

/// Sends a block and reads until the dictionary's beginning has come.
fn exchange(terminal: &mut File, block: &[u8]) -> Vec<u8> {
    terminal.write_all(block).expect("the terminal takes bytes");
    let mut reader = terminal.try_clone().expect("a second handle");
    let (sender, receiver) = mpsc::channel();
    thread::spawn(move || {
        let mut all = Vec::new();
        let mut buffer = [0; 256];
        while let Ok(count @ 1..) = reader.read(&mut buffer) {
            all.extend_from_slice(&buffer[..count]);
            if let Some(found) = dictionary_start(&all) {
                let _ = sender.send(found);
                break;
            }
        }
    });
    receiver.recv_timeout(PATIENCE).expect("an answer in time")
}

fn open(link: &Path) -> File {
    OpenOptions::new().read(true).write(true).open(link).expect("the terminal opens")
}

#[test]
fn a_host_may_come_and_go_and_the_name_goes_with_the_printer() {
    let link = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join("terminal");
    let _ = fs::remove_file(&link);
    let mut served = serve(&link);
    let first = exchange(&mut open(&link), &identify(0));
    // The board keeps its sequence number across hosts.
    let second = exchange(&mut open(&link), &identify(1));
    assert_eq!(second, first);
    let interrupt = Command::new("kill").args(["-INT", &served.0.id().to_string()]).status().expect("kill");
    assert!(interrupt.success());
    assert!(served.0.wait().expect("it ends").success());
    assert!(fs::symlink_metadata(&link).is_err(), "the link is left behind");
}

#[test]
fn a_file_that_is_in_the_way_is_not_replaced() {
    let path = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join("in-the-way");
    fs::write(&path, "precious").unwrap();
    let output = Command::new(env!("CARGO_BIN_EXE_stepcast"))
        .args(["virtual-printer", "--pty"])
        .arg(&path)
        .output()
        .expect("the command runs");
    assert_eq!(output.status.code(), Some(1));
    assert_eq!(fs::read(&path).unwrap(), b"precious");
    assert!(String::from_utf8_lossy(&output.stderr).contains("in-the-way"));
}

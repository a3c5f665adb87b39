//! The axes' paths as a table: one row a sample, written as they come.

use std::{
    fs::File,
    io::{BufWriter, Write as _},
    path::{Path, PathBuf},
};

use anyhow::Context;
use printer::planner::{PlanSink, TraceSample};

/// The columns: time, then position, speed and acceleration of each axis behind pressure advance and input shapers.
const HEADER: &str =
    "time_s,x_mm,y_mm,z_mm,e_mm,x_mm_s,y_mm_s,z_mm_s,e_mm_s,x_mm_s2,y_mm_s2,z_mm_s2,e_mm_s2\n";

/// A table that is being written, or none.
pub(crate) struct TraceFile(Option<Open>);

struct Open {
    path: PathBuf,
    file: BufWriter<File>,
    /// The first thing that went wrong.
    failed: Option<std::io::Error>,
}

impl TraceFile {
    /// A table with its header; none without a path.
    pub(crate) fn create(path: Option<&Path>) -> anyhow::Result<Self> {
        let Some(path) = path else { return Ok(Self(None)) };
        let create = || {
            let mut file = BufWriter::new(File::create(path)?);
            file.write_all(HEADER.as_bytes())?;
            Ok::<_, std::io::Error>(file)
        };
        let file = create().with_context(|| format!("cannot create {}", path.display()))?;
        Ok(Self(Some(Open { path: path.to_owned(), file, failed: None })))
    }

    /// Whether all has been written so far.
    pub(crate) fn check(&mut self) -> anyhow::Result<()> {
        let Some(open) = &mut self.0 else { return Ok(()) };
        match open.failed.take() {
            Some(error) => Err(error).with_context(|| format!("cannot write {}", open.path.display())),
            None => Ok(()),
        }
    }

    /// The table is complete.
    pub(crate) fn finish(mut self) -> anyhow::Result<()> {
        if let Some(open) = &mut self.0
            && open.failed.is_none()
        {
            open.failed = open.file.flush().err();
        }
        self.check()
    }
}

impl PlanSink for TraceFile {
    fn sample(&mut self, sample: &TraceSample) {
        let Some(open) = self.0.as_mut().filter(|open| open.failed.is_none()) else { return };
        let values = sample.position.iter().chain(&sample.velocity).chain(&sample.accel);
        let write = || {
            write!(open.file, "{:.6}", sample.time.0)?;
            for value in values {
                write!(open.file, ",{value:.6}")?;
            }
            open.file.write_all(b"\n")
        };
        open.failed = write().err();
    }
}

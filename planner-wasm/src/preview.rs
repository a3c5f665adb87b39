//! A file's geometry and summary for JavaScript.

use printer::{
    error::{ErrorCode, PrinterError},
    preview::{self, PictureFormat},
};
use wasm_bindgen::prelude::{JsError, wasm_bindgen};

use crate::{
    messages::{PreviewSummary, json},
    read_config, thrown,
};

/// Reads a file: feed what it wants, take vertices until there are none, and so on; then finish, take the last ones, and
/// ask for the summary.
#[wasm_bindgen]
pub struct Preview {
    reader: Option<preview::Preview>,
    origin_mm: [f64; 3],
    step_mm: f64,
    read_bytes: u64,
    summary: String,
}

#[wasm_bindgen]
impl Preview {
    /// A preview for a machine, or of the G-code alone.
    #[wasm_bindgen(constructor)]
    pub fn new(printer_cfg: Option<String>) -> Result<Preview, JsError> {
        let config = printer_cfg.map(|text| read_config(&text)).transpose();
        let config = config.map_err(|error| thrown(&error))?;
        Ok(Self::of(preview::Preview::new(config.as_ref())))
    }

    /// The same vertices, in a fraction of the time: without what the planner knows, and the summary without times and without
    /// what the machine cannot do.
    pub fn outline(printer_cfg: &str) -> Result<Preview, JsError> {
        let config = read_config(printer_cfg).map_err(|error| thrown(&error))?;
        Ok(Self::of(preview::Preview::outline(&config)))
    }

    /// Where the vertices' step 0, 0, 0 is, in mm.
    #[wasm_bindgen(getter)]
    pub fn origin_mm(&self) -> Vec<f64> {
        self.origin_mm.to_vec()
    }

    /// How long a step of the vertices is, in mm.
    #[wasm_bindgen(getter)]
    pub fn step_mm(&self) -> f64 {
        self.step_mm
    }

    /// How many bytes may be fed now. All of them may, once there are no vertices to be taken.
    pub fn wants(&self) -> usize {
        self.reader.as_ref().map_or(0, preview::Preview::wants)
    }

    /// Takes the next bytes of the file, at most what it wants.
    pub fn feed(&mut self, chunk: &[u8]) -> Result<(), JsError> {
        let taken = self.reader.as_mut().map_or(0, |reader| reader.feed(chunk));
        if taken == chunk.len() {
            return Ok(());
        }
        let detail = format!("{} bytes more than wanted were fed to the preview", chunk.len() - taken);
        Err(thrown(&PrinterError::new(ErrorCode::Internal, detail)))
    }

    /// Says that the file has ended.
    pub fn finish(&mut self) {
        if let Some(reader) = &mut self.reader {
            reader.end();
        }
    }

    /// Works on what was fed, and returns vertices, some 256 Ki at most; an empty array says that all is done. Each is four
    /// words, by `docs/vertex.md`.
    pub fn take_vertices(&mut self) -> Vec<u32> {
        let mut vertices = Vec::new();
        if let Some(reader) = &mut self.reader {
            while reader.run(&mut vertices) && vertices.is_empty() {}
            self.read_bytes = reader.read_bytes();
        }
        vertices
    }

    /// Works on what was fed, for the channels and the summary alone: in place of taking vertices.
    pub fn read_on(&mut self) {
        if let Some(reader) = &mut self.reader {
            while reader.run_on() {}
            self.read_bytes = reader.read_bytes();
        }
    }

    /// Asks for what the planner knows of each vertex, before the first byte is fed; there is none without a machine.
    pub fn want_channels(&mut self) {
        if let Some(reader) = &mut self.reader {
            reader.want_channels();
        }
    }

    /// What the planner knows of the vertices that it has planned since the last call: four words for each, in their order, by
    /// `docs/vertex.md`. It comes later than the vertices; take it after them, and once more before the summary.
    pub fn take_channels(&mut self) -> Vec<u32> {
        self.reader.as_mut().map(preview::Preview::take_channels).unwrap_or_default()
    }

    /// Pairs of a line and the vertex at which its segment ends, one for some dozens of vertices, in order; what is new
    /// since the last call.
    pub fn take_marks(&mut self) -> Vec<u32> {
        self.reader.as_mut().map(preview::Preview::take_marks).unwrap_or_default()
    }

    /// How many lines further than the vertex before it each vertex comes from, new since the last call; 255 where that is
    /// more, which then has a mark.
    pub fn take_line_steps(&mut self) -> Vec<u8> {
        self.reader.as_mut().map(preview::Preview::take_line_steps).unwrap_or_default()
    }

    /// The file's pictures of the print, new since the last call.
    pub fn take_thumbnails(&mut self) -> Vec<Thumbnail> {
        let thumbnails = self.reader.as_mut().map(preview::Preview::take_thumbnails).unwrap_or_default();
        thumbnails.into_iter().map(Thumbnail).collect()
    }

    /// Bytes of the file that have been read.
    #[wasm_bindgen(getter)]
    pub fn progress(&self) -> f64 {
        self.read_bytes as f64
    }

    /// What the file holds: a `PreviewSummary` as JSON. Ends the reading.
    pub fn summary(&mut self) -> String {
        if let Some(reader) = self.reader.take() {
            self.summary = json(&PreviewSummary::of(reader.finish()));
        }
        self.summary.clone()
    }
}

impl Preview {
    fn of(reader: preview::Preview) -> Self {
        let grid = *reader.grid();
        Self {
            reader: Some(reader),
            origin_mm: grid.origin_mm,
            step_mm: grid.step_mm,
            read_bytes: 0,
            summary: String::new(),
        }
    }
}

/// A picture of the print: a PNG's or JPEG's file.
#[wasm_bindgen]
pub struct Thumbnail(preview::Thumbnail);

#[wasm_bindgen]
impl Thumbnail {
    /// Its media type.
    #[wasm_bindgen(getter)]
    pub fn mime(&self) -> String {
        let mime = match self.0.format {
            PictureFormat::Png => "image/png",
            PictureFormat::Jpeg => "image/jpeg",
        };
        mime.to_owned()
    }

    /// Pixels across.
    #[wasm_bindgen(getter)]
    pub fn width(&self) -> u32 {
        self.0.size[0]
    }

    /// Pixels down.
    #[wasm_bindgen(getter)]
    pub fn height(&self) -> u32 {
        self.0.size[1]
    }

    /// Its file's bytes.
    #[wasm_bindgen(getter)]
    pub fn bytes(&self) -> Vec<u8> {
        self.0.bytes.clone()
    }
}

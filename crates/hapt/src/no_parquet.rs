//! Replaces `columnar.rs` in a program without Parquet: every table is refused.

use std::convert::Infallible;
use std::io::{self, BufRead, Write};
use std::marker::PhantomData;
use std::path::Path;

use hapt_sweep::table::Column;

fn missing() -> io::Error {
    io::Error::new(io::ErrorKind::Unsupported, "this hapt was built without its feature parquet")
}

/// Never constructed.
pub struct Writer<W> {
    never: Infallible,
    out: PhantomData<W>,
}

impl<W: Write> Writer<W> {
    pub fn new(_: &[Column], _: W) -> io::Result<Self> {
        Err(missing())
    }

    pub fn write(&mut self, _: impl IntoIterator<Item = Option<f64>>) -> io::Result<()> {
        match self.never {}
    }

    pub fn finish(self) -> io::Result<W> {
        match self.never {}
    }
}

/// How many rows a table has, and the values of the first one.
pub type FirstRow = (u64, Vec<Option<f64>>);

pub fn rows(_: &Path, _: &[Column]) -> io::Result<Option<FirstRow>> {
    Err(missing())
}

pub fn write<W: Write>(columns: &[Column], _: impl BufRead, out: W) -> io::Result<W> {
    Writer::new(columns, out)?.finish()
}

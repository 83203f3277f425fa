//! Arrays in files: little-endian numbers and nothing else.

use crate::work::Result;
use std::fs;
use std::path::Path;

pub fn numbers<T, const N: usize>(path: &Path, number: impl Fn([u8; N]) -> T) -> Result<Vec<T>> {
    let bytes = fs::read(path).map_err(|error| format!("{}: {error}", path.display()))?;
    Ok(bytes.as_chunks::<N>().0.iter().map(|&bytes| number(bytes)).collect())
}

pub fn save<const N: usize>(path: &Path, numbers: impl IntoIterator<Item = [u8; N]>) -> Result<()> {
    let bytes: Vec<u8> = numbers.into_iter().flatten().collect();
    Ok(fs::write(path, bytes).map_err(|error| format!("{}: {error}", path.display()))?)
}

//! What the arguments of `render` can be.

use crate::error::{Error, Result};
use glam::Vec3;
use std::ffi::OsStr;
use std::path::{Path, PathBuf};

/// Where the pictures go.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Target {
    File { path: PathBuf, is_exr: bool },
    Folder(PathBuf),
}

impl Target {
    pub(super) fn of(path: &Path) -> Result<Self> {
        let file = |is_exr| Ok(Self::File { path: path.to_owned(), is_exr });
        match path.extension().and_then(OsStr::to_str) {
            _ if path.is_dir() => Ok(Self::Folder(path.to_owned())),
            Some("png") => file(false),
            Some("exr") => file(true),
            None => Ok(Self::Folder(path.to_owned())),
            Some(_) => Err(Error::usage("names no kind of picture; give .png, .exr or a folder").at(path)),
        }
    }
}

pub(super) fn vector(text: &str) -> Result<Vec3, String> {
    let numbers: Option<Vec<f32>> = text.split(',').map(|part| part.trim().parse().ok()).collect();
    match numbers.as_deref() {
        Some(&[x, y, z]) if x.is_finite() && y.is_finite() && z.is_finite() => Ok(Vec3::new(x, y, z)),
        _ => Err("write three numbers, such as 0,1.5,4".to_owned()),
    }
}

pub(super) fn field_of_view(text: &str) -> Result<f32, String> {
    let degrees: Option<f32> = text.parse().ok();
    degrees.filter(|degrees| (0.1..=170.0).contains(degrees)).ok_or("give 0.1 to 170 degrees".to_owned())
}

pub(super) fn milliseconds(text: &str) -> Result<f64, String> {
    let time_ms: Option<f64> = text.parse().ok();
    time_ms
        .filter(|time_ms| (0.1..=10_000.0).contains(time_ms))
        .ok_or("give 0.1 to 10000 milliseconds".to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn outputs_are_told_by_their_names() {
        assert_eq!(
            Target::of(Path::new("b.png")).unwrap(),
            Target::File { path: "b.png".into(), is_exr: false }
        );
        assert_eq!(Target::of(Path::new("frames")).unwrap(), Target::Folder("frames".into()));
        assert!(Target::of(Path::new("b.jpg")).unwrap_err().to_string().contains("b.jpg: names no kind"));
    }

    #[test]
    fn vectors_are_three_finite_numbers() {
        assert_eq!(vector("1, -2.5,3e1"), Ok(Vec3::new(1.0, -2.5, 30.0)));
        for text in ["1,2", "1,2,3,4", "1,nan,2", "a,b,c", "", "1,inf,0"] {
            assert!(vector(text).is_err(), "{text}");
        }
        assert_eq!(field_of_view("40"), Ok(40.0));
        assert_eq!(milliseconds("16.7"), Ok(16.7));
        assert!(milliseconds("0").is_err() && milliseconds("nan").is_err());
        assert!(field_of_view("180").is_err() && field_of_view("nan").is_err());
    }
}

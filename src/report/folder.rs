//! The files of a report.

use super::document::Document;
use super::page::{page, plots};
use crate::error::{Error, Result};
use std::path::{Path, PathBuf};

/// The page's name.
const PAGE: &str = "index.html";

/// Writes `index.html`, `report.json` and the plots into `folder`, which is made if it is not there. Files of
/// the same names are replaced, each atomically: readers see either the old or the new one. Returns the
/// page's path.
///
/// # Errors
/// When the folder or a file cannot be written.
pub fn write(document: &Document, folder: &Path) -> Result<PathBuf> {
    std::fs::create_dir_all(folder).map_err(|error| {
        Error::failed("the folder for the report cannot be made").because(error).at(folder)
    })?;
    for (name, svg) in plots(document) {
        replace(folder, &name, &svg)?;
    }
    replace(folder, "report.json", &document.to_json())?;
    // The page comes last, because it is what people look at.
    replace(folder, PAGE, &page(document))
}

fn replace(folder: &Path, name: &str, text: &str) -> Result<PathBuf> {
    let (path, new) = (folder.join(name), folder.join(format!(".{name}.new")));
    let written = std::fs::write(&new, text).and_then(|()| std::fs::rename(&new, &path));
    written.map_err(|error| {
        // A full disk leaves an incomplete file; the old one is still there.
        let _ = std::fs::remove_file(&new);
        Error::failed("a file of the report cannot be written").because(error).at(&path)
    })?;
    Ok(path)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::document::tests::document;

    #[test]
    fn files_are_replaced_and_nothing_else_is_left() {
        let folder = tempfile::tempdir().unwrap();
        let below = folder.path().join("a/b");
        let mut document = document();
        write(&document, &below).unwrap();
        document.is_complete = true;
        let page = write(&document, &below).unwrap();
        assert_eq!(page, below.join("index.html"));
        let mut names: Vec<String> = std::fs::read_dir(&below)
            .unwrap()
            .map(|entry| entry.unwrap().file_name().into_string().unwrap())
            .collect();
        names.sort();
        assert_eq!(
            names,
            ["index.html", "map_1.svg", "map_2.svg", "maps_lights.svg", "maps_time.svg", "report.json"]
        );
        assert!(std::fs::read_to_string(below.join("report.json")).unwrap().contains("\"complete\": true"));
    }

    #[test]
    fn a_folder_that_cannot_be_is_named() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("file");
        std::fs::write(&file, "").unwrap();
        let error = write(&document(), &file.join("report")).unwrap_err().to_string();
        assert!(error.contains("file/report"), "{error}");
        std::fs::create_dir(folder.path().join("index.html")).unwrap();
        let error = write(&document(), folder.path()).unwrap_err().to_string();
        assert!(error.contains("index.html: a file of the report cannot be written"), "{error}");
        assert!(!folder.path().join(".index.html.new").exists());
    }
}

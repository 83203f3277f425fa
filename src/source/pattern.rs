//! The files that a path denotes, and their numbers.
//!
//! | path | means |
//! |---|---|
//! | a file that exists | this one |
//! | a folder | its pictures (`.exr`, `.hdr`, `.jpeg`, `.jpg`, `.pic`, `.png`), whose names must be equal except for the number |
//! | `name.####.exr` | the number with at least as many digits as there are `#`; other `#` before these are themselves |
//! | `name.%04d.exr`, `name.%d.exr` | the number as C prints it; other `%` before it are themselves |
//!
//! In a folder the number consists of the digits directly before the extension, so that `map_1k.hdr` has
//! none, with a sign where nothing else is before it; or it is a time in seconds with a fraction, in
//! nanoseconds then. Case does not count in extensions. Hidden files are left out.

use super::file_number::{numbered, seconds};
use crate::error::{Error, Result};
use std::ffi::OsString;
use std::fs;
use std::path::{Path, PathBuf};

/// Extensions of the pictures that are looked for in a folder.
const EXTENSIONS: [&str; 6] = ["exr", "hdr", "jpeg", "jpg", "pic", "png"];

/// Names that an error lists before it says how many more there are.
const LISTED_NAMES: usize = 8;

/// The files that `path` denotes, ascending by number; never empty.
///
/// # Errors
///
/// Of kind [`Usage`](crate::error::Kind::Usage), naming the path: there are no files, names do not belong to
/// one sequence, two files have the same number.
pub(super) fn files(path: &Path) -> Result<Vec<(i64, PathBuf)>> {
    let fault = |message: String| Error::usage(message).at(path);
    if path.is_file() {
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        return Ok(vec![(numbered(&name).map_or(0, |(_, number, _)| number), path.to_owned())]);
    }
    let mut files = if path.is_dir() {
        in_folder(path)?
    } else {
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        let Some(pattern) = Pattern::parse(&name) else {
            return Err(fault(
                "is neither a file, nor a folder, nor a pattern such as name.####.exr or name.%04d.exr"
                    .into(),
            ));
        };
        let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
        let mut files = Vec::new();
        for name in names(folder).map_err(|error| error.at(path))? {
            if let Some(number) = pattern.number(&name.text) {
                files.push((number, folder.join(name.file)));
            }
        }
        if files.is_empty() {
            return Err(fault("no file has a name like this".into()));
        }
        files
    };
    files.sort();
    if let Some(pair) = files.windows(2).find(|pair| pair[0].0 == pair[1].0) {
        return Err(fault(format!(
            "{} and {} have the same number; keep one",
            pair[0].1.display(),
            pair[1].1.display()
        )));
    }
    Ok(files)
}

/// Whether an entry is a file, or a link to one, and no folder, pipe or device.
fn is_file(entry: &fs::DirEntry) -> bool {
    match entry.file_type() {
        Ok(kind) if kind.is_symlink() => entry.path().is_file(),
        kind => kind.is_ok_and(|kind| kind.is_file()),
    }
}

/// The name of a file, and as text: where it is no Unicode, with replacement characters.
struct Name {
    file: OsString,
    text: String,
}

/// All names of files in a folder, sorted, without hidden ones.
fn names(folder: &Path) -> Result<Vec<Name>> {
    let entries = fs::read_dir(folder)
        .and_then(Iterator::collect::<std::io::Result<Vec<_>>>)
        .map_err(|error| Error::usage("cannot be listed").because(error).at(folder))?;
    let mut names: Vec<Name> = entries
        .into_iter()
        .filter(is_file)
        .map(|entry| Name { text: entry.file_name().to_string_lossy().into_owned(), file: entry.file_name() })
        .filter(|name| !name.text.starts_with('.'))
        .collect();
    names.sort_by(|a, b| a.text.cmp(&b.text));
    Ok(names)
}

/// What stands before the number of a name, the number, and what stands behind it.
type Split<'a> = Option<(&'a str, i64, &'a str)>;

fn in_folder(folder: &Path) -> Result<Vec<(i64, PathBuf)>> {
    let fault = |message: String| Error::usage(message).at(folder);
    let is_picture = |name: &Name| {
        let extension = Path::new(&name.text).extension().unwrap_or_default().to_ascii_lowercase();
        EXTENSIONS.iter().any(|&known| extension == known)
    };
    let mut names = names(folder)?;
    names.retain(is_picture);
    let Some(first) = names.first() else {
        return Err(fault(format!("holds no pictures ({})", EXTENSIONS.map(|e| format!(".{e}")).join(", "))));
    };
    if names.len() == 1 {
        let number = numbered(&first.text).map_or(0, |(_, number, _)| number);
        return Ok(vec![(number, folder.join(&first.file))]);
    }
    // Times in seconds look like sequences of one file, or of the fractions of one second.
    let is_times = names.iter().all(|name| seconds(&name.text).is_some());
    let split: fn(&str) -> Split = if is_times { seconds } else { numbered };

    // Every sequence, and every picture without a number, has one name.
    let family = |name: &str| match split(name) {
        Some((before, _, after)) => format!("{before}#{}", after.to_ascii_lowercase()),
        None => name.to_owned(),
    };
    let mut families: Vec<String> = names.iter().map(|name| family(&name.text)).collect();
    families.sort();
    families.dedup();
    if families.len() > 1 {
        let more = match families.len().saturating_sub(LISTED_NAMES) {
            0 => String::new(),
            more => format!(" and {more} more"),
        };
        families.truncate(LISTED_NAMES);
        return Err(fault(format!(
            "holds pictures that are not one sequence: {}{more}; give a file or a pattern such as name.####.exr",
            families.join(", ")
        )));
    }
    names
        .iter()
        .map(|name| match split(&name.text) {
            Some((_, number, _)) => Ok((number, folder.join(&name.file))),
            None => Err(Error::usage("has a number that is too large").at(folder.join(&name.file).as_path())),
        })
        .collect()
}

/// A name with a placeholder for a number of at least `digits` digits.
struct Pattern<'a> {
    before: &'a str,
    digits: usize,
    after: &'a str,
}

impl<'a> Pattern<'a> {
    fn parse(name: &'a str) -> Option<Self> {
        if let Some(last) = name.rfind('#') {
            let before = name[..last].trim_end_matches('#');
            return Some(Self { before, digits: 1 + last - before.len(), after: &name[last + 1..] });
        }
        name.rmatch_indices('%').find_map(|(at, _)| {
            let (width, after) = name[at + 1..].split_once('d')?;
            let digits = match width {
                "" => 1,
                _ => width.strip_prefix('0')?.parse().ok().filter(|digits| (1..=20).contains(digits))?,
            };
            Some(Self { before: &name[..at], digits, after })
        })
    }

    /// The number in `name`, which must be padded with zeros to exactly `digits` digits, its sign counted as
    /// C counts it, if it has fewer.
    fn number(&self, name: &str) -> Option<i64> {
        let rest = name.strip_prefix(self.before)?;
        let end = rest.len().checked_sub(self.after.len()).filter(|&end| rest.is_char_boundary(end))?;
        let (number, after) = rest.split_at(end);
        let digits = number.strip_prefix('-').unwrap_or(number);
        let plain = !digits.is_empty() && digits.bytes().all(|byte| byte.is_ascii_digit());
        // C counts the sign; programs that put one before a padded number do not.
        let is_padded = [number.len(), digits.len()].contains(&self.digits);
        let filled = is_padded || (digits.len() > self.digits && !digits.starts_with('0'));
        if plain && filled && is_same_but_for_case(after, self.after) { number.parse().ok() } else { None }
    }
}

/// Whether two ends of names are the same, the case of their extensions aside.
fn is_same_but_for_case(one: &str, other: &str) -> bool {
    let extension_at = |text: &str| text.rfind('.').unwrap_or(text.len());
    one.get(..extension_at(one)) == other.get(..extension_at(other)) && one.eq_ignore_ascii_case(other)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::error::Kind;

    fn found(names: &[&str], path: &str) -> std::result::Result<Vec<(i64, String)>, String> {
        let folder = tempfile::tempdir().unwrap();
        for name in names {
            fs::write(folder.path().join(name), b"").unwrap();
        }
        match files(&folder.path().join(path)) {
            Ok(files) => {
                let name = |path: PathBuf| path.file_name().unwrap().to_string_lossy().into_owned();
                Ok(files.into_iter().map(|(number, path)| (number, name(path))).collect())
            }
            Err(error) => {
                assert_eq!(error.kind(), Kind::Usage);
                Err(error.to_string())
            }
        }
    }

    fn owned(list: &[(i64, &str)]) -> Vec<(i64, String)> {
        list.iter().map(|(number, name)| (*number, (*name).to_owned())).collect()
    }

    #[test]
    fn patterns_take_their_number_of_digits_and_more_but_no_surplus_zeros() {
        let names =
            ["a.0009.exr", "a.0010.exr", "a.10000.exr", "a.00011.exr", "a.12.exr", "a.x.exr", "b.0001.exr"];
        let expected = owned(&[(9, "a.0009.exr"), (10, "a.0010.exr"), (10000, "a.10000.exr")]);
        assert_eq!(found(&names, "a.####.exr").unwrap(), expected);
        assert_eq!(found(&names, "a.%04d.exr").unwrap(), expected);
        let plain = owned(&[(12, "a.12.exr"), (10000, "a.10000.exr")]);
        assert_eq!(found(&names, "a.%d.exr").unwrap(), plain);
        assert_eq!(found(&names, "a.#.exr").unwrap(), plain);
    }

    #[test]
    fn paths_that_mean_nothing_are_refused_with_what_would() {
        for path in ["c.####.exr", "a.%03d.hdr"] {
            let error = found(&["a.001.exr"], path).unwrap_err();
            assert!(error.contains(path) && error.contains("no file has a name like this"), "{error}");
        }
        for path in ["a.exr", "a.%s.exr", "a.%4d.exr", "a.%099d.exr", "a.%0d.exr"] {
            let error = found(&["a.001.exr"], path).unwrap_err();
            assert!(error.contains("name.####.exr or name.%04d.exr"), "{path}: {error}");
        }
        assert!(found(&[], "missing/a.##.exr").unwrap_err().contains("missing: cannot be listed"));
    }

    #[test]
    fn folders_are_sorted_by_number_and_other_files_left_alone() {
        let names =
            ["shot10.exr", "shot9.exr", "shot0011.EXR.txt", "notes.txt", ".shot12.exr.7.part", "calib.json"];
        let expected = owned(&[(9, "shot9.exr"), (10, "shot10.exr")]);
        assert_eq!(found(&names, "").unwrap(), expected);
        assert_eq!(found(&["map_1k.hdr", "readme.md"], "").unwrap(), owned(&[(0, "map_1k.hdr")]));
        assert_eq!(found(&["0007.PNG", "0008.PNG"], "").unwrap(), owned(&[(7, "0007.PNG"), (8, "0008.PNG")]));
    }

    #[test]
    fn what_is_no_file_is_no_picture() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        fs::write(at("a.1.exr"), b"").unwrap();
        fs::create_dir(at("a.2.exr")).unwrap();
        assert!(std::process::Command::new("mkfifo").arg(at("a.3.exr")).status().unwrap().success());
        std::os::unix::fs::symlink("/dev/zero", at("a.4.exr")).unwrap();
        std::os::unix::fs::symlink(at("a.1.exr"), at("a.5.exr")).unwrap();
        let numbers =
            |path: &Path| files(path).unwrap().into_iter().map(|(number, _)| number).collect::<Vec<_>>();
        assert_eq!((numbers(folder.path()), numbers(&at("a.#.exr"))), (vec![1, 5], vec![1, 5]));
        assert!(files(&at("a.3.exr")).is_err());
    }

    #[test]
    fn folders_that_are_not_one_sequence_list_what_is_there() {
        let error = found(&["a.1.exr", "a.2.exr", "b.1.exr", "map_1k.hdr"], "").unwrap_err();
        assert!(error.contains("not one sequence: a.#.exr, b.#.exr, map_1k.hdr; give"), "{error}");
        let many: Vec<String> = (0..12_u8).map(|n| format!("{}.hdr", char::from(b'a' + n))).collect();
        let many: Vec<&str> = many.iter().map(String::as_str).collect();
        assert!(found(&many, "").unwrap_err().contains("h.hdr and 4 more;"));
        assert!(
            found(&["a.txt"], "").unwrap_err().contains("no pictures (.exr, .hdr, .jpeg, .jpg, .pic, .png)")
        );
        let error = found(&["a.1.exr", "a.01.exr"], "").unwrap_err();
        assert!(error.contains("a.01.exr and ") && error.contains("same number"), "{error}");
    }

    #[test]
    fn one_file_keeps_its_number_and_may_look_like_a_pattern() {
        assert_eq!(found(&["a.0042.exr"], "a.0042.exr").unwrap(), owned(&[(42, "a.0042.exr")]));
        assert_eq!(found(&["a_1k.hdr"], "a_1k.hdr").unwrap(), owned(&[(0, "a_1k.hdr")]));
        assert_eq!(
            found(&["take #3.exr", "take 4.exr"], "take #3.exr").unwrap(),
            owned(&[(3, "take #3.exr")])
        );
        let huge = "a.99999999999999999999999.exr";
        assert_eq!(found(&[huge], huge).unwrap(), owned(&[(0, huge)]));
    }
    #[test]
    fn other_signs_of_places_before_the_number_are_themselves() {
        let names = ["shot%20a.0001.exr", "shot%20a.0002.exr", "take #3.0001.exr", "take ##.0001.exr"];
        let percent = owned(&[(1, names[0]), (2, names[1])]);
        assert_eq!(found(&names, "shot%20a.%04d.exr").unwrap(), percent);
        assert_eq!(found(&names, "shot%20a.####.exr").unwrap(), percent);
        assert_eq!(found(&names, "take #3.####.exr").unwrap(), owned(&[(1, names[2])]));
        assert!(found(&names, "take ##.%04d.exr").unwrap_err().contains("no file"));
        assert_eq!(found(&names, "take ##.####.exr").unwrap(), owned(&[(1, names[3])]));
    }

    #[test]
    fn signs_cases_and_times() {
        let names = ["f.-001.exr", "f.-002.exr", "f.0000.exr", "f.0001.EXR"];
        let expected = owned(&[(-2, names[1]), (-1, names[0]), (0, names[2]), (1, names[3])]);
        for path in ["", "f.%04d.exr", "f.###.EXR"] {
            let found = found(&names, path).unwrap();
            assert_eq!(found[..2], expected[..2], "{path}");
            assert!(!path.is_empty() || found == expected, "{found:?}");
        }
        let stamps = ["1403636579.763555.png", "1403636580.013.png", "1403636579.9.png"];
        let expected =
            [763_555_000, 900_000_000, 1_013_000_000].map(|time| 1_403_636_579_000_000_000_i64 + time);
        let times: Vec<i64> = found(&stamps, "").unwrap().into_iter().map(|(time, _)| time).collect();
        assert_eq!(times, expected);
    }

    #[test]
    fn names_need_not_be_unicode() {
        use std::os::unix::ffi::OsStrExt;
        let folder = tempfile::tempdir().unwrap();
        let name = |end: &str| {
            folder.path().join(std::ffi::OsStr::from_bytes(&[b"caf\xe9.", end.as_bytes()].concat()))
        };
        for end in ["0001.exr", "0002.exr"] {
            fs::write(name(end), b"").unwrap();
        }
        let expected = vec![(1, name("0001.exr")), (2, name("0002.exr"))];
        assert_eq!(files(folder.path()).unwrap(), expected);
        assert_eq!(files(&name("####.exr")).unwrap(), expected);
    }
}

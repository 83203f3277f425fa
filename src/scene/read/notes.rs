//! Notes on what readers left out or made up.

/// The note on surfaces that ask for blending.
pub(super) const TRANSPARENCY: &str =
    "surfaces that are partly transparent are drawn opaque where alpha >= 0.5";

/// Adds a note that is not there yet.
pub(super) fn add_note(notes: &mut Vec<String>, note: impl Into<String>) {
    let note = note.into();
    if !notes.contains(&note) {
        notes.push(note);
    }
}

/// Says what was done about triangles without area and about normals that are no directions.
pub(super) fn normal_notes(notes: &mut Vec<String>, dropped: usize, given: usize) {
    if dropped > 0 {
        notes.push(format!("{dropped} triangles without area left out"));
    }
    if given > 0 {
        notes
            .push(format!("{given} vertices have no usable normal in the file; computed from the triangles"));
    }
}

//! Notes on what readers left out or filled in.

/// The note on surfaces that ask for blending.
pub(super) const TRANSPARENCY: &str =
    "surfaces that are partly transparent are drawn opaque where alpha >= 0.5";

/// Adds a note unless it is in the list already.
pub(super) fn add_note(notes: &mut Vec<String>, note: impl Into<String>) {
    let note = note.into();
    if !notes.contains(&note) {
        notes.push(note);
    }
}

/// Notes how many triangles without area were dropped and how many missing or invalid normals were computed.
pub(super) fn normal_notes(notes: &mut Vec<String>, dropped: usize, given: usize) {
    if dropped > 0 {
        notes.push(format!("{dropped} triangles without area left out"));
    }
    if given > 0 {
        notes
            .push(format!("{given} vertices have no usable normal in the file; computed from the triangles"));
    }
}

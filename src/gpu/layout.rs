//! Compares the layout of Rust structs with that of WGSL structs as parsed by naga.

/// A struct member: its name and its byte offset.
pub(crate) type Member = (&'static str, usize);

/// Fails unless the WGSL struct `name` has exactly these members in this order and this size.
pub(crate) fn assert_layout(source: &str, name: &str, size: usize, members: &[Member]) {
    let module =
        naga::front::wgsl::parse_str(source).unwrap_or_else(|e| panic!("{}", e.emit_to_string(source)));
    let (found, span) = module
        .types
        .iter()
        .find_map(|(_, ty)| match &ty.inner {
            naga::TypeInner::Struct { members, span } if ty.name.as_deref() == Some(name) => {
                Some((members, *span))
            }
            _ => None,
        })
        .unwrap_or_else(|| panic!("there is no struct {name} in the shader"));
    let found: Vec<(&str, usize)> =
        found.iter().map(|m| (m.name.as_deref().unwrap_or(""), m.offset as usize)).collect();
    assert_eq!(found, members, "{name}");
    assert_eq!(span as usize, size, "size of {name}");
}

/// Name and offset of every field of a struct, for [`assert_layout`].
macro_rules! members {
    ($of:ty: $($field:ident),+ $(,)?) => {
        &[$((stringify!($field), std::mem::offset_of!($of, $field))),+]
    };
}
pub(crate) use members;

/// Fails unless the source is valid WGSL with the capabilities that WebGPU guarantees (including packing of
/// half floats).
pub(crate) fn assert_valid(label: &str, source: &str) {
    let module = naga::front::wgsl::parse_str(source)
        .unwrap_or_else(|e| panic!("{label}: {}", e.emit_to_string(source)));
    let mut validator = naga::valid::Validator::new(
        naga::valid::ValidationFlags::all(),
        naga::valid::Capabilities::SHADER_FLOAT16_IN_FLOAT32,
    );
    if let Err(error) = validator.validate(&module) {
        panic!("{label}: {}", error.emit_to_string(source));
    }
}

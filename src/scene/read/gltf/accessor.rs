//! Numbers from glTF buffers. Everything is checked here (types, sizes, ranges), because the reader of `gltf`
//! 1.4 trusts the file.

use crate::error::{Error, Result};
use crate::scene::read::budget::MAX_TRIANGLES;
use gltf::Accessor;
use gltf::accessor::{DataType, Dimensions, sparse::IndexType};
use std::borrow::Cow;

/// Most elements of one accessor: the corners of all triangles.
const MAX_COUNT: usize = 3 * MAX_TRIANGLES;

/// The contents of all buffers, each at least as long as its `byteLength`.
pub(super) type Buffers = Vec<Vec<u8>>;

/// Vectors of `N` floats. Integers are accepted if they are normalised: [0, 1] unsigned, [-1, 1] signed.
pub(super) fn floats<const N: usize>(accessor: &Accessor, buffers: &Buffers) -> Result<Vec<[f32; N]>> {
    numbers(accessor, buffers, false).map_err(|error| error.at(format_args!("accessor {}", accessor.index())))
}

/// Vectors of `N` floats. Integers of 8 and 16 bits that are not normalised stand for themselves, as
/// `KHR_mesh_quantization` has it.
pub(super) fn quantized<const N: usize>(accessor: &Accessor, buffers: &Buffers) -> Result<Vec<[f32; N]>> {
    numbers(accessor, buffers, true).map_err(|error| error.at(format_args!("accessor {}", accessor.index())))
}

fn numbers<const N: usize>(
    accessor: &Accessor,
    buffers: &Buffers,
    may_be_integers: bool,
) -> Result<Vec<[f32; N]>> {
    let dimensions = accessor.dimensions().multiplicity();
    let (data_type, is_normalized) = (accessor.data_type(), accessor.normalized());
    if dimensions != N || matches!(accessor.dimensions(), Dimensions::Mat2) {
        return Err(Error::usage(format!("has {dimensions} components, not {N}")));
    }
    let from: fn(&[u8]) -> f32 = match (data_type, is_normalized) {
        (DataType::F32, _) => |b| f32::from_le_bytes([b[0], b[1], b[2], b[3]]),
        (DataType::U8, true) => |b| f32::from(b[0]) / 255.0,
        (DataType::U16, true) => |b| f32::from(u16::from_le_bytes([b[0], b[1]])) / 65_535.0,
        (DataType::I8, true) => |b| (f32::from(b[0] as i8) / 127.0).max(-1.0),
        (DataType::I16, true) => |b| (f32::from(i16::from_le_bytes([b[0], b[1]])) / 32_767.0).max(-1.0),
        (DataType::U8, false) if may_be_integers => |b| f32::from(b[0]),
        (DataType::U16, false) if may_be_integers => |b| f32::from(u16::from_le_bytes([b[0], b[1]])),
        (DataType::I8, false) if may_be_integers => |b| f32::from(b[0] as i8),
        (DataType::I16, false) if may_be_integers => |b| f32::from(i16::from_le_bytes([b[0], b[1]])),
        _ => {
            return Err(Error::usage(format!(
                "has components of type {data_type:?}; floats or normalised integers of 8 or 16 bits are needed"
            )));
        }
    };
    let bytes = elements(accessor, buffers)?;
    let size = data_type.size();
    let element = |bytes: &[u8]| std::array::from_fn(|i| from(&bytes[i * size..]));
    Ok(bytes.chunks_exact(N * size).map(element).collect())
}

/// Indices of vertices.
pub(super) fn indices(accessor: &Accessor, buffers: &Buffers) -> Result<Vec<u32>> {
    let read = || {
        let from: fn(&[u8]) -> u32 = match (accessor.dimensions(), accessor.data_type()) {
            (Dimensions::Scalar, DataType::U8) => |b| u32::from(b[0]),
            (Dimensions::Scalar, DataType::U16) => |b| u32::from(u16::from_le_bytes([b[0], b[1]])),
            (Dimensions::Scalar, DataType::U32) => |b| u32::from_le_bytes([b[0], b[1], b[2], b[3]]),
            (dimensions, data_type) => {
                return Err(Error::usage(format!("has no indices but {dimensions:?} of {data_type:?}")));
            }
        };
        Ok(elements(accessor, buffers)?.chunks_exact(accessor.data_type().size()).map(from).collect())
    };
    read().map_err(|error| error.at(format_args!("accessor {}", accessor.index())))
}

/// Four numbers of joints for each element.
pub(super) fn joints(accessor: &Accessor, buffers: &Buffers) -> Result<Vec<[u16; 4]>> {
    let read = || {
        let (from, size): (fn(&[u8]) -> u16, usize) = match (accessor.dimensions(), accessor.data_type()) {
            (Dimensions::Vec4, DataType::U8) => (|b| u16::from(b[0]), 1),
            (Dimensions::Vec4, DataType::U16) => (|b| u16::from_le_bytes([b[0], b[1]]), 2),
            (dimensions, data_type) => {
                return Err(Error::usage(format!("has no joints but {dimensions:?} of {data_type:?}")));
            }
        };
        let bytes = elements(accessor, buffers)?;
        Ok(bytes
            .chunks_exact(4 * size)
            .map(|four| std::array::from_fn(|i| from(&four[i * size..])))
            .collect())
    };
    read().map_err(|error| error.at(format_args!("accessor {}", accessor.index())))
}

/// The elements one after another, without gaps, sparse ones substituted.
fn elements<'a>(accessor: &Accessor, buffers: &'a Buffers) -> Result<Cow<'a, [u8]>> {
    let (count, size) = (accessor.count(), accessor.size());
    if count == 0 || count > MAX_COUNT {
        return Err(Error::usage(format!("has {count} elements; 1 to {MAX_COUNT} are read")));
    }
    let dense = match accessor.view() {
        Some(view) => strided(&view, accessor.offset(), count, size, buffers)?,
        // By the specification an accessor without a view is all zeros.
        None => Cow::Owned(vec![0; count * size]),
    };
    let Some(sparse) = accessor.sparse() else { return Ok(dense) };
    let mut dense = dense.into_owned();
    let (places, values) = (sparse.indices(), sparse.values());
    let place_size = match places.index_type() {
        IndexType::U8 => 1,
        IndexType::U16 => 2,
        IndexType::U32 => 4,
    };
    let many = sparse.count();
    if many == 0 || many > count {
        return Err(Error::usage(format!("has {many} sparse elements of {count}")));
    }
    let places = strided(&places.view(), places.offset(), many, place_size, buffers)?;
    let values = strided(&values.view(), values.offset(), many, size, buffers)?;
    for (place, value) in places.chunks_exact(place_size).zip(values.chunks_exact(size)) {
        let place = place.iter().rev().fold(0_usize, |sum, byte| sum << 8 | usize::from(*byte));
        let target = dense
            .get_mut(place * size..(place + 1) * size)
            .ok_or_else(|| Error::usage(format!("has a sparse element at {place}, but there are {count}")))?;
        target.copy_from_slice(value);
    }
    Ok(Cow::Owned(dense))
}

/// `count` elements of `size` bytes from a view, which may leave gaps between them.
fn strided<'a>(
    view: &gltf::buffer::View,
    offset: usize,
    count: usize,
    size: usize,
    buffers: &'a Buffers,
) -> Result<Cow<'a, [u8]>> {
    let bytes = view_bytes(view, buffers)?;
    let stride = view.stride().unwrap_or(size);
    if stride < size {
        return Err(Error::usage(format!("has elements of {size} bytes every {stride} bytes")));
    }
    let length = stride * (count - 1) + size;
    let bytes = offset.checked_add(length).and_then(|end| bytes.get(offset..end)).ok_or_else(|| {
        Error::usage(format!(
            "is truncated: {count} elements of {size} bytes every {stride} bytes, from byte {offset}, do not fit \
             into the {} bytes of its view",
            bytes.len()
        ))
    })?;
    if stride == size {
        return Ok(Cow::Borrowed(bytes));
    }
    Ok(Cow::Owned(bytes.chunks(stride).flat_map(|element| &element[..size]).copied().collect()))
}

/// The bytes of a view.
pub(super) fn view_bytes<'a>(view: &gltf::buffer::View, buffers: &'a Buffers) -> Result<&'a [u8]> {
    let buffer = &buffers[view.buffer().index()];
    let range = view.offset().checked_add(view.length()).and_then(|end| buffer.get(view.offset()..end));
    range.ok_or_else(|| {
        Error::usage(format!(
            "view {} has {} bytes from byte {} of buffer {}, which has {}",
            view.index(),
            view.length(),
            view.offset(),
            view.buffer().index(),
            buffer.len()
        ))
    })
}

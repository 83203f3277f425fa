//! Lists as JSON: what [`LightList::write_json_line`](crate::light::LightList::write_json_line) writes, without the line's end and with one key more at the end,
//! `"stream":{...}`, a [`Delivery`]. A program that knows lists and no streams reads it as a list.

use super::{Delivery, MESSAGE_MAX_BYTES, Message};
use crate::error::{Error, Result};

/// Puts a message together from the JSON object of its list and the rest, into `message`.
///
/// `list` is one JSON object with at least one key, as the list's own `serialize` gives it.
pub fn encode(list: &[u8], delivery: &Delivery, message: &mut Vec<u8>) {
    message.clear();
    message.extend_from_slice(list.strip_suffix(b"}").unwrap_or(list));
    message.extend_from_slice(b",\"stream\":");
    serde_json::to_writer(&mut *message, delivery).expect("numbers go into JSON, and memory takes them");
    message.push(b'}');
}

/// Takes a message apart.
///
/// # Errors
/// Those of [`LightList::read_json`](crate::light::LightList::read_json); a `stream` that is missing or wrong; more than [`MESSAGE_MAX_BYTES`].
pub fn decode(bytes: &[u8], message: &mut Message) -> Result<()> {
    if bytes.len() > MESSAGE_MAX_BYTES {
        return Err(Error::failed(format!("has more than {MESSAGE_MAX_BYTES} bytes: no list has")));
    }
    match message.list.read_json_with(bytes)? {
        Some(delivery) => message.delivery = delivery,
        None => return Err(Error::failed("has no key `stream`: it is a list, but no message")),
    }
    Ok(())
}

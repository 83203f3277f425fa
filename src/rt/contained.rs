use std::panic::{AssertUnwindSafe, catch_unwind};

/// Runs `body`; a panic ends here, and what it said is the error. For code of others that gives up on damaged
/// input, and for threads whose end somebody has to hear of: what `body` owned is dropped while unwinding,
/// and what it has borrowed must be as good half made as the caller takes it to be.
///
/// # Errors
/// The message of the panic.
pub fn contained<T>(body: impl FnOnce() -> T) -> Result<T, String> {
    catch_unwind(AssertUnwindSafe(body)).map_err(|payload| {
        let message = payload
            .downcast_ref::<&str>()
            .copied()
            .or_else(|| payload.downcast_ref::<String>().map(String::as_str))
            .unwrap_or("no message");
        message.to_owned()
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_panic_becomes_its_message() {
        assert_eq!(contained(|| 7), Ok(7));
        assert_eq!(contained::<()>(|| panic!("plain")), Err("plain".to_owned()));
        assert_eq!(contained::<()>(|| panic!("with {}", 7)), Err("with 7".to_owned()));
        assert_eq!(contained::<()>(|| std::panic::panic_any(7)), Err("no message".to_owned()));
    }
}

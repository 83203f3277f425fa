use std::panic::{AssertUnwindSafe, catch_unwind};

/// Runs `body` and catches a panic, whose message becomes the error. This is for third-party code that panics
/// on damaged input, and for threads whose end must be reported: what `body` owned is dropped while
/// unwinding, and the caller must be able to use what it borrowed in a partly changed state.
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

//! The program `lightcast`: see `lightcast --help`.

use std::path::Path;
use std::process::ExitCode;

fn main() -> ExitCode {
    silence_wayland();
    lightcast::cli::main()
}

/// Mesa's Vulkan layer that chooses a device asks for a Wayland display, and the library that it asks
/// complains of an `XDG_RUNTIME_DIR` that is missing, as it is on servers and in containers, on the standard
/// error of the program. A folder that does not exist has no display either, and nobody complains.
#[expect(unsafe_code, reason = "the environment is changed before any thread could read it")]
fn silence_wayland() {
    const NAME: &str = "XDG_RUNTIME_DIR";
    let is_valid = std::env::var_os(NAME).is_some_and(|folder| Path::new(&folder).is_absolute());
    if !is_valid {
        // SAFETY: this is the start of `main`, and the program has no other thread.
        unsafe { std::env::set_var(NAME, "/nonexistent") };
    }
}

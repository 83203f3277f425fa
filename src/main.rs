//! The program `lightcast`: see `lightcast --help`.

use std::path::Path;
use std::process::ExitCode;

fn main() -> ExitCode {
    silence_wayland();
    lightcast::cli::main()
}

/// Mesa's Vulkan layer that chooses a device looks for a Wayland display, and the library that it uses
/// complains on the program's standard error about a missing `XDG_RUNTIME_DIR`, which is usual on servers and
/// in containers. A folder that does not exist has no display either, but causes no complaint.
#[expect(unsafe_code, reason = "the environment is changed before any thread could read it")]
fn silence_wayland() {
    const NAME: &str = "XDG_RUNTIME_DIR";
    let is_valid = std::env::var_os(NAME).is_some_and(|folder| Path::new(&folder).is_absolute());
    if !is_valid {
        // SAFETY: this is the start of `main`, and the program has no other thread.
        unsafe { std::env::set_var(NAME, "/nonexistent") };
    }
}

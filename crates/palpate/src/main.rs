//! `palpate`: see `palpate --help`.

use palpate::{Interrupt, Liveliness};
use std::ffi::OsString;
use std::io::IsTerminal;
use std::sync::atomic::{AtomicU32, Ordering};

/// Mesa's layer that selects devices looks for a display server as soon as drivers are asked, and where there is none a line "error:
/// XDG_RUNTIME_DIR is invalid or not set" appears among ours. Nothing can be selected there, so this process becomes one without that layer.
#[cfg(target_os = "linux")]
fn without_device_selection() {
    use std::os::unix::process::CommandExt as _;
    let unset = |name| std::env::var_os(name).is_none_or(|v| v.is_empty());
    if unset("XDG_RUNTIME_DIR") && unset("NODEVICE_SELECT") {
        let mut own = std::env::args_os();
        if let (Some(name), Ok(program)) = (own.next(), std::env::current_exe()) {
            // Comes back only where it fails: then the line appears, and nothing else is different.
            drop(std::process::Command::new(program).arg0(name).args(own).env("NODEVICE_SELECT", "1").exec());
        }
    }
}

fn main() {
    #[cfg(target_os = "linux")]
    without_device_selection();
    let arguments: Vec<OsString> = std::env::args_os().collect();
    let interrupt = Interrupt::default();
    let raise = interrupt.clone();
    let presses = AtomicU32::new(0);
    let handler = move || {
        if presses.fetch_add(1, Ordering::SeqCst) > 0 {
            std::process::exit(palpate::cli::INTERRUPTED);
        }
        raise.abandon(|said| {
            eprintln!("\ninterrupted: {said}");
            std::process::exit(palpate::cli::INTERRUPTED);
        });
        raise.raise();
        eprintln!("\ninterrupted: stopping at the next time step; press Ctrl-C again to stop at once");
    };
    // Verbs that never look at the interrupt are ended by the system.
    if palpate::cli::listens(arguments.iter().cloned())
        && let Err(e) = ctrlc::set_handler(handler)
    {
        eprintln!("warning: Ctrl-C will stop at once ({e})");
    }
    let alive = if std::io::stderr().is_terminal() { Liveliness::Bars } else { Liveliness::Lines };
    let code = palpate::cli::run(arguments, &mut std::io::stdout(), &mut std::io::stderr(), interrupt, alive);
    std::process::exit(code);
}

//! `palpate`: see `palpate --help`.

use palpate::{Interrupt, Liveliness};
use std::ffi::OsString;
use std::io::IsTerminal;
use std::sync::atomic::{AtomicU32, Ordering};

fn main() {
    let arguments: Vec<OsString> = std::env::args_os().collect();
    let interrupt = Interrupt::default();
    let raise = interrupt.clone();
    let presses = AtomicU32::new(0);
    let handler = move || {
        if presses.fetch_add(1, Ordering::SeqCst) > 0 {
            std::process::exit(palpate::cli::INTERRUPTED);
        }
        raise.raise();
        eprintln!("\ninterrupted: stopping at the next time step; press Ctrl-C again to stop at once");
    };
    // Verbs that never look at the interrupt are ended by the system.
    if palpate::cli::listens(arguments.iter().cloned())
        && let Err(e) = ctrlc::set_handler(handler)
    {
        eprintln!("warning: Ctrl-C will stop at once ({e})");
    }
    let alive = if std::io::stderr().is_terminal() { Liveliness::Bars } else { Liveliness::Silent };
    let code = palpate::cli::run(arguments, &mut std::io::stdout(), &mut std::io::stderr(), interrupt, alive);
    std::process::exit(code);
}

//! `palpate`: see `palpate --help`.

use palpate::{Interrupt, Liveliness};
use std::io::IsTerminal;
use std::sync::atomic::{AtomicU32, Ordering};

fn main() {
    let interrupt = Interrupt::default();
    let raise = interrupt.clone();
    let presses = AtomicU32::new(0);
    let handler = move || {
        if presses.fetch_add(1, Ordering::SeqCst) > 0 {
            std::process::exit(palpate::cli::INTERRUPTED);
        }
        raise.raise();
        eprintln!("\ninterrupted: finishing the current evaluation; press Ctrl-C again to stop at once");
    };
    if let Err(e) = ctrlc::set_handler(handler) {
        eprintln!("warning: Ctrl-C will stop at once ({e})");
    }
    let alive = if std::io::stderr().is_terminal() { Liveliness::Bars } else { Liveliness::Lines };
    let code = palpate::cli::run(std::env::args_os(), &mut std::io::stdout(), &mut std::io::stderr(), interrupt, alive);
    std::process::exit(code);
}

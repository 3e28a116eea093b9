//! Ctrl-C: the first one asks the computation to stop, the second one ends the program.

use std::sync::atomic::{AtomicBool, Ordering};

static STOP: AtomicBool = AtomicBool::new(false);

/// Starts listening. Where a handler cannot be installed, Ctrl-C ends the program as usual.
pub fn listen() {
    // The only failure is a handler that exists already; then that one stays.
    let _ = ctrlc::set_handler(|| {
        if STOP.swap(true, Ordering::SeqCst) {
            std::process::exit(130);
        }
        eprintln!("\nstopping; what was found is kept (Ctrl-C again to end at once)");
    });
}

/// Whether Ctrl-C was pressed.
pub fn is_requested() -> bool {
    STOP.load(Ordering::SeqCst)
}

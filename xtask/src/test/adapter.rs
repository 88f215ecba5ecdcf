//! Finds a graphics adapter, and installs Mesa's software one where it may.

use std::process::Command;

/// What to install where we may not: by system.
const ADVICE: &str = "\
  Debian, Ubuntu   sudo apt-get install mesa-vulkan-drivers
  Fedora           sudo dnf install mesa-vulkan-drivers
  Arch             sudo pacman -S vulkan-swrast
  macOS, Windows   nothing: Metal and Direct3D 12 come with the system";

/// Name of the first adapter that can run the kernels.
fn adapter() -> Option<String> {
    palpate_gpu::adapters().into_iter().find(|a| a.refusal.is_none()).map(|a| a.name)
}

/// The words before `apt-get` with which this user may install packages; `None` where that is impossible.
fn privileged() -> Option<Vec<&'static str>> {
    let succeeds = |program: &str, arguments: &[&str]| {
        Command::new(program).args(arguments).output().is_ok_and(|o| o.status.success()).then_some(())
    };
    succeeds("apt-get", &["--version"])?;
    let root = Command::new("id").arg("-u").output().is_ok_and(|o| o.stdout.starts_with(b"0\n"));
    if root {
        return Some(Vec::new());
    }
    // Only where no password is asked: a test command must not wait for one.
    succeeds("sudo", &["-n", "true"]).map(|()| vec!["sudo", "-n"])
}

/// Installs lavapipe; false when a command fails.
fn install(before: &[&'static str]) -> bool {
    let run = |arguments: &[&str]| {
        let words: Vec<&str> = before.iter().copied().chain(["apt-get"]).chain(arguments.iter().copied()).collect();
        println!("running: {}", words.join(" "));
        Command::new(words[0]).args(&words[1..]).env("DEBIAN_FRONTEND", "noninteractive").status().is_ok_and(|s| s.success())
    };
    let package = ["install", "--yes", "--no-install-recommends", "mesa-vulkan-drivers"];
    // Package lists may be fresh already; only where they are not is the network asked for them.
    run(&package) || (run(&["update"]) && run(&package))
}

/// Name of a usable adapter; where there is none and `may_install`, Mesa's software one is installed first.
///
/// # Errors
/// There is none, and what to install.
pub fn find_adapter(may_install: bool) -> Result<String, String> {
    if let Some(name) = adapter() {
        return Ok(name);
    }
    if may_install && let Some(before) = privileged() {
        println!("no graphics adapter: installing Mesa's software adapter (lavapipe)");
        if install(&before)
            && let Some(name) = adapter()
        {
            return Ok(name);
        }
    }
    Err(format!("there is no usable graphics adapter. Install one:\n{ADVICE}"))
}

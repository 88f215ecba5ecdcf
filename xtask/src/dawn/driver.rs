//! A driver that Dawn takes: the system's, or on Debian a newer Mesa in a folder of its own, which installs nothing.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

/// Mesa's software adapter and what it needs newer than a system may have.
const PACKAGES: [&str; 3] = ["mesa-vulkan-drivers", "libdrm2", "libdrm-amdgpu1"];
/// Where Debian's packages put libraries.
const LIBRARIES: &str = "usr/lib/x86_64-linux-gnu";

/// The folder of a driver, or `None` where the system's own serves.
///
/// # Errors
/// Dawn takes neither.
pub fn find(folder: &Path) -> Result<Option<PathBuf>, String> {
    let takes =
        |driver: Option<&Path>| super::command(folder, "adapter", folder, driver).output().is_ok_and(|o| o.status.success());
    if takes(None) {
        return Ok(None);
    }
    let place = folder.join("mesa");
    if !place.join(LIBRARIES).is_dir() {
        println!("Dawn does not take this system's driver; fetching Mesa's newer one into {}", place.display());
        fetch(&folder.join("apt"), &place)?;
    }
    if takes(Some(&place)) {
        Ok(Some(place))
    } else {
        Err("Dawn takes neither this system's Vulkan driver nor Debian's newer Mesa".into())
    }
}

/// Has a command use the driver in a folder.
pub fn use_it(command: &mut Command, driver: &Path) {
    let libraries = driver.join(LIBRARIES);
    let description = driver.join("lavapipe.json");
    command.env("LD_LIBRARY_PATH", &libraries).env("VK_DRIVER_FILES", &description).env("VK_ICD_FILENAMES", &description);
}

/// A mirror and the name of this release, as apt uses them.
fn mirror() -> Option<(String, String)> {
    let said = Command::new("apt-cache").arg("policy").output().ok()?.stdout;
    // 500 MIRROR RELEASE/main amd64 Packages
    String::from_utf8_lossy(&said).lines().find_map(|line| {
        let words: Vec<&str> = line.split_whitespace().collect();
        let (address, suite) = (words.get(1)?, words.get(2)?.strip_suffix("/main")?);
        let plain = !suite.contains('-') && address.ends_with("/debian");
        plain.then(|| (address.to_string(), suite.to_string()))
    })
}

/// Unpacks the packages of Debian's backports, with lists and cache of apt in a folder of their own.
fn fetch(apt: &Path, place: &Path) -> Result<(), String> {
    let (address, suite) = mirror().ok_or("Dawn needs a newer Vulkan driver, and apt knows no Debian mirror")?;
    let fail = |e: std::io::Error| format!("{}: {e}", apt.display());
    for name in ["lists/partial", "cache/archives/partial", "packages"] {
        fs::create_dir_all(apt.join(name)).map_err(fail)?;
    }
    let sources = apt.join("sources.list");
    fs::write(&sources, format!("deb {address} {suite}-backports main\n")).map_err(fail)?;
    let options: Vec<String> = [
        ("Dir::Etc::sourcelist", sources.display().to_string()),
        ("Dir::Etc::sourceparts", "-".into()),
        ("Dir::State::lists", apt.join("lists").display().to_string()),
        ("Dir::Cache", apt.join("cache").display().to_string()),
    ]
    .iter()
    .map(|(key, value)| format!("{key}={value}"))
    .collect();
    let run = |arguments: &[&str]| {
        let mut command = Command::new("apt-get");
        command.current_dir(apt.join("packages")).arg("--quiet=2");
        options.iter().for_each(|o| {
            command.args(["-o", o]);
        });
        let done = command.args(arguments).status().map_err(|e| format!("apt-get: {e}"))?;
        if done.success() { Ok(()) } else { Err(format!("apt-get {} failed", arguments.join(" "))) }
    };
    run(&["update"])?;
    let release = format!("{suite}-backports");
    run(&[&["-t", release.as_str(), "download"], &PACKAGES[..]].concat())?;
    for entry in fs::read_dir(apt.join("packages")).map_err(fail)?.flatten() {
        let done = Command::new("dpkg-deb").arg("-x").arg(entry.path()).arg(place).status();
        if !done.is_ok_and(|s| s.success()) {
            return Err(format!("dpkg-deb cannot unpack {}", entry.path().display()));
        }
    }
    let library = place.join(LIBRARIES).join("libvulkan_lvp.so");
    let text = serde_json::json!({
        "file_format_version": "1.0.0", "ICD": { "library_path": library, "api_version": "1.3.0" }
    });
    fs::write(place.join("lavapipe.json"), text.to_string()).map_err(fail)
}

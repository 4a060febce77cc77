//! The pages in a real browser, wide and narrow, light and dark: no overflow, no overlap, no errors.
//!
//! This is a separate test program: it needs Chromium, node and npm. Where they are missing it prints that. With `CI` set, as in
//! `cargo xtask test`, which installs them, the test then fails.

#[path = "../report/common.rs"]
mod common;

use std::ffi::OsStr;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::Command;

/// Runs a command to its end; returns whether it succeeded.
fn runs<A: AsRef<OsStr>>(program: &str, args: impl IntoIterator<Item = A>, folder: &Path) -> bool {
    Command::new(program).args(args).current_dir(folder).output().is_ok_and(|ended| ended.status.success())
}

fn chromium() -> Option<PathBuf> {
    let named = std::env::var_os("CHROMIUM").map(PathBuf::from);
    let installed = ["/usr/bin/chromium", "/usr/bin/chromium-browser", "/usr/bin/google-chrome"].map(PathBuf::from);
    named.into_iter().chain(installed).find(|path| path.exists())
}

/// The browser, and the script's folder with its dependencies; or a list of what is missing.
fn ready() -> Result<(PathBuf, PathBuf), String> {
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/browser");
    let tools = || runs("node", ["--version"], &script) && runs("npm", ["--version"], &script);
    let browser = chromium().ok_or("Chromium (apt-get install chromium, or CHROMIUM=its path)")?;
    if !tools() {
        return Err("node and npm (apt-get install nodejs npm)".into());
    }
    if !script.join("node_modules/playwright-core").exists() {
        return Err(format!("playwright-core (npm ci in {})", script.display()));
    }
    Ok((browser, script))
}

#[test]
fn nothing_overflows_or_overlaps_in_a_browser_wide_or_narrow_light_or_dark() {
    let (browser, script) = match ready() {
        Ok(ready) => ready,
        Err(missing) => {
            assert!(std::env::var_os("CI").is_none(), "not looked at in a browser: missing {missing}");
            // Past the test's captured output, so that it is read.
            let _ = writeln!(std::io::stderr(), "NOT LOOKED AT in a browser: missing {missing}");
            return;
        }
    };
    let folder = tempfile::tempdir().unwrap();
    let mut command = Command::new("node");
    // Screenshots of pages with a fault, and with HAPT_SCREENSHOTS set of all, in the build's folder.
    let screenshots = Path::new(env!("CARGO_TARGET_TMPDIR")).join("screenshots");
    std::fs::create_dir_all(&screenshots).unwrap();
    command.arg("look.mjs").arg(browser).arg(&screenshots).current_dir(script);
    for made in common::all_pages() {
        let page = folder.path().join(format!("{}.html", made.stem));
        std::fs::write(&page, made.page).unwrap();
        command.arg(page);
    }
    let looked = command.output().unwrap();
    let printed = String::from_utf8_lossy(&looked.stdout);
    assert!(looked.status.success(), "{printed}{}", String::from_utf8_lossy(&looked.stderr));
}

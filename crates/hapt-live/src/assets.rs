//! The page's files, built from web/ and embedded.

/// Paths on the server and their bytes.
const PAGE: &[(&str, &[u8])] = include!(concat!(env!("OUT_DIR"), "/page.rs"));

/// The core in WebAssembly, for pages without a server; empty where it has not been built.
pub const CORE: &[u8] = include_bytes!(concat!(env!("OUT_DIR"), "/core.wasm"));

/// The page of a checkout in which the page has not been built.
const UNBUILT: &[u8] = b"<!doctype html><html lang=\"en\"><meta charset=\"utf-8\"><title>hapt live</title>\
<p>The page has not been built: npm ci and npm run build in web/, then build hapt anew.\n";

/// A file of the page.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Asset {
    /// Its bytes.
    pub bytes: &'static [u8],
    /// Its media type.
    pub media: &'static str,
    /// Whether it never changes under its name.
    pub is_hashed: bool,
}

/// The path of the files that are embedded in reports.
const REPORT: &str = "/report/";

/// Every file of the page: its path on the server, and its bytes.
pub fn all() -> impl Iterator<Item = (&'static str, &'static [u8])> {
    PAGE.iter().copied().filter(|(name, _)| !name.starts_with(REPORT))
}

/// A file for reports, which is text.
pub fn report(name: &str) -> Option<&'static str> {
    let (_, bytes) = PAGE.iter().find(|(at, _)| at.strip_prefix(REPORT) == Some(name))?;
    std::str::from_utf8(bytes).ok()
}

/// What is at this path, if anything.
pub fn asset(path: &str) -> Option<Asset> {
    let name = if path == "/" { "/index.html" } else { path };
    let found = all().find(|(at, _)| *at == name).map(|(_, bytes)| bytes);
    let bytes = found.or_else(|| (name == "/index.html").then_some(UNBUILT))?;
    // Vite puts files with a hash in their names there.
    Some(Asset { bytes, media: media(name), is_hashed: name.starts_with("/assets/") })
}

fn media(name: &str) -> &'static str {
    match name.rsplit_once('.').map_or("", |(_, ending)| ending) {
        "html" => "text/html; charset=utf-8",
        "js" => "text/javascript; charset=utf-8",
        "css" => "text/css; charset=utf-8",
        "json" | "map" => "application/json",
        "svg" => "image/svg+xml",
        "png" => "image/png",
        "ico" => "image/x-icon",
        "wasm" => "application/wasm",
        "woff2" => "font/woff2",
        "txt" => "text/plain; charset=utf-8",
        _ => "application/octet-stream",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_page_is_at_the_root_and_nothing_outside_of_it_is_served() {
        let page = asset("/").unwrap();
        assert_eq!(asset("/index.html"), Some(page));
        assert_eq!(page.media, "text/html; charset=utf-8");
        assert!(!page.is_hashed && page.bytes.starts_with(b"<!doctype html>"));
        for path in [
            "",
            "/..",
            "/../Cargo.toml",
            "//index.html",
            "/assets",
            "/assets/",
            "/index.html/",
            "/nothing",
            "/report/plots.js",
        ] {
            assert_eq!(asset(path), None, "{path}");
        }
    }

    #[test]
    fn every_file_that_the_page_loads_exists() {
        let page = String::from_utf8_lossy(asset("/").unwrap().bytes);
        for name in page.split(['"', '\'']).filter(|word| word.starts_with("/assets/") || word.starts_with("./assets/"))
        {
            assert!(asset(name.trim_start_matches('.')).is_some(), "{name}");
        }
    }
}

//! The files of the live page, embedded in the binary, so that a run of the page reads neither disk nor network.
//!
//! `page/` is served unchanged, without a build step; the stylesheet is that of the reports. Vendored files, with licence and
//! checksums, are in `page/vendor/`.

use pagekit::page;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Asset {
    /// Value of its `Content-Type`.
    pub content_type: &'static str,
    pub body: &'static [u8],
}

const SCRIPT: &str = "text/javascript; charset=utf-8";
const STYLE: &str = "text/css; charset=utf-8";

/// A file of `page/`, served at `/assets/` and its path there.
macro_rules! file {
    ($path:literal, $content_type:expr) => {
        (
            concat!("/assets/", $path),
            Asset { content_type: $content_type, body: include_bytes!(concat!("page/", $path)) },
        )
    };
}

const ASSETS: &[(&str, Asset)] = &[
    ("/", Asset { content_type: "text/html; charset=utf-8", body: include_bytes!("page/index.html") }),
    ("/assets/page_style.css", Asset { content_type: STYLE, body: page::STYLE.as_bytes() }),
    file!("watch.css", STYLE),
    file!("icon.svg", "image/svg+xml"),
    file!("main.js", SCRIPT),
    file!("chain_layout.js", SCRIPT),
    file!("chains.js", SCRIPT),
    file!("chart_list.js", SCRIPT),
    file!("charts.js", SCRIPT),
    file!("command.js", SCRIPT),
    file!("controls.js", SCRIPT),
    file!("dom.js", SCRIPT),
    file!("fault_form.js", SCRIPT),
    file!("figures.js", SCRIPT),
    file!("heartbeat.js", SCRIPT),
    file!("histogram.js", SCRIPT),
    file!("messages.js", SCRIPT),
    file!("rig_air.js", SCRIPT),
    file!("rig_arrows.js", SCRIPT),
    file!("rig_carriage.js", SCRIPT),
    file!("rig_cylinder.js", SCRIPT),
    file!("rig_drawing.js", SCRIPT),
    file!("rig_faults.js", SCRIPT),
    file!("rig_key.js", SCRIPT),
    file!("rig_layout.js", SCRIPT),
    file!("rig_linkage.js", SCRIPT),
    file!("store.js", SCRIPT),
    file!("stream.js", SCRIPT),
    file!("strip.js", SCRIPT),
    file!("theme.js", SCRIPT),
    file!("units.js", SCRIPT),
    file!("vendor/uplot/LICENSE", "text/plain; charset=utf-8"),
    file!("vendor/uplot/uPlot.esm.js", SCRIPT),
    file!("vendor/uplot/uPlot.min.css", STYLE),
];

pub(crate) fn find(path: &str) -> Option<Asset> {
    ASSETS.iter().find(|(known, _)| *known == path).map(|(_, asset)| *asset)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;
    use std::path::Path;

    fn page() -> std::path::PathBuf {
        Path::new(env!("CARGO_MANIFEST_DIR")).join("src/page")
    }

    #[test]
    fn every_file_of_the_page_is_served_but_the_checksums() {
        let files = |folder: &str| -> Vec<String> {
            let prefix = if folder.is_empty() { String::new() } else { format!("{folder}/") };
            let entries = std::fs::read_dir(page().join(folder)).unwrap().map(Result::unwrap);
            let files = entries.filter(|entry| entry.path().is_file());
            files.map(|entry| format!("/assets/{prefix}{}", entry.file_name().to_str().unwrap())).collect()
        };
        let mut there: BTreeSet<_> = files("").into_iter().chain(files("vendor/uplot")).collect();
        assert!(there.remove("/assets/index.html") && there.remove("/assets/vendor/uplot/SHA256SUMS"));
        there.extend(["/".to_owned(), "/assets/page_style.css".to_owned()]);
        let served: BTreeSet<_> = ASSETS.iter().map(|(path, _)| (*path).to_owned()).collect();
        assert_eq!(served, there);
        assert_eq!(find("/assets/../main.js"), None);
    }

    #[test]
    fn what_the_page_asks_for_is_served_by_us() {
        for (path, asset) in ASSETS {
            let Ok(text) = std::str::from_utf8(asset.body) else { continue };
            for start in ["src=\"", "href=\"/assets", "from \"./", "from \"/"] {
                for (at, _) in text.match_indices(start) {
                    let quoted = text[at..].split('"').nth(1).unwrap();
                    let wanted =
                        quoted.strip_prefix("./").map_or(quoted.to_owned(), |name| format!("/assets/{name}"));
                    assert!(find(&wanted).is_some(), "{path} asks for {wanted}");
                }
            }
        }
    }

    #[test]
    fn the_pages_own_files_are_short_and_make_no_markup_of_text() {
        // The style of all pages has tests of its own.
        let is_page_file = |path: &str| !path.contains("/vendor/") && path != "/assets/page_style.css";
        for (path, asset) in ASSETS.iter().filter(|(path, _)| is_page_file(path)) {
            let text = std::str::from_utf8(asset.body).unwrap();
            assert!(text.lines().count() <= 500, "{path}");
            for (line, number) in text.lines().zip(1..) {
                assert!(line.chars().count() <= 130, "{path}:{number}");
                for dangerous in [
                    "innerHTML",
                    "outerHTML",
                    "insertAdjacentHTML",
                    "document.write",
                    "eval(",
                    "http://",
                    "https://",
                ] {
                    let is_name_of_svg = line.contains("http://www.w3.org/2000/svg");
                    assert!(is_name_of_svg || !line.contains(dangerous), "{path}:{number}: {dangerous}");
                }
            }
        }
    }
}

//! The files of the page, compiled into the program: it works without a network, and without anything to build.

/// One file.
#[derive(Clone, Copy, Debug)]
pub struct File {
    /// Where a browser finds it.
    pub path: &'static str,
    /// What it is.
    pub kind: &'static str,
    /// What is in it.
    pub text: &'static str,
}

const HTML: &str = "text/html; charset=utf-8";
const CSS: &str = "text/css; charset=utf-8";
const SCRIPT: &str = "text/javascript; charset=utf-8";
const SVG: &str = "image/svg+xml";

macro_rules! file {
    ($name:literal, $kind:expr) => {
        File { path: concat!("/", $name), kind: $kind, text: include_str!(concat!("../page/", $name)) }
    };
}

/// All files.
pub const FILES: &[File] = &[
    File { path: "/", kind: HTML, text: include_str!("../page/index.html") },
    file!("style.css", CSS),
    file!("main.js", SCRIPT),
    file!("link.js", SCRIPT),
    file!("dom.js", SCRIPT),
    file!("map.js", SCRIPT),
    file!("drive.js", SCRIPT),
    file!("chart.js", SCRIPT),
    file!("services.js", SCRIPT),
    file!("lesson.js", SCRIPT),
    file!("reports.js", SCRIPT),
    file!("icon.svg", SVG),
];

/// What somebody sees who is not logged in.
const OUTSIDE: &[File] = &[
    File { path: "/", kind: HTML, text: include_str!("../page/login.html") },
    file!("login.js", SCRIPT),
    file!("style.css", CSS),
    file!("icon.svg", SVG),
];

/// The file at a path, for somebody who is not logged in.
#[must_use]
pub fn outside(path: &str) -> Option<&'static File> {
    OUTSIDE.iter().find(|file| file.path == path)
}

/// The file at a path.
#[must_use]
pub fn find(path: &str) -> Option<&'static File> {
    FILES.iter().find(|file| file.path == path)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_page_loads_nothing_from_elsewhere_and_names_become_text_only() {
        for file in FILES.iter().chain(OUTSIDE) {
            // The one address that is no address: the name of the language of drawings.
            let text = file.text.replace("http://www.w3.org/2000/svg", "");
            for outside in ["http://", "https://", "//cdn", "@import", "url("] {
                assert!(!text.contains(outside), "{} names {outside}", file.path);
            }
            for unsafe_word in
                ["innerHTML", "outerHTML", "insertAdjacentHTML", "document.write", "eval(", "new Function"]
            {
                assert!(!text.contains(unsafe_word), "{} uses {unsafe_word}", file.path);
            }
            // The policy of the page forbids what stands in the text itself.
            if file.kind == HTML {
                assert!(!text.contains("<script>") && !text.contains("<style") && !text.contains(" style="));
                assert!(!text.contains(" onclick") && !text.contains("javascript:"), "{}", file.path);
            }
            assert!(text.lines().count() <= 600, "{} is too long", file.path);
        }
    }

    #[test]
    fn every_module_that_a_file_takes_in_is_there() {
        let mut taken = 0;
        for file in FILES.iter().filter(|file| file.kind == SCRIPT) {
            for name in file.text.lines().filter_map(|line| line.split_once(" from \"./")?.1.split_once('"'))
            {
                assert!(find(&format!("/{}", name.0)).is_some(), "{} takes in {}", file.path, name.0);
                taken += 1;
            }
        }
        assert!(taken >= 6, "{taken} modules");
        for file in ["/login.js", "/style.css", "/icon.svg"] {
            let login = outside("/").expect("the login").text;
            assert!(login.contains(&format!("\"{}\"", &file[1..])) && outside(file).is_some(), "{file}");
        }
        assert!(outside("/main.js").is_none() && outside("/live").is_none());
        let index = find("/").expect("the page").text;
        for path in ["style.css", "main.js", "icon.svg"] {
            assert!(index.contains(&format!("\"{path}\"")), "{path}");
        }
    }
}

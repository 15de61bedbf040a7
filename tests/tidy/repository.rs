//! The files of the repository, read once for every rule.

use super::lexer::Lexed;
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

/// Directories that hold what programs have made.
const MADE: &[&str] = &[".git", "target", "demo-out", "recordings", ".venv", "__pycache__"];

/// A text file.
#[derive(Clone, Debug)]
pub(super) struct File {
    /// Its path in the repository, with `/`.
    pub(super) path: String,
    /// Its text.
    pub(super) text: String,
    /// Whether all of it is there for tests only.
    pub(super) is_test: bool,
}

impl File {
    /// A file; one in a folder `tests`, or with the name tests.rs, is a test.
    pub(super) fn new(path: &str, text: &str) -> Self {
        let is_test = path.split('/').any(|part| part == "tests" || part == "tests.rs");
        Self { path: path.to_owned(), text: text.to_owned(), is_test }
    }
    /// Whether it is Rust.
    pub(super) fn is_rust(&self) -> bool {
        self.path.ends_with(".rs")
    }
    /// Its code, with tests blanked out.
    pub(super) fn lexed(&self) -> Lexed {
        if self.is_test { Lexed::default() } else { Lexed::of(&self.text).without_tests() }
    }
    /// A finding about a line, counted from 1.
    pub(super) fn at(&self, line: usize, what: &str) -> String {
        format!("{}:{line}: {what}", self.path)
    }
}

/// All text files.
pub(super) struct Repository {
    /// In the order of their paths.
    pub(super) files: Vec<File>,
}

impl Repository {
    /// Reads the repository that this test was compiled from.
    pub(super) fn read() -> Self {
        let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
        let mut paths = Vec::new();
        walk(&root, &mut paths);
        let files = paths.iter().map(|path| {
            // Files that are no text, such as pictures, are there for links only.
            let text = String::from_utf8(std::fs::read(path).expect("a file")).unwrap_or_default();
            let inside = path.strip_prefix(&root).expect("below the root");
            File::new(&inside.to_str().expect("a path in UTF-8").replace('\\', "/"), &text)
        });
        let mut files: Vec<File> = files.collect();
        files.sort_by(|a, b| a.path.cmp(&b.path));
        mark_test_modules(&mut files);
        assert!(files.len() > 100, "only {} files were found", files.len());
        Self { files }
    }
    /// The file at `path`, which must exist.
    pub(super) fn file(&self, path: &str) -> &File {
        self.files.iter().find(|file| file.path == path).unwrap_or_else(|| panic!("{path} is missing"))
    }
    /// The Rust sources.
    pub(super) fn sources(&self) -> impl Iterator<Item = &File> {
        self.files.iter().filter(|file| file.is_rust())
    }
}

fn walk(directory: &Path, paths: &mut Vec<PathBuf>) {
    for entry in std::fs::read_dir(directory).expect("a directory") {
        let path = entry.expect("an entry").path();
        let name = path.file_name().and_then(|name| name.to_str()).unwrap_or_default();
        if !path.is_dir() {
            // In a further work tree, .git is a file that says where the repository is.
            if name != ".git" {
                paths.push(path);
            }
        // Cargo marks its target directories, whatever they are called.
        } else if !MADE.contains(&name) && !path.join("CACHEDIR.TAG").exists() {
            walk(&path, paths);
        }
    }
}

/// Files that are taken in by `#[cfg(test)] mod name;` are tests too, wherever they stand.
fn mark_test_modules(files: &mut [File]) {
    let mut tests = BTreeSet::new();
    for file in files.iter().filter(|file| file.is_rust()) {
        let folder = match file.path.strip_suffix(".rs") {
            Some(path) if path.ends_with("/lib") || path.ends_with("/main") => {
                path.rsplit_once('/').map_or("", |p| p.0)
            }
            Some(path) => path,
            None => continue,
        };
        for name in Lexed::of(&file.text).test_modules() {
            tests.insert(format!("{folder}/{name}"));
        }
    }
    for file in files {
        let path = file.path.trim_end_matches(".rs");
        file.is_test |= tests.iter().any(|test| path == test || path.starts_with(&format!("{test}/")));
    }
}

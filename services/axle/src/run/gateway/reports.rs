//! Reports: what `axle calibrate` and `axle tournament` have left in some directories, to look at in the page.
//!
//! Only files whose names are plain are listed, and only what is listed is given: no path of a request is ever opened.

use super::Hall;
use axum::extract::{Path as Part, State};
use axum::http::{StatusCode, header};
use axum::response::{IntoResponse as _, Response};
use serde::Serialize;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// The most files that are listed of a directory.
const MOST: usize = 200;
/// The largest file that is given.
const MAX_BYTES: u64 = 8 * 1024 * 1024;
/// What is shown, by the ends of names.
const KINDS: [(&str, &str); 7] = [
    ("svg", "image/svg+xml"),
    ("png", "image/png"),
    ("json", "application/json"),
    ("md", "text/plain; charset=utf-8"),
    ("csv", "text/plain; charset=utf-8"),
    ("toml", "text/plain; charset=utf-8"),
    ("txt", "text/plain; charset=utf-8"),
];

/// A file that can be looked at.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
struct Report {
    /// The last part of its directory.
    directory: String,
    name: String,
    bytes: u64,
    /// In seconds since 1970.
    changed: u64,
    #[serde(skip)]
    path: PathBuf,
    #[serde(skip)]
    kind: &'static str,
}

/// All of them, the newest first.
fn all(directories: &[PathBuf]) -> Vec<Report> {
    let mut all: Vec<_> = directories.iter().flat_map(|directory| of(directory)).collect();
    all.sort_by(|a, b| b.changed.cmp(&a.changed).then_with(|| a.name.cmp(&b.name)));
    all
}

/// Those of a directory; none where there is none yet.
fn of(directory: &Path) -> Vec<Report> {
    let Ok(entries) = std::fs::read_dir(directory) else { return Vec::new() };
    let place = directory.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
    let reports = entries.take(MOST * 10).flatten().filter_map(|entry| {
        // Links are not followed: they could lead anywhere.
        let metadata = entry.metadata().ok().filter(std::fs::Metadata::is_file)?;
        let name = entry.file_name().into_string().ok().filter(|name| is_plain(name))?;
        let kind = KINDS.iter().find(|(end, _)| name.rsplit('.').next() == Some(end))?.1;
        let changed = metadata.modified().ok()?.duration_since(std::time::UNIX_EPOCH).ok()?.as_secs();
        let (bytes, path) = (metadata.len(), entry.path());
        (bytes <= MAX_BYTES).then_some(Report { directory: place.clone(), name, bytes, changed, path, kind })
    });
    reports.take(MOST).collect()
}

fn is_plain(name: &str) -> bool {
    !name.starts_with('.')
        && name.len() <= 128
        && name.bytes().all(|b| b.is_ascii_alphanumeric() || b"._-".contains(&b))
}

/// `/reports`: what there is.
pub(super) async fn list(State(hall): State<Arc<Hall>>) -> Response {
    let directories = hall.params.reports.clone();
    let found = tokio::task::spawn_blocking(move || serde_json::to_string(&all(&directories)));
    match found.await {
        Ok(Ok(text)) => ([(header::CONTENT_TYPE, "application/json")], text).into_response(),
        _ => StatusCode::INTERNAL_SERVER_ERROR.into_response(),
    }
}

/// `/reports/DIRECTORY/NAME`: one of those that are listed.
pub(super) async fn one(
    State(hall): State<Arc<Hall>>,
    Part((directory, name)): Part<(String, String)>,
) -> Response {
    let directories = hall.params.reports.clone();
    let found = tokio::task::spawn_blocking(move || {
        let report =
            all(&directories).into_iter().find(|one| one.directory == directory && one.name == name)?;
        Some((report.kind, std::fs::read(report.path).ok()?))
    });
    match found.await {
        Ok(Some((kind, bytes))) => ([(header::CONTENT_TYPE, kind)], bytes).into_response(),
        _ => (StatusCode::NOT_FOUND, "there is no such report\n").into_response(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn plain_files_are_listed_and_nothing_else() {
        let place = std::env::temp_dir().join(format!("axle-reports-{}", std::process::id()));
        std::fs::create_dir_all(place.join("inner.md")).expect("a directory");
        for name in ["a.md", "b.svg", "c.exe", ".d.md", "e f.md", "<b>.md", "g.report.json"] {
            std::fs::write(place.join(name), "x").expect("a file");
        }
        std::os::unix::fs::symlink("/etc/passwd", place.join("h.txt")).expect("a link");
        let mut names: Vec<_> =
            all(&[place.clone(), "no/such".into()]).into_iter().map(|one| one.name).collect();
        names.sort();
        assert_eq!(names, ["a.md", "b.svg", "g.report.json"]);
        std::fs::remove_dir_all(&place).expect("removed");
    }
}

//! A small disk that can be filled: for this a person must be root.

use anyhow::Context as _;
use std::io::Write as _;
use std::path::{Path, PathBuf};
use tokio::process::Command;

/// What the disk holds.
const SIZE: &str = "size=512k";

/// A disk in memory; it goes when it is dropped.
pub(super) struct Disk(PathBuf);

impl Disk {
    /// Mounts it.
    ///
    /// # Errors
    /// When this person or this system may not.
    pub(super) async fn mount() -> anyhow::Result<Self> {
        let path = std::env::temp_dir().join(format!("axle-disk-{}", std::process::id()));
        std::fs::create_dir_all(&path)?;
        let mut mount = Command::new("mount");
        mount.args(["-t", "tmpfs", "-o", SIZE, "axle-disk"]).arg(&path);
        let done = mount.output().await.context("run mount")?;
        let words = String::from_utf8_lossy(&done.stderr);
        anyhow::ensure!(done.status.success(), "mount a disk: {}", words.trim());
        Ok(Self(path))
    }
    pub(super) fn path(&self) -> &Path {
        &self.0
    }
}

/// Writes until nothing fits.
pub(super) fn fill(disk: &Path) -> anyhow::Result<()> {
    let mut file = std::fs::File::create(disk.join("full"))?;
    while file.write_all(&[0; 4096]).is_ok() {}
    // Down to the last byte.
    while file.write_all(&[0]).is_ok() {}
    Ok(())
}

/// Makes room.
pub(super) fn empty(disk: &Path) -> anyhow::Result<()> {
    std::fs::remove_file(disk.join("full")).context("make room on the disk")
}

impl Drop for Disk {
    fn drop(&mut self) {
        drop(std::process::Command::new("umount").arg("--lazy").arg(&self.0).output());
        drop(std::fs::remove_dir(&self.0));
    }
}

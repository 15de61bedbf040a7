//! The map service as a process: it says the map of a file to whoever asks, however late they join.
//!
//! The file is read once, when the service begins: what robots plan on does not change under them. A new map is a new
//! start of the service; those who ask with the content that they have learn of it at their next question.

use super::Context;
use crate::out::usage;
use crate::params::load;
use axle_maps::{Description, Grid, MapParams, describe, image};
use axle_schema::{MapAsk, MapData, Refusal, key};
use std::io::Read as _;
use std::path::Path;

/// Says the map until it is told to stop.
pub(crate) async fn run(mut context: Context) -> anyhow::Result<()> {
    let map = load_map(context.params.as_deref())?;
    let key = match &context.robot {
        Some(robot) => key::MAP.of(Some(robot)),
        None => key::MAP.of_every_robot(),
    };
    let server = context.mesh.server::<MapAsk, MapData>(&key)?;
    let _visible = context.ready()?;
    loop {
        let asked = tokio::select! {
            asked = server.next() => asked,
            () = context.stop.wait() => return Ok(()),
        };
        let answer = asked.question().and_then(|question| answer(map.as_ref(), question));
        asked.reply(answer);
    }
}

fn answer(map: Option<&MapData>, question: MapAsk) -> Result<MapData, Refusal> {
    let hint = "the map service was started without one; set `file` in its parameters";
    let map = map.ok_or_else(|| Refusal::missing("map", hint))?;
    let is_known = question.have == Some(map.content);
    Ok(if is_known { MapData { runs: Vec::new(), name: map.name.clone(), ..*map } } else { map.clone() })
}

/// Whether the service can begin with this file of parameters, and with the map that they name.
pub(crate) fn check(file: Option<&Path>) -> anyhow::Result<()> {
    load_map(file).map(drop)
}

fn load_map(file: Option<&Path>) -> anyhow::Result<Option<MapData>> {
    let params: MapParams = load(file)?;
    if params.file.is_empty() {
        return Ok(None);
    }
    let grid = read(Path::new(&params.file))?;
    Ok(Some(grid.to_data().map_err(|refusal| usage(format!("{}: {refusal}", params.file)))?))
}

/// Reads a `map.yaml` and the image beside it.
///
/// # Errors
/// A usage error that names the file and the fault.
pub(crate) fn read(path: &Path) -> anyhow::Result<Grid> {
    let (description, image_path) = description(path)?;
    let wrong = |path: &Path, refusal: Refusal| usage(format!("{}: {refusal}", path.display()));
    let bytes = bounded(&image_path, image::MAX_BYTES)?;
    let image = image::read(&bytes).map_err(|refusal| wrong(&image_path, refusal))?;
    let name = path.file_stem().map(|stem| stem.to_string_lossy().into_owned()).unwrap_or_default();
    description.grid(&name, &image).map_err(|refusal| wrong(path, refusal))
}

/// Reads a `map.yaml`, and says where its image is.
pub(crate) fn description(path: &Path) -> anyhow::Result<(Description, std::path::PathBuf)> {
    let bytes = bounded(path, describe::MAX_BYTES)?;
    let description =
        Description::read(&bytes).map_err(|refusal| usage(format!("{}: {refusal}", path.display())))?;
    let image = path.parent().unwrap_or_else(|| Path::new("")).join(&description.image);
    Ok((description, image))
}

/// Reads a file of at most `limit` bytes; one byte more is read, so that whoever reads the bytes refuses the size.
fn bounded(path: &Path, limit: usize) -> anyhow::Result<Vec<u8>> {
    let cannot = |fault: std::io::Error| usage(format!("cannot read {}: {fault}", path.display()));
    let file = std::fs::File::open(path).map_err(cannot)?;
    let mut bytes = Vec::new();
    file.take(limit as u64 + 1).read_to_end(&mut bytes).map_err(cannot)?;
    Ok(bytes)
}

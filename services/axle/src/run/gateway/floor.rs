//! The map of the floor: asked of the map service when there is one, and put up as the areas that a page draws.
//!
//! A map does not change while its service runs, and a service that is started anew may have another one: so it is asked
//! again and again with the content that is known, and answers with a head of some bytes. Where there is no map service,
//! nobody is asked.

use super::{Hall, lock};
use axle_gateway::board::{MAX_WORD, Place, Word};
use axle_maps::{Grid, Ink};
use axle_mesh::Retry;
use axle_schema::{MapAsk, MapData, Metres, Refusal, key};
use serde::Serialize;
use std::sync::Arc;
use std::time::Duration;

/// How often the map is asked for, and how long its answer may take.
const PACE: Duration = Duration::from_secs(2);
const PATIENCE: Duration = Duration::from_secs(3);
/// The most areas of a drawing: some hundred thousand bytes.
const AREAS: usize = 4000;

/// A map as a page draws it.
#[derive(Serialize)]
struct Floor<'a> {
    name: &'a str,
    /// Names what is in it.
    content: u64,
    resolution: Metres,
    /// The corners of the whole map, one after the other.
    corners: [(f64, f64); 4],
    /// Obstacles, and what nobody knows: the corners of each area.
    walls: Vec<[(f64, f64); 4]>,
    unknown: Vec<[(f64, f64); 4]>,
}

/// Asks again and again.
pub(super) async fn look(hall: &Arc<Hall>) {
    let mut known = None;
    let mut pace = tokio::time::interval(PACE);
    pace.set_missed_tick_behavior(tokio::time::MissedTickBehavior::Delay);
    loop {
        pace.tick().await;
        if !lock(&hall.processes).iter().any(|process| process.service == "map") {
            continue;
        }
        match news(hall, known).await {
            Ok(Some(content)) => known = Some(content),
            Ok(None) => {}
            Err(refusal) => tracing::debug!("the map is not drawn: {refusal}"),
        }
    }
}

/// Puts the map up if it is another one than the one that is known.
async fn news(hall: &Arc<Hall>, known: Option<u64>) -> Result<Option<u64>, Refusal> {
    let ask = MapAsk { have: known };
    let map = hall.mesh.ask(&key::MAP, hall.only.as_ref(), &ask, PATIENCE, Retry::Idempotent).await?;
    if known == Some(map.content) {
        return Ok(None);
    }
    let content = map.content;
    // Millions of cells take a while, and pages are waiting to be told of robots.
    let word = tokio::task::spawn_blocking(move || drawn(&map)).await.map_err(Refusal::internal)??;
    let place = Place { robot: axle_schema::id::ALL.into(), stream: "map".into() };
    hall.board().put(hall.now(), place, word);
    Ok(Some(content))
}

fn drawn(map: &MapData) -> Result<Word, Refusal> {
    let grid = Grid::of_data(map)?;
    let mut most = AREAS;
    loop {
        let text = serde_json::to_string(&Floor::of(&grid, map.content, most)).map_err(Refusal::internal)?;
        // Coordinates may have many letters; then it is drawn coarser.
        if text.len() <= MAX_WORD || most < 2 {
            return Ok(text.into());
        }
        most /= 2;
    }
}

impl<'a> Floor<'a> {
    fn of(grid: &'a Grid, content: u64, most: usize) -> Self {
        let round = |value: f64| (value * 1e3).round() / 1e3;
        let rounded = |(x, y): (f64, f64)| (round(x), round(y));
        #[allow(clippy::cast_precision_loss, reason = "sides are below 2^16")]
        let (u, v) = (grid.width() as f64, grid.height() as f64);
        let corners = [(0.0, 0.0), (u, 0.0), (u, v), (0.0, v)];
        let corners = corners.map(|(u, v)| rounded(grid.in_metres(u, v)));
        let (mut walls, mut unknown) = (Vec::new(), Vec::new());
        for (ink, corners) in axle_maps::areas(grid, most) {
            let list = if ink == Ink::Occupied { &mut walls } else { &mut unknown };
            list.push(corners.map(rounded));
        }
        Self { name: &grid.name, content, resolution: grid.resolution, corners, walls, unknown }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use axle_schema::Pose;
    use serde_json::{Value, json};

    #[test]
    fn a_map_is_drawn_as_its_walls_and_a_large_one_still_fits_into_a_word() {
        let small = Grid::new("hall", Metres(0.5), Pose::new(1.0, 2.0, 0.0), 2, vec![0, 100, 255, 0]);
        let word = drawn(&small.and_then(|grid| grid.to_data()).expect("a map")).expect("a word");
        let value: Value = serde_json::from_str(&word).expect("JSON");
        assert_eq!(value["name"], "hall");
        assert_eq!(value["corners"], json!([[1.0, 2.0], [2.0, 2.0], [2.0, 3.0], [1.0, 3.0]]));
        assert_eq!(value["walls"], json!([[[1.5, 2.0], [2.0, 2.0], [2.0, 2.5], [1.5, 2.5]]]));
        assert_eq!(value["unknown"].as_array().map(Vec::len), Some(1));
        let specks = (0..400 * 400).map(|cell| if cell % 3 == 0 { 100 } else { 0 }).collect();
        let large = Grid::new("specks", Metres(0.05), Pose::new(-9999.123, 9999.456, 0.7), 400, specks);
        let word = drawn(&large.and_then(|grid| grid.to_data()).expect("a map")).expect("a word");
        assert!(word.len() <= MAX_WORD, "{} bytes", word.len());
    }
}

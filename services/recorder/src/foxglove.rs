//! Foxglove's well-known schemas, as far as they are used: what Foxglove, Lichtblick and PlotJuggler show by themselves.
//!
//! Names and fields are those of <https://docs.foxglove.dev/docs/visualization/message-schemas/introduction>, in JSON.

use axle_schema::Pose;
use serde_json::{Value, json};

/// A message schema of Foxglove.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum View {
    /// `foxglove.PoseInFrame`.
    Pose,
    /// `foxglove.PosesInFrame`.
    Poses,
    /// `foxglove.FrameTransform`.
    Transform,
    /// `foxglove.SceneUpdate`.
    Scene,
    /// `foxglove.Log`.
    Log,
}

impl View {
    /// Its name, as Foxglove knows it.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Pose => "foxglove.PoseInFrame",
            Self::Poses => "foxglove.PosesInFrame",
            Self::Transform => "foxglove.FrameTransform",
            Self::Scene => "foxglove.SceneUpdate",
            Self::Log => "foxglove.Log",
        }
    }
    /// The JSON schema that stands in the file.
    #[must_use]
    pub fn schema(self) -> String {
        let fields = match self {
            Self::Pose => json!({ "timestamp": time(), "frame_id": text(), "pose": pose() }),
            Self::Poses => json!({ "timestamp": time(), "frame_id": text(), "poses": list(pose()) }),
            Self::Transform => json!({
                "timestamp": time(), "parent_frame_id": text(), "child_frame_id": text(),
                "translation": numbers(&["x", "y", "z"]), "rotation": numbers(&["x", "y", "z", "w"]),
            }),
            Self::Scene => {
                json!({ "deletions": list(json!({ "type": "object" })), "entities": list(entity()) })
            }
            Self::Log => json!({
                "timestamp": time(), "level": { "type": "integer" }, "message": text(), "name": text(),
                "file": text(), "line": { "type": "integer" },
            }),
        };
        let mut schema = object(fields);
        schema["$schema"] = "https://json-schema.org/draft/2020-12/schema".into();
        schema["title"] = self.name().into();
        schema.to_string()
    }
}

fn object(fields: Value) -> Value {
    json!({ "type": "object", "properties": fields })
}
fn list(items: Value) -> Value {
    json!({ "type": "array", "items": items })
}
fn text() -> Value {
    json!({ "type": "string" })
}
fn numbers(names: &[&str]) -> Value {
    object(names.iter().map(|name| ((*name).to_owned(), json!({ "type": "number" }))).collect())
}
fn time() -> Value {
    let whole = json!({ "type": "integer", "minimum": 0 });
    let mut time = object(json!({ "sec": whole, "nsec": whole }));
    time["title"] = "time".into();
    time
}
fn pose() -> Value {
    object(json!({ "position": numbers(&["x", "y", "z"]), "orientation": numbers(&["x", "y", "z", "w"]) }))
}
fn color() -> Value {
    numbers(&["r", "g", "b", "a"])
}
fn entity() -> Value {
    let size = || numbers(&["x", "y", "z"]);
    let solid = || list(object(json!({ "pose": pose(), "size": size(), "color": color() })));
    let line = json!({
        "type": { "type": "integer" }, "pose": pose(), "thickness": { "type": "number" },
        "scale_invariant": { "type": "boolean" }, "points": list(size()), "color": color(),
        "colors": list(color()), "indices": list(json!({ "type": "integer" })),
    });
    let other = || list(json!({ "type": "object" }));
    let mut duration = time();
    duration["title"] = "duration".into();
    object(json!({
        "timestamp": time(), "frame_id": text(), "id": text(), "lifetime": duration,
        "frame_locked": { "type": "boolean" }, "metadata": other(), "arrows": other(), "cubes": solid(),
        "spheres": solid(), "cylinders": other(), "lines": list(object(line)), "triangles": other(),
        "texts": other(), "models": other(),
    }))
}

/// A time in nanoseconds since 1970.
pub(crate) fn stamp(at: u64) -> Value {
    json!({ "sec": at / 1_000_000_000, "nsec": at % 1_000_000_000 })
}
fn point(x: f64, y: f64, z: f64) -> Value {
    json!({ "x": x, "y": y, "z": z })
}
fn orientation(heading: f64) -> Value {
    let (sin, cos) = (heading / 2.0).sin_cos();
    json!({ "x": 0.0, "y": 0.0, "z": sin, "w": cos })
}
/// A pose in the plane, as one in space.
pub(crate) fn pose_of(pose: Pose) -> Value {
    json!({ "position": point(pose.x.0, pose.y.0, 0.0), "orientation": orientation(pose.heading.0) })
}
/// A pose in the frame `map`.
pub(crate) fn pose_in_map(at: u64, pose: Pose) -> Value {
    json!({ "timestamp": stamp(at), "frame_id": "map", "pose": pose_of(pose) })
}
/// Where the frame `child` is in the frame `map`.
pub(crate) fn transform(at: u64, child: &str, pose: Pose) -> Value {
    json!({
        "timestamp": stamp(at), "parent_frame_id": "map", "child_frame_id": child,
        "translation": point(pose.x.0, pose.y.0, 0.0), "rotation": orientation(pose.heading.0),
    })
}
/// Poses in the frame `map`.
pub(crate) fn poses_in_map(at: u64, poses: &[Pose]) -> Value {
    let poses: Vec<_> = poses.iter().copied().map(pose_of).collect();
    json!({ "timestamp": stamp(at), "frame_id": "map", "poses": poses })
}
/// How bad a line of the log is: 1 = debug, 2 = info, 3 = warning, 4 = error.
pub(crate) fn log(at: u64, level: u8, name: &str, message: &str) -> Value {
    json!({ "timestamp": stamp(at), "level": level, "message": message, "name": name, "file": "", "line": 0 })
}
/// A body that stays in its frame.
pub(crate) fn body(at: u64, frame: &str) -> Value {
    let tall = 0.12;
    let cube = |x: f64, length: f64, color: [f64; 4]| {
        json!({
            "pose": { "position": point(x, 0.0, tall / 2.0), "orientation": orientation(0.0) },
            "size": point(length, 0.3, tall), "color": paint(color),
        })
    };
    // A dark nose shows where ahead is.
    let cubes = [cube(-0.02, 0.28, [0.25, 0.5, 0.85, 0.9]), cube(0.14, 0.04, [0.1, 0.15, 0.3, 1.0])];
    scene(at, frame, "body", true, json!({ "cubes": cubes }))
}
/// Points to visit, one after the other.
pub(crate) fn points(at: u64, points: &[(f64, f64)]) -> Value {
    let spheres: Vec<_> = points
        .iter()
        .map(|&(x, y)| {
            json!({
                "pose": { "position": point(x, y, 0.0), "orientation": orientation(0.0) },
                "size": point(0.06, 0.06, 0.06), "color": paint([0.9, 0.4, 0.1, 0.9]),
            })
        })
        .collect();
    scene(at, "map", "way points", false, json!({ "spheres": spheres }))
}
fn paint([r, g, b, a]: [f64; 4]) -> Value {
    json!({ "r": r, "g": g, "b": b, "a": a })
}
fn scene(at: u64, frame: &str, id: &str, locked: bool, shapes: Value) -> Value {
    let mut entity = json!({
        "timestamp": stamp(at), "frame_id": frame, "id": id, "lifetime": { "sec": 0, "nsec": 0 },
        "frame_locked": locked, "metadata": [], "arrows": [], "cubes": [], "spheres": [], "cylinders": [],
        "lines": [], "triangles": [], "texts": [], "models": [],
    });
    if let (Value::Object(entity), Value::Object(shapes)) = (&mut entity, shapes) {
        entity.extend(shapes);
    }
    json!({ "deletions": [], "entities": [entity] })
}

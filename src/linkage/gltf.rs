//! States of one linkage as a glTF 2.0 binary (`.glb`): one mesh, a morph target for every state after the first, and an
//! animation that goes through them, so that viewers and Blender play the opening.
//!
//! Positions stay in millimetres with Z up, in single precision as the format has it; the node brings them to the format's
//! metres with Y up. There are no normals: the format asks viewers to shade flat then, which is what rigid triangles
//! look like. At the key frames the mesh is the state; between them points go straight, and edges are a little short.

use nalgebra::Point3;
use serde_json::{Value, json};

use super::Linkage;

/// Time from one state to the next, seconds, for a path of [`EASY_STEPS`] steps; never shorter than [`SHORTEST_STEP`].
const PATH_SECONDS: f32 = 5.0;

/// A path of at most so many steps takes half a second for each.
const EASY_STEPS: usize = 10;

/// Shortest time between two states, seconds.
const SHORTEST_STEP: f32 = 0.04;

/// Component types and targets of the format.
const FLOAT: u32 = 5126;
const UNSIGNED_INT: u32 = 5125;
const ARRAY_BUFFER: u32 = 34962;
const ELEMENT_ARRAY_BUFFER: u32 = 34963;

/// The buffer with the accessors that tell what is where in it; every number is four bytes, so that all is aligned.
#[derive(Default)]
struct Buffer {
    bytes: Vec<u8>,
    views: Vec<Value>,
    accessors: Vec<Value>,
}

impl Buffer {
    /// Adds numbers of four bytes and gives the accessor's number. `more` are further keys of the accessor.
    fn add(
        &mut self,
        numbers: impl Iterator<Item = [u8; 4]>,
        target: Option<u32>,
        mut accessor: Value,
    ) -> usize {
        let offset = self.bytes.len();
        self.bytes.extend(numbers.flatten());
        let mut view =
            json!({ "buffer": 0, "byteOffset": offset, "byteLength": self.bytes.len() - offset });
        if let Some(target) = target {
            view["target"] = json!(target);
        }
        accessor["bufferView"] = json!(self.views.len());
        self.views.push(view);
        self.accessors.push(accessor);
        self.accessors.len() - 1
    }

    /// Adds vectors, with the bounds that the format wants.
    fn add_vectors(&mut self, vectors: &[[f32; 3]]) -> usize {
        let bound = |k: usize, pick: fn(f32, f32) -> f32| vectors.iter().map(|v| v[k]).reduce(pick);
        let bounds = |pick: fn(f32, f32) -> f32| [0, 1, 2].map(|k| bound(k, pick).unwrap_or(0.0));
        let accessor = json!({
            "componentType": FLOAT, "type": "VEC3", "count": vectors.len(),
            "min": bounds(f32::min), "max": bounds(f32::max),
        });
        let numbers = vectors.iter().flatten().map(|x| x.to_le_bytes());
        self.add(numbers, Some(ARRAY_BUFFER), accessor)
    }

    /// Adds single numbers, with bounds if they are times.
    fn add_scalars(&mut self, numbers: &[f32], times: bool) -> usize {
        let mut accessor =
            json!({ "componentType": FLOAT, "type": "SCALAR", "count": numbers.len() });
        if times && let (Some(first), Some(last)) = (numbers.first(), numbers.last()) {
            accessor["min"] = json!([first]);
            accessor["max"] = json!([last]);
        }
        self.add(numbers.iter().map(|x| x.to_le_bytes()), None, accessor)
    }
}

/// The states of a linkage (positions by point, millimetres; one at least) as a glTF binary. `None` if there is no state,
/// or the file would be larger than its format can say (4 GB).
pub fn write_glb(linkage: &Linkage, states: &[&[Point3<f64>]]) -> Option<Vec<u8>> {
    let single = |p: &Point3<f64>| [p.x as f32, p.y as f32, p.z as f32];
    let (first, later) = states.split_first()?;
    let rest: Vec<[f32; 3]> = first.iter().map(single).collect();
    let mut buffer = Buffer::default();
    let corners = linkage.triangles.iter().flat_map(|t| t.points.map(|p| p.0));
    let indices = buffer.add(
        corners.map(u32::to_le_bytes),
        Some(ELEMENT_ARRAY_BUFFER),
        json!({ "componentType": UNSIGNED_INT, "type": "SCALAR", "count": 3 * linkage.triangles.len() }),
    );
    let positions = buffer.add_vectors(&rest);
    let mut targets = Vec::with_capacity(later.len());
    for state in later {
        let moved = |(p, q): (&Point3<f64>, &[f32; 3])| {
            let p = single(p);
            [0, 1, 2].map(|k| p[k] - q[k])
        };
        let moves: Vec<[f32; 3]> = state.iter().zip(&rest).map(moved).collect();
        targets.push(json!({ "POSITION": buffer.add_vectors(&moves) }));
    }

    let count = later.len();
    let mut primitive = json!({ "attributes": { "POSITION": positions }, "indices": indices, "material": 0, "mode": 4 });
    let mut mesh = json!({ "name": "linkage" });
    let mut document = json!({
        "asset": { "version": "2.0", "generator": concat!("kagome ", env!("CARGO_PKG_VERSION")) },
        "scene": 0,
        "scenes": [{ "nodes": [0] }],
        // Millimetres with Z up, turned by −90° about X.
        "nodes": [{
            "name": "linkage", "mesh": 0, "scale": [0.001, 0.001, 0.001],
            "rotation": [-std::f64::consts::FRAC_1_SQRT_2, 0.0, 0.0, std::f64::consts::FRAC_1_SQRT_2],
        }],
        "materials": [{
            "name": "sheet", "doubleSided": true,
            "pbrMetallicRoughness": { "baseColorFactor": [0.8, 0.7, 0.55, 1.0], "metallicFactor": 0.0, "roughnessFactor": 0.8 },
        }],
    });
    if count > 0 {
        primitive["targets"] = json!(targets);
        let names: Vec<String> = (1..=count).map(|n| format!("state-{n:03}")).collect();
        mesh["weights"] = json!(vec![0.0; count]);
        // What Blender and others call the targets by.
        mesh["extras"] = json!({ "targetNames": names });
        let pace = (PATH_SECONDS / count.max(EASY_STEPS) as f32).max(SHORTEST_STEP);
        let times: Vec<f32> = (0..=count).map(|n| n as f32 * pace).collect();
        let weights: Vec<f32> = (0..=count)
            .flat_map(|frame| (1..=count).map(move |n| f32::from(u8::from(n == frame))))
            .collect();
        let input = buffer.add_scalars(&times, true);
        let output = buffer.add_scalars(&weights, false);
        document["animations"] = json!([{
            "name": "opening",
            "samplers": [{ "input": input, "output": output, "interpolation": "LINEAR" }],
            "channels": [{ "sampler": 0, "target": { "node": 0, "path": "weights" } }],
        }]);
    }
    mesh["primitives"] = json!([primitive]);
    document["meshes"] = json!([mesh]);
    document["buffers"] = json!([{ "byteLength": buffer.bytes.len() }]);
    document["bufferViews"] = json!(buffer.views);
    document["accessors"] = json!(buffer.accessors);
    binary(&document, &buffer.bytes)
}

/// The document and its buffer as chunks of one file.
fn binary(document: &Value, bytes: &[u8]) -> Option<Vec<u8>> {
    let mut text = document.to_string().into_bytes();
    // Chunks are multiples of four bytes; the buffer is one already.
    text.resize(text.len().next_multiple_of(4), b' ');
    let total = 12 + 8 + text.len() + 8 + bytes.len();
    let mut file = Vec::with_capacity(total);
    file.extend(b"glTF");
    file.extend(2u32.to_le_bytes());
    file.extend(u32::try_from(total).ok()?.to_le_bytes());
    for (kind, chunk) in [(b"JSON", text.as_slice()), (b"BIN\0", bytes)] {
        file.extend(u32::try_from(chunk.len()).ok()?.to_le_bytes());
        file.extend(kind);
        file.extend(chunk);
    }
    Some(file)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::ids::Id as _;
    use crate::linkage::Handedness;

    fn number(bytes: &[u8], at: usize) -> u32 {
        u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap())
    }

    /// The file taken apart: its document, and the numbers of an accessor.
    fn parts(file: &[u8]) -> (Value, Vec<u8>) {
        assert_eq!(&file[..4], b"glTF");
        assert_eq!((number(file, 4), number(file, 8) as usize), (2, file.len()));
        let length = number(file, 12) as usize;
        assert_eq!(&file[16..20], b"JSON");
        let document = serde_json::from_slice(&file[20..20 + length]).unwrap();
        let binary = &file[20 + length..];
        assert_eq!(&binary[4..8], b"BIN\0");
        assert_eq!(number(binary, 0) as usize, binary.len() - 8);
        (document, binary[8..].to_vec())
    }

    fn words(document: &Value, bytes: &[u8], accessor: &Value) -> Vec<u32> {
        let accessor = &document["accessors"][accessor.as_u64().unwrap() as usize];
        let view = &document["bufferViews"][accessor["bufferView"].as_u64().unwrap() as usize];
        let get = |key: &str| view[key].as_u64().unwrap() as usize;
        let each = if accessor["type"] == "VEC3" { 3 } else { 1 };
        assert_eq!(
            get("byteLength") as u64,
            4 * each * accessor["count"].as_u64().unwrap()
        );
        assert_eq!(get("byteOffset") % 4, 0);
        let part = &bytes[get("byteOffset")..][..get("byteLength")];
        (0..part.len() / 4).map(|n| number(part, 4 * n)).collect()
    }

    #[test]
    fn a_viewer_that_follows_the_format_gets_every_state_at_its_key_frame() {
        let linkage = Linkage::patch(3.0, Handedness::Left, &Linkage::hexagon_cells(2));
        let states: Vec<Vec<Point3<f64>>> = (0..4)
            .map(|s| {
                let at = |i: usize| {
                    let (i, s) = (i as f64, f64::from(s));
                    Point3::new(i + 0.1 * s, -2.0 * i + s * s, 0.3 * i * s)
                };
                (0..linkage.point_count()).map(at).collect()
            })
            .collect();
        let all: Vec<&[Point3<f64>]> = states.iter().map(Vec::as_slice).collect();
        let (document, bytes) = parts(&write_glb(&linkage, &all).unwrap());
        assert_eq!(document["buffers"][0]["byteLength"], bytes.len());
        let floats = |accessor: &Value| -> Vec<f32> {
            words(&document, &bytes, accessor)
                .into_iter()
                .map(f32::from_bits)
                .collect()
        };
        let primitive = &document["meshes"][0]["primitives"][0];
        let corners: Vec<u32> = linkage
            .triangles
            .iter()
            .flat_map(|t| t.points.map(|p| p.index() as u32))
            .collect();
        assert_eq!(words(&document, &bytes, &primitive["indices"]), corners);
        let rest = floats(&primitive["attributes"]["POSITION"]);
        let targets: Vec<Vec<f32>> = primitive["targets"]
            .as_array()
            .unwrap()
            .iter()
            .map(|t| floats(&t["POSITION"]))
            .collect();
        let sampler = &document["animations"][0]["samplers"][0];
        let (times, weights) = (floats(&sampler["input"]), floats(&sampler["output"]));
        assert_eq!((targets.len(), times.len(), weights.len()), (3, 4, 12));
        assert!(times.windows(2).all(|t| t[0] < t[1]));
        for (frame, state) in states.iter().enumerate() {
            for (i, p) in state.iter().enumerate() {
                for k in 0..3 {
                    let moves = targets.iter().zip(&weights[3 * frame..]);
                    let x = rest[3 * i + k] + moves.map(|(t, w)| t[3 * i + k] * w).sum::<f32>();
                    assert!((f64::from(x) - p[k]).abs() <= 1e-6 * p[k].abs().max(20.0));
                }
            }
        }
        // Bounds are those of the numbers.
        for vectors in [
            &primitive["attributes"]["POSITION"],
            &primitive["targets"][1]["POSITION"],
        ] {
            let accessor = &document["accessors"][vectors.as_u64().unwrap() as usize];
            let all = floats(vectors);
            for k in 0..3 {
                let own = all.iter().skip(k).step_by(3);
                let low = own.clone().fold(f32::INFINITY, |a, b| a.min(*b));
                let high = own.fold(f32::NEG_INFINITY, |a, b| a.max(*b));
                assert_eq!(accessor["min"][k].as_f64().unwrap() as f32, low);
                assert_eq!(accessor["max"][k].as_f64().unwrap() as f32, high);
            }
        }
    }

    #[test]
    fn one_state_is_a_mesh_without_animation_and_none_is_nothing() {
        let linkage = Linkage::patch(3.0, Handedness::Left, &Linkage::hexagon_cells(1));
        let still = vec![Point3::origin(); linkage.point_count()];
        let (document, _) = parts(&write_glb(&linkage, &[&still]).unwrap());
        assert!(document.get("animations").is_none());
        assert!(
            document["meshes"][0]["primitives"][0]
                .get("targets")
                .is_none()
        );
        assert!(write_glb(&linkage, &[]).is_none());
    }
}

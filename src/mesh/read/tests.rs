use super::*;

fn error(name: &str, bytes: &[u8]) -> String {
    read_bytes(name, bytes).unwrap_err().to_string()
}

const SQUARE: &str = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n";

#[test]
fn obj_groups_keep_the_numbers_of_the_file() {
    let text = format!(
        "# two groups\nmtllib gone.mtl\n{SQUARE}v 2 0 0 0.5 0.5 0.5\nvt 0 0\nvn 0 0 1\no a\nf 1/1/1 2/1/1 3/1/1 4/1/1\ng b\nusemtl red\nf 1 2\nf -4//1 -1//1 -3//1\n"
    );
    let soup = read_bytes("x.obj", text.as_bytes()).unwrap();
    assert_eq!(soup.faces, [[0, 1, 2], [0, 2, 3], [1, 4, 2]]);
    assert_eq!(
        (&soup.source[..], soup.file_faces, soup.polygons),
        (&[0, 0, 2][..], 3, 1)
    );
}

#[test]
fn obj_lines_that_cannot_be_used_are_named() {
    let nan = format!("{SQUARE}v 1 nan 0\nf 1 2 3\n");
    assert_eq!(
        error("m.obj", nan.as_bytes()),
        "m.obj:5: \"nan\" is not a finite number; coordinates must be"
    );
    assert!(error("m.obj", b"v 1 2\nf 1 1 1\n").starts_with("m.obj:1: a vertex needs three"));
    assert!(error("m.obj", b"v 1 2 3\nv 1 1e999 0\n").starts_with("m.obj:2: \"1e999\""));
    let far = format!("{SQUARE}f 1 2 3\nf 1 2 9\n");
    assert_eq!(
        error("m.obj", far.as_bytes()),
        "m.obj:6: face 2 names vertex \"9\", but the file has 4 vertices"
    );
    let zero = format!("{SQUARE}f 0 1 2\n");
    assert!(error("m.obj", zero.as_bytes()).starts_with("m.obj:5: face 1 names vertex \"0\""));
    let back = format!("{SQUARE}f -1 -2 -5\n");
    assert!(error("m.obj", back.as_bytes()).contains("\"-5\""));
    let word = format!("{SQUARE}f a b c\n");
    assert!(error("m.obj", word.as_bytes()).contains("\"a\""));
    let crossed = format!("{SQUARE}f 1 2 3\nf 1 3 2 4\n");
    assert!(error("m.obj", crossed.as_bytes()).contains("face 2 has 4 corners"));
}

#[test]
fn what_is_no_mesh_is_said_to_be_none() {
    for (name, bytes) in [
        ("notes.txt", &b"dear diary"[..]),
        ("empty", b""),
        ("picture.png", b"\x89PNG\r\n\x1a\n\0\0\0"),
    ] {
        assert!(
            error(name, bytes).contains("no mesh that kagome reads"),
            "{name}"
        );
    }
    assert!(error("cut.stl", b"\0\0\0binary but short").contains("cut off"));
    let missing = read_file(Path::new("/no/such/mesh.obj")).unwrap_err();
    assert!(
        missing
            .to_string()
            .starts_with("/no/such/mesh.obj: cannot be read")
    );
}

fn binary_stl(triangles: &[[[f32; 3]; 3]]) -> Vec<u8> {
    let mut bytes = b"solid though it is binary".to_vec();
    bytes.resize(80, b' ');
    bytes.extend((triangles.len() as u32).to_le_bytes());
    for triangle in triangles {
        bytes.extend([0; 12]);
        bytes.extend(triangle.iter().flatten().flat_map(|x| x.to_le_bytes()));
        bytes.extend([0; 2]);
    }
    bytes
}

#[test]
fn stl_text_and_binary_say_the_same() {
    let triangles = [
        [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.5, 0.1]],
        [[1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.5, 0.1]],
    ];
    let mut text = String::from("solid thing\n");
    for t in &triangles {
        text += "facet normal 0 0 1\nouter loop\n";
        for [x, y, z] in t {
            text += &format!("vertex {x} {y} {z}\n");
        }
        text += "endloop\nendfacet\n";
    }
    text += "endsolid thing\n";
    let binary = binary_stl(&triangles);
    // Neither name tells the truth: content goes first.
    let a = read_bytes("a.obj", text.as_bytes()).unwrap();
    let b = read_bytes("b.ply", &binary).unwrap();
    assert_eq!((a.format, b.format), (Format::Stl, Format::Stl));
    assert_eq!((&a.positions, &a.faces), (&b.positions, &b.faces));
    assert_eq!(b.faces, [[0, 1, 2], [3, 4, 5]]);

    let bad = text.replace("vertex 1 1 0", "vertex 1 inf 0");
    assert!(error("a.stl", bad.as_bytes()).starts_with("a.stl:12: \"inf\""));
    let mut nan = triangles;
    nan[1][1][2] = f32::NAN;
    assert!(error("b.stl", &binary_stl(&nan)).contains("vertex 5 has a coordinate"));
    assert!(error("b.stl", &binary[..binary.len() - 1]).starts_with("b.stl: "));
}

#[test]
fn ply_text_and_binary_say_the_same() {
    let header = |format: &str| {
        format!(
            "ply\nformat {format} 1.0\ncomment x\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\nproperty uchar red\nelement face 2\nproperty list uchar int vertex_indices\nend_header\n"
        )
    };
    let points = [
        [0.0f32, 0.0, 0.0],
        [1.0, 0.0, 0.0],
        [1.0, 1.0, 0.0],
        [0.0, 1.0, 0.5],
    ];
    let faces = [[0i32, 1, 2], [0, 2, 3]];
    let mut text = header("ascii");
    for [x, y, z] in points {
        text += &format!("{x} {y} {z} 255\n");
    }
    for [a, b, c] in faces {
        text += &format!("3 {a} {b} {c}\n");
    }
    let from_text = read_bytes("x.ply", text.as_bytes()).unwrap();
    for big in [false, true] {
        let mut bytes = header(if big {
            "binary_big_endian"
        } else {
            "binary_little_endian"
        })
        .into_bytes();
        for p in points {
            for x in p {
                bytes.extend(if big {
                    x.to_be_bytes()
                } else {
                    x.to_le_bytes()
                });
            }
            bytes.push(255);
        }
        for f in faces {
            bytes.push(3);
            for i in f {
                bytes.extend(if big {
                    i.to_be_bytes()
                } else {
                    i.to_le_bytes()
                });
            }
        }
        let soup = read_bytes("renamed.stl", &bytes).unwrap();
        assert_eq!(
            (&soup.positions, &soup.faces),
            (&from_text.positions, &from_text.faces)
        );
        assert!(error("x.ply", &bytes[..bytes.len() - 3]).contains("PLY"));
        let at = bytes.len() - 2 * 13 - 5;
        bytes[at..at + 4].copy_from_slice(&[0xff; 4]);
        assert!(error("x.ply", &bytes).contains("vertex 4 has a coordinate"));
    }
    assert_eq!(from_text.faces, [[0, 1, 2], [0, 2, 3]]);
    let far = text.replace("3 0 2 3", "3 0 2 7");
    assert!(error("x.ply", far.as_bytes()).contains("face 2 names vertex \"7"));
    let nan = text.replace("0 1 0.5 255", "0 nan 0.5 255");
    let text = error("x.ply", nan.as_bytes());
    assert!(
        text.starts_with("x.ply:15: ") && text.contains("nan"),
        "{text}"
    );
    assert!(error("x.ply", b"ply\nnonsense\n").contains("PLY"));
}

proptest::proptest! {
    #![proptest_config(crate::base::cases::cases(300))]
    /// Files with bytes changed, cut or doubled give an error or a soup, never a panic.
    #[test]
    fn damaged_files_do_not_panic(
        which in 0usize..4, at in 0.0..1.0f64, byte in proptest::prelude::any::<u8>(), cut in 0.0..1.0f64, truncate: bool,
    ) {
        let ply = b"ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\nelement face 1\nproperty list uchar int vertex_index\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n".to_vec();
        let binary = ply.clone();
        let mut bytes = [
            format!("{SQUARE}f 1 2 3 4\n").into_bytes(),
            binary_stl(&[[[0.0; 3], [1.0; 3], [2.0, 0.0, 1.0]]]),
            ply,
            [&binary[..10], b"binary_little_endian", &binary[15..]].concat(),
        ][which].clone();
        let i = (at * (bytes.len() - 1) as f64) as usize;
        bytes[i] = byte;
        if truncate {
            bytes.truncate((cut * bytes.len() as f64) as usize);
        }
        if let Ok(soup) = read_bytes("x", &bytes) {
            let count = soup.positions.len() as u32;
            proptest::prop_assert!(soup.faces.iter().flatten().all(|v| *v < count));
            proptest::prop_assert_eq!(soup.faces.len(), soup.source.len());
        }
    }
}

use crate::error::Kind;
use crate::scene::built_in_tests::assert_sound;
use crate::scene::*;
use glam::Vec3;
use std::fs;
use std::path::Path;

fn load_with(name: &str, bytes: &[u8], others: &[(&str, &[u8])]) -> Result<Scene, String> {
    let folder = tempfile::tempdir().unwrap();
    for (name, bytes) in others {
        fs::write(folder.path().join(name), bytes).unwrap();
    }
    let path = folder.path().join(name);
    fs::write(&path, bytes).unwrap();
    let outcome = Scene::load(&path);
    if let Ok(scene) = &outcome {
        assert_sound(scene);
    }
    outcome.map_err(|error| {
        assert_eq!(error.kind(), Kind::Usage);
        let place = path.to_str().unwrap().to_owned();
        error.to_string().strip_prefix(&place).expect("the file is named").to_owned()
    })
}

fn obj(text: &str) -> Result<Scene, String> {
    load_with("a.obj", text.as_bytes(), &[])
}

fn ply(header: &str, body: &[u8]) -> Result<Scene, String> {
    load_with("a.ply", &[format!("ply\n{header}end_header\n").as_bytes(), body].concat(), &[])
}

const SQUARE: &str = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n";

#[test]
fn an_obj_without_anything_else_is_grey_and_smooth() {
    let scene = obj(&format!("{SQUARE}f 1 2 3 4\n")).unwrap();
    assert_eq!(scene.materials, [Material::lambert([0.6; 3])]);
    assert_eq!(scene.meshes[0].indices.len(), 6);
    assert!(scene.meshes[0].vertices.iter().all(|v| v.normal == [0.0, 0.0, 1.0] && v.colour == [1.0; 4]));
    assert!(scene.notes.is_empty() && scene.camera.is_none() && !scene.is_animated());
}

#[test]
fn normals_are_smooth_across_materials_and_texture_seams() {
    // A roof of two squares that share the ridge x = 0, of two materials, with separate texture coordinates.
    let text = "mtllib m.mtl\nv -1 -1 0\nv 0 0 0\nv 0 0 1\nv -1 -1 1\nv 1 -1 0\nv 1 -1 1\nvt 0 0\nvt 1 0.25\n\
                usemtl red\nf 1/1 4/1 3/1 2/1\nusemtl shiny\nf 2/2 3/2 6/2 5/2\n";
    let library = b"newmtl red\nKd 0.5 0.25 0.125\nKs 1 1 1\nNs 50\nillum 1\n\
                    newmtl shiny\nKd 0 0 1\nKs 0.5 0.5 0.5\nNs 20\nKe 0 2 0\nd 0.4\n";
    let scene = load_with("a.obj", text.as_bytes(), &[("m.mtl", library)]).unwrap();
    assert_eq!((scene.meshes.len(), scene.instances.len()), (2, 2));
    let [red, shiny] = &scene.materials[..] else { panic!("{:?}", scene.materials) };
    assert_eq!(*red, Material::lambert([0.5, 0.25, 0.125]).with_exponent(50.0));
    assert_eq!(shiny.shading, Shading::Phong { specular: [0.5; 3], exponent: 20.0 });
    assert_eq!(
        (shiny.emissive, shiny.base_colour, shiny.alpha_cutoff),
        ([0.0, 2.0, 0.0], [0.0, 0.0, 1.0, 0.4], Some(0.5))
    );
    for mesh in &scene.meshes {
        for vertex in &mesh.vertices {
            let side = vertex.position[0];
            let expected = Vec3::new(side, 1.0, 0.0).normalize_or_zero();
            let expected = if side == 0.0 { Vec3::Y } else { expected };
            assert!(Vec3::from(vertex.normal).abs_diff_eq(expected, 1e-6), "{vertex:?}");
        }
    }
    assert_eq!(scene.meshes[1].vertices[0].uv, [1.0, 0.75], "v is turned over");
}

impl Material {
    fn with_exponent(mut self, exponent: f32) -> Self {
        self.shading = Shading::Phong { specular: [0.0; 3], exponent };
        self
    }
}

#[test]
fn what_an_obj_lacks_is_noted() {
    let missing = obj(&format!("mtllib gone.mtl\n{SQUARE}usemtl a\nf 1 2 3\n")).unwrap();
    assert!(
        missing.notes[0].starts_with("materials left out: `gone.mtl`: cannot be read"),
        "{:?}",
        missing.notes
    );
    assert_eq!(missing.materials, [Material::lambert([0.6; 3])]);

    let library = b"newmtl a\nKd 0.5\n";
    let text = format!("mtllib m.mtl\n{SQUARE}usemtl a\nf 1 2 3\n");
    let damaged = load_with("a.obj", text.as_bytes(), &[("m.mtl", library)]).unwrap();
    assert!(damaged.notes[0].contains("`m.mtl`"), "{:?}", damaged.notes);

    let library = b"newmtl a\nmap_Kd ..\\x.png\nmap_Bump b.png\n";
    let picture = load_with("a.obj", text.as_bytes(), &[("m.mtl", library)]).unwrap();
    let notes = picture.notes.join("; ");
    assert!(notes.contains("leads out") && notes.contains("`b.png` left out"), "{notes}");

    let partly = obj(&format!("{SQUARE}vt 0 0\nf 1/1 2/1 3/1\nf 1 3 4\n")).unwrap();
    assert!(partly.notes[0].contains("texture coordinates of"), "{:?}", partly.notes);
    assert!(partly.meshes[0].vertices.iter().all(|vertex| vertex.uv == [0.0, 0.0]));

    let flat = obj(&format!("{SQUARE}f 1 2 3\nf 1 1 2\nf 2 2 2\n")).unwrap();
    assert_eq!(
        (flat.notes, flat.meshes[0].indices.len()),
        (vec!["2 triangles without area left out".to_owned()], 3)
    );
}

#[test]
fn colours_of_obj_and_ply_files_are_srgb() {
    let text = "v 0 0 0 1 0.5 0\nv 1 0 0 1 0.5 0\nv 0 1 0 1 0.5 0\nf 1 2 3\n";
    let scene = obj(text).unwrap();
    assert_eq!(scene.materials, [Material::lambert([1.0; 3])]);
    let [red, green, blue, alpha] = scene.meshes[0].vertices[0].colour;
    assert!((green - 0.214_041).abs() < 1e-5 && (red, blue, alpha) == (1.0, 0.0, 1.0));

    let header = "format ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n\
                  property uchar red\nproperty uchar green\nproperty uchar blue\nproperty float s\nproperty float t\n\
                  element face 1\nproperty list uchar int vertex_index\n";
    let body = b"0 0 0 255 188 0 0.5 0.25\n1 0 0 0 0 0 0 0\n0 1 0 0 0 0 0 0\n3 0 1 2\n";
    let scene = ply(header, body).unwrap();
    assert_eq!(scene.materials, [Material::lambert([1.0; 3])]);
    let vertex = scene.meshes[0].vertices[0];
    // 188 / 255 is 0.50289 (IEC 61966-2-1, computed with 20 digits).
    assert!((vertex.colour[1] - 0.502_886).abs() < 1e-5, "{}", vertex.colour[1]);
    assert_eq!((vertex.colour[0], vertex.uv), (1.0, [0.5, 0.75]));
}

#[test]
fn damaged_obj_files_say_what_is_wrong_and_where() {
    for (text, says) in [
        ("", "is empty"),
        ("# nothing\n", "has no triangle to show"),
        ("v 0 0 0\nl 1 1\n", "has no triangle to show"),
        ("v 0 0\n", "line 1: cannot be read as OBJ"),
        ("v 0 0 0\nv 0 0 x\n", "line 2: cannot be read as OBJ"),
        ("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 4\n", "face vertex index out of bounds"),
        ("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 -9\n", "face vertex index out of bounds"),
        ("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 0\n", "face vertex index out of bounds"),
        (
            "v 0 0 0\nv 1 0 0\nv NaN 1 0\nf 1 2 3\n",
            "has no triangle to show: 1 faces have corners that are not",
        ),
        ("v 0 0 0\nv 1 0 0\nv inf 1 0\nf 1 2 3\n", "not finite"),
        ("v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\n", "1 triangles without area left out"),
        ("v 0 0 0\nv 1 0 0\nv 1e10 1 0\nf 1 2 3\n", "coordinates are read up to 1e9"),
    ] {
        let message = obj(text).unwrap_err();
        assert!(message.contains(says), "{text}: {message}");
    }
    let groups = format!("{}{SQUARE}f 1 2 3\n", " g a\n".repeat((1 << 20) + 1));
    assert!(obj(&groups).unwrap_err().contains("has 1048577 lines that begin"));
    let corners = format!("{SQUARE}f{}\n", " 1".repeat(3 * MAX_TRIANGLES + 1));
    assert!(obj(&corners).unwrap_err().contains("has 50331649 corners of faces"));
    assert!(load_with("a.stl", b"solid", &[]).unwrap_err().contains("neither glTF nor PLY"));
    assert!(Scene::load(Path::new("/nonexistent/a.obj")).unwrap_err().to_string().contains("cannot be read"));
}

const HEADER: &str = "format binary_little_endian 1.0\nelement vertex 3\nproperty float x\nproperty float y\n\
                      property float z\nelement face 1\nproperty list uchar int vertex_indices\n";

fn floats(values: &[f32]) -> Vec<u8> {
    values.iter().flat_map(|value| value.to_le_bytes()).collect()
}

#[test]
fn damaged_ply_files_say_what_is_wrong() {
    let points = floats(&[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0]);
    let face = |corners: &[i32]| {
        let corners: Vec<u8> = corners.iter().flat_map(|corner| corner.to_le_bytes()).collect();
        [vec![(corners.len() / 4) as u8], corners].concat()
    };
    let whole = [points.clone(), face(&[0, 1, 2])].concat();
    let scene = ply(HEADER, &whole).unwrap();
    assert_eq!(scene.meshes[0].indices, [0, 1, 2]);
    assert!(scene.meshes[0].vertices.iter().all(|vertex| vertex.normal == [0.0, 0.0, 1.0]));

    let nan = [floats(&[f32::NAN]), points[4..].to_vec(), face(&[0, 1, 2])].concat();
    for (says, header, body) in [
        ("is it complete?", HEADER.to_owned(), whole[..40].to_vec()),
        (
            "face 0: has vertex 3, but there are 3",
            HEADER.to_owned(),
            [points.clone(), face(&[0, 1, 3])].concat(),
        ),
        (
            "face 0: is damaged: it has negative indices",
            HEADER.to_owned(),
            [points.clone(), face(&[0, 1, -1])].concat(),
        ),
        ("has no triangle to show", HEADER.to_owned(), nan),
        ("has no triangle to show", HEADER.to_owned(), [points.clone(), face(&[0, 1])].concat()),
        ("cannot hold", HEADER.replace("vertex 3", "vertex 18446744073709551615"), whole.clone()),
        ("cannot hold", HEADER.replace("face 1", "face 9000000000"), whole.clone()),
        ("cannot hold", format!("{HEADER}element nothing 99999999999\n"), whole.clone()),
        ("properties x, y and z", HEADER.replace("float z", "float w"), whole.clone()),
        ("no element `face`", HEADER.replace("vertex_indices", "strips"), whole.clone()),
        (
            "no element `face`",
            HEADER.replace("element face 1\nproperty list uchar int vertex_indices\n", ""),
            points.clone(),
        ),
        ("cannot be read as PLY", HEADER.replace("list uchar int", "list uchar complex"), whole.clone()),
    ] {
        let message = ply(&header, &body).unwrap_err();
        assert!(message.contains(says), "`{says}` expected, but: {message}");
    }
    // A list that claims 4 G corners must not cause an allocation.
    let header = HEADER.replace("list uchar int", "list uint int");
    assert!(ply(&header, &[points, vec![0xff; 20]].concat()).unwrap_err().contains("is it complete?"));
}

#[test]
fn a_million_triangles_are_read() {
    // A sheet of waves of 708 x 708 cells with two triangles each.
    let cells = 708_u32;
    let count = (cells + 1) * (cells + 1);
    let mut body = Vec::new();
    for i in 0..count {
        let (x, z) = ((i % (cells + 1)) as f32 / 100.0, (i / (cells + 1)) as f32 / 100.0);
        body.extend(floats(&[x, (x + 2.0 * z).sin(), z]));
    }
    for cell in 0..cells * cells {
        let corner = cell / cells * (cells + 1) + cell % cells;
        let across = corner + cells + 2;
        for triangle in [[corner, across, corner + 1], [corner, corner + cells + 1, across]] {
            body.push(3);
            body.extend(triangle.iter().flat_map(|corner| corner.to_le_bytes()));
        }
    }
    let triangles = 2 * cells * cells;
    assert!(triangles > 1_000_000);
    let header = HEADER
        .replace("vertex 3", &format!("vertex {count}"))
        .replace("face 1", &format!("face {triangles}"));
    let scene = ply(&header, &body).unwrap();
    let mesh = &scene.meshes[0];
    assert_eq!((mesh.vertices.len(), mesh.indices.len() / 3), (count as usize, triangles as usize));
    // Away from the edges the smooth normal is that of the wave, up to the square of the step.
    for vertex in mesh.vertices.iter().skip(1000 * 300).take(100) {
        let slope = (vertex.position[0] + 2.0 * vertex.position[2]).cos();
        let expected = Vec3::new(-slope, 1.0, -2.0 * slope).normalize_or_zero();
        assert!(Vec3::from(vertex.normal).abs_diff_eq(expected, 1e-3), "{vertex:?} {expected}");
    }
}

#[test]
fn faces_with_a_corner_that_is_not_finite_are_left_out_whole() {
    let obj = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv nan 0 0\nf 1 2 3 4\nf 1 2 5 4\n";
    let header = "format ascii 1.0\nelement vertex 5\nproperty float x\nproperty float y\nproperty float z\n\
                  element face 2\nproperty list uchar int vertex_index\n";
    let body = "0 0 0\n+1. 0 0\n\n1 1e0 .0\n0 1 -0\nNaN 0 inf\n4 0 1 2 3\n4 0 1 4 3\n";
    for (name, scene) in [
        ("obj", load_with("a.obj", obj.as_bytes(), &[]).unwrap()),
        ("ply", ply(header, body.as_bytes()).unwrap()),
    ] {
        assert_eq!(scene.meshes[0].indices.len(), 6, "{name}");
        assert_eq!(scene.meshes[0].bounds.max, Vec3::new(1.0, 1.0, 0.0), "{name}");
        assert_eq!(scene.notes, ["1 faces have corners that are not finite; left out"], "{name}");
    }
}

#[test]
fn faults_in_the_body_of_an_ascii_ply_file_are_told_with_their_line() {
    let header = "format ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n\
                  element face 1\nproperty list uchar int vertex_indices\n";
    for (body, words) in [
        ("0 0 0\n1 0 0\n0 1 0\n3 0 1 two\n", "line 13: `two` is no number"),
        ("0 0 0\n1 0\n0 1 0\n3 0 1 2\n", "line 11: has too few numbers for an element `vertex`"),
        ("0 0 0\n1 0 0\n0 1 0\n", "ends before the last of the 1 elements `face`"),
        ("0 0 0\n1 0 0\n0 1 0\n9999 0 1 2\n", "line 13: has a list of 9999 numbers"),
        ("0 0 0\n1 0 0\n0 1 0\n3 0 1 3\n", "face 0: has vertex 3, but there are 3"),
        ("0 0 0\n1 0 0\n0 1 0\n3 0 1 -1\n", "face 0: is damaged"),
    ] {
        let message = ply(header, body.as_bytes()).unwrap_err();
        assert!(message.contains(words), "{words}: {message}");
    }
}

//! OBJ and MTL files: everything that is read, in its smallest form.

mod scene_support;

use glam::{DVec2, DVec3};
use lumel::Error;
use lumel::scene::{Scene, exitance, reflectance};
use scene_support::*;

const WHOLE: [DVec3; 3] = [DVec3::X, DVec3::Y, DVec3::Z];

const TRIANGLE: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";

fn read(text: &str) -> Result<Scene, Error> {
    Folder::new().read("scene.obj", text)
}

#[test]
fn numbers_are_read_in_f64() {
    let scene = read("v 0.1 0 0\nv 1.1234567890123456 0 0\nv 0 1e-3 +2\nf 1 2 3").unwrap();
    assert_eq!(scene.triangles[0].vertices[0].x, 0.1);
    assert_eq!(scene.triangles[0].vertices[1].x, 1.1234567890123456);
    assert_eq!(scene.triangles[0].vertices[2], DVec3::new(0.0, 1e-3, 2.0));
}

#[test]
fn legitimate_oddities_are_accepted() {
    let odd: [&[u8]; 9] = [
        b"v 0 0 0\r\nv 1 0 0\r\nv 0 1 0\r\nf 1 2 3\r\n",
        b"v 0 0 0\nv 1 0 \\\n0\nv 0 1 0\nf 1 \\\r\n 2 \\\n3",
        b"# caf\xe9 \\\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3",
        b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf -3 -2 -1",
        b"v 0 0 0 # origin\nv\t1\t0\t0\nv 0 1 0\n  f 1 2 3 # face\n#end",
        b"f 1 2 3\nv 0 0 0\nv 1 0 0\nv 0 1 0",
        b"\xef\xbb\xbfv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3",
        b"v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0.5\nvn 0 0 1\nf 1/1/1 2//1 3/",
        b"v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0 0\nvt 0 1\nf -3/-3 -2/-2 -1/-1",
    ];
    for text in odd {
        let scene = Folder::new().read("scene.obj", text);
        let shown = String::from_utf8_lossy(text);
        let scene = scene.unwrap_or_else(|e| panic!("{shown}: {e}"));
        assert_eq!(scene.triangles.len(), 1, "{shown}");
        assert_eq!(scene.triangles[0].vertices, [DVec3::ZERO, DVec3::X, DVec3::Y], "{shown}");
    }
}

#[test]
fn objects_have_names() {
    let faces = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 2 3\no Left wall\nf 1 2 4\ng part\n\
                 f 2 3 4\no B\nf 1 3 4\no Left wall\nf 3 2 1\n";
    let names = |scene: &Scene| -> Vec<String> {
        let name = |t: &lumel::scene::Triangle| scene.objects[t.object as usize].name.clone();
        // The order of objects is not that of the file.
        let mut names: Vec<String> = scene.triangles.iter().map(name).collect();
        names.sort();
        names
    };
    let scene = read(faces).unwrap();
    assert_eq!(names(&scene), ["B", "Left wall", "Left wall", "Left wall", "scene"]);
    // Groups name objects where there are no others.
    let scene = read(&faces.replace("\no ", "\ng ")).unwrap();
    assert_eq!(names(&scene), ["B", "Left wall", "Left wall", "part", "scene"]);
    assert_eq!(scene.objects.len(), 4);
    let scene = read(&format!("o A b\n{TRIANGLE}")).unwrap();
    assert_eq!(scene.objects.len(), 1);
}

#[test]
fn texture_coordinates_stay_with_their_corners() {
    // tobj would give the corner without coordinates those of the corner before.
    let scene =
        read("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0\nvt 0.25 0.5\nvt 1 0\nf 1/2 2 3/1\nf 2 4 3/2\n")
            .unwrap();
    let uv = |i: usize| scene.triangles[i].uv[0];
    assert_eq!(uv(0), [DVec2::new(1.0, 0.0), DVec2::ZERO, DVec2::new(0.25, 0.5)]);
    assert_eq!(uv(1), [DVec2::ZERO, DVec2::ZERO, DVec2::new(1.0, 0.0)]);
}

#[test]
fn lines_points_weights_and_colours_are_left_out() {
    let scene =
        read("v 0 0 0 2\nv 1 0 0 1 0 0\nv 0 1 0 1\nl 1 2 3\np 1\nf 1 2\ncurv 0 1 1 2\nf 1 2 3\n")
            .unwrap();
    assert_eq!(scene.triangles.len(), 1);
    assert_eq!(scene.triangles[0].vertices, [DVec3::ZERO, DVec3::X, DVec3::Y]);
    assert_eq!(scene.triangles[0].colour, [DVec3::ONE; 3]);
    for text in ["weights", "vertex colours", "points and lines", "fewer than three", "statements"]
    {
        assert!(noticed(&scene, "file", text), "{text}: {:?}", scene.notices);
    }
}

#[test]
fn polygons_keep_area_and_orientation() {
    // An L, a star, and both turned over; none is convex.
    let shapes: [&[[f64; 2]]; 2] = [
        &[[0., 0.], [3., 0.], [3., 1.], [1., 1.], [1., 3.], [0., 3.]],
        &[[0., 5.], [-1., 1.], [-5., 0.], [-1., -1.], [0., -5.], [1., -1.], [5., 0.], [1., 1.]],
    ];
    let (u, v) = (DVec3::new(2.0, 1.0, 2.0) / 3.0, DVec3::new(-2.0, 2.0, 1.0) / 3.0);
    for shape in shapes {
        for reverse in [false, true] {
            let mut points = shape.to_vec();
            if reverse {
                points.reverse();
            }
            let mut text = String::new();
            let mut area = 0.0;
            for (i, p) in points.iter().enumerate() {
                let q = points[(i + 1) % points.len()];
                area += 0.5 * (p[0] * q[1] - p[1] * q[0]);
                let at = u * p[0] + v * p[1] + DVec3::new(10.0, 20.0, 30.0);
                text += &format!("v {} {} {}\n", at.x, at.y, at.z);
            }
            text += "f";
            for i in 1..=points.len() {
                text += &format!(" {i}");
            }
            let scene = read(&text).unwrap();
            let want = u.cross(v) * area;
            assert!((area_vector(&scene) - want).length() < 1e-12 * area.abs());
            let sum: f64 =
                (0..scene.triangles.len()).map(|i| scene.triangle_normal_and_area(i).1).sum();
            assert!((sum - area.abs()).abs() < 1e-12 * sum, "{sum} {area}");
            assert_eq!(scene.notices.iter().filter(|n| !n.about.contains("default")).count(), 0);
        }
    }
}

#[test]
fn flawed_polygons_are_noticed() {
    let scene = read("o Saddle\nv 0 0 0\nv 1 0 .3\nv 1 1 0\nv 0 1 .3\nf 1 2 3 4\n").unwrap();
    assert_eq!(scene.triangles.len(), 2);
    assert!(noticed(&scene, "Saddle", "not plane"));
    let scene = read("o Tie\nv 0 0 0\nv 2 2 0\nv 2 0 0\nv 0 1 0\nf 1 2 3 4\n").unwrap();
    assert!(noticed(&scene, "Tie", "cross themselves"));
}

#[test]
fn materials_come_from_their_libraries() {
    let folder = Folder::new();
    folder.write(
        "lib one.mtl",
        "Kd 9 9 9\nnewmtl Warm wall #2\r\nKd 0.7 0.6 0.5\r\nKe 1 \\\n2 3\nillum 1\nKs 1 1 1\n\
         newmtl grey\nkd .25\nd 0.5\nbump b.png\nPm 1\nnewmtl bare\nnewmtl gloss\nKd 1\nKs .5",
    );
    folder.write("two.mtl", "newmtl third\nKd 0 0.125 0\nTr 0\n");
    let scene = folder
        .read(
            "s.obj",
            "mtllib lib one.mtl\nmtllib none.mtl two.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\n\
             usemtl Warm wall #2\nf 1 2 3\nusemtl grey\nf 1 2 4\nusemtl third\nf 1 3 4\n\
             usemtl\tmissing\nf 2 3 4\nusemtl grey\nf 3 2 1\n",
        )
        .unwrap();
    let of = |i: usize| &scene.materials[scene.triangles[i].material as usize];
    assert_eq!(of(0).name, "Warm wall #2");
    assert_eq!(of(0).reflectance, DVec3::new(0.7, 0.6, 0.5));
    assert_eq!(of(0).radiance, DVec3::new(1.0, 2.0, 3.0));
    assert_eq!(exitance(&scene, 0, &WHOLE), DVec3::new(1.0, 2.0, 3.0) * std::f64::consts::PI);
    assert_eq!(of(1).reflectance, DVec3::splat(0.25));
    assert_eq!(reflectance(&scene, 2, &WHOLE), DVec3::new(0.0, 0.125, 0.0));
    assert_eq!((of(3).name.as_str(), of(3).reflectance.x), ("missing", 0.5));
    assert_eq!(of(4).name, "grey");
    assert_eq!(scene.materials.len(), 6);
    assert!(noticed(&scene, "none.mtl", "missing"));
    assert!(noticed(&scene, "\"missing\"", "not defined"));
    assert!(noticed(&scene, "\"bare\"", "no Kd"));
    assert!(noticed(&scene, "\"grey\"", "transparency"));
    assert!(noticed(&scene, "\"grey\"", "bump"));
    assert!(noticed(&scene, "\"grey\"", "Pm"));
    assert!(noticed(&scene, "\"gloss\"", "Ks"));
    assert!(noticed(&scene, "\"gloss\"", "outside"));
    assert!(!noticed(&scene, "Warm wall", "") && !noticed(&scene, "third", ""));
}

#[test]
fn faces_without_material_are_grey() {
    let scene = read(TRIANGLE).unwrap();
    assert_eq!(reflectance(&scene, 0, &WHOLE), DVec3::splat(0.5));
    assert!(noticed(&scene, "default", "0.5"));
}

#[test]
fn names_that_are_not_utf8_stay_different() {
    let folder = Folder::new();
    folder.write("m.mtl", b"newmtl gr\xfcn\nKd .1\nnewmtl gr\xf6n\nKd .2\n");
    let scene = folder
        .read(
            "s.obj",
            b"mtllib m.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nusemtl gr\xfcn\nf 1 2 3\n\
              usemtl gr\xf6n\nf 1 2 4",
        )
        .unwrap();
    assert_eq!(reflectance(&scene, 0, &WHOLE).x, 0.1);
    assert_eq!(reflectance(&scene, 1, &WHOLE).x, 0.2);
}

#[test]
fn maps_are_found_placed_and_multiplied() {
    let folder = Folder::new();
    // Left half black, right half white; top row white only at the far right.
    folder.write("tex/half.png", png(2, 2, |x, _| [if x == 1 { 255 } else { 0 }; 3]));
    folder.write("rows.png", png(2, 2, |_, y| [if y == 0 { 255 } else { 0 }; 3]));
    folder.write(
        "m.mtl",
        "newmtl a\nKd 0.5 0.5 0.5\nmap_Kd -s 1 1 1 -o 0 0 0 tex\\half.png\nKe 2 2 2\n\
         map_Ke \"C:\\art\\rows.png\"\nnewmtl b\nmap_Kd -clamp on -o 0.5 rows.png\n",
    );
    let scene = folder
        .read(
            "s.obj",
            "mtllib m.mtl\nusemtl a\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0.75 0.25\nvt 0.75 0.75\n\
             vt 0.25 0.25\nf 1/1 2/2 3/3\nusemtl b\nf 3/3 2/2 1/1\n",
        )
        .unwrap();
    let at = |b: DVec3| reflectance(&scene, 0, &[b; 3]).x;
    assert!((at(DVec3::X) - 0.5).abs() < 1e-6, "right texel at (0.75, 0.25)");
    assert!(at(DVec3::Z) < 1e-6, "left texel at (0.25, 0.25)");
    // The first row of an image is at the top, v = 1.
    let light = |b: DVec3| exitance(&scene, 0, &[b; 3]).x / std::f64::consts::PI;
    assert!(light(DVec3::X) < 1e-6 && (light(DVec3::Y) - 2.0).abs() < 1e-6);
    // A map alone gives the whole colour.
    assert!((reflectance(&scene, 1, &[DVec3::Y; 3]).x - 0.999).abs() < 1e-6);
}

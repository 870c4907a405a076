//! Wavefront OBJ files.
//!
//! The text is made plain first (see `obj_text`), then read by `tobj`; its models are cut at every
//! object and material. Polygons are cut into triangles in their own plane. Lengths are taken as
//! metres, axes as they are.

use std::path::Path;

use glam::{DVec2, DVec3};

use super::limits::Budget;
use super::mtl::Library;
use super::notices::Notices;
use super::polygon::Cutter;
use super::{Object, Scene, Triangle, obj_text};
use crate::error::{Error, Result};

/// Reads an OBJ file with its materials and textures.
pub(crate) fn read(path: &Path, bytes: &[u8], budget: Budget) -> Result<Scene> {
    let mut notices = Notices::default();
    let stem = path.file_stem().map_or("scene".into(), |s| s.to_string_lossy());
    let plain = obj_text::plain(path, bytes, &stem, &mut notices)?;
    let mut library = Library::new(path, budget);
    for argument in &plain.libraries {
        library.load(argument, &mut notices)?;
    }
    let numbers: Vec<u32> =
        plain.materials.iter().map(|name| library.number(name, &mut notices)).collect();

    let text = if numbers.is_empty() { plain.text } else { format!("mtllib .\n{}", plain.text) };
    let options =
        tobj::LoadOptions { ignore_points: true, ignore_lines: true, ..Default::default() };
    // Materials are known to tobj by their numbers only.
    let stand_ins = |_: &Path| {
        let named = |i: usize| tobj::Material { name: i.to_string(), ..Default::default() };
        let list: Vec<_> = (0..numbers.len()).map(named).collect();
        let map = list.iter().enumerate().map(|(i, m)| (m.name.clone(), i)).collect();
        Ok((list, map))
    };
    let (models, _) = tobj::load_obj_buf(&mut text.as_bytes(), &options, stand_ins)
        .map_err(|e| Error::invalid(path, "file", format!("{e}; export it again")))?;
    drop(text);

    let mut scene = Scene { path: path.to_path_buf(), ..Scene::default() };
    scene.objects = plain.objects.into_iter().map(|name| Object { name }).collect();
    let mut cutter = Cutter::default();
    for model in &models {
        if model.mesh.indices.is_empty() {
            continue;
        }
        // A name that is no number cannot come back from the plain text.
        let object: u32 = model.name.parse().unwrap_or(0);
        let material = match model.mesh.material_id.and_then(|id| numbers.get(id)) {
            Some(&number) => number,
            None => library.number_of_none(&mut notices),
        };
        add_model(&mut scene, &model.mesh, (object, material), budget, &mut cutter, &mut notices)?;
    }
    scene.materials = library.list;
    scene.textures = library.textures;
    scene.files = library.files;
    scene.notices = notices.into_list();
    drop_empty_first_object(&mut scene);
    Ok(scene)
}

/// Adds the triangles of one model, which has one object and one material.
fn add_model(
    scene: &mut Scene,
    mesh: &tobj::Mesh,
    (object, material): (u32, u32),
    budget: Budget,
    cutter: &mut Cutter,
    notices: &mut Notices,
) -> Result<()> {
    let about =
        format!("object \"{}\"", scene.objects.get(object as usize).map_or("", |o| &o.name));
    let (points, _) = mesh.positions.as_chunks::<3>();
    let (coordinates, _) = mesh.texcoords.as_chunks::<2>();
    let point = |place: usize| {
        let index = mesh.indices.get(place).map_or(usize::MAX, |&i| i as usize);
        points.get(index).map_or(DVec3::NAN, |&p| DVec3::from(p))
    };
    let uv = |place: usize| {
        let index = mesh.texcoord_indices.get(place).map_or(usize::MAX, |&i| i as usize);
        coordinates.get(index).map_or(DVec2::ZERO, |&uv| DVec2::from(uv))
    };
    let triangles_only = vec![3; mesh.indices.len() / 3];
    let arities = if mesh.face_arities.is_empty() { &triangles_only } else { &mesh.face_arities };
    let mut start = 0;
    let mut polygon = Vec::new();
    for &arity in arities {
        polygon.clear();
        polygon.extend((start..start + arity as usize).map(point));
        let (triangles, flaw) = cutter.cut(&polygon);
        if let Some(flaw) = flaw {
            notices.add(&about, flaw.text());
        }
        budget.triangles(&scene.path, &about, scene.triangles.len() + triangles.len())?;
        for corners in triangles {
            scene.triangles.push(Triangle {
                vertices: corners.map(|i| polygon[i]),
                uv: [corners.map(|i| uv(start + i)), [DVec2::ZERO; 3]],
                colour: [DVec3::ONE; 3],
                material,
                object,
            });
        }
        start += arity as usize;
    }
    Ok(())
}

/// The object that stands for faces before the first name is not there if there are none.
fn drop_empty_first_object(scene: &mut Scene) {
    if scene.objects.len() > 1 && scene.triangles.iter().all(|t| t.object != 0) {
        scene.objects.remove(0);
        for triangle in &mut scene.triangles {
            triangle.object -= 1;
        }
    }
}

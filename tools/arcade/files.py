"""A scene as glTF 2.0 (one file), as GLB, or as OBJ and MTL."""

import base64
import json
import struct

from make_scenes import dump, look_at

from .shapes import GRID, moved


def metres(point):
    """Exact: a division by a power of two."""
    return [x / GRID for x in point]


def document(scene, generator):
    """The glTF document without its buffer's URI, and the buffer. Copies share their mesh."""
    materials = scene.materials()
    place_of = {m.name: i for i, m in enumerate(materials)}
    buffer = bytearray()
    views, accessors, meshes, nodes, mesh_of = [], [], [], [], {}

    def view(data, target):
        views.append({"buffer": 0, "byteOffset": len(buffer), "byteLength": len(data), "target": target})
        buffer.extend(data + bytes(-len(data) % 4))
        return len(views) - 1

    for thing in scene.things:
        key = (id(thing.mesh), thing.material)
        if key not in mesh_of:
            numbers = {}
            indices = [numbers.setdefault(p, len(numbers)) for t in thing.mesh for p in t]
            packed = b"".join(struct.pack("<3f", *metres(p)) for p in numbers)
            rounded = list(struct.iter_unpack("<3f", packed))
            kind, code = ("H", 5123) if len(numbers) < 2**16 else ("I", 5125)
            accessors.append({
                "bufferView": view(packed, 34962),
                "componentType": 5126,
                "count": len(numbers),
                "type": "VEC3",
                "min": [min(x) for x in zip(*rounded)],
                "max": [max(x) for x in zip(*rounded)],
            })
            accessors.append({
                "bufferView": view(struct.pack(f"<{len(indices)}{kind}", *indices), 34963),
                "componentType": code,
                "count": len(indices),
                "type": "SCALAR",
            })
            mesh_of[key] = len(meshes)
            meshes.append({
                "name": thing.name,
                "primitives": [{
                    "attributes": {"POSITION": len(accessors) - 2},
                    "indices": len(accessors) - 1,
                    "material": place_of[thing.material],
                }],
            })
        node = {"name": thing.name, "mesh": mesh_of[key]}
        if any(thing.at):
            node["translation"] = metres(thing.at)
        if thing.defect:
            node["extras"] = {"defect": thing.defect}
        nodes.append(node)

    cameras = []
    for camera in scene.cameras:
        perspective = {"yfov": camera.yfov, "aspectRatio": camera.aspect, "znear": 0.01}
        cameras.append({"name": camera.name, "type": "perspective", "perspective": perspective})
        nodes.append({
            "name": camera.name,
            "camera": len(cameras) - 1,
            "translation": camera.eye,
            "rotation": look_at(camera),
        })

    described = []
    for material in materials:
        entry = {
            "name": material.name,
            "pbrMetallicRoughness": {
                "baseColorFactor": [*material.reflectance, 1.0],
                "metallicFactor": 0.0,
                "roughnessFactor": 1.0,
            },
        }
        if material.emits():
            entry["emissiveFactor"] = material.emission
            entry["extensions"] = {
                "KHR_materials_emissive_strength": {"emissiveStrength": material.strength}
            }
        described.append(entry)

    about = {"about": scene.about, **scene.extras}
    return {
        "asset": {"version": "2.0", "generator": generator, "extras": about},
        "extensionsUsed": ["KHR_materials_emissive_strength"],
        "scene": 0,
        "scenes": [{"name": scene.name, "nodes": list(range(len(nodes)))}],
        "nodes": nodes,
        "cameras": cameras,
        "meshes": meshes,
        "materials": described,
        "accessors": accessors,
        "bufferViews": views,
        "buffers": [{"byteLength": len(buffer)}],
    }, bytes(buffer)


def gltf(scene, generator):
    root, buffer = document(scene, generator)
    uri = "data:application/octet-stream;base64," + base64.b64encode(buffer).decode("ascii")
    root["buffers"][0]["uri"] = uri
    return (dump(root) + "\n").encode("ascii")


def glb(scene, generator):
    """GLB 2: a header and two chunks, JSON padded with spaces, each a multiple of four bytes."""
    root, buffer = document(scene, generator)
    text = json.dumps(root, separators=(",", ":")).encode("ascii")
    text += b" " * (-len(text) % 4)
    chunks = struct.pack("<I4s", len(text), b"JSON") + text
    chunks += struct.pack("<I4s", len(buffer), b"BIN\0") + buffer
    return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks


def obj(scene, generator, library):
    """OBJ and MTL; cameras have no place in them, and copies are written out."""
    header = [f"# {scene.about}", f"# {generator}"]
    numbers, faces = {}, []
    for thing in scene.things:
        faces += ["", f"# {thing.defect}"] if thing.defect else [""]
        faces += [f"o {thing.name}", f"usemtl {thing.material}"]
        for t in moved(thing.mesh, thing.at):
            faces.append("f " + " ".join(str(numbers.setdefault(p, len(numbers) + 1)) for p in t))
    # repr gives the shortest decimals that read back as the same number.
    vertices = ["v " + " ".join(repr(x) for x in metres(p)) for p in numbers]
    text = "\n".join(header + ["", f"mtllib {library}", ""] + vertices + faces) + "\n"

    lines = header + ["# Kd: reflectance. Ke: radiance in W/(m^2 sr). Linear."]
    for m in scene.materials():
        lines += ["", f"newmtl {m.name}", "illum 1", "Ka 0 0 0"]
        lines.append("Kd " + " ".join(repr(x) for x in m.reflectance))
        if m.emits():
            lines.append("Ke " + " ".join(repr(x) for x in m.radiance()))
    return text.encode("ascii"), ("\n".join(lines) + "\n").encode("ascii")

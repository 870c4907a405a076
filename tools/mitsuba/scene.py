"""Scenes as lumel reads them, given to Mitsuba.

`lumel inspect SCENE --export FILE` writes triangles, sides, reflectance, radiance and view
(src/output/export.rs says how). From that a Mitsuba scene is made:

- Triangles of one material, with the same light and reflectance, are one mesh without normals, so
  flat. Mitsuba's `diffuse` and `area` are one-sided, black at the back, and block: what lumel's
  one-sided faces do.
- Two-sided faces that do not emit are `twosided`; so are pairs of one-sided ones with the same
  corners, back to back, since of two faces at one place a ray finds either.
- Two-sided faces and such pairs that emit become two meshes back to back, each moved forward by
  APART of the scene's size.

- One-sided faces that lie in one plane, overlap and look in opposite directions (a cupboard's top
  and the ceiling that it touches) are moved APART likewise, so that rays find the one that looks
  at them, as lumel's do. (Those that look the same way lumel has already cut.)

Other modules here take `mi` and `dr` from this one, before they import anything else that imports
drjit: it looks for its compiler when it is imported. Run by itself, this says whether Mitsuba works.
"""

import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent.parent
PROGRAM = Path(os.environ.get("LUMEL", ROOT / "target" / "release" / "lumel"))

# Half the distance between the two sides of an emitting sheet, relative to the scene's size: large
# enough that float32 (6e-8) tells them apart, and well below the height above surfaces at which
# rays start (trace.NEAR), so that those of points on the sheet start in front of it.
APART = 5e-7


def start_mitsuba(threads=None):
    """Mitsuba with its vectorised variant and so many threads (all by default)."""
    found = sorted((ROOT / ".venv" / "mitsuba" / "llvm").glob("usr/lib/*/libLLVM.so*"))
    if found:
        os.environ.setdefault("DRJIT_LIBLLVM_PATH", str(found[0]))
    try:
        import drjit
        import mitsuba
    except ImportError:
        sys.exit("Mitsuba is not there: run `sh tools/mitsuba/setup.sh`, and then this with "
                 ".venv/mitsuba/bin/python")
    mitsuba.set_variant("llvm_ad_rgb")
    if threads is not None:
        drjit.set_thread_count(threads)
    return mitsuba


mi = start_mitsuba()
import drjit as dr  # noqa: E402
import numpy as np  # noqa: E402


def lumel(*words):
    """Runs lumel; what it says is shown only when it fails."""
    words = [str(PROGRAM), *map(str, words)]
    done = subprocess.run(words, capture_output=True, text=True)
    if done.returncode == 4:  # the tolerance was not met, but there is a result
        print(done.stderr, file=sys.stderr)
    elif done.returncode != 0:
        sys.exit(f"{' '.join(words)}\nfailed with exit code {done.returncode}:\n{done.stderr}")
    return done.stdout


class Exported:
    """A scene as lumel reads it: arrays over triangles, and the view."""

    def __init__(self, path, *options):
        with tempfile.TemporaryDirectory() as room:
            file = Path(room) / "scene.json"
            lumel("inspect", path, "--export", file, "--quiet", *options)
            data = json.loads(file.read_text())
        triangles = data["triangles"]
        self.corners = np.array(triangles["vertices"]).reshape(-1, 3, 3)
        self.reflectance = np.array(triangles["reflectance"])
        self.radiance = np.array(triangles["radiance"])
        self.material = np.array(triangles["material"])
        sides = np.array([m["two_sided"] for m in data["materials"]])
        self.two_sided = sides[self.material]
        self.averaged = data["averaged"]
        self.view = data["view"]
        across = np.cross(self.corners[:, 1] - self.corners[:, 0],
                          self.corners[:, 2] - self.corners[:, 0])
        double = np.linalg.norm(across, axis=1)
        self.area = double / 2
        self.normal = across / double[:, None]
        flat = self.corners.reshape(-1, 3)
        self.extent = float((flat.max(axis=0) - flat.min(axis=0)).max())


def opposite(exported):
    """For each triangle the one with the same corners that looks the other way, or -1."""
    other = np.full(len(exported.corners), -1)
    seen = {}
    for k, corners in enumerate(exported.corners + 0.0):
        key = tuple(sorted(map(tuple, corners)))
        for j in seen.get(key, []):
            if exported.normal[k] @ exported.normal[j] < 0:
                other[k], other[j] = j, k
        seen.setdefault(key, []).append(k)
    return other


def in_one_plane(exported, single):
    """How far to move each triangle along its normal so that it can be told from those that overlap
    it, less than twice APART from its plane, and look the other way: forward, or back where it lies
    behind the other; in units of APART. `single`: triangles that are one-sided and not paired."""
    normal, corners, extent = exported.normal, exported.corners, exported.extent
    moved = np.zeros(len(corners))
    rounded = np.round(normal, 3) + 0.0
    largest = rounded[np.arange(len(rounded)), np.abs(rounded).argmax(axis=1)]
    turned = rounded * np.sign(largest)[:, None]
    groups = {}
    for k in np.nonzero(single)[0]:
        groups.setdefault(tuple(turned[k]), []).append(k)
    for key, members in groups.items():
        members = np.array(members)
        height = corners[members].mean(axis=1) @ np.array(key)
        order = members[np.argsort(height)]
        height = np.sort(height)
        first = np.searchsorted(height, height - 2 * APART * extent)
        end = np.searchsorted(height, height + 2 * APART * extent, side="right")
        for k, begin, stop in zip(order, first, end):
            others = order[begin:stop]
            others = others[(normal[others] @ normal[k] < 0) & overlap(corners[k], corners[others], normal[k])]
            if len(others):
                behind = (corners[others].mean(axis=1) - corners[k].mean(axis=0)) @ normal[k]
                moved[k] = -1 if behind[np.abs(behind).argmin()] > 1e-10 * extent else 1
    return moved


def overlap(triangle, others, normal):
    """Whether triangles in one plane share area with `triangle`."""
    apart = np.zeros(len(others), dtype=bool)
    size = np.abs(triangle - triangle[0]).max()
    for one, other in [(triangle[None], others), (others, triangle[None])]:
        for i in range(3):
            edge = one[:, (i + 1) % 3] - one[:, i]
            across = np.cross(normal, edge)
            across /= np.maximum(np.linalg.norm(across, axis=1), 1e-300)[:, None]
            side = ((one[:, (i + 2) % 3] - one[:, i]) * across).sum(axis=1)
            across *= np.where(side < 0, -1, 1)[:, None]
            reach = ((other - one[:, i][:, None]) * across[:, None]).sum(axis=2).max(axis=1)
            apart |= reach <= 1e-6 * size
    return ~apart


def mesh(corners, front, back, radiance):
    """A Mitsuba mesh of triangles with these reflectances; no back: black, and it blocks."""
    shape = mi.Mesh("part", 3 * len(corners), len(corners), props=properties(front, back, radiance))
    parameters = mi.traverse(shape)
    parameters["vertex_positions"] = mi.Float(corners.astype(np.float32).ravel())
    parameters["faces"] = mi.UInt32(np.arange(3 * len(corners), dtype=np.uint32))
    parameters.update()
    return shape


def properties(front, back, radiance):
    def diffuse(colour):
        return {"type": "diffuse", "reflectance": {"type": "rgb", "value": [float(c) for c in colour]}}

    surface = diffuse(front)
    if back is not None:
        surface = {"type": "twosided", "front": surface, "back": diffuse(back)}
    own = mi.Properties()
    own["mesh_bsdf"] = mi.load_dict(surface)
    if max(radiance) > 0:
        value = {"type": "rgb", "value": [float(c) for c in radiance]}
        own["mesh_emitter"] = mi.load_dict({"type": "area", "radiance": value})
    return own


def mitsuba_scene(exported):
    """The scene for Mitsuba, without sensor; emitters are sampled by their power."""
    twin = opposite(exported)
    moved = in_one_plane(exported, (twin < 0) & ~exported.two_sided)
    groups = {}

    def add(k, front, back, radiance, corners):
        key = (tuple(front), None if back is None else tuple(back), tuple(radiance))
        groups.setdefault((int(exported.material[k]), key), []).append(corners)

    dark = np.zeros(3)
    for k, corners in enumerate(exported.corners):
        front, radiance = exported.reflectance[k], exported.radiance[k]
        other = twin[k]
        paired = exported.two_sided[k] or other >= 0
        back = front if other < 0 else exported.reflectance[other]
        emits = radiance.max() > 0 or (other >= 0 and exported.radiance[other].max() > 0)
        forward = APART * exported.extent * exported.normal[k]
        if not paired:
            add(k, front, None, radiance, corners + moved[k] * forward)
        elif emits:
            add(k, front, None, radiance, corners + forward)
            if other < 0:
                add(k, front, None, radiance, corners[::-1] - forward)
        elif other < 0 or k < other:
            add(k, front, back, dark, corners)
    shapes = {"type": "scene"}
    for number, ((_, (front, back, radiance)), parts) in enumerate(groups.items()):
        shapes[f"part{number}"] = mesh(np.array(parts), front, back, radiance)
    return mi.load_dict(shapes)


def camera_rays(view, width, height, x, y):
    """Rays of the view through places of a picture: pixels from the top left, as lumel has them.

    x and y are Float arrays; y grows downwards.
    """
    parallel = "half_height" in view
    half_height = view["half_height"] if parallel else np.tan(0.5 * view["vertical_fov"])
    right, up, forward, eye = (mi.Vector3f(view[k]) for k in ("right", "up", "forward", "eye"))
    across = (2 * x / width - 1) * (half_height * width / height)
    step = across * right + (1 - 2 * y / height) * half_height * up
    if parallel:
        return mi.Ray3f(mi.Point3f(eye + step), forward + dr.zeros(mi.Vector3f, dr.width(x)))
    return mi.Ray3f(mi.Point3f(eye) + dr.zeros(mi.Point3f, dr.width(x)), dr.normalize(forward + step))


def sample_rays(view, width, height, across):
    """Rays through the middles of across x across parts of each pixel, pixel by pixel:
    through the pixels of a picture that is so many times larger."""
    place = dr.arange(mi.UInt32, width * height * across**2)
    part, pixel = place % across**2, place // across**2
    x = mi.Float(pixel % width) + (mi.Float(part % across) + 0.5) / across
    y = mi.Float(pixel // width) + (mi.Float(part // across) + 0.5) / across
    return camera_rays(view, width, height, x, y)


def camera_is_off_by(view, width, height):
    """Largest distance, in pixels, between rays of Mitsuba's own camera and those made here."""
    eye, forward, up = (np.array(view[k]) for k in ("eye", "forward", "up"))
    place = mi.ScalarTransform4f().look_at(eye.tolist(), (eye + forward).tolist(), up.tolist())
    made = {"film": {"type": "hdrfilm", "width": width, "height": height}, "near_clip": 1e-3}
    if "half_height" in view:
        half_width = view["half_height"] * width / height
        scale = mi.ScalarTransform4f().scale([half_width, half_width, 1.0])
        made |= {"type": "orthographic", "to_world": place @ scale}
        pixel = 2 * view["half_height"] / height
    else:
        made |= {"type": "perspective", "to_world": place, "fov_axis": "y",
                 "fov": float(np.degrees(view["vertical_fov"]))}
        pixel = 2 * np.tan(0.5 * view["vertical_fov"]) / height
    x, y = (mi.Float(v) for v in ([0.5, width - 0.5, 0.25 * width], [0.5, height - 0.5, 0.4 * height]))
    theirs = mi.load_dict(made).sample_ray(0, 0, mi.Point2f(x / width, y / height), mi.Point2f(0))[0]
    ours = camera_rays(view, width, height, x, y)
    away = dr.norm(dr.cross(ours.d, theirs.d))
    if "half_height" in view:
        away += dr.norm(dr.cross(theirs.o - ours.o, ours.d))
    return float(np.max(np.array(away)) / pixel)


if __name__ == "__main__":
    box = mi.load_dict(mi.cornell_box())
    mean = float(dr.mean(mi.render(box, spp=4).array)[0])
    print(f"Mitsuba {mi.__version__} works (its Cornell box is {mean:.2f} bright)")

#!/usr/bin/env python3
"""Writes an arcade: a vaulted hall with columns, a stair and furniture, of as many triangles as wanted.

    tools/make_arcade.py -o FILE.gltf                      5,000 triangles
    tools/make_arcade.py --triangles 250000 -o FILE.glb    any number from 4,700 on, within 5 %
    tools/make_arcade.py --defects -o FILE.obj             with objects that are wrong on purpose
    tools/make_arcade.py --lamp-triangles 1000 -o ...      the chandelier's globe in that many
    tools/make_arcade.py --t-junctions -o ...              every second row of tiles shifted by half
    tools/make_arcade.py --check [any of these]            check the geometry, write nothing

The hall is the same at every count (12 x 15 m, 7.25 m high); more triangles make curves finer and
furniture more. What --defects adds comes on top: at most 5 %, and all else is as without it. Lengths
are metres, y is up, faces are counter-clockwise about the side that radiates. The room is one closed
surface that faces in, everything in it a closed solid that faces out. Coordinates are multiples of
1/65536 m, exact in f32: what stands on something touches it exactly. All this is checked each time
before a file is written. The same bytes on every machine.

tools/arcade/ holds the parts. Needs Python 3.9 and nothing else.
"""

import argparse
import sys
from dataclasses import dataclass
from pathlib import Path

from arcade import defects, files, furnish, hall, proofs
from arcade.things import Fine
from make_scenes import Camera, Material, degrees

GENERATOR = "lumel tools/make_arcade.py"
SHIPPED, LEAST, MOST = 5000, 4700, 2_000_000

MATERIALS = [
    Material("marble_light", (0.66, 0.62, 0.54)),
    Material("marble_dark", (0.32, 0.24, 0.21)),
    Material("limestone", (0.68, 0.62, 0.52)),
    Material("ochre", (0.66, 0.50, 0.34)),
    Material("plaster", (0.76, 0.73, 0.67)),
    Material("azure", (0.24, 0.36, 0.50)),
    Material("marble", (0.74, 0.72, 0.67)),
    Material("oak", (0.44, 0.30, 0.20)),
    Material("terracotta", (0.58, 0.32, 0.22)),
    Material("cream", (0.78, 0.75, 0.68)),
    Material("blue", (0.20, 0.32, 0.54)),
    Material("green", (0.22, 0.38, 0.20)),
    Material("red", (0.56, 0.22, 0.20)),
    Material("brass", (0.60, 0.46, 0.24)),
    Material("iron", (0.22, 0.21, 0.20)),
    Material("skylight", (0.30, 0.30, 0.30), (0.82, 0.91, 1.0), 20.0),
    Material("oculus_light", (0.30, 0.30, 0.30), (0.82, 0.91, 1.0), 8.0),
    Material("globe_light", (0.60, 0.60, 0.60), (1.0, 0.78, 0.50), 32.0),
    Material("lantern_light", (0.60, 0.60, 0.60), (1.0, 0.70, 0.40), 40.0),
]

CAMERAS = [
    Camera("overview", (1.5, 1.65, 6.75), (-0.5, 1.9, -7.0), degrees(58.0), 16 / 9),
    Camera("table", (1.9, 1.5, 3.4), (-0.1, 0.85, 0.7), degrees(42.0), 16 / 9),
    Camera("aisle", (4.375, 1.65, 7.25), (4.75, 2.05, -7.0), degrees(62.0), 16 / 9),
]


@dataclass
class Arcade:
    """What `files` writes. The room's parts come first among the things."""

    name: str
    about: str
    things: list
    extras: dict
    room: list
    cameras: tuple = tuple(CAMERAS)

    def materials(self):
        used = {t.material for t in self.things}
        return [m for m in MATERIALS if m.name in used]

    def triangles(self):
        return sum(len(t.mesh) for t in self.things)


def build(fine, count, options):
    """The scene at a fineness; `count(n)` says how many books, of 12 triangles, go with n others."""
    room = hall.room(fine, options.t_junctions)
    things = [furnish.Thing(name, material, mesh) for name, material, mesh in room]
    things += furnish.architecture(fine, options.lamp_triangles) + furnish.furniture(fine)
    things += furnish.library(fine, count(sum(len(t.mesh) for t in things)))
    if options.defects:
        things += defects.defects(fine, next(t for t in things if t.name == "cup_1"))
    about = (
        "A closed hall with two arcades, groin vaults over the aisles, a coffered ceiling with skylights,"
        " a stair and furniture; every solid is closed. Metres, y up."
    )
    scene = Arcade("arcade", about, things, {}, room)
    scene.extras["triangles"] = scene.triangles()
    if options.t_junctions:
        scene.extras["floor"] = "rows of tiles meet in T-junctions"
    wrong = {t.name: t.defect for t in things if t.defect}
    if wrong:
        scene.about += " Some objects are wrong on purpose."
        scene.extras["defects"] = wrong
    return scene


def wanted(options):
    """The finest scene that is not above the count, filled up with books.

    Without what --defects adds: with it and without it the rest is the same.
    """
    n = options.triangles

    def size(step):
        things = build(Fine(step / 64), lambda _: 0, options).things
        return sum(len(t.mesh) for t in things if not t.defect)

    # In steps of 1/64 of the fineness.
    low, high = 32, 64
    if size(low) > n * 1.05:
        sys.exit(f"--triangles {n} is too few: {size(low)} is the least with these options")
    while size(high) <= n:
        low, high = high, 2 * high
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (middle, high) if size(middle) <= n else (low, middle)
    scene = build(Fine(low / 64), lambda have: max(0, n - have) // 12, options)
    if abs(scene.triangles() - n) > 0.05 * n:
        sys.exit(f"--triangles {n}: {scene.triangles()} came out, more than 5 % off; ask for more")
    return scene


def check(scene, options):
    """Raises AssertionError where the geometry is not what it should be."""
    proofs.assert_room(scene.room, options.t_junctions)
    solids = [t for t in scene.things[len(scene.room) :] if not t.defect]
    for mesh, name in {id(t.mesh): (t.mesh, t.name) for t in solids}.values():
        proofs.assert_solid(name, mesh)
    proofs.assert_apart(solids)
    proofs.assert_contacts([t for t in scene.things if not t.defect])
    for m in scene.materials():
        assert all(0.2 <= x <= 0.8 for x in m.reflectance), f"{m.name} reflects {m.reflectance}"
    if options.defects:
        defects.assert_defects(scene.things)
    return len(solids)


def parse(arguments=None):
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    add = parser.add_argument
    add("--triangles", type=int, default=SHIPPED, help="how many, within 5 %% (default: %(default)s)")
    add("--lamp-triangles", type=int, default=32, help="of the chandelier's globe (default: %(default)s)")
    add("--defects", action="store_true", help="add objects that are wrong on purpose")
    add("--t-junctions", action="store_true", help="shift every second row of tiles by half a tile")
    add("--check", action="store_true", help="check the geometry and write nothing")
    add("-o", "--output", type=Path, help=".gltf, .glb or .obj (with .mtl)")
    options = parser.parse_args(arguments)
    if not LEAST <= options.triangles <= MOST:
        parser.error(f"--triangles: from {LEAST} to {MOST}")
    if not 8 <= options.lamp_triangles <= 100_000:
        parser.error("--lamp-triangles: from 8 to 100000")
    if options.check == (options.output is not None):
        parser.error("either -o FILE or --check")
    if options.output and options.output.suffix not in (".gltf", ".glb", ".obj"):
        parser.error("-o: .gltf, .glb or .obj")
    return options


def shipped():
    """The files of scenes/ that are made here: names and bytes, checked."""
    out = {}
    for name, write, words in (
        ("arcade.gltf", files.gltf, []),
        ("arcade-defects.glb", files.glb, ["--defects"]),
    ):
        options = parse(["-o", name, *words])
        scene = wanted(options)
        check(scene, options)
        out[name] = write(scene, GENERATOR)
    return out


def main():
    options = parse()
    scene = wanted(options)
    solids = check(scene, options)
    if options.check:
        print(
            f"{scene.triangles()} triangles: the room is closed, and so are the {solids} solids in it;"
            " they are outward, apart or in contact, and none floats"
        )
        return 0
    path = options.output
    if path.suffix == ".obj":
        text, library = files.obj(scene, GENERATOR, path.with_suffix(".mtl").name)
        path.write_bytes(text)
        path.with_suffix(".mtl").write_bytes(library)
    else:
        path.write_bytes((files.gltf if path.suffix == ".gltf" else files.glb)(scene, GENERATOR))
    print(f"{path}: {scene.triangles()} triangles, {len(scene.things)} objects")
    return 0


if __name__ == "__main__":
    sys.exit(main())

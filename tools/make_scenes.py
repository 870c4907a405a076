#!/usr/bin/env python3
"""Writes the scenes that are shipped with lumel into scenes/.

    tools/make_scenes.py             write the files
    tools/make_scenes.py --check     fail unless scenes/ holds just what would be written
    tools/make_scenes.py --closure   cast rays in the closed scenes: every one meets a front side

The geometry is stated once, here (that of the arcade in make_arcade.py, which makes
it in any size), as planar faces with holes, and the files follow from it: the same
bytes on every machine (only +, -, *, / and sqrt reach the files; angles are
rounded). Lengths are metres, axes right-handed, faces
counter-clockwise about the side that radiates, emission is radiance in
W/(m^2 sr), and colours are linear.

Before anything is written the surfaces are checked in exact integer or
floating-point arithmetic: closed scenes have every edge shared by exactly two
triangles that run it in opposite directions, enclose the stated volume, and
triangulations cover their faces' areas.

Needs Python 3.9 and nothing else.
"""

import argparse
import base64
import json
import math
import random
import struct
import sys
from dataclasses import dataclass, field
from pathlib import Path

SCENES = Path(__file__).resolve().parent.parent / "scenes"
GENERATOR = "lumel tools/make_scenes.py"

UP, DOWN = (0, 1, 0), (0, -1, 0)


# ---------------------------------------------------------------------------
# What a scene is
# ---------------------------------------------------------------------------


@dataclass
class Material:
    """A diffuse one-sided material; it radiates `strength * emission`, W/(m^2 sr).

    Emission is kept as glTF keeps it, a factor in [0, 1] and a strength.
    """

    name: str
    reflectance: tuple
    emission: tuple = (0.0, 0.0, 0.0)
    strength: float = 1.0

    def radiance(self):
        return tuple(self.strength * e for e in self.emission)

    def emits(self):
        return any(self.emission)


@dataclass
class Part:
    """A named triangle mesh of one material: one node and one mesh in glTF."""

    name: str
    material: Material
    vertices: list
    triangles: list

    def corners(self):
        return [tuple(self.vertices[i] for i in t) for t in self.triangles]


@dataclass
class Camera:
    """A perspective camera at `eye` that looks at `target`; `yfov` in radians."""

    name: str
    eye: tuple
    target: tuple
    yfov: float
    aspect: float
    up: tuple = (0, 1, 0)


@dataclass
class Scene:
    name: str
    about: str
    parts: list
    cameras: list
    extras: dict = field(default_factory=dict)

    def materials(self):
        return list({id(p.material): p.material for p in self.parts}.values())

    def triangles(self):
        return [t for p in self.parts for t in p.corners()]


def degrees(angle):
    """Radians, rounded to 1e-12 so that every platform writes the same digits."""
    return round(math.radians(angle), 12)


# ---------------------------------------------------------------------------
# Vectors
# ---------------------------------------------------------------------------


def sub(a, b):
    return tuple(x - y for x, y in zip(a, b))


def dot(a, b):
    return sum(x * y for x, y in zip(a, b))


def cross(a, b):
    return (
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    )


def unit(a):
    length = math.sqrt(dot(a, a))
    return tuple(x / length for x in a)


def look_at(camera):
    """The unit quaternion (x, y, z, w) that turns the -Z axis to the target.

    The columns of the rotation are the camera's right, up and backward axes.
    """
    back = unit(sub(camera.eye, camera.target))
    right = unit(cross(camera.up, back))
    up = cross(back, right)
    m = list(zip(right, up, back))
    # The largest of the four squared components is at least 1/4: no cancellation.
    squares = [
        1 + m[0][0] - m[1][1] - m[2][2],
        1 - m[0][0] + m[1][1] - m[2][2],
        1 - m[0][0] - m[1][1] + m[2][2],
        1 + m[0][0] + m[1][1] + m[2][2],
    ]
    largest = squares.index(max(squares))
    s = 2 * math.sqrt(squares[largest])
    x, y, z = m[2][1] - m[1][2], m[0][2] - m[2][0], m[1][0] - m[0][1]
    xy, xz, yz = m[0][1] + m[1][0], m[0][2] + m[2][0], m[1][2] + m[2][1]
    rows = [(None, xy, xz, x), (xy, None, yz, y), (xz, yz, None, z), (x, y, z, None)]
    return [s / 4 if v is None else v / s + 0.0 for v in rows[largest]]


# ---------------------------------------------------------------------------
# Triangulation of a planar face with holes, in exact integer arithmetic
# ---------------------------------------------------------------------------


def turn(a, b, c):
    """Twice the signed area of the triangle a b c in the plane."""
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])


def between(a, b, p):
    """Whether p lies on the closed segment a b."""
    return turn(a, b, p) == 0 and (
        (p[0] - a[0]) * (p[0] - b[0]) + (p[1] - a[1]) * (p[1] - b[1]) <= 0
    )


def inside(p, loops):
    """Even-odd rule; p must not lie on a loop."""
    odd = False
    for loop in loops:
        for a, b in zip(loop, loop[1:] + loop[:1]):
            if (a[1] > p[1]) != (b[1] > p[1]):
                odd ^= (turn(a, b, p) > 0) == (b[1] > a[1])
    return odd


def twice_area(loop):
    return sum(a[0] * b[1] - a[1] * b[0] for a, b in zip(loop, loop[1:] + loop[:1]))


# The circumradius over the shortest side at which refinement is content: 20 degrees.
COARSEST = 1.4619


def triangulate(loops, extra=0):
    """A polygon with holes as (extra points, triangles), triangles as index triples.

    `loops` holds the outline first, counter-clockwise, then the holes,
    clockwise: the polygon lies to the left of every edge. Indices count through
    the loops and then the extra points. The boundary gets no vertex, so that
    faces which share boundary vertices fit without T-junctions.

    A greedy triangulation (chords that cross nothing, the shortest first) is
    made constrained Delaunay by Lawson's flips. Then up to `extra` points are
    added inside, each at the off-centre of the worst triangle (Üngör, "Off-
    centers", 2004), until no angle is below 20 degrees; an off-centre in the
    diametral circle of a boundary edge, which Delaunay refinement would cut
    there, is passed over. Coordinates are integers and every decision exact, but
    for the order of the worst. O(n^3) in the corners: meant for some hundred.
    """
    points = [p for loop in loops for p in loop]
    corners = len(points)
    boundary = []
    first = 0
    for loop in loops:
        boundary += [(first + i, first + (i + 1) % len(loop)) for i in range(len(loop))]
        first += len(loop)

    def crosses(a, b, c, d):
        a, b, c, d = points[a], points[b], points[c], points[d]
        return turn(a, b, c) * turn(a, b, d) < 0 and turn(c, d, a) * turn(c, d, b) < 0

    def length2(a, b):
        step = sub(points[a], points[b])
        return dot(step, step)

    # The greedy triangulation's edges.
    edges = {tuple(sorted(e)) for e in boundary}
    chords = [(a, b) for a in range(corners) for b in range(a + 1, corners)]
    doubled = [[(2 * x, 2 * y) for x, y in loop] for loop in loops]
    for a, b in sorted(chords, key=lambda e: (length2(*e), e)):
        p, q = points[a], points[b]
        if (
            (a, b) not in edges
            and not any(between(p, q, r) for i, r in enumerate(points) if i not in (a, b))
            and not any(crosses(a, b, c, d) for c, d in edges)
            and inside((p[0] + q[0], p[1] + q[1]), doubled)
        ):
            edges.add((a, b))

    # `third[a, b]` is the third corner of the triangle to the left of a -> b.
    near = {i: set() for i in range(corners)}
    for a, b in edges:
        near[a].add(b)
        near[b].add(a)
    outside = {(b, a) for a, b in boundary}
    third = {}
    for a, b in [e for a, b in edges for e in ((a, b), (b, a)) if e not in outside]:
        left = [c for c in near[a] if turn(points[a], points[b], points[c]) > 0]
        (third[a, b],) = [
            c for c in left if all(turn(points[a], points[c], points[d]) >= 0 for d in left)
        ]

    def add(*triangles):
        for a, b, c in triangles:
            third[a, b], third[b, c], third[c, a] = c, a, b

    def in_circle(a, b, c, d):
        """Positive when d lies inside the circle through a, b, c."""
        rows = []
        for i in (a, b, c):
            x, y = sub(points[i], points[d])
            rows.append((x, y, x * x + y * y))
        return dot(rows[0], cross(rows[1], rows[2]))

    def flip(waiting):
        """Lawson's flips from these edges on, until all are locally Delaunay."""
        while waiting:
            a, b = waiting.pop()
            if (a, b) not in third or (b, a) not in third:
                continue
            c, d = third[a, b], third[b, a]
            if in_circle(a, b, c, d) > 0:
                del third[a, b], third[b, a]
                add((a, d, c), (d, b, c))
                waiting += [(a, d), (d, b), (b, c), (c, a)]

    def triangles():
        return sorted({min((a, b, c), (b, c, a), (c, a, b)) for (a, b), c in third.items()})

    def shape(a, b, c):
        """Circumradius over shortest side, 1 / (2 sin(smallest angle)), and the off-centre.

        The off-centre lies above the shortest side, towards the circumcentre, but
        no farther than where it makes a triangle of just the wanted shape with it.
        """
        _, a, b, c = min((length2(a, b), a, b, c), (length2(b, c), b, c, a), (length2(c, a), c, a, b))
        (px, py), (qx, qy) = sub(points[b], points[a]), sub(points[c], points[a])
        p2, q2, d = px * px + py * py, qx * qx + qy * qy, 2 * (px * qy - py * qx)
        x, y = (qy * p2 - py * q2) / d, (px * q2 - qx * p2) / d
        ratio = math.sqrt((x * x + y * y) / p2)
        # Heights above the side, over its length: of the circumcentre, and of the apex.
        height = (x * -py + y * px) / p2
        apex = COARSEST + math.sqrt(COARSEST**2 - 0.25)
        pull = min(height, apex)
        return ratio, (
            points[a][0] + round(px / 2 - pull * py),
            points[a][1] + round(py / 2 + pull * px),
        )

    def admissible(p):
        if p in points or any(between(points[a], points[b], p) for a, b in boundary):
            return False
        return inside(p, loops) and all(
            dot(sub(points[a], p), sub(points[b], p)) > 0 for a, b in boundary
        )

    def insert(p):
        new = len(points)
        points.append(p)
        for t in triangles():
            sides = [turn(points[t[i]], points[t[(i + 1) % 3]], p) for i in range(3)]
            if min(sides) >= 0:
                break
        a, b, c = (t[(sides.index(min(sides)) + i) % 3] for i in range(3))
        rim = [(b, c), (c, a)]
        if min(sides) > 0:
            rim.append((a, b))
        else:  # on the edge a b: the triangle beyond is cut as well
            d = third.pop((b, a))
            del third[a, b]
            rim += [(a, d), (d, b)]
        add(*((e[0], e[1], new) for e in rim))
        flip(rim)

    flip(sorted(edges))
    for _ in range(extra):
        shapes = sorted((shape(*t) for t in triangles()), reverse=True)
        centres = [p for ratio, p in shapes if ratio > COARSEST and admissible(p)]
        if not centres:
            break
        insert(centres[0])

    found = triangles()
    area = sum(turn(*(points[i] for i in t)) for t in found)
    assert area == sum(twice_area(loop) for loop in loops), "triangles do not cover the face"
    inner = points[corners:]
    assert len(found) == corners + 2 * len(inner) + 2 * len(loops) - 4, "Euler's formula"
    return inner, found


# ---------------------------------------------------------------------------
# Faces in space, on the lattice of 1/64 m
# ---------------------------------------------------------------------------

# Coordinates of the triangulated scenes are whole multiples of 1/64 m: exact in
# f32, so that faces are exactly planar, and exact for the predicates above.
LATTICE = 64


def to_lattice(point):
    scaled = tuple(x * LATTICE for x in point)
    assert all(x == int(x) for x in scaled), f"{point} is off the lattice"
    return tuple(int(x) for x in scaled)


def split(loop, longest):
    """The loop with its edges cut into equal pieces no longer than `longest`.

    The cuts depend on the edge alone, so the faces at both sides agree.
    """
    points = []
    for a, b in zip(loop, loop[1:] + loop[:1]):
        step = sub(b, a)
        pieces = max(1, math.ceil(math.sqrt(dot(step, step)) / longest))
        while any(x % pieces for x in step):
            pieces += 1
        points += [tuple(p + x * i // pieces for p, x in zip(a, step)) for i in range(pieces)]
    return points


def face(name, material, facing, outline, holes=(), longest=1.5, extra=0):
    """A planar face with holes (corners in metres), triangulated, seen from `facing`.

    Edges are cut to `longest`. Up to `extra` points go inside; only a face that is
    parallel to two axes can have them.
    """
    loops = [split([to_lattice(p) for p in loop], longest * LATTICE) for loop in (outline, *holes)]
    # Drop the coordinate in which the face is most extended along its normal and
    # keep the orientation: (u, v, dropped) is an even permutation.
    axis = max(range(3), key=lambda i: abs(facing[i]))
    u, v = ((1, 2), (2, 0), (0, 1))[axis]
    if facing[axis] < 0:
        u, v = v, u
    origin = loops[0][0]
    assert all(dot(sub(p, origin), facing) == 0 for loop in loops for p in loop), f"{name}: not planar"

    def flat(p):
        return (p[u], p[v])

    # The outline counter-clockwise, the holes clockwise, however they were listed.
    for i, loop in enumerate(loops):
        if (twice_area([flat(p) for p in loop]) > 0) != (i == 0):
            loop.reverse()
    plane = [[flat(p) for p in loop] for loop in loops]
    points = [p for loop in loops for p in loop]
    inner, triangles = triangulate(plane, extra)
    assert not inner or sum(x != 0 for x in facing) == 1
    for a, b in inner:
        p = list(origin)
        p[u], p[v] = a, b
        points.append(tuple(p))
    vertices = [tuple(x / LATTICE for x in p) for p in points]
    return Part(name, material, vertices, triangles)


def rectangle(x, z, y):
    """The corners of a horizontal rectangle at height y; x and z are (low, high)."""
    return [(x[0], y, z[0]), (x[1], y, z[0]), (x[1], y, z[1]), (x[0], y, z[1])]


def wall(a, b, low, high):
    """The corners of an upright rectangle above the ground line from a to b, (x, z)."""
    return [(a[0], low, a[1]), (b[0], low, b[1]), (b[0], high, b[1]), (a[0], high, a[1])]


def merge(name, parts):
    """One part from several of the same material."""
    vertices, triangles = [], []
    for p in parts:
        assert p.material is parts[0].material
        triangles += [tuple(i + len(vertices) for i in t) for t in p.triangles]
        vertices += p.vertices
    return Part(name, parts[0].material, vertices, triangles)


# ---------------------------------------------------------------------------
# Proofs
# ---------------------------------------------------------------------------


def open_edges(triangles):
    """Directed edges that no neighbour runs in the other direction.

    Raises where an edge is run twice in one direction: overlapping faces, an
    inside-out face, or more than two triangles at one edge.
    """
    seen = set()
    for t in triangles:
        for e in zip(t, t[1:] + t[:1]):
            assert e not in seen, f"edge {e} is run twice in one direction"
            seen.add(e)
    return [(a, b) for a, b in seen if (b, a) not in seen]


def enclosed_volume(triangles):
    """Of a closed surface whose front sides face the air inside.

    With coordinates on the lattice every product is exact in f64.
    """
    return -sum(dot(a, cross(b, c)) for a, b, c in triangles) / 6


def assert_closed(scene, volume):
    triangles = scene.triangles()
    assert not open_edges(triangles), f"{scene.name} is open"
    assert enclosed_volume(triangles) == volume, f"{scene.name}: volume {enclosed_volume(triangles)}"


def smallest_angle(triangles):
    """In degrees: how well the triangles are shaped."""
    worst = 180.0
    for t in triangles:
        for i in range(3):
            p, q = unit(sub(t[i - 2], t[i])), unit(sub(t[i - 1], t[i]))
            worst = min(worst, math.degrees(math.acos(max(-1.0, min(1.0, dot(p, q))))))
    return worst


def assert_closure(scene, points=50, rays=2000, seed=1):
    """Casts rays from random points of the surface, by brute force.

    Every ray must meet a surface, and its front side first: then the
    form factors from each point add up to 1. The side tests of a shared edge
    have exactly opposite values, so no ray slips through between triangles.
    """
    random_number = random.Random(seed).random
    triangles = scene.triangles()
    normals = [cross(sub(b, a), sub(c, a)) for a, b, c in triangles]
    areas = [math.sqrt(dot(n, n)) for n in normals]
    for _ in range(points):
        pick = random_number() * sum(areas)
        for triangle, normal, area in zip(triangles, normals, areas):
            pick -= area
            if pick < 0:
                break
        r, s = math.sqrt(random_number()), random_number()
        weights = (1 - r, r * (1 - s), r * s)
        p = tuple(dot(weights, axis) for axis in zip(*triangle))

        # The cone of each triangle seen from p, and the plane that it lies in.
        cones = []
        for t, n in zip(triangles, normals):
            height = dot(sub(t[0], p), n)
            if t is triangle or abs(height) < 1e-12:
                continue  # the triangle of p itself, or one in p's plane
            a, b, c = (sub(corner, p) for corner in t)
            cones.append((cross(a, b), cross(b, c), cross(c, a), n, height))

        for _ in range(rays):
            while True:
                d = tuple(2 * random_number() - 1 for _ in range(3))
                if 1e-4 < dot(d, d) < 1 and dot(d, normal) > 0:
                    break
            nearest, front = math.inf, None
            dx, dy, dz = d
            for (ax, ay, az), (bx, by, bz), (cx, cy, cz), n, height in cones:
                side = ax * dx + ay * dy + az * dz
                if side >= 0:
                    if bx * dx + by * dy + bz * dz < 0 or cx * dx + cy * dy + cz * dz < 0:
                        continue
                elif bx * dx + by * dy + bz * dz > 0 or cx * dx + cy * dy + cz * dz > 0:
                    continue
                slope = n[0] * dx + n[1] * dy + n[2] * dz
                if slope != 0 and 0 < height / slope < nearest:
                    nearest, front = height / slope, slope < 0
            assert front is not None, f"{scene.name}: a ray from {p} along {d} escapes"
            assert front, f"{scene.name}: a ray from {p} along {d} meets a back side"


# ---------------------------------------------------------------------------
# The scenes
# ---------------------------------------------------------------------------


def paper():
    """The occluded surface of Atkinson & Chien (2006), section 6: (A, B, C) = (5, 2, 1).

    The paper's own coordinates, in which z is up (glTF viewers take y as up).
    """
    a, b, c = 5.0, 2.0, 1.0
    gray = Material("gray", (0.5, 0.5, 0.5))
    # Exitance E = pi * radiance = 1.
    emitter = Material("emitter", (0.5, 0.5, 0.5), (1.0, 1.0, 1.0), 1 / math.pi)

    def square(name, material, size, z, up):
        """[0, size]^2 at height z, cut along (0, 0)-(size, size)."""
        vertices = [(0.0, 0.0, z), (size, 0.0, z), (size, size, z), (0.0, size, z)]
        triangles = [(0, 1, 2), (0, 2, 3)] if up else [(0, 2, 1), (0, 3, 2)]
        return Part(name, material, vertices, triangles)

    s5 = [(0.0, a, 0.0), (a, a, 0.0), (a, a, 1.0), (0.0, a, 1.0)]
    parts = [
        square("S1", gray, a, 0.0, up=True),
        square("S2", gray, b, 1.0, up=False),
        square("S3", gray, b, 1.0, up=True),
        square("S4", emitter, c, 2.0, up=False),
        Part("S5", gray, s5, [(0, 1, 3), (1, 2, 3)]),  # faces -y, cut along (5,5,0)-(0,5,1)
    ]
    facings = {"S1": (0, 0, 1), "S2": (0, 0, -1), "S3": (0, 0, 1), "S4": (0, 0, -1), "S5": (0, -1, 0)}
    for part in parts:
        for p, q, r in part.corners():
            assert unit(cross(sub(q, p), sub(r, p))) == facings[part.name]

    center = (2.5, 2.5, 0.5)
    cameras = [
        Camera("above", (9.0, -7.0, 7.0), center, degrees(32.0), 1.5, up=(0, 0, 1)),
        Camera("low", (8.0, -6.0, 1.5), center, degrees(32.0), 1.5, up=(0, 0, 1)),
    ]
    about = (
        "The occluded surface of Atkinson and Chien (2006) with (A,B,C) = (5,2,1), in the paper's"
        " coordinates: z is up. Reflectance 0.5; S4 emits exitance 1 W/m^2, radiance 1/pi."
    )
    return Scene("paper", about, parts, cameras)


# The Cornell box as measured by the Cornell University Program of Computer Graphics,
# www.graphics.cornell.edu/online/box/data.html, in millimetres. The published
# order of the corners is counter-clockwise about the radiating side.
CORNELL = {
    "floor": ("white", [[(552.8, 0, 0), (0, 0, 0), (0, 0, 559.2), (549.6, 0, 559.2)]]),
    "light": ("light", [[(343, 548.8, 227), (343, 548.8, 332), (213, 548.8, 332), (213, 548.8, 227)]]),
    "ceiling": ("white", [[(556, 548.8, 0), (556, 548.8, 559.2), (0, 548.8, 559.2), (0, 548.8, 0)]]),
    "back_wall": ("white", [[(549.6, 0, 559.2), (0, 0, 559.2), (0, 548.8, 559.2), (556, 548.8, 559.2)]]),
    "right_wall": ("green", [[(0, 0, 559.2), (0, 0, 0), (0, 548.8, 0), (0, 548.8, 559.2)]]),
    # Not planar: folded along (552.8, 0, 0)-(556, 548.8, 559.2).
    "left_wall": ("red", [[(552.8, 0, 0), (549.6, 0, 559.2), (556, 548.8, 559.2), (556, 548.8, 0)]]),
    "short_block": (
        "white",
        [
            [(130, 165, 65), (82, 165, 225), (240, 165, 272), (290, 165, 114)],
            [(290, 0, 114), (290, 165, 114), (240, 165, 272), (240, 0, 272)],
            [(130, 0, 65), (130, 165, 65), (290, 165, 114), (290, 0, 114)],
            [(82, 0, 225), (82, 165, 225), (130, 165, 65), (130, 0, 65)],
            [(240, 0, 272), (240, 165, 272), (82, 165, 225), (82, 0, 225)],
        ],
    ),
    "tall_block": (
        "white",
        [
            [(423, 330, 247), (265, 330, 296), (314, 330, 456), (472, 330, 406)],
            [(423, 0, 247), (423, 330, 247), (472, 330, 406), (472, 0, 406)],
            [(472, 0, 406), (472, 330, 406), (314, 330, 456), (314, 0, 456)],
            [(314, 0, 456), (314, 330, 456), (265, 330, 296), (265, 0, 296)],
            [(265, 0, 296), (265, 330, 296), (423, 330, 247), (423, 0, 247)],
        ],
    ),
}


def cornell():
    """The Cornell box, with the light set in the ceiling instead of lying on it."""
    # Reflectances are the published spectra at 650, 510 and 475 nm (the means of
    # the samples at 648 and 652, at 508 and 512, and the sample at 476 nm).
    # Radiance is (18.387, 13.9873, 6.75357), that of Mitsuba's Cornell box, here over
    # 20 because glTF wants factors up to 1. It is a customary value, no reading of the
    # published lamp spectrum (0, 8, 15.6 and 18.4 at 400, 500, 600 and 700 nm), which
    # is (17, 8.76, 6) at the wavelengths above.
    materials = {
        "white": Material("white", (0.7295, 0.7355, 0.729)),
        "green": Material("green", (0.117, 0.4125, 0.115)),
        "red": Material("red", (0.611, 0.0555, 0.062)),
        "light": Material("light", (0.78, 0.78, 0.78), (0.91935, 0.699365, 0.3376785), 20.0),
    }

    def metres(p):
        return tuple(x / 1000 for x in p)

    parts = []
    for name, (material, quads) in CORNELL.items():
        vertices, triangles = [], []
        if name == "ceiling":
            # The light coincides with the ceiling in the data, where both would be
            # counted. Here the ceiling has a hole that the light fills: its corners
            # are vertices of both. In the plane of (x, z) both run counter-clockwise
            # about the downward normal, so the hole is turned round. Tenths of a
            # millimetre are whole numbers.
            loops = [quads[0], CORNELL["light"][1][0][::-1]]
            vertices = [metres(p) for loop in loops for p in loop]
            _, triangles = triangulate([[(round(10 * x), round(10 * z)) for x, _, z in p] for p in loops])
        else:
            for quad in quads:
                first = len(vertices)
                vertices += [metres(p) for p in quad]
                triangles += [(first, first + 1, first + 2), (first, first + 2, first + 3)]
        parts.append(Part(name, materials[material], vertices, triangles))

    # Open only at the front and at the feet of the blocks, which stand on the floor.
    for a, b in open_edges([t for p in parts for t in p.corners()]):
        front = a[2] == b[2] == 0
        foot = a[1] == b[1] == 0 and 0 < a[2] < 0.5592 and 0 < b[2] < 0.5592
        assert front or foot, f"cornell is open at {a} {b}"
    ring = dict((p.name, p) for p in parts)["ceiling"]
    area = sum(dot(cross(sub(q, p), sub(r, p)), DOWN) / 2 for p, q, r in ring.corners())
    assert abs(area - (0.556 * 0.5592 - 0.130 * 0.105)) < 1e-15
    for part in parts[:6]:  # the walls face the middle of the room
        for p, q, r in part.corners():
            assert dot(cross(sub(q, p), sub(r, p)), sub((0.278, 0.273, 0.28), p)) > 0
    for part, top in zip(parts[6:], (0.165, 0.330)):  # the blocks face away from their middles
        middle = tuple(sum(x) / len(part.vertices) for x in zip(*part.vertices))
        for p, q, r in part.corners():
            assert dot(cross(sub(q, p), sub(r, p)), sub(p, middle)) > 0
        assert max(p[1] for p in part.vertices) == top

    # Position (278, 273, -800), direction (0, 0, 1), up (0, 1, 0), focal length 35 mm
    # and a film of 25 mm. Looking along +z with y up, -x is at the right in
    # right-handed axes: red at the left, as in the photograph, nothing mirrored.
    yfov = round(2 * math.atan(12.5 / 35), 12)
    camera = Camera("cornell", (0.278, 0.273, -0.8), (0.278, 0.273, 0.0), yfov, 1.0)
    assert look_at(camera) == [0, 1, 0, 0]
    about = (
        "The Cornell box from the measurements of the Cornell University Program of Computer"
        " Graphics, in metres. The light fills a hole of the ceiling."
    )
    extras = {"source": "https://www.graphics.cornell.edu/online/box/data.html"}
    return Scene("cornell", about, parts, [camera], extras)


def room():
    """A closed L-shaped room with a column, a table, a ceiling light and a window.

    Plan (x to the right, z downward; y is up, the ceiling at 2.625):

        0,0 ------------------------------- 6,0
         |     table           column        |
         |   +---------+         <>          # window
         |   +---------+                     |
         |                 3,3 ------------ 6,3
         |    light         |
         |   [     ]        |
        0,5.5 ----------- 3,5.5
    """
    top = 2.625
    outline = [(0, 0), (6, 0), (6, 3), (3, 3), (3, 5.5), (0, 5.5)]
    walls = ["north", "east", "nook", "side", "south", "west"]
    light = ((0.75, 2.25), (3.75, 4.75))  # x, z
    window = wall((6, 0.75), (6, 2.25), 0.75, 2.0)
    column = [(4.5, 1.1875), (4.1875, 1.5), (4.5, 1.8125), (4.8125, 1.5)]  # a square on its corner
    plate = ((0.75, 2.25), (1.0, 1.75))
    plate_low, plate_top = 0.65625, 0.75
    leg, inset = 0.09375, 0.09375

    plaster = Material("plaster", (0.72, 0.70, 0.66))
    terracotta = Material("terracotta", (0.58, 0.24, 0.15))
    blue = Material("blue", (0.16, 0.32, 0.52))
    white = Material("white", (0.84, 0.84, 0.82))
    wood = Material("floorboards", (0.42, 0.29, 0.18))
    stone = Material("stone", (0.55, 0.55, 0.52))
    oak = Material("oak", (0.50, 0.36, 0.20))
    lamp = Material("ceiling_light", (0.60, 0.60, 0.60), (1.0, 0.875, 0.6875), 16.0)
    glass = Material("window", (0.10, 0.10, 0.10), (0.5, 0.75, 1.0), 6.0)

    def level(points, y):
        return [(x, y, z) for x, z in points]

    xs = [plate[0][0] + inset, plate[0][1] - inset - leg]
    zs = [plate[1][0] + inset, plate[1][1] - inset - leg]
    feet = [((x, x + leg), (z, z + leg)) for x in xs for z in zs]

    parts = [
        face("floor", wood, UP, level(outline, 0), [level(column, 0)] + [rectangle(*f, 0) for f in feet],
             extra=12),
        face("ceiling", white, DOWN, level(outline, top), [level(column, top), rectangle(*light, top)],
             extra=6),
        face("ceiling_light", lamp, DOWN, rectangle(*light, top)),
        face("window", glass, (-1, 0, 0), window),
    ]
    colours = {"north": terracotta, "west": blue}
    for name, a, b in zip(walls, outline, outline[1:] + outline[:1]):
        # The plan runs clockwise seen from above, the room to its right.
        inward = (a[1] - b[1], 0, b[0] - a[0])
        parts.append(
            face(f"wall_{name}", colours.get(name, plaster), inward, wall(a, b, 0, top),
                 [window] if name == "east" else [])
        )

    def prism(name, material, plan, low, high, longest):
        """The sides of an upright prism, seen from outside; the plan runs as the room's."""
        turned = twice_area(plan) < 0
        sides = []
        for a, b in zip(plan, plan[1:] + plan[:1]):
            outward = (b[1] - a[1], 0, a[0] - b[0])
            if turned:
                outward = tuple(-x for x in outward)
            sides.append(face(name, material, outward, wall(a, b, low, high), longest=longest))
        return merge(name, sides)

    def plan(x, z):
        return [(x[0], z[0]), (x[1], z[0]), (x[1], z[1]), (x[0], z[1])]

    parts.append(prism("column", stone, column, 0, top, 1.5))
    parts.append(
        merge("table_top", [
            face("", oak, UP, rectangle(*plate, plate_top), longest=0.75),
            face("", oak, DOWN, rectangle(*plate, plate_low), [rectangle(*f, plate_low) for f in feet],
                 longest=0.75),
            prism("", oak, plan(*plate), plate_low, plate_top, 0.75),
        ])
    )
    for i, foot in enumerate(feet):
        parts.append(prism(f"table_leg_{i + 1}", oak, plan(*foot), 0, plate_low, 0.75))

    cameras = [
        Camera("overview", (5.75, 2.25, 0.25), (2.25, 0.625, 2.25), degrees(66.0), 1.5),
        Camera("table", (0.375, 1.375, 2.875), (2.125, 0.5, 1.25), degrees(54.0), 1.5),
    ]
    about = (
        "A closed L-shaped room with a column and a table, lit by a ceiling panel and a window"
        " panel, each flush in a hole. From every point the form factors add up to 1."
    )
    scene = Scene("room", about, parts, cameras)

    solid = twice_area([to_lattice(p) for p in column]) / -2 / LATTICE**2 * top
    solid += 1.5 * 0.75 * (plate_top - plate_low) + 4 * leg**2 * plate_low
    assert_closed(scene, (6 * 3 + 3 * 2.5) * top - abs(solid))
    return scene


def furnace():
    """A closed box that emits and reflects everywhere alike: u = E / (1 - rho) = 2."""
    x, y, z = 1.0, 1.5, 0.75
    glow = Material("glow", (0.5, 0.5, 0.5), (1.0, 1.0, 1.0), 1 / math.pi)
    parts = [
        face("floor", glow, UP, rectangle((0, x), (0, z), 0)),
        face("ceiling", glow, DOWN, rectangle((0, x), (0, z), y)),
        face("wall_x0", glow, (1, 0, 0), wall((0, 0), (0, z), 0, y)),
        face("wall_x1", glow, (-1, 0, 0), wall((x, 0), (x, z), 0, y)),
        face("wall_z0", glow, (0, 0, 1), wall((0, 0), (x, 0), 0, y)),
        face("wall_z1", glow, (0, 0, -1), wall((0, z), (x, z), 0, y)),
    ]
    about = (
        "A closed box whose faces emit exitance 1 W/m^2 (radiance 1/pi) and reflect 0.5:"
        " radiosity is 2, irradiance 2 W/m^2 and radiance 2/pi at every point."
    )
    camera = Camera("inside", (0.875, 1.25, 0.625), (0.25, 0.5, 0.125), degrees(60.0), 1.0)
    scene = Scene("furnace", about, parts, [camera])
    assert_closed(scene, x * y * z)
    return scene


# ---------------------------------------------------------------------------
# Files
# ---------------------------------------------------------------------------


def dump(value, indent=0):
    """JSON with one space of indent, lists of plain values on one line."""
    pad = "\n" + " " * (indent + 1)
    end = "\n" + " " * indent
    if isinstance(value, dict):
        items = [f"{json.dumps(k)}: {dump(v, indent + 1)}" for k, v in value.items()]
        return "{" + pad + ("," + pad).join(items) + end + "}"
    if isinstance(value, (list, tuple)):
        if any(isinstance(v, (dict, list, tuple)) for v in value):
            items = [dump(v, indent + 1) for v in value]
            return "[" + pad + ("," + pad).join(items) + end + "]"
        return "[" + ", ".join(json.dumps(v) for v in value) + "]"
    return json.dumps(value)


def gltf(scene):
    """The scene as one glTF 2.0 file, its buffer within."""
    materials = scene.materials()
    buffer = bytearray()
    views, accessors, meshes, nodes = [], [], [], []

    def view(data, target):
        views.append({"buffer": 0, "byteOffset": len(buffer), "byteLength": len(data), "target": target})
        buffer.extend(data + bytes(-len(data) % 4))
        return len(views) - 1

    for part in scene.parts:
        # Equal corners of a part share a vertex.
        vertices = list(dict.fromkeys(part.vertices))
        place = {v: i for i, v in enumerate(vertices)}
        indices = [place[part.vertices[i]] for t in part.triangles for i in t]
        packed = b"".join(struct.pack("<3f", *v) for v in vertices)
        rounded = list(struct.iter_unpack("<3f", packed))
        accessors.append({
            "name": f"{part.name} positions",
            "bufferView": view(packed, 34962),
            "componentType": 5126,
            "count": len(vertices),
            "type": "VEC3",
            "min": [min(x) for x in zip(*rounded)],
            "max": [max(x) for x in zip(*rounded)],
        })
        accessors.append({
            "name": f"{part.name} indices",
            "bufferView": view(struct.pack(f"<{len(indices)}H", *indices), 34963),
            "componentType": 5123,
            "count": len(indices),
            "type": "SCALAR",
        })
        meshes.append({
            "name": part.name,
            "primitives": [{
                "attributes": {"POSITION": len(accessors) - 2},
                "indices": len(accessors) - 1,
                "material": materials.index(part.material),
            }],
        })
        nodes.append({"name": part.name, "mesh": len(meshes) - 1})

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

    uri = "data:application/octet-stream;base64," + base64.b64encode(bytes(buffer)).decode("ascii")
    return dump({
        "asset": {
            "version": "2.0",
            "generator": GENERATOR,
            "extras": {"about": scene.about, **scene.extras},
        },
        "extensionsUsed": ["KHR_materials_emissive_strength"],
        "scene": 0,
        "scenes": [{"name": scene.name, "nodes": list(range(len(nodes)))}],
        "nodes": nodes,
        "cameras": cameras,
        "meshes": meshes,
        "materials": described,
        "accessors": accessors,
        "bufferViews": views,
        "buffers": [{"byteLength": len(buffer), "uri": uri}],
    }) + "\n"


def obj(scene):
    """The scene as a Wavefront OBJ file and its MTL file. Cameras have no place in it."""
    header = [f"# {scene.about}", f"# {GENERATOR}"] + [f"# {k}: {v}" for k, v in scene.extras.items()]
    numbers = {}  # of the vertices, which all parts share
    faces = []
    for part in scene.parts:
        faces += ["", f"o {part.name}", f"usemtl {part.material.name}"]
        for corners in part.corners():
            faces.append("f " + " ".join(str(numbers.setdefault(c, len(numbers) + 1)) for c in corners))
    vertices = ["v " + " ".join(f"{x:g}" for x in v) for v in numbers]
    text = "\n".join(header + ["", f"mtllib {scene.name}.mtl", ""] + vertices + faces) + "\n"

    library = header + ["# Kd: reflectance. Ke: radiance in W/(m^2 sr). Linear."]
    for m in scene.materials():
        library += ["", f"newmtl {m.name}", "illum 1", "Ka 0 0 0"]
        library.append("Kd " + " ".join(f"{x:g}" for x in m.reflectance))
        if m.emits():
            library.append("Ke " + " ".join(f"{x:.6g}" for x in m.radiance()))
    return text, "\n".join(library) + "\n"


def files():
    """Every file's name and bytes."""
    from make_arcade import shipped  # not above: it imports this module

    box = cornell()
    out = {f"{s.name}.gltf": gltf(s) for s in (paper(), box, room(), furnace())}
    out["cornell.obj"], out["cornell.mtl"] = obj(box)
    return {**{name: text.encode("ascii") for name, text in out.items()}, **shipped()}


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--check", action="store_true", help="compare scenes/ with what would be written")
    parser.add_argument("--closure", action="store_true", help="cast rays in the closed scenes")
    options = parser.parse_args()

    if options.closure:
        for scene in (furnace(), room()):
            assert_closure(scene)
            print(f"{scene.name}: 50 points x 2000 rays, each meets a front side")
        return 0

    stale = []
    for name, data in files().items():
        path = SCENES / name
        if options.check:
            if not path.is_file() or path.read_bytes() != data:
                stale.append(name)
        else:
            SCENES.mkdir(exist_ok=True)
            path.write_bytes(data)
    for name in stale:
        print(f"scenes/{name} differs from what tools/make_scenes.py writes", file=sys.stderr)
    return 1 if stale else 0


if __name__ == "__main__":
    sys.exit(main())

"""Triangles on a grid that f32 holds exactly.

Coordinates are whole multiples of 1/65536 m (15 micrometres), below 2^24 of them: exact in f32,
so that what touches touches exactly, and exact in the proofs. A mesh is a list of triangles, each
three points (x, y, z) in grid units, counter-clockwise about the side that radiates.

The only transcendental numbers are sines and cosines. They are rounded to 2^-30, with a guard
that no rounding is doubtful; what follows from them is +, -, *, / and round, which are the same
on every machine.
"""

import functools
import math

from make_scenes import cross, dot, sub, turn, twice_area

GRID = 65536


def grid(*metres):
    """Lengths in metres to the nearest grid units: one number, or a tuple of several."""
    units = tuple(round(x * GRID) for x in metres)
    return units if len(units) > 1 else units[0]


@functools.lru_cache(maxsize=None)
def circle(n):
    """(cos, sin) of k/n of a full turn, for k = 0 ... n - 1, multiples of 2^-30."""

    def rounded(x):
        scaled = x * 2**30
        assert abs(scaled - math.floor(scaled) - 0.5) > 1e-5, f"doubtful rounding in circle({n})"
        return round(scaled) / 2**30

    turns = [2 * math.pi * k / n for k in range(n)]
    return [(rounded(math.cos(t)), rounded(math.sin(t))) for t in turns]


def quarter(n):
    """(cos, sin) from 0 to 90 degrees in n steps; n + 1 pairs."""
    return circle(4 * n)[: n + 1]


# ---------------------------------------------------------------------------
# Meshes
# ---------------------------------------------------------------------------


def quad(a, b, c, d):
    return [(a, b, c), (a, c, d)]


def flipped(mesh):
    return [(a, c, b) for a, b, c in mesh]


def moved(mesh, step):
    return [tuple((x + step[0], y + step[1], z + step[2]) for x, y, z in t) for t in mesh]


def mirrored(mesh):
    """The mirror image in the plane x = 0, still the right way round."""
    return flipped([tuple((-x, y, z) for x, y, z in t) for t in mesh])


def quarter_turned(mesh, times):
    """Turned about the y axis: once takes +z to +x."""
    for _ in range(times % 4):
        mesh = [tuple((z, y, -x) for x, y, z in t) for t in mesh]
    return mesh


def box(x, y, z):
    """A closed box; x, y and z are (low, high)."""
    a, b, c, d = ((x[i], y[0], z[j]) for i, j in ((0, 0), (1, 0), (1, 1), (0, 1)))
    e, f, g, h = ((x[i], y[1], z[j]) for i, j in ((0, 0), (1, 0), (1, 1), (0, 1)))
    faces = [(a, b, c, d), (e, h, g, f), (a, e, f, b), (b, f, g, c), (c, g, h, d), (d, h, e, a)]
    return [t for face in faces for t in quad(*face)]


# ---------------------------------------------------------------------------
# Polygons
# ---------------------------------------------------------------------------


def polygon(points):
    """Index triples that cover a simple polygon, counter-clockwise; vertices in edges are allowed.

    Ears are clipped, then edges flipped until the triangulation is Delaunay within the outline.
    Every decision is exact. No vertex is added, so faces that share an outline fit.
    """
    rest = list(range(len(points)))
    found = []

    def is_ear(i):
        a, b, c = rest[i - 1], rest[i], rest[(i + 1) % len(rest)]
        p, q, r = points[a], points[b], points[c]
        if turn(p, q, r) <= 0:
            return False
        # Closed: a vertex on the new edge would leave a part without area behind.
        return not any(
            turn(p, q, points[k]) >= 0 and turn(q, r, points[k]) >= 0 and turn(r, p, points[k]) >= 0
            for k in rest
            if k not in (a, b, c)
        )

    start = 0
    while len(rest) > 3:
        # Going on from the last ear clips all around instead of making a fan of needles.
        i = next(j % len(rest) for j in range(start, start + len(rest)) if is_ear(j % len(rest)))
        found.append((rest[i - 1], rest[i], rest[(i + 1) % len(rest)]))
        del rest[i]
        start = i + 1
    found.append(tuple(rest))
    found = delaunay(points, found)
    area = sum(turn(*(points[i] for i in t)) for t in found)
    assert area == twice_area(points) > 0, "the triangles do not cover the polygon"
    return found


def delaunay(points, triangles):
    """Lawson's flips: no vertex is left in the circle of a triangle across an edge."""
    third = {}

    def add(*added):
        for a, b, c in added:
            third[a, b], third[b, c], third[c, a] = c, a, b

    def in_circle(a, b, c, d):
        rows = []
        for i in (a, b, c):
            x, y = sub(points[i], points[d])
            rows.append((x, y, x * x + y * y))
        return dot(rows[0], cross(rows[1], rows[2]))

    add(*triangles)
    waiting = list(third)
    while waiting:
        a, b = waiting.pop()
        if (a, b) not in third or (b, a) not in third:
            continue
        c, d = third[a, b], third[b, a]
        # A flip within a circle keeps both triangles the right way round, unless c or d is in
        # line with the edge's end: then a triangle without area would come of it.
        if in_circle(a, b, c, d) > 0 and turn(points[a], points[d], points[c]) > 0 < turn(
            points[d], points[b], points[c]
        ):
            del third[a, b], third[b, a]
            add((a, d, c), (d, b, c))
            waiting += [(a, d), (d, b), (b, c), (c, a)]
    return sorted({min((a, b, c), (b, c, a), (c, a, b)) for (a, b), c in third.items()})


def face(points, place):
    """A planar face: 2D points, counter-clockwise as seen from its front, put into space."""
    return [tuple(place(points[i]) for i in t) for t in polygon(points)]


# (u, v, w) to (x, y, z) with w along the axis, right-handed.
PLACES = {
    "x": lambda u, v, w: (w, u, v),
    "y": lambda u, v, w: (v, w, u),
    "z": lambda u, v, w: (u, v, w),
}


def prism(points, axis, low, high):
    """A closed prism: the polygon swept along an axis.

    The polygon is in the plane of the other two axes, in cyclic order: (y, z), (z, x) or (x, y).
    """
    if twice_area(points) < 0:
        points = points[::-1]
    place = PLACES[axis]
    mesh = face(points, lambda p: place(*p, high))
    mesh += flipped(face(points, lambda p: place(*p, low)))
    for p, q in zip(points, points[1:] + points[:1]):
        mesh += quad(place(*p, low), place(*q, low), place(*q, high), place(*p, high))
    return mesh


# ---------------------------------------------------------------------------
# Solids of revolution about the y axis
# ---------------------------------------------------------------------------


def outline(pieces, start, *parts):
    """The points (r, y) of an outline in grid units, from lengths in metres.

    A part (r, y) is a line there; (r1, y1, r2, y2, r, y, k) a cubic Bézier curve with control
    points (r1, y1) and (r2, y2), in `pieces(k)` pieces.
    """
    points = [start]
    for part in parts:
        if len(part) == 2:
            points.append(part)
            continue
        (r0, y0), (r1, y1, r2, y2, r3, y3, k) = points[-1], part
        n = pieces(k)
        for i in range(1, n + 1):
            t, s = i / n, 1 - i / n
            w = (s * s * s, 3 * s * s * t, 3 * s * t * t, t * t * t)
            points.append((dot(w, (r0, r1, r2, r3)), dot(w, (y0, y1, y2, y3))))
    units = [grid(*p) for p in points]
    return [p for i, p in enumerate(units) if i == 0 or p != units[i - 1]]


def ring(n, radius, y, depths=None):
    """n points around the y axis, clockwise from above; depths[j] is taken off the j-th radius."""
    if radius == 0:
        return [(0, y, 0)] * n
    radii = [radius - d for d in depths] if depths else [radius] * n
    return [(round(r * c), y, round(r * s)) for r, (c, s) in zip(radii, circle(n))]


def square(half, y):
    """Four points around the y axis, clockwise from above."""
    return [(half, y, half), (-half, y, half), (-half, y, -half), (half, y, -half)]


def downward(corners):
    """The flat face of four points that run clockwise from above, facing down."""
    return quad(*corners)


def upward(corners):
    return quad(*corners[::-1])


def mantle(rings):
    """The surface through rings that rise on the outside; a ring that is one point closes it."""
    mesh = []
    for low, high in zip(rings, rings[1:]):
        for j in range(len(low)):
            a, b, c, d = low[j - 1], high[j - 1], high[j], low[j]
            if b != c:
                mesh.append((a, b, c))
            if a != d:
                mesh.append((a, c, d))
    return mesh


def revolved(points, n):
    """A closed solid: the outline begins and ends on the axis, and rises on the outside."""
    assert points[0][0] == points[-1][0] == 0
    return mantle([ring(n, r, y) for r, y in points])


def collar(around, corners):
    """The flat ring that faces up between a circle (a ring of 4 k points) and a square around it."""
    n = len(around)
    mesh = []
    for q in range(4):
        mesh.append((corners[q - 1], around[q * n // 4], corners[q]))
        for j in range(q * n // 4, (q + 1) * n // 4):
            mesh.append((corners[q], around[j], around[(j + 1) % n]))
    return mesh



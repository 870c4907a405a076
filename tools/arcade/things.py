"""What stands in the hall: closed solids, drawn about the origin with their feet at y = 0.

Lengths are metres until `grid` makes them exact. `fine` says how finely curves are cut. Parts of
one thing touch in faces and share no edge, so each is closed by itself.
"""

import functools
import itertools

from .shapes import GRID, box, circle, collar, downward, flipped, grid, mantle, moved, outline, prism
from .shapes import quarter_turned, revolved, ring, square, upward

FLUTES = 16


class Fine:
    """How finely curves are cut; f = 1 makes a hall of some 5,000 triangles."""

    def __init__(self, f):
        self.f = f

    def round(self, base, least, step=2):
        """Segments of a circle: about base * f, a multiple of `step`."""
        return step * max(-(-least // step), round(base * self.f / step))

    def pieces(self, base):
        """Pieces of a curve: about base * f."""
        return max(1, round(base * self.f))

    def turned(self, base, start, *parts, least=6):
        """A solid of revolution in about base * f segments; `parts` as for `outline`."""
        return revolved(outline(self.pieces, start, *parts), self.round(base, least))


def block(x, y, z):
    """A closed box, metres."""
    return box(grid(*x), grid(*y), grid(*z))


def centred(width, y, depth, x=0.0, z=0.0):
    """A closed box about (x, z), metres."""
    return block((x - width / 2, x + width / 2), y, (z - depth / 2, z + depth / 2))


# ---------------------------------------------------------------------------
# Architecture
# ---------------------------------------------------------------------------

COLUMN_HEIGHT = 3.0


def column(fine):
    """A Tuscan column, with flutes where there are segments for them: one closed mesh."""
    n = fine.round(9, 8, 4)
    fluted = n >= 3 * FLUTES
    if fluted:
        n -= n % FLUTES
    shaft = [(0.3, 0.48), (0.3, 1.2, 0.28, 1.9, 0.25, 2.44, 0.8)]
    if fluted:  # they begin and end within 4 cm
        shaft = [(0.3, 0.48), (0.3, 0.52), (0.3, 1.2, 0.28, 1.9, 0.25, 2.4, 0.8), (0.25, 2.44)]
    neck_ring = [(0.27, 2.48), (0.31, 2.50, 0.31, 2.54, 0.27, 2.56, 0.4)]
    if fine.f < 1:
        shaft, neck_ring = shaft[1:], []
    foot, neck, top = 0.15625, 2.8125, COLUMN_HEIGHT
    points = outline(
        fine.pieces,
        (0.40625, foot),
        (0.46, 0.16, 0.46, 0.265, 0.40625, 0.28125, 1.4),
        (0.33, 0.29, 0.345, 0.335, 0.3125, 0.4, 0.8),
        *shaft,
        *neck_ring,
        (0.26, 2.62),
        (0.33, 2.66, 0.385, 2.71, 0.39, neck, 1.0),
    )
    low, high = grid(0.48, 2.44)
    waves = [abs(circle(n)[FLUTES // 2 * j % n][1]) for j in range(n)]
    depths = [round(grid(0.022) * wave) for wave in waves]
    rings = [ring(n, r, y, depths if fluted and low < y < high else None) for r, y in points]
    half = grid(0.4375)
    squares = [square(half, y) for y in grid(0.0, foot, neck, top)]
    mesh = downward(squares[0]) + mantle(squares[:2]) + collar(rings[0], squares[1])
    mesh += mantle(rings)
    return mesh + flipped(collar(rings[-1], squares[2])) + mantle(squares[2:]) + upward(squares[3])


def cornice(fine, length):
    """A moulding along z, to be set against a wall at x = 0 on its left."""
    points = outline(
        fine.pieces,
        (0.0, 0.0),
        (0.05, 0.0),
        (0.05, 0.04),
        (0.06, 0.12, 0.16, 0.06, 0.17, 0.16, 1.6),
        (0.2, 0.16),
        (0.2, 0.22),
        (0.0, 0.22),
    )
    return prism(points, "z", -length // 2, length // 2)


def corbel(fine):
    """A block on a bracket, against a wall at x = 0 on its left; its top is at y = 0."""
    points = outline(
        fine.pieces,
        (0.0, -0.625),
        (0.02, -0.5, 0.17, -0.4, 0.1875, -0.1875, 1.3),
        (0.0, -0.1875),
    )
    block_on_top = block((0.0, 0.375), (-0.1875, 0.0), (-0.15625, 0.15625))
    return block_on_top + prism(points, "z", *grid(-0.125, 0.125))


RISE, GOING, STEPS = 0.15625, 0.3125, 6


def stair(width):
    """Five steps up to a sixth, the dais: they rise towards -z, whose side is at z = 0."""
    corners = [(0.0, 0.0), ((STEPS - 1) * GOING, 0.0)]
    for i in range(1, STEPS):
        corners += [((STEPS - i) * GOING, i * RISE), ((STEPS - 1 - i) * GOING, i * RISE)]
    # (y, z) for a prism along x.
    points = [grid(y, z) for z, y in corners]
    return prism(points, "x", *grid(-width / 2, width / 2))


def balustrade(fine, length, balusters):
    """Along x: a foot, turned balusters, a rail."""
    mesh = centred(length, (0.0, 0.0625), 0.1875) + centred(length, (0.75, 0.84375), 0.21875)
    baluster = moved(
        fine.turned(
            5,
            (0.0, 0.0),
            (0.05, 0.0),
            (0.05, 0.05),
            (0.03, 0.09),
            (0.095, 0.14, 0.075, 0.36, 0.03, 0.5, 2.2),
            (0.025, 0.58, 0.03, 0.6, 0.048, 0.63, 0.7),
            (0.048, 0.6875),
            (0.0, 0.6875),
            least=4,
        ),
        (0, grid(0.0625), 0),
    )
    for i in range(balusters):
        mesh += moved(baluster, (round(((i + 0.5) / balusters - 0.5) * length * GRID), 0, 0))
    return mesh


def door(panels):
    """A double door against a wall behind it (z = 0), with raised panels."""
    mesh = block((-1.0, -0.005), (0.0, 2.75), (0.0, 0.0625)) + block((0.005, 1.0), (0.0, 2.75), (0.0, 0.0625))
    for side in (-1, 1):
        for i in range(panels):
            low = 0.2 + i * 2.4 / panels
            x = sorted((side * 0.15, side * 0.85))
            mesh += block(x, (low, low + 2.4 / panels - 0.15), (0.0625, 0.09375))
    return mesh


# ---------------------------------------------------------------------------
# Lamps
# ---------------------------------------------------------------------------


def globe(triangles, radius):
    """A sphere about the origin of about as many triangles, segments by bands."""

    def error(m):
        n = max(3, round(triangles / (2 * (m - 1))))
        return abs(2 * n * (m - 1) - triangles) / triangles + 0.01 * abs(n / (2 * m) - 1), m, n

    _, m, n = min(error(m) for m in range(2, max(4, triangles)))
    half_turn = circle(2 * m)[: m + 1]
    points = [(round(grid(radius) * s), round(-grid(radius) * c)) for c, s in half_turn]
    points[0], points[-1] = (0, -grid(radius)), (0, grid(radius))
    return revolved(points, n)


SHADE = 0.328125


def shade(fine):
    """A brass dish with a neck, SHADE high; below it, at y = 0, hangs a globe."""
    return fine.turned(
        9,
        (0.0, 0.0),
        (0.06, 0.0),
        (0.06, 0.14),
        (0.2, 0.16, 0.42, 0.12, 0.55, 0.02, 1.4),
        (0.5625, 0.03),
        (0.44, 0.15, 0.22, 0.19, 0.05, 0.22, 1.4),
        (0.03, SHADE),
        (0.0, SHADE),
        least=8,
    )


LANTERN = 0.625  # from where it hangs down to the tip of its glass


def lantern(fine):
    """The metal of a lantern that hangs from y = 0: a rod, and a hood down to y = -LANTERN."""
    mesh = centred(0.02, (0.15625 - LANTERN, 0.0), 0.02)
    hood = fine.turned(
        6,
        (0.0, 0.0),
        (0.125, 0.0),
        (0.09, 0.06, 0.03, 0.07, 0.02, 0.15625, 1.0),
        (0.0, 0.15625),
    )
    return mesh + moved(hood, (0, grid(-LANTERN), 0))


def drop():
    """A lantern's glass: two pyramids of four sides; its upper tip is at y = 0."""
    return revolved([(0, grid(-0.4375)), grid(0.125, -0.15625), (0, 0)], 4)


# ---------------------------------------------------------------------------
# Furniture
# ---------------------------------------------------------------------------

TABLE = 0.75


def table(width, length):
    """A long table: plate, legs, and rails between them."""
    mesh = centred(width, (0.6875, TABLE), length)
    x, z = width / 2 - 0.109375, length / 2 - 0.171875
    for sx in (-1, 1):
        for sz in (-1, 1):
            mesh += centred(0.09375, (0.0, 0.6875), 0.09375, sx * x, sz * z)
        mesh += centred(0.03125, (0.59375, 0.6875), 2 * z - 0.09375, sx * x)
    return mesh


def bench(length):
    mesh = centred(0.3125, (0.40625, 0.453125), length)
    for side in (-1, 1):
        mesh += centred(0.25, (0.0, 0.40625), 0.0625, z=side * (length / 2 - 0.1875))
    return mesh + centred(0.03125, (0.1875, 0.25), length - 0.4375)


def stone_bench(length):
    mesh = centred(0.46875, (0.375, 0.46875), length)
    for side in (-1, 1):
        mesh += centred(0.375, (0.0, 0.375), 0.25, z=side * (length / 2 - 0.34375))
    return mesh


def chair(fine, turns):
    """A chair that looks along +z, then turned by quarters."""
    mesh = centred(0.4375, (0.40625, 0.453125), 0.421875)
    for side in (-1, 1):
        x = side * 0.1796875
        mesh += block((x - 0.0234375, x + 0.0234375), (0.0, 0.953125), (-0.25, -0.2109375))
        if fine.f < 1.8:
            mesh += centred(0.046875, (0.0, 0.40625), 0.046875, x, 0.171875)
        else:
            leg = fine.turned(
                3.5,
                (0.0, 0.0),
                (0.012, 0.0),
                (0.014, 0.1, 0.034, 0.16, 0.024, 0.3, 1.0),
                (0.016, 0.31),
                (0.024, 0.32),
                (0.024, 0.40625),
                (0.0, 0.40625),
            )
            mesh += moved(leg, (grid(x), 0, grid(0.171875)))
    slats = 2 if fine.f < 1.4 else 3
    for i in range(slats):
        y = 0.890625 - 0.125 * i
        mesh += block((-0.15625, 0.15625), (y - 0.0625, y), (-0.2421875, -0.21875))
    return quarter_turned(mesh, turns)


def round_table(fine):
    """A table on one turned leg: one closed mesh."""
    return fine.turned(
        10,
        (0.0, 0.0),
        (0.3, 0.0),
        (0.3, 0.03125),
        (0.16, 0.05, 0.05, 0.07, 0.05, 0.2, 1.2),
        (0.11, 0.32, 0.09, 0.42, 0.045, 0.5, 1.3),
        (0.04, 0.6, 0.08, 0.68, 0.2, 0.703125, 1.0),
        (0.5, 0.703125),
        (0.53, 0.705, 0.53, 0.748, 0.5, TABLE, 0.8),
        (0.0, TABLE),
        least=8,
    )


def cup(fine):
    return fine.turned(
        5.5,
        (0.0, 0.0),
        (0.024, 0.0),
        (0.04, 0.012, 0.043, 0.04, 0.0421, 0.085, 1.2),
        (0.0391, 0.085),
        (0.039, 0.045, 0.036, 0.016, 0.0, 0.007, 1.2),
    )


def goblet(fine):
    return fine.turned(
        6,
        (0.0, 0.0),
        (0.036, 0.0),
        (0.02, 0.008, 0.006, 0.01, 0.006, 0.03, 0.8),
        (0.006, 0.08),
        (0.03, 0.09, 0.045, 0.12, 0.038, 0.18, 1.4),
        (0.0355, 0.18),
        (0.042, 0.12, 0.028, 0.095, 0.0, 0.09, 1.4),
    )


def plate(fine):
    return fine.turned(
        8,
        (0.0, 0.0),
        (0.07, 0.0),
        (0.09, 0.004, 0.1, 0.014, 0.126, 0.0156, 0.8),
        (0.126, 0.0186),
        (0.098, 0.0176, 0.09, 0.008, 0.068, 0.004, 0.8),
        (0.0, 0.004),
    )


def bowl(fine):
    return fine.turned(
        8,
        (0.0, 0.0),
        (0.06, 0.0),
        (0.06, 0.012),
        (0.13, 0.03, 0.16, 0.07, 0.17, 0.12, 1.5),
        (0.165, 0.122),
        (0.152, 0.075, 0.12, 0.04, 0.0, 0.024, 1.5),
        least=8,
    )


def fruit(fine):
    """An apple."""
    return fine.turned(
        4,
        (0.0, 0.0),
        (0.012, 0.0),
        (0.045, 0.008, 0.05, 0.062, 0.022, 0.07, 2.0),
        (0.008, 0.072, 0.006, 0.066, 0.0, 0.06, 0.6),
    )


def vase(fine):
    """A slender vase, open at the top, 0.375 m high."""
    return fine.turned(
        8,
        (0.0, 0.0),
        (0.06, 0.0),
        (0.1, 0.05, 0.17, 0.15, 0.06, 0.27, 2.2),
        (0.035, 0.31, 0.04, 0.34, 0.07, 0.375, 1.0),
        (0.064, 0.375),
        (0.03, 0.335, 0.03, 0.31, 0.052, 0.265, 1.0),
        (0.14, 0.16, 0.09, 0.06, 0.0, 0.012, 1.5),
        least=8,
    )


def candlestick(fine):
    """A brass stick with a candle in one piece, 0.4 m high."""
    return fine.turned(
        5,
        (0.0, 0.0),
        (0.06, 0.0),
        (0.055, 0.012, 0.02, 0.014, 0.014, 0.04, 0.8),
        (0.026, 0.07, 0.024, 0.09, 0.01, 0.11, 1.0),
        (0.01, 0.19),
        (0.034, 0.2),
        (0.034, 0.206),
        (0.0125, 0.21),
        (0.0125, 0.39),
        (0.0, 0.4),
    )


def pot(fine):
    """A plant pot, full to the brim, 0.5 m high."""
    return fine.turned(
        8,
        (0.0, 0.0),
        (0.18, 0.0),
        (0.2, 0.1, 0.31, 0.28, 0.27, 0.42, 1.2),
        (0.33, 0.44),
        (0.33, 0.5),
        (0.0, 0.5),
        least=8,
    )


def tree(fine):
    """A clipped tree, moss, stem and two balls in one piece."""
    return fine.turned(
        7,
        (0.0, 0.0),
        (0.28, 0.0),
        (0.22, 0.05, 0.03, 0.02, 0.025, 0.32, 1.0),
        (0.16, 0.31, 0.27, 0.42, 0.27, 0.55, 0.9),
        (0.27, 0.68, 0.16, 0.77, 0.02, 0.79, 0.9),
        (0.02, 0.87),
        (0.12, 0.88, 0.19, 0.95, 0.19, 1.04, 0.8),
        (0.19, 1.14, 0.1, 1.22, 0.0, 1.23, 0.8),
    )


def pedestal():
    mesh = centred(0.625, (0.0, 0.09375), 0.625) + centred(0.46875, (0.09375, 0.625), 0.46875)
    return mesh + centred(0.5625, (0.625, 0.6875), 0.5625)


def amphora(fine):
    """A large vase, closed by a lid, 1 m high."""
    return fine.turned(
        10,
        (0.0, 0.0),
        (0.15, 0.0),
        (0.15, 0.03),
        (0.09, 0.05, 0.07, 0.08, 0.1, 0.12, 0.8),
        (0.26, 0.26, 0.36, 0.52, 0.2, 0.7, 2.4),
        (0.12, 0.76, 0.12, 0.8, 0.17, 0.84, 1.0),
        (0.17, 0.86),
        (0.1, 0.88, 0.06, 0.9, 0.03, 0.93, 0.8),
        (0.05, 0.96, 0.04, 1.0, 0.0, 1.0, 0.8),
        least=8,
    )


BOOKCASE = 1.875  # wide
SHELVES = [0.0625, 0.5, 0.90625, 1.3125, 1.71875]  # lower sides
BOARD = 0.03125


def bookcase():
    """Against a wall on its right (x = 0): sides and shelves."""
    mesh = []
    for side in (-1, 1):
        mesh += centred(0.34375, (0.0, 2.125), BOARD, -0.171875, side * (BOOKCASE - BOARD) / 2)
    for y in SHELVES + [2.0625]:
        mesh += centred(0.3125, (y, y + BOARD), BOOKCASE - 2 * BOARD, -0.171875)
    return mesh


@functools.lru_cache(maxsize=None)
def books(seed):
    """The books of one bookcase, a full one, each a box; the first of each shelf, then the second ones.

    They stand in a row with gaps of 2 mm or more: no two share an edge.
    """
    state = seed

    def pick(low, high):
        # A linear congruential generator (Numerical Recipes): the same numbers everywhere.
        nonlocal state
        state = (1664525 * state + 1013904223) % 2**32
        return low + state * (high - low) / 2**32

    rows = []
    for shelf in SHELVES:
        rows.append([])
        z, end = -BOOKCASE / 2 + BOARD + 0.01, BOOKCASE / 2 - BOARD - 0.01
        while True:
            thick, tall, deep = pick(0.018, 0.05), pick(0.2, 0.31), pick(0.15, 0.23)
            if z + thick > end:
                break
            low = shelf + BOARD
            rows[-1].append(block((-0.03 - deep, -0.03), (low, low + tall), (z, z + thick)))
            z += thick + (0.002 if pick(0, 1) < 0.94 else pick(0.05, 0.25))
    return [book for book_of_each in itertools.zip_longest(*rows) for book in book_of_each if book]

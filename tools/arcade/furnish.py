"""What stands where: the things of the hall, more of them the finer it is.

Each thing is a solid of one material, a drawn mesh and a place; copies share their mesh. Numbers
such as `fine.f >= 1.5` are chosen so that furniture keeps its share of the triangles.
"""

from dataclasses import dataclass

from . import things as draw
from .hall import END
from .shapes import grid, mirrored


@dataclass
class Thing:
    """A solid: `mesh` moved by `at`, both in grid units; `defect` says what is wrong on purpose."""

    name: str
    material: str
    mesh: list
    at: tuple = (0, 0, 0)
    defect: str = ""


SEATS = [(-1, 0), (1, 0), (0, -1), (0, 1)]
DAIS_DEPTH, DAIS_HEIGHT = 1.75, draw.STEPS * draw.RISE
LONG_TABLE = (1.125, 3.5, 0.5)  # width, length, middle in z
# (side, z): against outer walls, in the aisles, against end walls, in the order in which they come.
BOOKCASES = [(1, 3.0), (-1, -3.0), (1, -3.0), (-1, 6.0), (-1, 3.0), (1, 6.0)]
ROUND_TABLES = [(1, 0.0), (-1, 0.0), (1, -5.75), (-1, -5.75)]
STONE_BENCHES = [(-1, -7.25), (1, -7.25), (-1, 7.25), (1, 7.25)]


def architecture(fine, lamp_triangles):
    """Columns, mouldings, stair and lamps."""
    f, found = fine.f, []

    def put(name, material, mesh, x=0.0, y=0.0, z=0.0):
        found.append(Thing(name, material, mesh, grid(x, y, z)))

    column, corbel, cornice = draw.column(fine), draw.corbel(fine), draw.cornice(fine, 2 * END)
    lantern, drop = draw.lantern(fine), draw.drop()
    for side, name in ((1, "right"), (-1, "left")):
        for i, z in enumerate((-4.5, -1.5, 1.5, 4.5)):
            put(f"column_{name}_{i + 1}", "marble", column, side * 3.25, 0.0, z)
    for side, name, against in ((1, "right", mirrored), (-1, "left", list)):
        put(f"cornice_{name}", "plaster", against(cornice), side * 3.0, 5.75)
        bracket = against(corbel)
        for i, z in enumerate((-4.5, -1.5, 1.5, 4.5)):
            put(f"corbel_{name}_{i + 1}", "limestone", bracket, side * 6.0, 3.25, z)
    for side, name in ((1, "right"), (-1, "left")):
        for i, z in enumerate((-4.5, 4.5)):
            at = (side * 5.71875, 3.0625, z)
            put(f"lantern_{name}_{i + 1}", "iron", lantern, *at)
            put(f"lantern_glass_{name}_{i + 1}", "lantern_light", drop, at[0], at[1] - draw.LANTERN, z)

    low = 4.5
    put("chandelier_rod", "iron", draw.centred(0.03, (low + draw.SHADE, 7.0), 0.03))
    put("chandelier_shade", "brass", draw.shade(fine), 0.0, low)
    radius = 0.28125
    put("chandelier_globe", "globe_light", draw.globe(lamp_triangles, radius), 0.0, low - radius)

    front = DAIS_DEPTH - 7.5
    put("dais", "limestone", draw.block((-2.5, 2.5), (0.0, DAIS_HEIGHT), (-7.5, front)))
    put("stair", "limestone", draw.stair(2.5), 0.0, 0.0, front)
    if f >= 1.2:
        for side, name in ((1, "right"), (-1, "left")):
            rail = draw.balustrade(fine, 1.25, 4 if f < 2 else 6)
            put(f"balustrade_{name}", "limestone", rail, side * 1.875, DAIS_HEIGHT, front - 0.125)
    put("door", "oak", draw.quarter_turned(draw.door(0 if f < 1.1 else 3), 2), 0.0, 0.0, 7.5)
    return found


def furniture(fine):
    """Tables and what is on them, seats, vases, trees, bookcases without books."""
    f, found, counts = fine.f, [], {}
    drawn = {}

    def put(name, material, mesh, x, y, z):
        """`mesh` is one that is drawn already, or the name of what to draw finely."""
        if isinstance(mesh, str):
            mesh = drawn.setdefault(mesh, getattr(draw, mesh)(fine))
        counts[name] = counts.get(name, 0) + 1
        found.append(Thing(f"{name}_{counts[name]}", material, mesh, grid(x, y, z)))

    def chair(x, z, turns):
        mesh = drawn.setdefault(("chair", turns), draw.chair(fine, turns))
        put("chair", "oak", mesh, x, 0.0, z)

    # The long table in the nave.
    width, length, z = LONG_TABLE
    put("long_table", "oak", draw.table(width, length), 0.0, 0.0, z)
    seat = draw.bench(3.0)
    for side in (1, -1):
        put("bench", "oak", seat, side * 0.953125, 0.0, z)
    top = draw.TABLE
    put("vase", "blue", "vase", 0.03, top, z + 0.1)
    put("bowl", "terracotta", "bowl", 0.0, top, z + 0.75)
    places = 2 if f < 1.15 else 4 if f < 3 else 5
    for i in range(places):
        at = z + (i - (places - 1) / 2) * 3.0 / places
        for side in (1, -1):
            put("cup", "cream", "cup", side * 0.28, top, at + side * 0.21)
            if f >= 1.15:
                put("plate", "cream", "plate", side * 0.4, top, at)
            if f >= 2:
                put("goblet", "brass", "goblet", side * 0.22, top, at - side * 0.18)
    if f >= 1.3:
        for dz in (-0.7, 1.4):
            put("candlestick", "brass", "candlestick", 0.0, top, z + dz)
        for dx, dz in ((0.1, -0.3), (-0.09, -0.22), (0.04, -0.13), (-0.1, -0.42)):
            put("apple", "red", "fruit", dx, top, z + dz)
    chair(0.0, z - length / 2 - 0.375, 0)
    chair(0.3, z + length / 2 + 0.5, 2)

    put("pedestal", "limestone", draw.pedestal(), 0.0, DAIS_HEIGHT, -6.75)
    put("amphora", "terracotta", "amphora", 0.0, DAIS_HEIGHT + 0.6875, -6.75)

    trees = [(-1.9, -5.0), (1.9, -5.0), (-2.2, -3.0), (2.2, -3.0), (-2.25, 0.0), (-2.25, 3.0)]
    trees += [(side * 5.35, z) for side in (1, -1) for z in (-4.5, 4.5)]
    for x, z in trees[: 1 if f < 0.8 else 2 if f < 1.25 else 4 if f < 1.5 else 6 if f < 2.25 else 10]:
        put("pot", "terracotta", "pot", x, 0.0, z)
        put("tree", "green", "tree", x, 0.5, z)

    # The aisles.
    cases = {1: draw.bookcase(), -1: mirrored(draw.bookcase())}
    for side, z in BOOKCASES[: bookcases(fine)]:
        put("bookcase", "oak", cases[side], side * 6.0, 0.0, z)
    tables = 0 if f < 1 else 1 if f < 1.4 else 2 if f < 2.7 else 4
    for side, z in ROUND_TABLES[:tables]:
        x = side * 4.6
        put("round_table", "marble", "round_table", x, 0.0, z)
        put("vase", "blue", "vase", x, top, z)
        for i, (dx, dz) in enumerate(SEATS[: 2 if f < 1.4 else 4]):
            # One that sits at -x looks along +x: turned once.
            chair(x + 0.8 * dx, z + 0.8 * dz, {(-1, 0): 1, (1, 0): 3, (0, -1): 0, (0, 1): 2}[dx, dz])
            put("cup", "cream", "cup", x + 0.3 * dx + 0.1 * dz, top, z + 0.3 * dz - 0.1 * dx)
            if f >= 2:
                put("plate", "cream", "plate", x + 0.36 * dx - 0.12 * dz, top, z + 0.36 * dz + 0.12 * dx)
    stone = draw.quarter_turned(draw.stone_bench(2.0), 1)
    for side, z in STONE_BENCHES[: 0 if f < 1.3 else 2 if f < 2 else 4]:
        put("stone_bench", "limestone", stone, side * 4.75, 0.0, z)
    return found


def bookcases(fine):
    f = fine.f
    return 1 if f < 1.1 else 2 if f < 1.5 else 4 if f < 2 else 6


def all_books(fine):
    """The books of all bookcases, in the order in which they come: (bookcase, colour, mesh)."""
    shelves = [draw.books(i + 1) for i in range(bookcases(fine))]
    found = []
    for i in range(max(len(b) for b in shelves)):
        for case, row in enumerate(shelves):
            if i < len(row):
                side = BOOKCASES[case][0]
                found.append((case, (i + case) % 3, row[i] if side > 0 else mirrored(row[i])))
    return found


def library(fine, count):
    """So many books, at least two fifths of all where there are many shelves.

    An object for each bookcase and colour.
    """
    colours, groups = ("terracotta", "blue", "green"), {}
    ready = all_books(fine)
    for case, colour, mesh in ready[: max(count, 2 * len(ready) // 5 if fine.f >= 1.4 else 0)]:
        groups.setdefault((case, colour), []).extend(mesh)
    found = []
    for (case, colour), mesh in sorted(groups.items()):
        side, z = BOOKCASES[case]
        name = f"books_{case + 1}_{colours[colour]}"
        found.append(Thing(name, colours[colour], mesh, grid(side * 6.0, 0.0, z)))
    return found

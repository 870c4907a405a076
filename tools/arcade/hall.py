"""The closed room: a nave with a coffered ceiling between two groin-vaulted aisles.

Plan, x to the right, z downward; everything is mirrored in x = 0 (metres):

    -6       -3.5 -3                3  3.5        6
     +---------##---------------------##----------+ -7.5   piers ## carry the outer arches
     |                                            |
     |         oo                     oo          | -4.5   columns oo the others
     |                                            |
     |  aisle  oo         nave        oo   aisle  | -1.5
     |                                            |        ... five bays of 3 m
     +---------##---------------------##----------+  7.5

Arches spring at 3 m, vaults at 3.25 m; the nave is 7 m high, its coffers 7.25 m. The arcades,
walls 0.5 m thick above the arches, belong to the room: its surface is one, and closed. Each
part of it that has a name or a material of its own is an open mesh; neighbours share all vertices
of a common edge. Faces look into the room.
"""

import itertools

from make_scenes import twice_area

from .shapes import circle, downward, face, flipped, grid, mantle, mirrored, moved, quad, quarter, square

NAVE, AISLE, WALL = grid(3.0, 3.5, 6.0)  # x of the arcade's two sides and of the outer wall
END, BAY = grid(7.5, 3.0)  # half the length; a bay
PIER = grid(0.375)  # half of what stands on a column
SPRING, VAULT_SPRING, VAULT_RISE, CEILING = grid(3.0, 3.25, 1.5, 7.0)
ARCH = BAY // 2 - PIER  # radius
TILE, COFFER = grid(1.0, 1.5)
OCULUS_Y, OCULUS_RADIUS = grid(5.1875, 0.9375)  # the round window in the end wall z = -END
# Coffers with a window instead of a panel: (column, row).
SKYLIGHTS = [(i, j) for i in (1, 2) for j in (1, 3, 6, 8)]


def bays():
    """z where each bay begins."""
    return range(-END, END, BAY)


def floor(bond):
    """Square tiles in two colours: (light, dark).

    With `bond` every second row is shifted by half a tile: rows meet in T-junctions.
    """
    colours = ([], [])
    rows, half = 2 * END // TILE, TILE // 2

    def lay(colour, points):
        """A tile that is fanned out from its first point; points are (z, x), counter-clockwise."""
        first, *others = [(x, 0, z) for z, x in points]
        colours[colour % 2].extend((first, p, q) for p, q in zip(others, others[1:]))

    for row in range(rows):
        z0, z1 = -END + row * TILE, -END + (row + 1) * TILE
        outer = row in (0, rows - 1)
        if bond and not outer and row % 2:
            cuts = [-WALL] + list(range(-WALL + half, WALL, TILE)) + [WALL]
        else:
            cuts = list(range(-WALL, WALL + 1, TILE))
        for column, (x0, x1) in enumerate(zip(cuts, cuts[1:])):
            colour = row + column
            if not outer or not ({abs(x0), abs(x1)} & {NAVE}):
                lay(colour, [(z0, x0), (z1, x0), (z1, x1), (z0, x1)])
                continue
            # The tiles at a pier: drawn for the pier of x > 0 at z < 0, then mirrored into place.
            side = 1 if x0 + x1 > 0 else -1
            near, far = (z0, z1) if row == 0 else (z1, z0)
            foot = near + PIER if row == 0 else near - PIER
            if max(abs(x0), abs(x1)) == NAVE:  # beside it
                inner = min(abs(x0), abs(x1))
                points = [(foot, NAVE), (near, NAVE), (near, inner), (far, inner), (far, NAVE)]
            else:  # around it
                outside = max(abs(x0), abs(x1))
                points = [(foot, AISLE), (near, AISLE), (near, outside), (far, outside), (far, NAVE)]
                points.append((foot, NAVE))
            points = [(z, side * x) for z, x in points]
            lay(colour, points if twice_area(points) > 0 else points[:1] + points[:0:-1])
    return colours


def arch_points(middle, n):
    """The arch from left to right: (z, y), n even segments in each half."""
    rise = [(round(ARCH * c), round(ARCH * s)) for c, s in quarter(n)]
    left = [(middle - c, SPRING + s) for c, s in rise]
    return left + [(middle + c, SPRING + s) for c, s in rise[-2::-1]]


def lunette(middle, half, n):
    """The edge of a vault on a wall, from left to right: half an ellipse."""
    rise = [(round(half * s), round(VAULT_RISE * c)) for c, s in quarter(n)]
    left = [(middle - s, VAULT_SPRING + c) for s, c in rise[::-1]]
    return left + [(middle + s, VAULT_SPRING + c) for s, c in rise[1:]]


def arcade(arch, vault):
    """The arcade at x > 0, `arch` and `vault` segments in a quarter turn."""
    mesh = []
    for z0 in bays():
        z1, middle = z0 + BAY, z0 + BAY // 2
        opening = [(z0, SPRING)] + arch_points(middle, arch) + [(z1, SPRING)]
        top = [(z1, CEILING), (middle, CEILING), (z0, CEILING)]
        if z0 == -END:
            top.append((z0, OCULUS_Y))  # a vertex of the end wall
        # Counter-clockwise in (z, y) faces -x.
        mesh += face(opening + top, lambda p: (NAVE, p[1], p[0]))
        mesh += flipped(face(opening + lunette(middle, BAY // 2, vault)[::-1], lambda p: (AISLE, p[1], p[0])))
        under = opening
        for at, inward in ((z0, 1), (z1, -1)):
            if abs(at) == END:  # a pier down to the floor instead of a column
                foot = at + inward * PIER
                a, b = sorted((at, foot))
                sides = quad((NAVE, 0, a), (NAVE, 0, b), (NAVE, SPRING, b), (NAVE, SPRING, a))
                sides += flipped(quad((AISLE, 0, a), (AISLE, 0, b), (AISLE, SPRING, b), (AISLE, SPRING, a)))
                front = quad((NAVE, 0, foot), (AISLE, 0, foot), (AISLE, SPRING, foot), (NAVE, SPRING, foot))
                mesh += sides + (front if inward > 0 else flipped(front))
                under = under[1:] if inward > 0 else under[:-1]
        for (za, ya), (zb, yb) in zip(under, under[1:]):
            mesh += quad((NAVE, ya, za), (AISLE, ya, za), (AISLE, yb, zb), (NAVE, yb, zb))
    return mesh


def vaults(n, cells):
    """The groin vaults of the aisle at x > 0: air up to the higher of two crossing barrels.

    With `cells` the strips between neighbouring rulings are cut where the other barrel's are.
    """
    steps = quarter(n)
    half_x, half_z, middle_x = (WALL - AISLE) // 2, BAY // 2, (WALL + AISLE) // 2
    at = [(round(half_x * s), round(VAULT_RISE * c), round(half_z * s)) for c, s in steps]
    mesh = []
    for z0, swap, sign_u, sign_v in itertools.product(bays(), (False, True), (-1, 1), (-1, 1)):

        def point(i, k):
            """On one of eight webs: its height falls with i, its rulings run along k >= i."""
            u, v = (i, k) if swap else (k, i)
            (x, _, _), (_, y, _), (_, _, z) = at[u], at[i], at[v]
            return (middle_x + sign_u * x, VAULT_SPRING + y, z0 + half_z + sign_v * z)

        for i in range(n):
            cuts = range(i, n + 1) if cells else (i, n)
            for k, l in zip(cuts, cuts[1:]):
                # The groin cuts off a corner of the first: there c and d are one.
                a, b, c, d = point(i, k), point(i, l), point(i + 1, l), point(i + 1, max(i + 1, k))
                mesh += [(a, b, c)] if c == d else quad(a, b, c, d)
    return facing_down(mesh)


def facing_down(mesh):
    def looks_down(t):
        (ax, _, az), (bx, _, bz), (cx, _, cz) = t
        return (bz - az) * (cx - ax) - (bx - ax) * (cz - az) < 0

    return [t if looks_down(t) else (t[0], t[2], t[1]) for t in mesh]


def outer_wall(vault):
    """x = WALL."""
    mesh = []
    for z0 in bays():
        foot = [(z, 0) for z in range(z0, z0 + BAY + 1, TILE)]
        arc = lunette(z0 + BAY // 2, BAY // 2, vault)
        mesh += face(foot + arc[::-1], lambda p: (WALL, p[1], p[0]))
    return mesh


def end_wall(z, vault, window):
    """The end of nave and aisles at z = END or -END: (wall, round window)."""
    mesh, glass = [], []

    def put(points, target):
        # Counter-clockwise in (x, y) faces +z.
        found = face(points, lambda p: (p[0], p[1], z))
        target.extend(found if z < 0 else flipped(found))

    foot = [(x, 0) for x in range(-NAVE, NAVE + 1, TILE)]
    top = [(x, CEILING) for x in range(NAVE, -NAVE - 1, -COFFER)]
    if z < 0:
        round_window = [
            (round(OCULUS_RADIUS * c), OCULUS_Y + round(OCULUS_RADIUS * s)) for c, s in circle(4 * window)
        ]
        upper, lower = round_window[: 2 * window + 1], round_window[2 * window :] + round_window[:1]
        east, west = (NAVE, OCULUS_Y), (-NAVE, OCULUS_Y)
        put(foot + [(NAVE, SPRING), east] + lower[::-1] + [west, (-NAVE, SPRING)], mesh)
        put([west] + upper[::-1] + [east] + top, mesh)
        put(round_window, glass)
    else:
        put(foot + [(NAVE, SPRING)] + top + [(-NAVE, SPRING)], mesh)
    aisle = [(AISLE, 0)] + [(x, 0) for x in range(AISLE + TILE // 2, WALL + 1, TILE)]
    aisle += lunette((AISLE + WALL) // 2, (WALL - AISLE) // 2, vault)[::-1] + [(AISLE, SPRING)]
    put(aisle, mesh)
    put([(-x, y) for x, y in aisle[::-1]], mesh)
    return mesh, glass


def ceiling(steps):
    """Coffers in one or two steps: (ribs, panels, windows)."""
    sections = {
        1: [(0.75, 7.0), (0.59375, 7.0), (0.4375, 7.25)],
        2: [(0.75, 7.0), (0.625, 7.0), (0.59375, 7.125), (0.5, 7.125), (0.4375, 7.25)],
    }
    section = [grid(*p) for p in sections[steps]]

    squares = [square(*p) for p in section]
    # The sides rise on the outside of the air.
    coffer = flipped(mantle(squares[1:]))
    outer, inner = squares[:2]
    coffer += [t for j in range(4) for t in quad(outer[j - 1], outer[j], inner[j], inner[j - 1])]
    panel = downward(squares[-1])
    ribs, panels, windows = [], [], []
    for i in range(2 * NAVE // COFFER):
        for j in range(2 * END // COFFER):
            step = (-NAVE + i * COFFER + COFFER // 2, 0, -END + j * COFFER + COFFER // 2)
            ribs += moved(coffer, step)
            (windows if (i, j) in SKYLIGHTS else panels).extend(moved(panel, step))
    return ribs, panels, windows


def room(fine, bond):
    """The room's surface: (name, material, mesh)."""
    arch, vault, window = fine.round(4, 3, 1), fine.round(3, 3, 1), fine.round(2.5, 2, 1)
    light, dark = floor(bond)
    far, glass = end_wall(-END, vault, window)
    near, _ = end_wall(END, vault, window)
    ribs, panels, windows = ceiling(1 if fine.f < 1.8 else 2)
    right = {
        "arcade": ("limestone", arcade(arch, vault)),
        "wall": ("ochre", outer_wall(vault)),
        "vault": ("plaster", vaults(vault, fine.f >= 1.8)),
    }
    parts = [("floor_light", "marble_light", light), ("floor_dark", "marble_dark", dark)]
    for name, (material, mesh) in right.items():
        parts += [(f"{name}_right", material, mesh), (f"{name}_left", material, mirrored(mesh))]
    return parts + [
        ("wall_far", "ochre", far),
        ("wall_near", "ochre", near),
        ("oculus", "oculus_light", glass),
        ("ceiling", "plaster", ribs),
        ("coffer_panels", "azure", panels),
        ("skylights", "skylight", windows),
    ]

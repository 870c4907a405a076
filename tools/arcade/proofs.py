"""What must hold before anything is written, in exact integer arithmetic."""

from make_scenes import cross, dot, open_edges, sub

from .hall import AISLE, CEILING, END, NAVE, PIER, SPRING, VAULT_SPRING, WALL
from .shapes import moved


def six_volumes(mesh):
    """Six times the volume that a closed mesh encloses, in cubic grid units."""
    return sum(dot(a, cross(b, c)) for a, b, c in mesh)


def normal(t):
    return cross(sub(t[1], t[0]), sub(t[2], t[0]))


def assert_exact(name, mesh):
    """Coordinates are whole numbers that f32 holds, and triangles have an area."""
    for t in mesh:
        for p in t:
            assert all(type(x) is int and abs(x) < 2**24 for x in p), f"{name}: {p} is not exact in f32"
        assert any(normal(t)), f"{name}: a triangle without area at {t[0]}"


def assert_solid(name, mesh):
    """Every edge is shared by just two triangles that run it in opposite directions; outward."""
    assert_exact(name, mesh)
    assert not open_edges(mesh), f"{name} is open"
    for piece in pieces(mesh):
        assert six_volumes(piece) > 0, f"{name} is inside out"


def assert_room(parts, bond):
    """The parts of the room are one closed surface that faces in; T-junctions only in the floor."""
    mesh = [t for _, _, part in parts for t in part]
    assert_exact("the room", mesh)
    assert not open_edges(cut_at_vertices(mesh) if bond else mesh), "the room is open"
    volume = -six_volumes(mesh) / 6 / 65536**3
    # With smooth vaults and arches it would be just above 1,040.
    assert 1030 < volume < 1041, f"the room's volume is {volume} m^3"


def cut_at_vertices(mesh):
    """The triangles as polygons, with the floor's vertices in their edges along x."""
    lines = {}
    for t in mesh:
        for x, y, z in t:
            if y == 0:
                lines.setdefault(z, set()).add(x)

    def split(a, b):
        if a[1] or b[1] or a[2] != b[2]:
            return [a]
        low, high = sorted((a[0], b[0]))
        cuts = sorted((x for x in lines[a[2]] if low < x < high), reverse=a[0] > b[0])
        return [a] + [(x, 0, a[2]) for x in cuts]

    return [tuple(p for a, b in zip(t, t[1:] + t[:1]) for p in split(a, b)) for t in mesh]


def pieces(mesh):
    """The connected pieces of a mesh: joined by common corners."""
    root = {}

    def find(p):
        while root.setdefault(p, p) != p:
            root[p] = root[root[p]]
            p = root[p]
        return p

    for a, b, c in mesh:
        root[find(a)] = root[find(b)] = find(c)
    found = {}
    for t in mesh:
        found.setdefault(find(t[0]), []).append(t)
    return list(found.values())


def bounds(mesh):
    points = [p for t in mesh for p in t]
    return tuple((min(x), max(x)) for x in zip(*points))


def assert_apart(things):
    """The boxes around all pieces of all things are in the room, and apart or in contact.

    And each piece touches another one, or the room, and in the end the room: nothing floats.
    """
    boxes, of_mesh = [], {}
    for thing in things:
        if id(thing.mesh) not in of_mesh:
            of_mesh[id(thing.mesh)] = [bounds(piece) for piece in pieces(thing.mesh)]
        for b in of_mesh[id(thing.mesh)]:
            boxes.append((tuple((low + d, high + d) for (low, high), d in zip(b, thing.at)), thing.name))
    boxes.sort()

    held, touching = set(), {i: [] for i in range(len(boxes))}
    for i, (b, name) in enumerate(boxes):
        assert in_room(b), f"{name} is partly in a wall"
        if on_room(b):
            held.add(i)
        for j in range(i + 1, len(boxes)):
            c, other = boxes[j]
            if c[0][0] > b[0][1]:
                break
            gaps = [max(p[0], q[0]) - min(p[1], q[1]) for p, q in zip(b, c)]
            assert max(gaps) >= 0, f"{name} and {other} may overlap"
            if max(gaps) == 0:
                touching[i].append(j)
                touching[j].append(i)
    waiting = list(held)
    while waiting:
        for j in touching[waiting.pop()]:
            if j not in held:
                held.add(j)
                waiting.append(j)
    floating = {boxes[i][1] for i in range(len(boxes)) if i not in held}
    assert not floating, f"nothing holds {sorted(floating)}"


def in_room(b):
    """Whether a box lies in the air of the room, arches and upper parts of vaults left out."""
    (x0, x1), (y0, y1), (z0, z1) = b
    inner, outer = (0 if x0 < 0 < x1 else min(abs(x0), abs(x1))), max(abs(x0), abs(x1))
    if outer > WALL or max(-z0, z1) > END or y0 < 0 or y1 > CEILING:
        return False
    beside = inner >= AISLE or outer <= NAVE
    if y1 > SPRING and not beside or y1 > VAULT_SPRING and outer > NAVE:
        return False
    return beside or max(-z0, z1) <= END - PIER


def on_room(b):
    (x0, x1), (y0, y1), (z0, z1) = b
    walls = {x0, x1, -x0, -x1} & {WALL} or y0 > SPRING and {x0, x1, -x0, -x1} & {NAVE}
    return bool(y0 == 0 or y1 == CEILING or walls or max(-z0, z1) == END)


def assert_contacts(things):
    """No two faces of different things lie in one plane, overlap and look the same way.

    Looked for among faces that are normal to an axis, where all contacts are.
    """
    planes = {}
    for number, thing in enumerate(things):
        for t in moved(thing.mesh, thing.at):
            n = normal(t)
            if sum(x != 0 for x in n) == 1:
                axis = next(i for i in range(3) if n[i])
                planes.setdefault((axis, n[axis] > 0, t[0][axis]), {}).setdefault(number, []).append(t)
    for (axis, _, _), faces in planes.items():
        spans = []
        for number, mesh in faces.items():
            for t in mesh:
                b = bounds([t])
                spans.append((b[axis - 2], b[axis - 1], number, t))
        spans.sort(key=lambda s: s[0])
        for i, (u, v, number, t) in enumerate(spans):
            for w, x, other, s in spans[i + 1 :]:
                if w[0] >= u[1]:
                    break
                if other != number and min(v[1], x[1]) > max(v[0], x[0]):
                    assert not overlap(t, s, axis), f"{things[number].name} and {things[other].name} overlap"


def overlap(t, s, axis):
    """Whether two triangles in a plane normal to `axis` have a part in common, with an area."""
    for a, b in ((t, s), (s, t)):
        a, b = ([(p[axis - 2], p[axis - 1]) for p in q] for q in (a, b))

        def side(p, q, r):
            return (q[0] - p[0]) * (r[1] - p[1]) - (q[1] - p[1]) * (r[0] - p[0])

        sign = 1 if side(*a) > 0 else -1
        for p, q in zip(a, a[1:] + a[:1]):
            if all(sign * side(p, q, r) <= 0 for r in b):
                return False
    return True

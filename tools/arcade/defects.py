"""Objects that are wrong on purpose, each with what is wrong about it.

They are placed where the furniture leaves room. What is said of them is checked by `assert_defects`.
Coordinates finer than the grid are fractions of a grid unit: exact as f64, and in f32 where they
are small (a hair above 0).
"""

from . import things as draw
from .furnish import Thing
from .proofs import bounds, normal, open_edges, six_volumes
from .shapes import GRID, box, flipped, grid, quad

# Heights above what they lie on, metres. Both are kept by f32 next to 0, not next to 0.75: the
# node's translation lifts the cup.
RUG_GAP, CUP_GAP = 1e-7, 1e-9


def sheet(width, depth, y=0):
    """A rectangle that faces up: open, as rugs often are."""
    x, z = grid(width / 2, depth / 2)
    return quad((-x, y, z), (x, y, z), (x, y, -z), (-x, y, -z))


def slivers(needles):
    """A closed slab whose top is cut into needles: widths of 1/65536 m over a length of 1.5 m."""
    x, y, z = grid(0.75, 0.0625, 0.25)
    cuts = [-x] + [i - needles // 2 for i in range(needles)] + [x]
    mesh = [t for t in box((-x, x), (0, y), (-z, z)) if any(p[1] == 0 for p in t)]
    # Two corners of the top, and the points between them, in sides that are cut like it.
    side = [t for t in mesh if not all(p[2] == z for p in t)]
    side += [t for a, b in zip(cuts, cuts[1:]) for t in [((a, y, z), (-x, 0, z), (b, y, z))]]
    side += [((-x, 0, z), (x, 0, z), (x, y, z))]
    top = [((a, y, z), (b, y, z), (x, y, -z)) for a, b in zip(cuts, cuts[1:])]
    top += [((-x, y, z), (x, y, -z), (-x, y, -z))]
    return side + top


def defects(fine, cup_1):
    """The objects; all but one stand clear of the furniture, whose cup_1 that one doubles."""
    found = []

    def put(name, material, mesh, x, y, z, defect):
        found.append(Thing(f"defect_{name}", material, mesh, grid(x, y, z), defect))

    crate = draw.centred(0.5, (0.0, 0.5), 0.5)
    urn, top = draw.pot(fine), draw.cup(fine)
    put("rug_on_floor", "red", sheet(2.5, 1.75), 0.0, 0.0, 4.625,
        "coplanar overlap: a sheet exactly in the plane of the floor")
    put("rug_above_floor", "red", sheet(1.0, 2.0, RUG_GAP * GRID), -4.5, 0.0, 4.0,
        "coplanar overlap: a sheet 1e-7 m above the floor")
    put("crate_twice", "oak", crate + crate, -1.4, 0.0, 6.5,
        "duplicate faces: every triangle is there twice")
    found.append(Thing("defect_cup_again", "blue", top, cup_1.at,
                       "duplicate faces: coincides with cup_1, in another material"))
    put("slab_of_slivers", "limestone", slivers(9), 4.6, 0.0, 1.5,
        "slivers: triangles 1/65536 m wide and 1 m long; the slab is closed")
    a, b = grid(0.2, 0.5, 0.2), grid(-0.2, 0.5, 0.2)
    middle = grid(0.0, 0.5, 0.2)
    nothing = [(a, a, b), (a, b, b), (a, a, a), (a, middle, b), (b, a, middle)]
    put("crate_zero_area", "oak", crate + nothing, -1.4, 0.0, 5.7,
        "zero-area triangles: five of them have two equal corners or three in line")
    put("pot_some_flipped", "terracotta", [t if i % 4 else flipped([t])[0] for i, t in enumerate(urn)],
        -2.1, 0.0, 0.0, "flipped winding: every fourth triangle is turned over")
    put("crate_inside_out", "oak", flipped(crate), 2.1, 0.0, 0.0,
        "flipped winding: the whole object is inside out")
    put("crate_around", "oak", crate, 1.6, 0.0, 6.5,
        "hidden: contains defect_box_within")
    put("box_within", "azure", draw.centred(0.25, (0.125, 0.375), 0.25), 1.6, 0.0, 6.5,
        "hidden: a closed box buried in defect_crate_around")
    floating = [tuple((x, y + CUP_GAP * GRID, z) for x, y, z in t) for t in top]
    put("cup_above_table", "blue", floating, 0.4, draw.TABLE, 2.125,
        "near contact: floats 1e-9 m above long_table_1")
    return found


def assert_defects(things):
    """Each is wrong in the way that it says, and in no other."""
    by_name = {t.name: t for t in things}
    wrong = {name[7:]: t for name, t in by_name.items() if name.startswith("defect_")}

    def mesh(name):
        return wrong.pop(name).mesh

    assert all(t.defect for t in wrong.values())
    rug, hair = mesh("rug_on_floor"), mesh("rug_above_floor")
    assert {p[1] for t in rug for p in t} == {0} and {p[1] / GRID for t in hair for p in t} == {RUG_GAP}
    assert all(normal(t)[1] > 0 for t in rug + hair)

    twice = mesh("crate_twice")
    assert sorted(twice) == sorted(2 * sorted(set(twice))) and not open_edges(set(twice))
    again, cup = wrong["cup_again"], by_name["cup_1"]
    assert again.at == cup.at and mesh("cup_again") == cup.mesh

    slab = mesh("slab_of_slivers")
    assert not open_edges(slab) and six_volumes(slab) == 6 * 2 * grid(0.75) * grid(0.0625) * 2 * grid(0.25)
    longest = max(grid(1.5), 1)
    needles = [t for t in slab if 0 < max(abs(x) for x in normal(t)) < longest * 2]
    assert len(needles) >= 8

    crate = mesh("crate_zero_area")
    assert sum(not any(normal(t)) for t in crate) == 5

    pot = by_name["pot_1"].mesh
    some, whole = mesh("pot_some_flipped"), mesh("crate_inside_out")
    assert sum(s == t for s, t in zip(some, pot)) == len(pot) - -(-len(pot) // 4)
    assert not open_edges(whole) and six_volumes(whole) < 0

    outer, inner = wrong["crate_around"], wrong["box_within"]
    assert outer.at == inner.at
    for (a, b), (c, d) in zip(bounds(mesh("crate_around")), bounds(mesh("box_within"))):
        assert a < c < d < b
    cup = wrong["cup_above_table"]
    assert cup.at[1] == grid(draw.TABLE) and bounds(mesh("cup_above_table"))[1][0] / GRID == CUP_GAP
    assert not wrong, f"unchecked: {sorted(wrong)}"

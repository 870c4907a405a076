"""Parts of tools/make_arcade.py: the geometry of an arcade, its defects, proofs and files.

shapes     exact coordinates, polygons, prisms, solids of revolution
hall       the closed room: floor, walls, arcades, vaults, ceiling
things     columns, stair, lamps, furniture: closed solids that stand in it
defects    objects that are wrong on purpose
proofs     what is checked before anything is written
files      glTF, GLB and OBJ
"""

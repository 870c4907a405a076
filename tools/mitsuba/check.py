"""Checks the tools themselves: sides, emission and estimators.

    cargo build --release && .venv/mitsuba/bin/python tools/mitsuba/check.py

- In scenes/furnace.gltf irradiance is 2 W/m^2 everywhere, exactly.
- One-sided and two-sided faces, emitting and not, and sheets of two faces back to back: lumel and
  both estimators (this directory's own, and Mitsuba's `path` unchanged) at both sides of each.

Differences must be within four standard errors and lumel's tolerance of 0.1 % of the mean. Takes
less than a minute.
"""

import sys
import tempfile
from pathlib import Path

from scene import ROOT, Exported, lumel, mitsuba_scene, np  # before all else

import references
import trace

SAMPLES = 1 << 16
POINTS = 32
TOLERANCE = 1e-3

# Scene, options of lumel.
CASES = [
    ("furnace", ()),
    ("paper", ()),
    ("paper", ("--two-sided",)),
    ("paper", ("--emission", "*=0.3,0.2,0.1")),
    ("cornell", ("--two-sided", "--emission", "red=0.5,0,0.2")),
]


def by_lumel(path, positions, normals, options):
    with tempfile.TemporaryDirectory() as room:
        points, found = Path(room) / "points.csv", Path(room) / "found.csv"
        np.savetxt(points, np.hstack([positions, normals]), delimiter=",", fmt="%.17g",
                   header="x,y,z,nx,ny,nz", comments="")
        lumel("probe", path, "--points", points, "-o", found, "--tolerance", TOLERANCE, "--quiet",
              *options)
        return np.genfromtxt(found, delimiter=",", skip_header=1)[:, 6:9]


def main():
    failed = False
    for name, options in CASES:
        path = ROOT / "scenes" / f"{name}.gltf"
        exported = Exported(path, *options)
        scene = mitsuba_scene(exported)
        faces, positions, normals = references.random_points(exported, POINTS, 5)
        # Backs of two-sided faces too.
        behind = exported.two_sided[faces]
        faces = np.concatenate([faces, faces[behind]])
        positions = np.concatenate([positions, positions[behind]])
        normals = np.concatenate([normals, -normals[behind]])
        wanted = by_lumel(path, positions, normals, options)
        exact = np.full_like(wanted, 2.0) if name == "furnace" else wanted
        reflectance, radiance = exported.reflectance[faces], exported.radiance[faces]
        runs = {
            "own": trace.irradiance(scene, exported.extent, positions, normals, SAMPLES, 1),
            "path": trace.stock_irradiance(scene, positions, normals, reflectance, radiance, SAMPLES, 2),
        }
        for way, (mean, error, _) in runs.items():
            allowed = 4 * error + TOLERANCE * exact.mean()
            off = np.abs(mean - exact) / allowed
            bad = off.max() > 1 or np.abs(wanted - exact).max() > TOLERANCE * exact.mean()
            failed |= bool(bad)
            print(f"{' '.join((name, *options)):45} {way:5} {len(mean)} points, largest difference "
                  f"{off.max():.2f} of what is allowed{': FAILED' if bad else ''}", flush=True)
    sys.exit(int(failed))


if __name__ == "__main__":
    main()

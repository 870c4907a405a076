"""Values by path tracing that tests/mitsuba.rs compares lumel with.

    .venv/mitsuba/bin/python tools/mitsuba/references.py [NAME...]

For scenes/NAME.gltf (by default all of SCENES) writes tests/data/mitsuba_NAME.json:

- `points`: irradiance at POINTS places. A face is drawn with a chance proportional to the root of
  its area (so that small ones are seen too), then a place on it evenly, by NumPy's default
  generator with the seed that is written; the side is the one that radiates.
- `view`: radiance of a small picture, each pixel the mean of ACROSS x ACROSS rays through the
  middles of its parts: the rays of a picture by lumel that is ACROSS times larger, so that edges
  count alike.
- `offset_bias`: how much irradiance at the points changes, relative to its sum, where rays start
  and end ten times farther from surfaces, by the same random numbers; and what Mitsuba's own
  `path` integrator differs by, whose offsets are larger still. The first is ten times the bias of
  what is stored.

All standard errors are those of means of independent samples. Takes about 15 CPU minutes.
"""

import json
import sys

from scene import ROOT, Exported, mi, mitsuba_scene, np, sample_rays  # before all else

import trace

# Scene: seed, samples a point, samples a ray of the view.
SCENES = {
    "cornell": (1, 1 << 21, 1 << 12),
    "paper": (2, 1 << 22, 1 << 12),
    "room": (3, 1 << 21, 1 << 12),
    "arcade": (4, 1 << 20, 1 << 10),
}
POINTS = 64
WIDTH, HEIGHT, ACROSS = 32, 24, 4


def random_points(exported, count, seed):
    """Faces, positions and normals."""
    random = np.random.default_rng(seed)
    share = np.sqrt(exported.area)
    faces = random.choice(len(share), size=count, p=share / share.sum())
    u = random.random((count, 2))
    beyond = u.sum(axis=1) > 1
    u[beyond] = 1 - u[beyond]
    a, b, c = (exported.corners[faces, k] for k in range(3))
    return faces, a + u[:, :1] * (b - a) + u[:, 1:] * (c - a), exported.normal[faces]


def relative_change(new, old):
    """Sum of the differences of (mean, error, ...) over the sum, and its error: largest channel."""
    change = (new[0] - old[0]).sum(axis=0) / old[0].sum(axis=0)
    error = np.sqrt((new[1] ** 2 + old[1] ** 2).sum(axis=0)) / old[0].sum(axis=0)
    k = np.argmax(np.abs(change))
    return {"relative_change": round(float(change[k]), 7), "standard_error": round(float(error[k]), 7)}


def digits(values, count=7):
    return [[float(f"{v:.{count}g}") for v in row] for row in values]


def points_of(exported, scene, seed, samples):
    faces, positions, normals = random_points(exported, POINTS, seed)
    extent = exported.extent
    values = trace.irradiance(scene, extent, positions, normals, samples, seed)
    print(f"  points: mean error {values[1].sum() / values[0].sum():.1e}", flush=True)
    farther = trace.irradiance(scene, extent, positions, normals, samples, seed, 10 * trace.NEAR)
    stock = trace.stock_irradiance(scene, positions, normals, exported.reflectance[faces],
                                   exported.radiance[faces], samples, seed + 100)
    entries = zip(positions.tolist(), normals.tolist(), digits(values[0]), digits(values[1], 3))
    return {
        "seed": seed,
        "samples": values[2],
        "offset_bias": {
            "ten_times_farther": relative_change(farther, values),
            "mitsuba_path": relative_change(stock, values),
        },
        "entries": [
            {"position": p, "normal": n, "irradiance": h, "standard_error": e}
            for p, n, h, e in entries
        ],
    }


def view_of(exported, scene, seed, samples):
    rays = sample_rays(exported.view, WIDTH, HEIGHT, ACROSS)
    mean, error, done = trace.radiance(scene, exported.extent, rays, ACROSS, samples, seed + 200)
    print(f"  view: mean error {error.sum() / mean.sum():.1e}", flush=True)
    return {
        "camera": exported.view["camera"],
        "width": WIDTH,
        "height": HEIGHT,
        "across": ACROSS,
        "samples": done,
        "radiance": digits(mean),
        "standard_error": digits(error, 3),
    }


def main():
    for name in sys.argv[1:] or SCENES:
        seed, samples, ray_samples = SCENES[name]
        print(name, flush=True)
        exported = Exported(ROOT / "scenes" / f"{name}.gltf", "--size", f"{WIDTH}x{HEIGHT}")
        scene = mitsuba_scene(exported)
        data = {
            "made_by": "tools/mitsuba/references.py",
            "mitsuba": mi.__version__,
            "variant": mi.variant(),
            "scene": f"scenes/{name}.gltf",
            "offset": trace.NEAR,
            "points": points_of(exported, scene, seed, samples),
            "view": view_of(exported, scene, seed, ray_samples),
        }
        print("  " + json.dumps(data["points"]["offset_bias"]), flush=True)
        path = ROOT / "tests" / "data" / f"mitsuba_{name}.json"
        text = json.dumps(data).replace(', {"position"', ',\n{"position"').replace("], [", "],\n[")
        path.write_text(text + "\n")


if __name__ == "__main__":
    main()

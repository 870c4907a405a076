"""Draws a scene with lumel and with Mitsuba's path tracer, and says how they differ.

    cargo build --release
    .venv/mitsuba/bin/python tools/mitsuba/compare.py SCENE [--size 320x240] [--samples 64]
        [--tolerance 0.3%] [-o compare.png] [-- options of lumel: --camera, --emission, ...]

Both see the triangles, sides, light and view that `lumel inspect --export` writes, and send rays
through the same 4 x 4 places of each pixel; Mitsuba traces SAMPLES paths from each by its `path`
integrator, unlimited depth. Printed are

- the mean relative squared error: (lumel - Mitsuba)^2 / (Mitsuba^2 + 0.01 mean^2), averaged over
  pixels and channels; the share of it that is Mitsuba's noise, by its standard errors; and the
  difference of the means over the picture;
- the mean square of the difference in standard errors (1 where only noise is left), and the pixels
  where it is largest. With few samples expect some of 5 to 9 in dark places: paths that bring much
  light there are rare, and until one is found the standard error is too small. They go away with
  more samples; a real difference grows.

The picture shows expected (Mitsuba) | difference | actual (lumel). The difference is grey where there
is none, red where lumel is brighter and blue where it is darker, fully so at FULL of the
picture's mean. Textures are averaged over each triangle for Mitsuba: said when it happens.
"""

import argparse
import tempfile
from pathlib import Path

from scene import (Exported, camera_is_off_by, lumel, mi, mitsuba_scene, np,  # before all else
                   sample_rays)

import trace

# Rays along each side of a pixel.
ACROSS = 4

# Part of the picture's mean at which the difference has its full colour.
FULL = 0.1

WORST = 8


def arguments():
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("scene")
    parser.add_argument("--size", default="320x240")
    parser.add_argument("--samples", type=int, default=64, help="paths of each of 16 rays a pixel")
    parser.add_argument("--tolerance", default="0.3%")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("-o", "--output", type=Path, default=Path("compare.png"))
    parser.add_argument("options", nargs="*", help="of lumel, after --")
    return parser.parse_args()


def lumel_picture(typed, width, height):
    with tempfile.TemporaryDirectory() as room:
        file = Path(room) / "view.exr"
        # With --samples light would be gathered once a pixel and face; so it is for each ray.
        lumel("render", typed.scene, "-o", file, "--size", f"{ACROSS * width}x{ACROSS * height}",
              "--tolerance", typed.tolerance, "--quiet", *typed.options)
        picture = mi.Bitmap(str(file)).convert(mi.Bitmap.PixelFormat.RGB, mi.Struct.Type.Float32, False)
        fine = np.array(picture, dtype=np.float64).reshape(height, ACROSS, width, ACROSS, 3)
        return fine.mean(axis=(1, 3)).reshape(-1, 3)


def srgb(linear):
    clipped = np.clip(linear, 0, 1)
    return np.where(clipped <= 0.0031308, 12.92 * clipped, 1.055 * clipped ** (1 / 2.4) - 0.055)


def painted(theirs, ours, width):
    """Three pictures side by side, 8 bits."""
    white = max(np.percentile(theirs, 98), 1e-30)
    off = ((ours - theirs).mean(axis=1) / (FULL * theirs.mean())).clip(-1, 1)[:, None]
    grey, red, blue = (np.array(c) for c in ((0.5, 0.5, 0.5), (1.0, 0.0, 0.0), (0.0, 0.2, 1.0)))
    middle = np.where(off > 0, grey + off * (red - grey), grey - off * (blue - grey))
    rows = [v.reshape(-1, width, 3) for v in (srgb(theirs / white), middle, srgb(ours / white))]
    return np.ascontiguousarray((np.concatenate(rows, axis=1) * 255 + 0.5).astype(np.uint8))


def main():
    typed = arguments()
    exported = Exported(typed.scene, "--size", typed.size, *typed.options)
    if exported.averaged:
        print(f"{len(exported.averaged)} triangles have textures or vertex colours: Mitsuba is given "
              "their means, so what they show will differ")
    width, height = (int(v) for v in typed.size.split("x"))
    off = camera_is_off_by(exported.view, width, height)
    print(f"camera \"{exported.view['camera']}\": Mitsuba's own is off by {off:.1e} pixels")
    scene, path = mitsuba_scene(exported), trace.stock_path()
    rays = sample_rays(exported.view, width, height, ACROSS)

    def value(ray, sampler):
        return path.sample(scene, sampler, mi.RayDifferential3f(ray))[0]

    theirs, error, samples = trace.picture(value, rays, ACROSS, max(2, typed.samples), typed.seed)
    ours = lumel_picture(typed, width, height)
    mean = theirs.mean()
    below = theirs**2 + 0.01 * mean**2
    print(f"mean relative squared error: {((ours - theirs) ** 2 / below).mean():.2e}, of which noise "
          f"of the path tracer {(error**2 / below).mean():.2e}")
    print(f"difference of the means: {(ours - theirs).mean() / mean:+.2e} of them, standard error "
          f"{np.sqrt((error**2).sum()) / error.size / mean:.1e}")
    # In deep shadow a path that brings light is rare: with n paths and none, or few, found, an error
    # is believed only down to one part in n of the mean.
    score = np.abs(ours - theirs) / np.maximum(error, mean / (samples * ACROSS**2))
    print(f"mean square in standard errors: {(score**2).mean():.2f}")
    print("   x    y   in standard errors   Mitsuba                        lumel")
    for k in np.argsort(-score.max(axis=1))[:WORST]:
        numbers = ["  ".join(f"{v:9.3e}" for v in values[k]) for values in (theirs, ours)]
        print(f"{k % width:4d} {k // width:4d}   {score[k].max():18.1f}   {numbers[0]}   {numbers[1]}")
    mi.Bitmap(painted(theirs, ours, width)).write(str(typed.output))
    print(f"expected | difference | actual: {typed.output}")


if __name__ == "__main__":
    main()

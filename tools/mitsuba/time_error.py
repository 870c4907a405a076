"""CPU seconds against the error of irradiance: lumel at a ladder of tolerances, Mitsuba's path
tracer at a ladder of samples, on the same texels.

    cargo build --release && .venv/mitsuba/bin/python tools/mitsuba/time_error.py [--quick] [NAME...]

Writes tools/mitsuba/time_error.csv and, by plot.py, time_error.svg beside it. Both programs use
THREADS threads, one after the other; nothing else should run. The whole run takes about half an
hour on two threads; --quick takes about two minutes, writes to the directory for temporary files,
and shows only that everything works.

The quantity is irradiance on all texels of a scene, each the mean of 4 x 4 points
(tools/accuracy.rs, which also runs lumel), relative to the mean over the texels; of the channels
the largest root mean square.

- Mitsuba: its own `path` integrator, unlimited depth, Russian roulette from the fourth reflection
  on, independent sampler, llvm_ad_rgb. A path begins just above a point of the texel and looks
  straight at it; samples are stratified over the texel's points. What comes back is
  Le + rho/pi H. CPU seconds are of the sampling alone: reading the scene, building its tree and
  compiling are left out.
  The error of a run R follows from two long runs A and B that are independent of it and each other:
  the mean of (R - A)(R - B) over all texels is the mean square error of R, without that of A and B.
- lumel: CPU seconds are of the whole process. The error is the difference from a run with a far
  smaller tolerance. That its runs share no larger error is seen by the column
  `against_path_tracing`, the root of the mean of (L - A)(L - B): it is at most about the column
  `noise_of_that`, the root of the standard error of that mean, or else what is larger of lumel's
  error and Mitsuba's bias (offsets of rays in float32, at contacts). Negative means are written as
  negative roots.
"""

import csv
import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from scene import ROOT, Exported, dr, mi, mitsuba_scene, np  # before all else

import plot
import trace

THREADS = 2

# Scene: tolerances of lumel, that of its reference; samples a texel of Mitsuba's runs, those of each
# of the two long ones.
LADDERS = {
    "cornell": ((3e-2, 1e-2, 3e-3, 1e-3, 3e-4), 1e-4, (16, 64, 256, 1024, 4096), 8192),
    "room": ((3e-2, 1e-2, 3e-3, 1e-3), 2.5e-4, (16, 64, 256, 1024, 4096), 8192),
    "paper": ((1e-2, 1e-3, 1e-4), 5e-6, (16, 64, 256, 1024, 4096, 16384), 32768),
}
QUICK = {
    "cornell": ((3e-2, 1e-2), 3e-3, (16, 64), 128),
    "room": ((3e-2,), 1e-2, (16, 64), 128),
    "paper": ((1e-2, 1e-3), 1e-4, (16, 64), 128),
}

# Where a path begins above its texel, relative to the scene's size.
ABOVE = 1e-4

# Paths in flight.
BATCH = 1 << 21


def accuracy(*words):
    """Runs the Rust side; its line of JSON."""
    command = ["cargo", "bench", "--quiet", "--bench", "accuracy", "--", *map(str, words)]
    environment = os.environ | {"RAYON_NUM_THREADS": str(THREADS)}
    done = subprocess.run(command, cwd=ROOT, env=environment, capture_output=True, text=True)
    if done.returncode != 0:
        sys.exit(f"{' '.join(command)}\nfailed:\n{done.stderr}")
    return done.stdout


class Texels:
    """Points of all texels, and what Mitsuba's path tracer finds there."""

    def __init__(self, name, room):
        path = room / "points"
        accuracy("--texels", name, path)
        rows = np.fromfile(path).reshape(-1, 8)
        exported = Exported(ROOT / "scenes" / f"{name}.gltf")
        triangle = rows[:, 7].astype(int)
        texel = rows[:, 0].astype(int)
        self.count = texel[-1] + 1
        first = np.searchsorted(texel, np.arange(self.count + 1))
        if exported.reflectance[triangle].min() <= 0:
            sys.exit(f"{name}: black surfaces do not show their irradiance")
        flat = np.float32
        # By point: a texel may lie across two materials.
        self.factor = mi.Color3f((np.pi / exported.reflectance[triangle]).T.astype(flat))
        self.radiance = mi.Color3f(exported.radiance[triangle].T.astype(flat))
        self.positions = mi.Point3f(rows[:, 1:4].T.astype(flat))
        self.normals = mi.Vector3f(rows[:, 4:7].T.astype(flat))
        self.first = mi.UInt32(first[:-1].astype(np.uint32))
        self.points = mi.UInt32(np.diff(first).astype(np.uint32))
        self.above = ABOVE * exported.extent
        self.scene = mitsuba_scene(exported)
        self.path = trace.stock_path()
        dr.eval(self.positions, self.normals, self.first, self.points, self.factor, self.radiance)

    def batch(self, each, done, samples, seed):
        """Sums of the irradiance that samples done..done + each of all texels find."""
        sampler = mi.load_dict({"type": "independent"})
        sampler.seed(seed, int(self.count) * each)
        lane = dr.arange(mi.UInt32, int(self.count) * each)
        texel = lane // each
        points = dr.gather(mi.UInt32, self.points, texel)
        place = (mi.Float(lane % each + done) + sampler.next_1d()) / samples
        point = dr.minimum(mi.UInt32(place * points), points - 1)
        point += dr.gather(mi.UInt32, self.first, texel)
        normal = dr.gather(mi.Vector3f, self.normals, point)
        position = dr.gather(mi.Point3f, self.positions, point)
        ray = mi.RayDifferential3f(mi.Ray3f(position + self.above * normal, -normal))
        found = self.path.sample(self.scene, sampler, ray)[0]
        found = (found - dr.gather(mi.Color3f, self.radiance, point)) * dr.gather(
            mi.Color3f, self.factor, point)
        sums = [dr.block_sum(channel, each) for channel in found]
        dr.eval(sums)
        return np.array([np.array(s) for s in sums], dtype=np.float64).T

    def irradiance(self, samples, seed):
        """Irradiance of the texels, and the CPU seconds that it took."""
        most = max(1, BATCH // int(self.count))
        before = time.process_time()
        total, done, run = 0.0, 0, 0
        while done < samples:
            each = min(most, samples - done)
            total = total + self.batch(each, done, samples, 10_007 * seed + run)
            done += each
            run += 1
        seconds = time.process_time() - before
        return total / samples, seconds


def product(value, a, b, mean):
    """Mean of (value - a)(value - b) relative to the mean: the largest channel, and its error."""
    products = (value - a) * (value - b) / mean**2
    k = np.argmax(np.abs(products.mean(axis=0)))
    return products[:, k].mean(), products[:, k].std() / np.sqrt(len(products))


def root(square):
    return float(np.sign(square) * np.sqrt(abs(square)))


def measure(name, ladder, room, write):
    tolerances, finest, samples, long = ladder
    texels = Texels(name, room)
    print(f"{name}: {texels.count} texels", flush=True)
    for seed, n in enumerate(sorted({16, *samples})):
        texels.irradiance(min(n, 64), 900 + seed)  # compiles
    (a, _), (b, _) = texels.irradiance(long, 1), texels.irradiance(long, 2)
    mean = (a + b).mean(axis=0) / 2
    for k, n in enumerate(samples):
        value, seconds = texels.irradiance(n, 10 + k)
        square, error = product(value, a, b, mean)
        write(name, "mitsuba", f"{n} samples", seconds, root(square), root(square), root(error))
    reference = room / f"{name}-reference"
    begin = time.time()
    accuracy("--case", name, "uniform", finest, reference)
    best = np.fromfile(reference).reshape(-1, 3)
    square, error = product(best, a, b, mean)
    print(f"  lumel's reference (in {time.time() - begin:.0f} s) against path tracing: "
          f"{root(square):.1e} +- {root(error):.1e}", flush=True)
    for tolerance in tolerances:
        own = room / f"{name}-{tolerance}"
        result = json.loads(accuracy("--case", name, "uniform", tolerance, own))
        value = np.fromfile(own).reshape(-1, 3)
        off = float(np.sqrt(((value - best) ** 2).mean(axis=0) / best.mean(axis=0) ** 2).max())
        square, error = product(value, a, b, mean)
        setting = f"tolerance {tolerance:g}"
        write(name, "lumel", setting, result["cpu"], off, root(square), root(error))


def main():
    words = sys.argv[1:]
    quick = "--quick" in words
    ladders = QUICK if quick else LADDERS
    names = [w for w in words if not w.startswith("-")] or list(ladders)
    place = Path(tempfile.gettempdir()) if quick else Path(__file__).resolve().parent
    dr.set_thread_count(THREADS)
    begin = time.time()
    rows = []

    def write(*row):
        rows.append([f"{v:.4g}" if isinstance(v, float) else v for v in row])
        print("  " + ", ".join(map(str, rows[-1])), flush=True)

    with tempfile.TemporaryDirectory() as room:
        for name in names:
            measure(name, ladders[name], Path(room), write)
    with open(place / "time_error.csv", "w", newline="") as file:
        table = csv.writer(file, lineterminator="\n")
        table.writerow(plot.COLUMNS)
        table.writerows(rows)
    (place / "time_error.svg").write_text(plot.picture(place / "time_error.csv"))
    print(plot.table(place / "time_error.csv"))
    print(f"written to {place} after {time.time() - begin:.0f} s")


if __name__ == "__main__":
    main()

#!/usr/bin/env python3
"""Measures what the README's tables show, and prints them.

    cargo build --release && python3 tools/measure.py

Needs nothing but Python. CPU seconds are of all threads; memory is the peak of the process.
"""

import csv
import json
import os
import resource
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
PROGRAM = ROOT / "target" / "release" / "lumel"


def run(directory, *words):
    """Runs the program; returns its report and the CPU seconds it took."""
    report = Path(directory) / "report.json"
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run([PROGRAM, *map(str, words), "--report", report], check=True, cwd=ROOT)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    cpu = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return json.loads(report.read_text()), cpu


def renders(directory):
    """Every shipped scene, 960 pixels on the longer side, to 1 %."""
    print("| scene | elements | CPU s | memory, MiB | gathers a pixel | estimated error rms | largest |")
    print("|---|---|---|---|---|---|---|")
    for scene in ("paper", "cornell", "room", "furnace"):
        report, cpu = run(directory, "render", f"scenes/{scene}.gltf", "-o", Path(directory) / "v.exr")
        counts, values = report["counts"], report["values"]
        memory = values["peak_memory_bytes"] / 2**20
        gathers = counts["gathers of indirect light"] / counts["points"]
        error = [values[f"estimated error of the output {name}"] for name in ("rms", "maximum")]
        print(
            f"| `{scene}.gltf` | {counts['elements']} | {cpu:.1f} | {memory:.0f} | {gathers:.2f} "
            f"| {error[0]:.1e} | {error[1]:.1e} |"
        )


def lattice(directory):
    """576 points on the floor of the Cornell box, off the lines of any regular mesh."""
    path = Path(directory) / "floor.csv"
    with path.open("w") as out:
        print("x,y,z,nx,ny,nz", file=out)
        for i in range(24):
            for j in range(24):
                print((i + 0.431) / 24 * 0.5496, 0, (j + 0.618) / 24 * 0.5592, 0, 1, 0, sep=",", file=out)
    return path


def irradiances(directory, points, *words):
    table = Path(directory) / "out.csv"
    report, cpu = run(directory, "probe", "scenes/cornell.gltf", "--points", points, "-o", table, *words)
    with table.open() as rows:
        values = [[float(row[f"irradiance_{c}"]) for c in "rgb"] for row in csv.DictReader(rows)]
    return [v for row in values for v in row], report, cpu


def refinement(directory):
    """Irradiance on the floor of the Cornell box against a small tolerance."""
    points = lattice(directory)
    finest, _, _ = irradiances(directory, points, "--tolerance", 0.0001)
    size = sum(v * v for v in finest) ** 0.5
    print("| settings | elements | CPU s | RMS error | largest error |")
    print("|---|---|---|---|---|")
    mean = size / len(finest) ** 0.5
    for words in (
        ("--tolerance", "1%"),
        ("--tolerance", "0.1%"),
        ("--max-edge", 0.1),
        ("--max-edge", 0.05),
        ("--max-edge", 0.1, "--basis", "constant"),
        ("--max-edge", 0.1, "--operator", "clustered"),
    ):
        values, report, cpu = irradiances(directory, points, *words)
        errors = [abs(a - b) for a, b in zip(values, finest)]
        rms = sum(e * e for e in errors) ** 0.5 / size
        text = " ".join(map(str, words))
        elements = report["counts"]["elements"]
        print(f"| `{text}` | {elements} | {cpu:.1f} | {rms:.1e} | {max(errors) / mean:.1e} |")


def main():
    if not PROGRAM.exists():
        sys.exit(f"{PROGRAM} is not there: run cargo build --release first")
    with tempfile.TemporaryDirectory() as directory:
        print(f"{os.cpu_count()} processors\n")
        renders(directory)
        print()
        refinement(directory)


if __name__ == "__main__":
    main()

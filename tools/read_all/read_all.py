#!/usr/bin/env python3
"""Whether lumel reads, or refuses well, every scene file below some folders.

    cargo build --release && python3 tools/read_all/read_all.py FOLDER... [--csv TABLE.csv] [--seconds N]

Each .gltf, .glb and .obj goes through `inspect --audit`, and where that succeeds through `probe`: everything is
made to emit, and light is looked for at three points to 30 %. Fails where the program panics, is
killed, takes longer than its time limit allows, takes more memory than README.md states, or refuses a
file without naming it. Peaks are of the whole process and contain some 12 MiB of this script, which
starts it.
"""

import argparse
import csv
import json
import os
import resource
import subprocess
import sys
import tempfile
import threading
import time
import urllib.parse
from collections import Counter
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent.parent
PROGRAM = ROOT / "target/release/lumel"
MIB = 1 << 20

# Stated in README.md: reading takes at most so many bytes for each byte of the files, for each triangle
# and for each texel, and this.
BYTES_PER_BYTE = 600
BYTES_PER_TRIANGLE = 1500
BYTES_PER_TEXEL = 24
ANYWAY = 64 * MIB

# Address space beyond which something is wrong.
LIMIT = 8 << 30


def run(line, seconds):
    """Exit code (negative: a signal), seconds, peak in bytes, standard output, standard error."""

    def limit():
        resource.setrlimit(resource.RLIMIT_AS, (LIMIT, LIMIT))

    begin = time.time()
    with tempfile.TemporaryFile() as out, tempfile.TemporaryFile() as err:
        child = subprocess.Popen(line, stdout=out, stderr=err, preexec_fn=limit)
        alarm = threading.Timer(seconds, child.kill)
        alarm.start()
        _, status, usage = os.wait4(child.pid, 0)
        alarm.cancel()
        child.returncode = os.waitstatus_to_exitcode(status)
        out.seek(0), err.seek(0)
        texts = [f.read().decode(errors="replace") for f in (out, err)]
    return child.returncode, time.time() - begin, usage.ru_maxrss * 1024, *texts


def beside(path):
    """The files that a scene refers to, as far as they are easily found, each once."""
    found = {}
    try:
        data = path.read_bytes()
        if path.suffix.lower() == ".obj":
            words = [line.split(None, 1)[1].decode(errors="replace").strip()
                     for line in data.splitlines() if line.startswith(b"mtllib ")]
            for library in [path.parent / w for w in words]:
                if library.is_file():
                    found[library] = None
                    for line in library.read_bytes().splitlines():
                        if line.strip().startswith(b"map_"):
                            name = line.decode(errors="replace").split()[-1]
                            found[library.parent / name] = None
        else:
            at = 20 if data[:4] == b"glTF" else 0
            end = at + int.from_bytes(data[12:16], "little") if at else len(data)
            scene = json.loads(data[at:end])
            for part in scene.get("buffers", []) + scene.get("images", []):
                uri = part.get("uri", "")
                if uri and not uri.startswith("data:"):
                    found[path.parent / urllib.parse.unquote(uri)] = None
    except (OSError, ValueError, AttributeError, IndexError, TypeError):
        pass
    return [p for p in found if p.is_file()]


def texels(picture):
    """Texels of a picture beside a scene."""
    data = picture.read_bytes()
    if data[:8] == b"\x89PNG\r\n\x1a\n":
        return int.from_bytes(data[16:20], "big") * int.from_bytes(data[20:24], "big")
    at = 2
    while data[:2] == b"\xff\xd8" and at + 9 < len(data):
        marker, length = data[at + 1], int.from_bytes(data[at + 2:at + 4], "big")
        if 0xC0 <= marker <= 0xCF and marker not in (0xC4, 0xC8, 0xCC):
            return int.from_bytes(data[at + 5:at + 7], "big") * int.from_bytes(data[at + 7:at + 9], "big")
        at += 2 + length
    return 0


def read(path, seconds, folder):
    """One line of the table, and what is wrong."""
    wrong = []
    others = beside(path)
    size = path.stat().st_size + sum(p.stat().st_size for p in others)
    pixels = sum(texels(p) for p in others)
    code, took, peak, out, err = run([PROGRAM, "inspect", path, "--audit", "--json", "--quiet"], seconds)
    steps = [("inspect", code, err)]
    line = {"file": str(path), "bytes": size, "texels": pixels, "inspect": code, "seconds": f"{took:.2f}",
            "peak_mib": f"{peak / MIB:.0f}", "bytes_per_byte": f"{max(0, peak - 16 * MIB) / size:.0f}" if size else ""}
    scene = json.loads(out) if code == 0 else {"faces": 0}
    stated = (ANYWAY + BYTES_PER_BYTE * size + BYTES_PER_TRIANGLE * scene["faces"]
              + BYTES_PER_TEXEL * pixels)
    if peak > stated:
        wrong.append(f"inspect takes {peak / MIB:.0f} MiB, where README.md states {stated / MIB:.0f}")
    if code == 0:
        low, high = scene["bounds"]
        middle = [0.5 * (a + b) for a, b in zip(low, high)]
        points = folder / "points.csv"
        at = ",".join(repr(x) for x in middle)
        points.write_text(f"x,y,z,nx,ny,nz\n{at},0,1,0\n{at},1,0,0\n{at},0,-1,0.5\n")
        code, took, peak, out, err = run(
            [PROGRAM, "probe", path, "--points", points, "--emission", "*=1", "--tolerance", "30%",
             "--time-limit", str(seconds / 4), "--max-memory", "1GiB", "--quiet"], seconds)
        steps.append(("probe", code, err))
        line |= {"faces": scene["faces"], "probe": code, "probe_seconds": f"{took:.2f}",
                 "probe_peak_mib": f"{peak / MIB:.0f}"}
        values = [v for row in out.splitlines()[1:] for v in row.split(",")[6:9]]
        if any(v and not -1e-9 <= float(v) < float("inf") for v in values):
            wrong.append(f"probe: {values}")
    for step, code, err in steps:
        message = err.strip().splitlines()[-1] if err.strip() else ""
        if "panicked at" in err or code not in (0, 1, 3, 4):
            wrong.append(f"{step}: exit code {code}: {err.strip()[-300:]}")
        elif code and not message:
            wrong.append(f"{step}: exit code {code} without a message")
        elif code == 3 and str(path.parent) not in message:
            wrong.append(f"{step}: no file is named: {message}")
        if code:
            line["message"] = message
    return line, wrong


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folders", nargs="+", type=Path)
    parser.add_argument("--csv", type=Path, help="write the table of all files here")
    parser.add_argument("--seconds", type=float, default=60, help="most for each command (60)")
    arguments = parser.parse_args()
    kinds = {".gltf", ".glb", ".obj"}
    paths = [p for f in arguments.folders for p in ([f] if f.is_file() else sorted(f.rglob("*")))
             if p.is_file() and p.suffix.lower() in kinds]
    lines, bad, codes = [], [], Counter()
    with tempfile.TemporaryDirectory() as folder:
        for path in paths:
            line, wrong = read(path.resolve(), arguments.seconds, Path(folder))
            lines.append(line)
            codes[line["inspect"], line.get("probe", "-")] += 1
            bad += [f"{path}: {text}" for text in wrong]
            for text in wrong:
                print(f"{path}: {text}", file=sys.stderr, flush=True)
    if arguments.csv:
        names = list(dict.fromkeys(name for line in lines for name in line))
        with arguments.csv.open("w", newline="") as file:
            writer = csv.DictWriter(file, names)
            writer.writeheader(), writer.writerows(lines)
    for (inspect, probe), count in sorted(codes.items(), key=str):
        print(f"inspect {inspect}, probe {probe}: {count}")
    if lines:
        slowest = max(lines, key=lambda line: float(line["seconds"]))
        largest = max(lines, key=lambda line: float(line["peak_mib"]))
        print(f"{len(lines)} files; slowest {slowest['seconds']} s ({slowest['file']}); "
              f"largest {largest['peak_mib']} MiB ({largest['file']})")
    sys.exit(1 if bad or not lines else 0)


if __name__ == "__main__":
    main()

#!/usr/bin/env python3
"""How much memory runs really take that were allowed so much, and whether real limits hold.

    cargo build --release && python3 tools/stress_limits.py

For each shipped scene and --max-memory: the exit code and the peak of the process. Then the same
under a real limit of the address space (ulimit -v) of a little more than --max-memory: nothing may
be killed or abort, and the exit code must be the same. Prints a table in Markdown, and fails where
a peak is above what the README states.
"""

import os
import resource
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
PROGRAM = ROOT / "target/release/lumel"
MIB = 1 << 20

# Stated in the README: the peak is at most --max-memory and this.
BESIDE = 64 * MIB

# Address space of threads and libraries that is never touched.
UNTOUCHED = 256 * MIB

RUNS = [
    ("cornell.gltf", "render", "0.05%"),
    ("room.gltf", "render", "0.1%"),
    ("paper.gltf", "render", "0.001%"),
    ("furnace.gltf", "render", "0.1%"),
    ("cornell.gltf", "bake", "0.3%"),
]
LIMITS = [16, 64, 256]


def words(scene, command, tolerance, folder, limit):
    output = {"render": ["-o", f"{folder}/v.exr", "--size", "320x240"],
              "bake": ["-o", f"{folder}/o.glb", "--size", "256"]}[command]
    return [str(PROGRAM), command, str(ROOT / "scenes" / scene), *output, "--tolerance", tolerance,
            "--max-memory", f"{limit}MiB", "--quiet", "--threads", "2"]


def run(line, address_space=None):
    """Exit code, peak of the resident set in bytes, message."""

    def limit():
        if address_space:
            resource.setrlimit(resource.RLIMIT_AS, (address_space, address_space))

    child = subprocess.Popen(line, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, preexec_fn=limit)
    message = child.stderr.read().decode()
    _, status, usage = os.wait4(child.pid, 0)
    child.returncode = os.waitstatus_to_exitcode(status)
    return child.returncode, usage.ru_maxrss * 1024, message


def main():
    bad = []
    print("| scene | command | tolerance | `--max-memory`, MiB | exit code | peak, MiB |"
          " exit code with `ulimit -v` |")
    print("|---|---|---|---|---|---|---|")
    with tempfile.TemporaryDirectory() as folder:
        for scene, command, tolerance in RUNS:
            for limit in LIMITS:
                line = words(scene, command, tolerance, folder, limit)
                code, peak, message = run(line)
                allowed = limit * MIB + BESIDE
                under, _, said = run(line, allowed + UNTOUCHED)
                if code not in (0, 4) and not (code == 1 and "--max-memory" in message):
                    bad.append(f"{scene} {command} {limit}: exit code {code}: {message}")
                if peak > allowed:
                    bad.append(f"{scene} {command} {limit}: {peak / MIB:.0f} MiB")
                if under != code:
                    bad.append(f"{scene} {command} {limit}: under ulimit -v {under}: {said}")
                print(f"| `{scene}` | {command} | {tolerance.replace('%', ' %')} | {limit} | {code} |"
                      f" {peak / MIB:.0f} | {under} |", flush=True)
    print("\n".join(bad), file=sys.stderr)
    return 1 if bad else 0


if __name__ == "__main__":
    sys.exit(main())

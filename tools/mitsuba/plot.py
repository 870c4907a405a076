"""Draws time_error.csv as time_error.svg: `python3 tools/mitsuba/plot.py`. Needs nothing but Python.

A panel a scene, both axes logarithmic. Dashed lines go on as 1/sqrt(time) from the last run of the
path tracer, down to lumel's smallest error: what it would take. Also prints, as a table, the CPU
seconds that each program needs for some errors, by straight lines between its runs in logarithms.
"""

import csv
import math
from pathlib import Path

COLUMNS = ["scene", "program", "setting", "cpu_seconds", "rms_error", "against_path_tracing",
           "noise_of_that"]
COLOURS = {"lumel": "#0a6ebd", "mitsuba": "#c8511b"}
NAMES = {"lumel": "lumel", "mitsuba": "Mitsuba 3, path"}
TITLES = {"cornell": "Cornell box", "room": "room", "paper": "the paper's surface"}

# Pixels: of a panel, and around it.
WIDTH, HEIGHT, LEFT, TOP, BOTTOM, GAP = 270, 250, 84, 34, 46, 36


def curves(path):
    """Points (seconds, error) by scene and program, in the order of the file."""
    found = {}
    with open(path, newline="") as file:
        for row in csv.DictReader(file):
            point = float(row["cpu_seconds"]), float(row["rms_error"])
            found.setdefault(row["scene"], {}).setdefault(row["program"], []).append(point)
    return found


def slope(points):
    """Exponent q of error ~ time^q, by least squares in logarithms."""
    logs = [(math.log(t), math.log(e)) for t, e in points if e > 0]
    mt, me = (sum(v) / len(logs) for v in zip(*logs))
    below = sum((t - mt) ** 2 for t, _ in logs)
    return sum((t - mt) * (e - me) for t, e in logs) / below if below > 0 else math.nan


def seconds(points, error, program):
    """CPU seconds for an error, in words: `<` where the coarsest run is better, `(...)` where it is
    what 1/sqrt(time) from the path tracer's last run says, nothing where lumel was not run so far."""
    points = [p for p in points if p[1] > 0]
    if points[0][1] <= error:
        return f"< {points[0][0]:.2g}"
    for (t0, e0), (t1, e1) in zip(points, points[1:]):
        if e1 <= error < e0:
            share = math.log(e0 / error) / math.log(e0 / e1)
            return f"{t0 * (t1 / t0) ** share:.3g}"
    t, e = points[-1]
    return f"({float(f'{t * (e / error) ** 2:.2g}'):,.0f})" if program == "mitsuba" else ""


def table(path, errors=(1e-2, 1e-3, 3e-4)):
    """CPU seconds for these errors, as Markdown."""
    heads = [f"{NAMES[p]}, {100 * e:g} %" for e in errors for p in ("lumel", "mitsuba")]
    lines = ["| scene | " + " | ".join(heads) + " |", "|---" * (1 + len(heads)) + "|"]
    for scene, programs in curves(path).items():
        cells = [seconds(programs[p], e, p) for e in errors for p in ("lumel", "mitsuba")]
        lines.append(f"| {TITLES.get(scene, scene)} | " + " | ".join(cells) + " |")
    return "\n".join(lines)


def decades(low, high):
    return range(math.floor(math.log10(low)), math.ceil(math.log10(high)) + 1)


def text(x, y, words, anchor="middle", size=12, colour="#333", turn=None):
    turned = f' transform="rotate(-90 {x:.1f} {y:.1f})"' if turn else ""
    return (f'<text x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}" font-size="{size}" '
            f'fill="{colour}"{turned}>{words}</text>')


def power(k):
    small = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
    return {-2: "0.01", -1: "0.1", 0: "1", 1: "10", 2: "100"}.get(k, "10" + str(k).translate(small))


def percent(k):
    """10^k as a percentage."""
    return f"{100 * 10.0**k:g} %"


def picture(path):
    """The SVG text of a table."""
    found = curves(path)
    every = [p for programs in found.values() for c in programs.values() for p in c if p[1] > 0]
    # To where the path tracer's lines are drawn on.
    further = []
    for programs in found.values():
        if {"mitsuba", "lumel"} <= programs.keys():
            t, e = programs["mitsuba"][-1]
            least = min(e for _, e in programs["lumel"] if e > 0)
            further.append((t * (e / least) ** 2, least))
    times = decades(min(t for t, _ in every), max(t for t, _ in every + further))
    errors = decades(min(e for _, e in every), max(e for _, e in every))

    def at(panel, point):
        x = (math.log10(point[0]) - times[0]) / (times[-1] - times[0])
        y = (math.log10(point[1]) - errors[0]) / (errors[-1] - errors[0])
        return LEFT + panel * (WIDTH + GAP) + x * WIDTH, TOP + (1 - y) * HEIGHT

    width = LEFT + len(found) * (WIDTH + GAP) + GAP
    out = [f'<svg xmlns="http://www.w3.org/2000/svg" width="{width}" height="{TOP + HEIGHT + BOTTOM}" '
           'font-family="sans-serif">', '<rect width="100%" height="100%" fill="white"/>']
    for panel, (scene, programs) in enumerate(found.items()):
        middle = LEFT + panel * (WIDTH + GAP) + WIDTH / 2
        out.append(text(middle, TOP - 14, TITLES.get(scene, scene), size=14))
        for k in times:
            x, bottom = at(panel, (10.0**k, 10.0 ** errors[0]))
            out.append(f'<path d="M{x:.1f} {TOP}V{bottom:.1f}" stroke="#ddd"/>')
            if (times[-1] - k) % 2 == 0 or len(times) < 7:
                out.append(text(x, bottom + 16, power(k)))
        for k in errors:
            x, y = at(panel, (10.0 ** times[0], 10.0**k))
            out.append(f'<path d="M{x:.1f} {y:.1f}h{WIDTH}" stroke="#ddd"/>')
            if panel == 0:
                out.append(text(x - 6, y + 4, percent(k), "end"))
        out.append(text(middle, TOP + HEIGHT + 36, "CPU seconds"))
        for number, (program, points) in enumerate(programs.items()):
            colour = COLOURS[program]
            places = [at(panel, p) for p in points if p[1] > 0]
            line = "M" + "L".join(f"{x:.1f} {y:.1f}" for x, y in places)
            out.append(f'<path d="{line}" fill="none" stroke="{colour}" stroke-width="2"/>')
            out += [f'<circle cx="{x:.1f}" cy="{y:.1f}" r="3" fill="{colour}"/>' for x, y in places]
            if program == "mitsuba" and "lumel" in programs:
                t, e = points[-1]
                least = min(e for _, e in programs["lumel"] if e > 0)
                (x0, y0), (x1, y1) = at(panel, (t, e)), at(panel, (t * (e / least) ** 2, least))
                out.append(f'<path d="M{x0:.1f} {y0:.1f}L{x1:.1f} {y1:.1f}" stroke="{colour}" '
                           'stroke-dasharray="3 4"/>')
            words = f"{NAMES[program]}: error ~ time^{slope(points):.2f}".replace("-", "−")
            x = LEFT + panel * (WIDTH + GAP) + WIDTH - 6
            out.append(text(x, TOP + 16 + 16 * number, words, "end", 11, colour))
    out.append(text(14, TOP + HEIGHT / 2, "RMS error of irradiance / mean", turn=True))
    return "\n".join(out) + "\n</svg>\n"


if __name__ == "__main__":
    here = Path(__file__).resolve().parent
    (here / "time_error.svg").write_text(picture(here / "time_error.csv"))
    print(table(here / "time_error.csv"))

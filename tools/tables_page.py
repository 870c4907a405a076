#!/usr/bin/env python3
"""Markdown tables, printed beside computed, from `lumel reference --json` (one object a line).

    lumel reference --max-n 40960 --json > tables.jsonl
    python3 tools/tables_page.py tables.jsonl [more.jsonl ...]
"""

import json
import sys

COUNTS = {"sigma_G", "sigma_N", "sigma_F"}


def shown(value, quantity):
    """A number as the paper would print it."""
    if value is None:
        return "-"
    if quantity == "seconds_per_iteration":
        return f"{value:.3g}"
    mantissa, exponent = f"{value:.2e}".split("e")
    return f"{mantissa}e{int(exponent)}"


def column(row):
    """What the columns of a table differ in."""
    return (row["eta"] or 0, row["order"] or 0, row["quantity"] == "seconds_per_iteration")


def title(key):
    eta, order, seconds = key
    words = [f"eta {eta:g}"] * (eta > 0) + [f"order {order}"] * (order > 0) + ["s"] * seconds
    return ", ".join(words) or "error"


def page(rows):
    tables = {}
    for row in rows:
        tables.setdefault(row["table"], []).append(row)
    for name in sorted(tables, key=lambda name: int(name.split(".")[1])):
        here = tables[name]
        if here[0]["quantity"] in COUNTS:
            equal = sum(row["printed"] == row["computed"] for row in here)
            print(f"\nTable {name}: {equal} of {len(here)} printed counts equal.")
            continue
        here = [row for row in here if row["quantity"] != "ratio"]
        keys = sorted({column(row) for row in here})
        cells = {(row["n"], column(row)): row for row in here}
        print(f"\nTable {name} (printed / computed)\n")
        print("| n | " + " | ".join(map(title, keys)) + " |")
        print("|---" * (len(keys) + 1) + "|")
        for n in sorted({row["n"] for row in here}):
            line = []
            for key in keys:
                row = cells.get((n, key))
                values = (row["printed"], row["computed"]) if row else (None, None)
                quantity = row["quantity"] if row else ""
                line.append(" / ".join(shown(value, quantity) for value in values))
            print(f"| {n} | " + " | ".join(line) + " |")


def main():
    rows = {}
    for path in sys.argv[1:]:
        with open(path, encoding="utf-8") as lines:
            for line in lines:
                row = json.loads(line)
                key = tuple(row[k] for k in ("table", "n", "eta", "order", "quantity"))
                rows[key] = row
    if not rows:
        sys.exit(__doc__)
    page(rows.values())


if __name__ == "__main__":
    main()

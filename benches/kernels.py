"""Kernels beside their plain forms and other libraries, as a table of GFLOP/s and shares of the multiply-add peak.

    python3 benches/kernels.py OUT.md [--only FILTER]

Runs `cargo bench -p phyture-kernels`, which measures the peak first, and reads what criterion kept of it. A share is of the peak of one
thread at the level of the run. Kernels whose operations are elements and not multiplications have their rate in 10⁹ elements a second.
"""

import argparse
import json
import pathlib
import re
import subprocess
import time

ROOT = pathlib.Path(__file__).resolve().parents[1]
# Kernels that are counted in floating-point operations; the others in elements.
PRODUCTS = ("gemm", "conv1d", "attention")
OTHERS = ["plain", "reference", "matrixmultiply", "gemm"]


def run(only):
    command = ["cargo", "bench", "-p", "phyture-kernels", "--bench", "kernels", "--", *([only] if only else [])]
    output = subprocess.run(command, cwd=ROOT, check=True, stdout=subprocess.PIPE, text=True).stdout
    return re.search(r"multiply-add peak at level (\w+): ([\d.]+) GFLOP/s", output).groups()


def estimates(folder, since):
    """What criterion kept of the benches that were run after a time; it also holds those of earlier runs."""
    for path in folder.glob("**/new/benchmark.json"):
        if path.stat().st_mtime < since:
            continue
        about = json.loads(path.read_text())
        nanoseconds = json.loads((path.parent / "estimates.json").read_text())["median"]["point_estimate"]
        _, name, shape = about["group_id"].split("/")
        yield (name, shape), about["function_id"], about["throughput"]["Elements"] / nanoseconds


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out", type=pathlib.Path)
    parser.add_argument("--only", help="part of the ids, as cargo bench takes it")
    arguments = parser.parse_args()
    start = time.time()
    level, peak = run(arguments.only)
    rows = {}
    for kernel, contender, rate in estimates(ROOT / "target" / "criterion", start):
        rows.setdefault(kernel, {})[contender] = rate
    lines = [f"Level {level}, multiply-add peak {peak} GFLOP/s of one thread, measured in the same run.", "",
             f"| kernel | shape | {level} | share of the peak | " + " | ".join(OTHERS) + " |", "| --- | --- |" + " ---: |" * (2 + len(OTHERS))]
    for (name, shape), rates in sorted(rows.items()):
        own = rates.get(level)
        if own is None:
            continue
        share = f"{100 * own / float(peak):.0f} %" if name.startswith(PRODUCTS) else "–"
        others = [f"{rates[other]:.1f}" if other in rates else "–" for other in OTHERS]
        lines.append(f"| {name} | {shape} | {own:.1f} | {share} | " + " | ".join(others) + " |")
    arguments.out.write_text("\n".join(lines) + "\n")
    print("\n".join(lines))


if __name__ == "__main__":
    main()

"""Training steps and forward passes of Phy-Ture beside two other Rust frameworks, candle and burn, on this machine, in turn.

    python3 benches/peers/rust.py OUT [--rounds 1] [--repeats 2] [--only "no dropout"]

Builds the programs of `rust/` under target/, for this machine's processor and with AVX-512, and this project's own row as it is
delivered; then does as `run.py` beside it: every row in a process of its own, one after another, ROUNDS times. Writes OUT.json and
OUT.md. Not part of `run.py`, for a step of these frameworks takes many seconds.
"""

import argparse
import json
import os
import pathlib
import platform
import shutil
import subprocess
import sys

# No compiled copy of run.py in the tree.
sys.dont_write_bytecode = True
import run

FOLDER = run.ROOT / "target" / "peers-rust"
# Title, program, case, tuned memory (never). Within a group all are compared with the first.
CASES = {"training step, dropout 0.2": ("dropout", "0.2"), "training step, no dropout": ("nodropout", "0"), "forward pass": ("forward", "forward")}
GROUPS = {
    title: [("phyture", "phyture", own, False), ("candle", "candle", case, False), ("burn, Flex", "burn", case, False)]
    for title, (own, case) in CASES.items()
}


def other_program():
    # Built from a copy: the lock file stays out of the tree.
    source = FOLDER / "source"
    shutil.copytree(run.HERE / "rust", source, dirs_exist_ok=True)
    variables = {**os.environ, "RUSTFLAGS": "-C target-cpu=native", "CARGO_TARGET_DIR": str(FOLDER)}
    subprocess.run(["cargo", "build", "--release"], check=True, cwd=source, env=variables)
    return FOLDER / "release" / "peers-rust"


def measure(other, own, row, threads, batch, history, repeats):
    if row[1] == "phyture":
        return own_measure(other, own, row, threads, batch, history, repeats)
    command = [str(part) for part in (other, row[1], row[2], threads, batch, history, repeats)]
    variables = {**os.environ, "RAYON_NUM_THREADS": str(threads)}
    done = subprocess.run(command, env=variables, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    if done.returncode != 0:
        print(f"  {row[0]}: {done.stderr.strip().splitlines()[-1:]}", file=sys.stderr)
        return None
    return json.loads(done.stdout)


# run.compare() starts its rows through this name.
own_measure, run.measure = run.measure, measure


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out")
    parser.add_argument("--rounds", type=int, default=1)
    parser.add_argument("--repeats", type=int, default=2)
    parser.add_argument("--only", action="append", help="those tables whose title holds this text")
    options = parser.parse_args()
    other, own = other_program(), run.own_program()
    record, lines = {}, []
    tables = [(title, rows, os.cpu_count(), run.BATCH) for title, rows in GROUPS.items()] + [("latency", GROUPS["forward pass"], 1, 1)]
    for name, rows, threads, batch in tables:
        if options.only and not any(text in name for text in options.only):
            continue
        title = f"{name}: history {run.HISTORY}, batch {batch}, threads {threads}"
        print(title, file=sys.stderr)
        record[title] = run.compare(other, own, rows, threads, batch, run.HISTORY, options.rounds, options.repeats)
        lines.extend(run.table(title, record[title]))
    results = [result for found in record.values() for results in found.values() for result in results]
    if len({result["parameters"] for result in results}) > 1:
        sys.exit("the programs do not have the same number of parameters")
    versions = sorted({result["version"] for result in results})
    processor = next((line.split(":")[1].strip() for line in open("/proc/cpuinfo") if line.startswith("model name")), platform.processor())
    head = [f"{processor}, {os.cpu_count()} cores; {'; '.join(versions)}; {options.rounds} rounds of {options.repeats} steps each, rows in turn.", ""]
    pathlib.Path(options.out + ".json").write_text(json.dumps(record, indent=1))
    pathlib.Path(options.out + ".md").write_text("\n".join([*head, *lines]))
    print("\n".join([*head, *lines]))


if __name__ == "__main__":
    main()

"""Training steps and forward passes of Phy-Ture beside two other Rust frameworks, candle and burn, on this machine, in turn.

    python3 benches/peers/rust.py OUT [--rounds 1] [--repeats 2] [--only "no dropout"]

Builds the programs of `rust/` under target/, for this machine's processor and with AVX-512, and this project's own row as it is
delivered; then does as `run.py` beside it: every row in a process of its own, one after another, ROUNDS times. Writes OUT.json and
OUT.md. Not part of `run.py`, for a step of these frameworks takes many seconds.
"""

import argparse
import os
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


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out")
    parser.add_argument("--rounds", type=int, default=1)
    parser.add_argument("--repeats", type=int, default=2)
    parser.add_argument("--only", action="append", help="those tables whose title holds this text")
    options = parser.parse_args()
    other = other_program()
    programs = {"phyture": [run.own_program()], "candle": [other, "candle"], "burn": [other, "burn"]}
    record, lines = {}, []
    tables = [(title, rows, os.cpu_count(), run.BATCH) for title, rows in GROUPS.items()] + [("latency", GROUPS["forward pass"], 1, 1)]
    for name, rows, threads, batch in tables:
        if options.only and not any(text in name for text in options.only):
            continue
        title = f"{name}: history {run.HISTORY}, batch {batch}, threads {threads}"
        print(title, file=sys.stderr)
        record[title] = run.compare(programs, rows, threads, batch, run.HISTORY, options.rounds, options.repeats)
        lines.extend(run.table(title, record[title]))
    results = [result for found in record.values() for results in found.values() for result in results]
    if len({result["parameters"] for result in results}) > 1:
        sys.exit("the programs do not have the same number of parameters")
    run.report(options, record, lines)


if __name__ == "__main__":
    main()

"""Training steps and forward passes of Phy-Ture beside other programs, on this machine, in turn.

    python3 benches/peers/run.py OUT [--rounds 3] [--repeats 5] [--sizes | --only-sizes] [--peers | --only-peers] [--without jax]
                                   [--only "no dropout"] [--only timemixer]

Makes a virtual environment under target/ with the pinned versions below, builds this project's own row, and starts every row in a
process of its own, one after another, ROUNDS times: so that whatever else the machine does hits all alike. Writes OUT.json (every
time of every step) and OUT.md (medians, ranges, ratios). Rows that this project loses are marked, not left out.
"""

import argparse
import json
import os
import pathlib
import platform
import statistics
import subprocess
import sys

HERE = pathlib.Path(__file__).resolve().parent
ROOT = HERE.parents[1]
VERSIONS = ["torch==2.15.0", "numpy==2.4.6", "jax==0.10.2"]
# glibc keeps freed memory and asks for huge pages: what an expert sets before starting PyTorch.
TUNED = {"MALLOC_TOP_PAD_": "4294967296", "MALLOC_MMAP_THRESHOLD_": "4294967296", "MALLOC_TRIM_THRESHOLD_": "8589934592",
         "GLIBC_TUNABLES": "glibc.malloc.hugetlb=1"}
HISTORY, BATCH = 1000, 32
# What fits into minutes and is trained most.
SHORT_HISTORY = 128
# Operations of a training step of Phy-Ture at these sizes, as its sums stand: convolutions 76, attention 29 (scores twice), linear maps 3.
STEP_GFLOP = 108

# Title, program, case, tuned memory. Within a group all are compared with the first.
GROUPS = {
    "training step, dropout 0.2": [
        ("phyture", "phyture", "dropout", False),
        ("PyTorch, stored attention map", "torch", "naive-0.2", False),
        ("PyTorch, fused attention", "torch", "fused-0.2", False),
        ("PyTorch, stored map, tuned memory", "torch", "naive-0.2", True),
        ("PyTorch, fused attention, tuned memory", "torch", "fused-0.2", True),
        ("PyTorch, byte masks, recomputed attention, tuned memory", "torch", "expert-0.2", True),
        ("JAX, jit", "jax", "0.2", True),
    ],
    "training step, no dropout": [
        ("phyture", "phyture", "nodropout", False),
        ("PyTorch, stored attention map", "torch", "naive-0", False),
        ("PyTorch, fused attention", "torch", "fused-0", False),
        ("PyTorch, fused attention, tuned memory", "torch", "fused-0", True),
        ("JAX, jit", "jax", "0", True),
    ],
    "forward pass": [
        ("phyture", "phyture", "forward", False),
        ("PyTorch, stored attention map", "torch", "forward-naive", False),
        ("PyTorch, fused attention", "torch", "forward-fused", False),
        ("PyTorch, fused attention, tuned memory", "torch", "forward-fused", True),
        ("JAX, jit", "jax", "forward", True),
    ],
}
# Histories and batches beside each other; a history is a multiple of 8. PyTorch's attention maps of a batch of 128 at history 1000 take 14 GB.
SIZES = [(248, 32), (504, 32), (1000, 32), (2000, 32), (1000, 1), (1000, 4), (1000, 16), (1000, 128)]
# The peer networks at their own sizes, without dropout. PyTorch's Informer here attends to every key (fused), ours to those it samples.
PEERS = ["cnn", "cnn_lstm", "tcn", "timesnet", "timemixer", "dlinear", "informer"]
# Batch 1 on one thread.
LATENCY = GROUPS["forward pass"]


def environment(name="peers-venv", versions=VERSIONS):
    folder = ROOT / "target" / name
    python = folder / "bin" / "python"
    if not python.exists():
        subprocess.run([sys.executable, "-m", "venv", folder], check=True)
    subprocess.run([python, "-m", "pip", "install", "--quiet", *versions], check=True)
    return python


def own_program(bench="peers", features=()):
    command = ["cargo", "bench", *features, "--bench", bench, "--no-run", "--message-format=json"]
    lines = subprocess.run(command, check=True, cwd=ROOT, stdout=subprocess.PIPE, text=True).stdout.splitlines()
    return [json.loads(line)["executable"] for line in lines if f'"{bench}"' in line and '"executable":"' in line][-1]


def processor():
    return next((line.split(":")[1].strip() for line in open("/proc/cpuinfo") if line.startswith("model name")), platform.processor())


def measure(programs, row, threads, batch, history, repeats):
    """Starts a row's program, whose name stands for the start of its command in `programs`."""
    _, program, case, tuned = row
    command = [str(part) for part in (*programs[program], case, threads, batch, history, repeats)]
    count = {name: str(threads) for name in ("OMP_NUM_THREADS", "RAYON_NUM_THREADS")}
    variables = {**os.environ, **count, **(TUNED if tuned else {})}
    done = subprocess.run(command, env=variables, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    if done.returncode != 0:
        print(f"  {row[0]}: {done.stderr.strip().splitlines()[-1:]}", file=sys.stderr)
        return None
    return json.loads(done.stdout.strip().splitlines()[-1])


def compare(programs, rows, threads, batch, history, rounds, repeats):
    found = {row[0]: [] for row in rows}
    for turn in range(rounds):
        for row in rows:
            result = measure(programs, row, threads, batch, history, repeats)
            if result:
                found[row[0]].append(result)
                print(f"  round {turn + 1}: {row[0]}: {statistics.median(result['seconds']):.4f} s", file=sys.stderr)
    return found


def table(title, found):
    lines = [f"### {title}", "", "| | median, s | range, s | times phyture | peak memory, MiB |", "| --- | ---: | ---: | ---: | ---: |"]
    own = statistics.median(second for result in found["phyture"] for second in result["seconds"])
    for name, results in found.items():
        if not results:
            lines.append(f"| {name} | did not run | | | |")
            continue
        seconds = [second for result in results for second in result["seconds"]]
        median, ratio = statistics.median(seconds), statistics.median(seconds) / own
        memory = max(result["peak_mib"] for result in results)
        lost = " (faster)" if ratio < 1 else ""
        lines.append(f"| {name} | {median:.4f} | {min(seconds):.4f}–{max(seconds):.4f} | {ratio:.2f}{lost} | {memory:.0f} |")
    return [*lines, ""]


def share_of_peak(found):
    """Of the peak that as many threads reach together, measured in the same processes before and after the steps."""
    shares = [100 * STEP_GFLOP / statistics.median(result["seconds"]) / statistics.mean(result["peak_gflops"]) for result in found["phyture"]]
    peaks = [peak for result in found["phyture"] for peak in result["peak_gflops"]]
    return [f"phyture: {STEP_GFLOP} GFLOP a step, {statistics.median(shares):.0f} % ({min(shares):.0f}–{max(shares):.0f}) of the peak of all "
            f"threads together, {min(peaks):.0f}–{max(peaks):.0f} GFLOP/s.", ""]


def size_row(history, batch, pair):
    own, other = ([second for result in results for second in result["seconds"]] for results in pair)
    own = statistics.median(own)
    there = f"{statistics.median(other):.4f} | {statistics.median(other) / own:.2f}" if other else "did not run |"
    return f"| {history} | {batch} | {own:.4f} | {1e3 * own / batch:.2f} | {there} |"


def report(options, record, lines):
    """Writes every time of every step, and the tables under a line that says on what and with what they were measured."""
    results = [result for found in record.values() for results in found.values() for result in results]
    own = [result for found in record.values() for result in found["phyture"]]
    head = [f"{processor()}, {os.cpu_count()} cores, level {own[0]['level']}, {max(result['peak_gflops_alone'] for result in own):.0f} GFLOP/s of "
            f"multiply-adds on one core; {'; '.join(sorted({result['version'] for result in results}))}; {options.rounds} rounds of "
            f"{options.repeats} steps each, rows in turn.", ""]
    pathlib.Path(options.out + ".json").write_text(json.dumps(record, indent=1))
    pathlib.Path(options.out + ".md").write_text("\n".join([*head, *lines]))
    print("\n".join([*head, *lines]))


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out")
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--repeats", type=int, default=5)
    parser.add_argument("--sizes", action="store_true", help="also histories 248 to 2000 and batches 1 to 128")
    parser.add_argument("--only-sizes", action="store_true", help="these histories and batches and nothing else")
    parser.add_argument("--peers", action="store_true", help="also a training step of every peer network beside PyTorch")
    parser.add_argument("--only-peers", action="store_true", help="the peer networks and nothing else")
    parser.add_argument("--without", action="append", default=[], help="leave a program out: torch or jax")
    parser.add_argument("--only", action="append", help="tables whose title, or network, holds this text")
    options = parser.parse_args()
    python = environment()
    programs = {"phyture": [own_program()], **{name: [python, HERE / f"{name}_step.py"] for name in ("torch", "jax")}}
    keep = lambda rows: [row for row in rows if row[1] not in options.without]
    wanted = lambda title: not options.only or any(text in title for text in options.only)
    threads, record, lines = os.cpu_count(), {}, []

    def add(title, rows, threads, batch, history):
        print(title, file=sys.stderr)
        record[title] = compare(programs, keep(rows), threads, batch, history, options.rounds, options.repeats)
        lines.extend(table(title, record[title]))

    if not options.only_peers and not options.only_sizes:
        main_tables = [(title, rows, threads, BATCH, HISTORY) for title, rows in GROUPS.items()] + [("latency", LATENCY, 1, 1, HISTORY)]
        main_tables += [(title, rows, threads, BATCH, SHORT_HISTORY) for title, rows in GROUPS.items() if title.startswith("training")]
        for title, rows, count, batch, history in main_tables:
            whole_title = f"{title}: history {history}, batch {batch}, threads {count}"
            if wanted(whole_title):
                add(whole_title, rows, count, batch, history)
                if title.startswith("training") and history == HISTORY:
                    lines.extend(share_of_peak(record[whole_title]))
    for kind in filter(wanted, PEERS) if options.peers or options.only_peers else []:
        rows = [("phyture", "phyture", f"peer-{kind}", False), ("PyTorch", "torch", f"peer-{kind}", False),
                ("PyTorch, tuned memory", "torch", f"peer-{kind}", True)]
        add(f"{kind}, training step: history {HISTORY}, batch {BATCH}, {threads} threads", rows, threads, BATCH, HISTORY)
    for title, rows in GROUPS.items() if options.sizes or options.only_sizes else []:
        if not wanted(title):
            continue
        pair = [rows[0], next(row for row in rows if row[2] in ("naive-0.2", "fused-0", "forward-fused"))]
        lines += [f"### {title}, {threads} threads: medians, s", "", f"| history | batch | phyture | a window, ms | {pair[1][0]} | times phyture |",
                  "| ---: | ---: | ---: | ---: | ---: | ---: |"]
        for history, batch in SIZES:
            size = f"{title}: history {history}, batch {batch}"
            print(size, file=sys.stderr)
            record[size] = compare(programs, keep(pair), threads, batch, history, options.rounds, options.repeats)
            lines.append(size_row(history, batch, [record[size].get(row[0], []) for row in pair]))
        lines.append("")
    report(options, record, lines)


if __name__ == "__main__":
    main()

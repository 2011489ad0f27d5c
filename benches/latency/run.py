"""Latency of a prediction in flight, beside PyTorch and ONNX Runtime on the same network with the same weights, on this machine.

    python3 benches/latency/run.py OUT [--seconds 60]

Every row is a process of its own on one core, fed at 100 Hz in real time for SECONDS, while another process keeps a second core busy where there
is one. The rows of this project are the whole prediction: physics with the whole catalogue, network, interval, envelope. Those of the others are
the network alone, called on a history that is there already; they load the weights and a window that the first row leaves behind, and a row whose output
is another fails. Writes OUT.json (every time) and OUT.md. Rows that this project loses are marked.
"""

import argparse
import json
import os
import pathlib
import subprocess
import sys
import tempfile

HERE = pathlib.Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parent / "peers"))
import run as peers  # noqa: E402

VERSIONS = ["torch==2.15.0", "numpy==2.4.6", "onnx==1.23.2", "onnxscript==0.7.2", "onnxruntime==1.32.0", "safetensors==0.8.0"]
# History, width, levels of the trees.
SIZES = [(1000, 64, 3), (100, 16, 2)]


def measure(name, command):
    """Runs a row on the first core; what it prints last is its result."""
    one_thread = {count: "1" for count in ("OMP_NUM_THREADS", "RAYON_NUM_THREADS")}
    done = subprocess.run(["taskset", "-c", "0", *map(str, command)], env={**os.environ, **one_thread}, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
                          text=True)
    if done.returncode != 0:
        print(f"  {name}: {done.stderr.strip().splitlines()[-1:]}", file=sys.stderr)
        return None
    result = json.loads(done.stdout.strip().splitlines()[-1])
    print(f"  {name}: p50 {1e3 * quantile(result['seconds'], 0.5):.3f} ms, p99 {1e3 * quantile(result['seconds'], 0.99):.3f} ms", file=sys.stderr)
    return result


def quantile(seconds, level):
    ordered = sorted(seconds)
    return ordered[min(len(ordered) - 1, int(level * len(ordered)))]


def table(title, found):
    lines = [f"### {title}", "", "| | p50, ms | p99, ms | longest, ms | times phyture (p50) | memory, MiB |", "| --- | ---: | ---: | ---: | ---: | ---: |"]
    own = quantile(found["phyture, whole prediction"]["seconds"], 0.5)
    for name, result in found.items():
        if result is None:
            lines.append(f"| {name} | did not run | | | | |")
            continue
        p50, p99, longest = (quantile(result["seconds"], level) for level in (0.5, 0.99, 1.0))
        lost = " (faster)" if p50 < own and not name.startswith("phyture") else ""
        memory = result.get("stream_mib") or result.get("resident_mib")
        lines.append(f"| {name} | {1e3 * p50:.3f} | {1e3 * p99:.3f} | {1e3 * longest:.3f} | {p50 / own:.2f}{lost} | {memory:.0f} |" if memory else
                     f"| {name} | {1e3 * p50:.4f} | {1e3 * p99:.4f} | {1e3 * longest:.4f} | | |")
    return [*lines, ""]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out")
    parser.add_argument("--seconds", type=int, default=60)
    options = parser.parse_args()
    python = peers.environment("latency-venv", VERSIONS)
    program = peers.own_program("latency", ["--features", "sim"])
    folder = tempfile.TemporaryDirectory()
    busy = subprocess.Popen(["taskset", "-c", "1", sys.executable, "-c", "while True: pass"]) if os.cpu_count() > 1 else None
    record, lines = {}, []
    try:
        for history, width, levels in SIZES:
            sizes = [history, width, options.seconds]
            title = f"history {history}, width {width}, {options.seconds} s at 100 Hz"
            print(title, file=sys.stderr)
            found = {"phyture, whole prediction": measure("phyture", [program, *sizes, 1, folder.name])}
            if found["phyture, whole prediction"] is None:
                sys.exit("this project's own row did not run")
            found["phyture, physics alone (whole catalogue)"] = {"seconds": found["phyture, whole prediction"]["physics_seconds"]}
            found["phyture, network at each 4th sample"] = measure("phyture, every 4th", [program, *sizes, 4])
            for case in ["naive", "fused", "compile", "onnx"]:
                name = {"naive": "PyTorch, stored attention map, inference_mode", "fused": "PyTorch, fused attention, inference_mode",
                        "compile": "PyTorch, torch.compile, inference_mode", "onnx": "ONNX Runtime"}[case]
                found[name] = measure(name, [python, HERE / "other.py", case, history, width, levels, options.seconds, folder.name])
            record[title] = found
            lines += table(title, found)
    finally:
        if busy:
            busy.kill()
        folder.cleanup()
    versions = sorted({result["version"] for found in record.values() for result in found.values() if result and "version" in result})
    others = [result for found in record.values() for result in found.values() if result and "difference" in result]
    furthest = max((result["difference"] for result in others), default=0.0)
    head = [f"{peers.processor()}, one core of {os.cpu_count()}, another kept busy; {'; '.join(versions)}. The same weights: outputs differ by at most "
            f"{furthest:.0e} of the largest. Memory: of phyture what the stream takes, of the others the whole process.", ""]
    pathlib.Path(options.out + ".json").write_text(json.dumps(record, indent=1))
    pathlib.Path(options.out + ".md").write_text("\n".join([*head, *lines]))
    print("\n".join([*head, *lines]))


if __name__ == "__main__":
    main()

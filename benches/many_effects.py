#!/usr/bin/env python3
"""Many effects missing at once: simulates, runs `phyture loop`, and prints the rows of the table "Tested with much missing at once" of docs/results.md.

    cargo build --release --features cli
    python3 benches/many_effects.py target/release/phyture OUT [--formulas] [SEED...]

A row for each seed, or for all that are reported: of 83001 to 83003 all mechanisms of the simulator are missing in 30 minutes, of 83010 in 7376 s, of 83400 to 83401
three of random size, of 83700 to 83701 six, of 84300 to 84301 twelve. A seed with `=N` behind it is a development run of N effects, 0 being all.
`--formulas` goes on to the loop, whose formulas are counted apart. What is there already in OUT is not run again. Nothing is timed that other work on the machine does not slow down.
"""

import json
import os
import random
import re
import subprocess
import sys
import time
from pathlib import Path

CHANNELS = ["vx_dot", "vy_dot", "vz_dot", "wx_dot", "wy_dot", "wz_dot"]
REPORTED = {83001: 0, 83002: 0, 83003: 0, 83010: -1, 83400: 3, 83401: 3, 83700: 6, 83701: 6, 84300: 12, 84301: 12}
WORTH = 0.02


def effects():
    """The effects that the simulator and the catalogue share, in the order of the single-effect benchmark."""
    text = (Path(__file__).parent / "hidden_effect" / "cases.rs").read_text()
    singles = text[text.index("pub const SINGLES") : text.index("/// Removable shares aimed at")]
    return re.findall(r'(?:fixed\(|dynamic\(|id: )"([a-z_]+)"', singles)


def drawn(seed, count):
    """Effects with their scales; a vortex ring beyond 1.2 lets the simulated machine fall."""
    source = random.Random(seed)
    scales = {}
    for effect in source.sample(effects(), count):
        scale = source.uniform(0.6, 1.4)
        scales[effect] = min(scale, 1.2) if effect == "vortex_ring" else scale
    return scales


def run(command):
    """Peak memory, MB, and time, s."""
    start = time.monotonic()
    child = subprocess.Popen([str(word) for word in command], stdout=subprocess.DEVNULL)
    _, status, usage = os.wait4(child.pid, 0)
    if os.waitstatus_to_exitcode(status) not in (0, 3):
        sys.exit(f"{command} failed")
    return usage.ru_maxrss / 1000, time.monotonic() - start


def case(binary, folder, seed, count, options):
    """The result of a seed, from its file if it is there."""
    kept = folder / f"{seed}.json"
    if kept.exists():
        return json.loads(kept.read_text())
    flights, floor, amended = folder / f"{seed}", folder / f"{seed}-floor", folder / f"{seed}.toml"
    scales = drawn(seed, count) if count > 0 else {effect: 1.0 for effect in effects()}
    size = ["--like", "stanford"] if count < 0 else ["--minutes", "30"]
    hidden = [word for effect, scale in scales.items() for word in ("--hide", f"{effect}={scale:.3f}")] if count > 0 else []
    level = ["--level", "2"] if count > 0 else []
    run([binary, "simulate", flights, "--explainable", floor, "--seed", seed, "--force", "--quiet", *size, *hidden, *level])
    answer = folder / f"{seed}-loop.json"
    loop = [binary, "loop", flights, "-m", flights / "model.toml", "-o", amended, "--explainable", floor, *options]
    memory, seconds = run([*loop, "--json", answer, "--force", "--quiet"])
    document = json.loads(answer.read_text())
    if "together" not in document:
        return {"refused": document["summary"]}
    result = {"truth": scales, "memory_mb": memory, "seconds": seconds, **document["together"]}
    kept.write_text(json.dumps(result))
    return result


def row(seed, count, result):
    """The row of the table."""
    if "refused" in result:
        return f"| {count} missing | {seed} | refused: {result['refused']} |"
    formulas = {effect for effect in result["accepted"] if effect.startswith("suggested_")}
    truth, named = set(result["truth"]), set(result["accepted"]) - formulas
    rises = {entry["effect"]: max(entry["rise"].values()) for entry in result["worth"]}
    left = {entry["effect"]: max([*entry["held_out_mse_fall"].values(), 0.0]) for entry in result["candidates"] if entry["status"] != "accepted"}
    worth = {effect for effect in truth & named if rises.get(effect, 0.0) >= WORTH}
    missed = {effect for effect in truth - named if left.get(effect, 0.0) / (1.0 - left.get(effect, 0.0)) >= WORTH}
    removed = result["locked"]["removable_removed"]
    shown = " ".join("–" if removed.get(channel) is None else f"{100 * removed[channel]:.0f}" for channel in CHANNELS)
    bars = sum(1 for bar in result["locked"]["waterfall"] if bar.get("rises"))
    what = {0: "everything, 30 min", -1: "everything, 7376 s"}.get(count, f"{count} of random size")
    false = ", ".join(f"`{effect}`" for effect in sorted(named - truth)) or "0"
    return (
        f"| {what} | {seed} | {len(truth & named)} of {len(truth)} | {false} | {len(worth)} of {len(worth | missed)} | {shown} "
        f"| {100 * removed['mean']:.0f} | {bars} | {', '.join(sorted(formulas)) or 0} | {result['memory_mb']:.0f} MB | {result['seconds']:.0f} s |"
    )


def main():
    binary, folder, *chosen = sys.argv[1:]
    options = [word for word in chosen if word == "--formulas"]
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    pairs = [word.split("=") for word in chosen if word not in options]
    asked = {int(seed): int(count[0]) if count else REPORTED[int(seed)] for seed, *count in pairs} or REPORTED
    print("| missing | seed | named, right | not in the truth | of those worth 2 % | removable: vx vy vz wx wy wz, % | mean | bars that rise | formulas | memory | time |")
    print("| --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |")
    for seed, count in asked.items():
        print(row(seed, count, case(binary, folder, seed, count, options)), flush=True)


if __name__ == "__main__":
    main()

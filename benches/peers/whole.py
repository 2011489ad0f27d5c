"""A whole training run, from the logs to the last epoch, beside the same one written in PyTorch, on this machine, in turn.

    python3 benches/peers/whole.py OUT [--rounds 2] [--epochs 2] [--minutes 30]

Simulates and calibrates a data set under OUT (not timed). A row is one process: read the CSV files, compute the physics, cut windows of 128 samples
every tenth, train on 70 % of them in batches of 32 with Adam and dropout 0.2, look at the validation part after each epoch. The program is the released
one; the other is what a person writes with pandas, numpy and a DataLoader, the network of torch_step.py. Both have as many windows; which ones
differs. Prints wall time and peak memory of each row, and the time of the steps alone, by which the rest shows.
"""

import argparse
import json
import os
import pathlib
import resource
import statistics
import subprocess
import sys
import time

import run

HISTORY, STRIDE, BATCH = 128, 10, 32
STATES = ["vx", "vy", "vz", "wx", "wy", "wz", "u1", "u2", "u3", "u4", "g_x", "g_y", "g_z"]
TARGETS = ["vx_dot", "vy_dot", "vz_dot", "wx_dot", "wy_dot", "wz_dot"]
CONFIG = f"""inputs = {json.dumps(STATES)}
epochs = EPOCHS
stride = {STRIDE}

[network]
history = {HISTORY}
d_model = 64
state_channels = {len(STATES)}
dropout = 0.2
"""


def coefficients(path):
    import tomllib

    found = {}
    for effect in tomllib.loads(pathlib.Path(path).read_text())["effect"]:
        found.update({f"{effect['kind']}.{name}": value for name, value in effect.get("coefficients", {}).items()})
    return found


def accelerations(table, c, inertia):
    """The paper's baseline, a column for each target; gravity in body axes is among the inputs."""
    import numpy as np

    u, v, w = (np.stack([table[name] for name in names]) for names in (("u1", "u2", "u3", "u4"), ("vx", "vy", "vz"), ("wx", "wy", "wz")))
    i = inertia
    turning = np.stack([(i[1] - i[2]) / i[0] * w[1] * w[2], (i[2] - i[0]) / i[1] * w[2] * w[0], (i[0] - i[1]) / i[2] * w[0] * w[1]])
    axes = "xyz"
    gravity = np.stack([table[f"g_{axis}"] for axis in axes])
    linear = gravity + np.cross(v, w, axis=0) + np.stack([c[f"linear_drag.a_{axis}"] * v[k] for k, axis in enumerate(axes)])
    linear[2] += c["collective_thrust.c_z"] * u[3] + c["vertical_bias.d_z"]
    angular = turning + np.stack([c[f"rate_damping.b_{axis}"] * w[k] + c[f"control_moment.c_{axis}"] * u[k] + c[f"moment_bias.d_{axis}"]
                                  for k, axis in enumerate(axes)])
    return np.concatenate([linear, angular]).T


class Windows:
    """What a DataLoader asks for: the inputs and the physics of the last HISTORY samples, and the target of the last."""

    def __init__(self, flights, ends):
        self.flights, self.ends = flights, ends

    def __len__(self):
        return len(self.ends)

    def __getitem__(self, index):
        flight, end = self.ends[index]
        states, physics, targets = self.flights[flight]
        return states[end - HISTORY : end], physics[end - HISTORY : end], targets[end - 1 : end]


def in_torch(data, model, windows, validation, epochs):
    import tomllib

    import numpy as np
    import pandas
    import torch
    import torch_step

    torch.manual_seed(0)
    c, inertia = coefficients(model), tomllib.loads(pathlib.Path(model).read_text())["model"]["inertia"]
    flights = []
    for path in sorted(pathlib.Path(data).glob("*/*.csv")):
        table = pandas.read_csv(path)
        table["g_x"] = -9.80665 * np.sin(table["pitch"])
        table["g_y"] = 9.80665 * np.sin(table["roll"]) * np.cos(table["pitch"])
        table["g_z"] = 9.80665 * np.cos(table["roll"]) * np.cos(table["pitch"])
        physics, targets = accelerations(table, c, inertia), table[TARGETS].to_numpy()
        flights.append([table[STATES].to_numpy(), physics, targets - physics])
    for part in range(3):
        columns = np.concatenate([flight[part] for flight in flights])
        mean, deviation = columns.mean(axis=0), columns.std(axis=0) + 1e-9
        for flight in flights:
            flight[part] = torch.from_numpy(((flight[part] - mean) / deviation).astype(np.float32))
    ends = [(index, end) for index, flight in enumerate(flights) for end in range(HISTORY, len(flight[0]), STRIDE)]
    order = torch.randperm(len(ends)).tolist()
    chosen = [ends[index] for index in order]
    parts = Windows(flights, chosen[:windows]), Windows(flights, chosen[windows : windows + validation])
    torch_step.STATES = len(STATES)
    network = torch_step.PhyTure(HISTORY, 0.2, "fused")
    adam = torch.optim.Adam(network.parameters(), lr=1e-3)
    train = torch.utils.data.DataLoader(parts[0], batch_size=BATCH, shuffle=True)
    held = torch.utils.data.DataLoader(parts[1], batch_size=BATCH)
    steps = 0.0
    for _ in range(epochs):
        network.train()
        for states, physics, targets in train:
            start = time.perf_counter()
            loss = ((network(states, physics) - targets) ** 2).mean()
            adam.zero_grad()
            loss.backward()
            adam.step()
            steps += time.perf_counter() - start
        network.eval()
        with torch.no_grad():
            total = sum(float(((network(states, physics) - targets) ** 2).sum()) for states, physics, targets in held)
        print(f"validation {total / max(1, validation * len(TARGETS)):.3f}", file=sys.stderr)
    print(json.dumps({"steps_s": steps, "windows": len(parts[0]), "peak_mib": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024}))


def timed(command, variables=None):
    """Wall time, what it printed, and the peak memory of the process, MiB."""
    start = time.perf_counter()
    child = subprocess.Popen([str(part) for part in command], env={**os.environ, **(variables or {})}, stdout=subprocess.PIPE, text=True)
    said = child.stdout.read()
    _, status, usage = os.wait4(child.pid, 0)
    child.returncode = os.waitstatus_to_exitcode(status)
    if child.returncode != 0:
        sys.exit(f"{command[0]} ended with {child.returncode}")
    return time.perf_counter() - start, said, usage.ru_maxrss / 1024


def main():
    if sys.argv[1:2] == ["--torch"]:
        data, model, windows, validation, epochs = sys.argv[2:]
        return in_torch(data, model, int(windows), int(validation), int(epochs))
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out", type=pathlib.Path)
    parser.add_argument("--rounds", type=int, default=2)
    parser.add_argument("--epochs", type=int, default=2)
    parser.add_argument("--minutes", type=float, default=30)
    options = parser.parse_args()
    python = run.environment("whole-venv", [*run.VERSIONS[:2], "pandas==3.0.0"])
    subprocess.run(["cargo", "build", "--release", "--features", "cli", "--bin", "phyture"], cwd=run.ROOT, check=True)
    program, out = run.ROOT / "target" / "release" / "phyture", options.out
    data, model, config = out / "flights", out / "model.toml", out / "config.toml"
    if not model.exists():
        subprocess.run([program, "simulate", data, "--minutes", str(options.minutes), "--seed", "7", "--quiet"], check=True)
        subprocess.run([program, "calibrate", data, "-o", model, "--quiet"], check=True)
    config.write_text(CONFIG.replace("EPOCHS", str(options.epochs)))
    rows = {"phyture": [], "PyTorch": [], "PyTorch, tuned memory": []}
    for turn in range(options.rounds):
        folder, result = out / f"run{time.time_ns()}", out / "result.json"
        result.unlink(missing_ok=True)
        seconds, _, memory = timed([program, "train", data, "-m", model, "-o", folder, "--config", config, "--json", result, "--quiet"])
        said = json.loads(result.read_text())
        windows, validation = said["windows"], said["validation_windows"]
        rows["phyture"].append((seconds, None, memory))
        arguments = [python, __file__, "--torch", data, model, windows, validation, options.epochs]
        for name, variables in (("PyTorch", {}), ("PyTorch, tuned memory", run.TUNED)):
            seconds, printed, memory = timed(arguments, variables)
            rows[name].append((seconds, json.loads(printed.splitlines()[-1])["steps_s"], memory))
        print(f"round {turn + 1}: {windows} windows, {validation} validate; " + ", ".join(f"{name} {row[-1][0]:.1f} s" for name, row in rows.items()))
    own = statistics.median(row[0] for row in rows["phyture"])
    print(f"{run.processor()}, {os.cpu_count()} threads, {options.minutes} min of flight, {options.epochs} epochs of {windows} windows, {options.rounds} rounds")
    print("| | whole run, s | range, s | times phyture | steps of them, s | peak memory, MiB |\n| --- | ---: | ---: | ---: | ---: | ---: |")
    for name, found in rows.items():
        seconds = [row[0] for row in found]
        steps = "–" if found[0][1] is None else f"{statistics.median(row[1] for row in found):.1f}"
        print(f"| {name} | {statistics.median(seconds):.1f} | {min(seconds):.1f}–{max(seconds):.1f} | {statistics.median(seconds) / own:.2f} | "
              f"{steps} | {max(row[2] for row in found):.0f} |")


if __name__ == "__main__":
    main()

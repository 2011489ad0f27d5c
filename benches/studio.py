"""Waiting times of the studio over HTTP, and its memory: `python3 benches/studio.py PROGRAM FLIGHTS`, the standard library alone."""

import json
import statistics
import subprocess
import sys
import tempfile
import time
import urllib.request
from pathlib import Path


def main(program, flights):
    told = Path(tempfile.mkdtemp()) / "studio.json"
    begun = time.time()
    studio = subprocess.Popen([program, "studio", flights, "--quiet", "--json", told], stdout=subprocess.DEVNULL)
    try:
        while not told.exists():
            if studio.poll() is not None:
                sys.exit("the studio did not start")
            time.sleep(0.02)
        url, token = json.loads(told.read_text())["url"].split("/#token=")
        ready = time.time() - begun

        def ask(name, **body):
            headers = {"content-type": "application/json", "x-studio-token": token}
            request = urllib.request.Request(f"{url}/api/{name}", json.dumps(body).encode(), headers)
            begun = time.time()
            answer = json.loads(urllib.request.urlopen(request).read())
            return time.time() - begun, answer

        first, overview = ask("overview")
        first += ask("steps")[0] + ask("trace", flight=0, channel=0, pixels=1100)[0]
        count = len(overview["flights"])
        views = [ask("trace", flight=k % count, channel=k % 6, pixels=1100)[0] for k in range(2 * count)]
        views += [ask("map", by=by, part=part)[0] for by in ("manoeuvre", "regime") for part in ("judged", "all")]
        views += [ask(name, channel=k)[0] for name in ("dependence", "surface", "regions", "in_time") for k in range(6)] + [ask("model")[0]]
        views += [ask("rollout", flight=k, at_s=20, ahead_s=1)[0] for k in range(count)] + [ask("rollouts", ahead_s=s)[0] for s in (0.5, 1, 2, 5)]
        views += [ask("runs")[0] for _ in range(2)]
        fits = [ask("edit", do="calibrate")[0] for _ in range(5)]
        memory = [line.split()[1] for line in Path(f"/proc/{studio.pid}/status").read_text().splitlines() if "VmHWM" in line]
        print(f"flights {overview['duration_s']:.0f} s; from the start to the address {ready:.2f} s; first view {first:.3f} s")
        print(f"{len(views)} views: median {statistics.median(views):.4f} s, longest {max(views):.3f} s")
        print(f"calibration: median {statistics.median(fits):.3f} s, longest {max(fits):.3f} s; most memory {int(memory[0]) / 1024:.0f} MiB")
    finally:
        studio.kill()
        studio.wait()


main(*sys.argv[1:])

#!/usr/bin/env python3
"""What depth and a live view cost the frames of a running service: the same recording without and with both, in turn.

    view_latency.py BUILD SEQUENCE RESULTS.json [--device cuda] [--pairs 6] [--frames N]

BUILD has tools/haustra, platform/daemon/haustrad and platform/publish/haustra_pose_client (or all three side by side). Each run
is a service of its own in a folder of its own, in real time, at 50 and at 25 frames a second of SEQUENCE. With both: depth.enabled,
publish.view and publish.depth, `haustra view`, and one viewer who reads its stream. Every second pair begins with both. A run ends
after N answered frames, by default 780 at 50 a second and 500 at 25: SEQUENCE has more, and the device answers nearly all.

Writes the latencies of all runs, from frame to pose in ms as the client reads them, without the first 50 frames, and prints a
table: means over the runs of their mean, median and p99, and the difference of the pairs with its standard error.
"""

import argparse
import http.client
import json
import os
import re
import signal
import statistics
import subprocess
import sys
import tempfile
import threading
import time
from pathlib import Path

LEFT_OUT = 50
FRAMES = {50: 780, 25: 500}
LONGEST_RUN_S = 120
TOKEN = "a" * 40


def program(build, path):
    for candidate in (build / path, build / Path(path).name):
        if candidate.is_file():
            return candidate.resolve()
    sys.exit(f"{build}: no {path}")


class Viewer(threading.Thread):
    """Reads the stream of `haustra view` until it is told to stop, and counts the walls that it is told of."""

    def __init__(self, port):
        super().__init__(daemon=True)
        self.port, self.stopped, self.walls = port, threading.Event(), 0

    def run(self):
        while not self.stopped.is_set():
            try:
                connection = http.client.HTTPConnection("127.0.0.1", self.port, timeout=5)
                connection.request("GET", f"/{TOKEN}/live")
                answer = connection.getresponse()
                while answer.status == 200 and not self.stopped.is_set():
                    line = answer.fp.readline()
                    if not line:
                        break
                    self.walls += line.startswith(b"event: wall")
            except OSError:
                time.sleep(0.2)  # the server is not there yet, or no more


def run_once(arguments, rate_hz, is_on):
    build = arguments.build
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "state").mkdir(mode=0o700)
        (folder / "run").mkdir(mode=0o755)
        (folder / "token").write_text(TOKEN)
        (folder / "token").chmod(0o600)
        on = "true" if is_on else "false"
        settings = {"procedure.begin_at_start": "true", "files.state_folder": folder / "state", "files.runtime_folder": folder / "run",
                    "vision.device": arguments.device, "source.rate": rate_hz / arguments.source_hz, "depth.enabled": on,
                    "publish.view": on, "publish.depth": on}
        command = [program(build, "platform/daemon/haustrad"), "--source", arguments.sequence]
        for key, value in settings.items():
            command += ["--set", f"{key}={value}"]
        log = folder / "log"
        poses, view, viewer = folder / "run" / "poses", None, None
        with log.open("w") as file:
            service = subprocess.Popen(command, stdout=file, stderr=file)
        try:
            while not poses.exists():
                if service.poll() is not None:
                    sys.exit(log.read_text())
                time.sleep(0.05)
            if is_on:
                view = subprocess.Popen([program(build, "tools/haustra"), "view", "--folder", folder / "run", "--port",
                                         str(arguments.port), "--token-file", folder / "token"],
                                        stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
                viewer = Viewer(arguments.port)
                viewer.start()
            num_frames = arguments.frames or FRAMES[rate_hz]
            try:
                said = subprocess.run([program(build, "platform/publish/haustra_pose_client"), poses, str(num_frames)],
                                      capture_output=True, text=True, check=True, timeout=LONGEST_RUN_S).stdout
            except subprocess.TimeoutExpired:
                sys.exit(f"{rate_hz} a second: {num_frames} frames were not answered in {LONGEST_RUN_S} s")
        finally:
            if viewer:
                viewer.stopped.set()
                view.send_signal(signal.SIGINT)
                view.wait(20)
            service.send_signal(signal.SIGTERM)
            service.wait(30)
        latencies = [float(value) for value in re.findall(r"latency ([\d.]+) ms", said)][LEFT_OUT:]
        return {"rate_hz": rate_hz, "is_on": is_on, "latencies_ms": latencies, "tracking": said.count(" tracking "),
                "walls": viewer.walls if viewer else 0}


def figures(run):
    ordered = sorted(run["latencies_ms"])
    return {"mean": statistics.mean(ordered), "p50": ordered[len(ordered) // 2], "p99": ordered[int(0.99 * len(ordered))]}


def table(runs):
    lines = ["| frames a second | ms | without | with | difference of the pairs |", "|---|---|---|---|---|"]
    for rate_hz in FRAMES:
        off = {run["pair"]: figures(run) for run in runs if run["rate_hz"] == rate_hz and not run["is_on"]}
        on = {run["pair"]: figures(run) for run in runs if run["rate_hz"] == rate_hz and run["is_on"]}
        pairs = sorted(set(off) & set(on))
        for key in ("mean", "p50", "p99"):
            before, after = ([side[pair][key] for pair in pairs] for side in (off, on))
            percent = [100 * (b - a) / statistics.mean(before) for a, b in zip(before, after)]
            error = statistics.stdev(percent) / len(percent) ** 0.5 if len(percent) > 1 else float("nan")
            lines.append(f"| {rate_hz} | {key} | {statistics.mean(before):.2f} | {statistics.mean(after):.2f} | "
                         f"{statistics.mean(percent):+.1f} % ± {error:.1f} |")
    return "\n".join(lines)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("build", type=Path)
    parser.add_argument("sequence", type=Path)
    parser.add_argument("results", type=Path)
    parser.add_argument("--device", default="cuda")
    parser.add_argument("--pairs", type=int, default=6)
    parser.add_argument("--frames", type=int, help=f"that are answered in each run, more than {LEFT_OUT}")
    parser.add_argument("--source-hz", type=float, default=25.0, help="rate of the sequence")
    parser.add_argument("--port", type=int, default=8123)
    arguments = parser.parse_args()
    runs = []
    for pair in range(arguments.pairs):
        for rate_hz in FRAMES:
            for is_on in (False, True) if pair % 2 == 0 else (True, False):
                runs.append({"pair": pair, **run_once(arguments, rate_hz, is_on)})
                arguments.results.write_text(json.dumps(runs) + os.linesep)
    print(table(runs))


if __name__ == "__main__":
    main()

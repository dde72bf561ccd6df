#!/usr/bin/env python3
"""A whole procedure in real time: renders minutes of colon in which tracking is lost every 20 seconds, maps it at the
camera's pace, judges it by the ground truth. A procedure that is there already is not rendered again.

    python3 tools/benchmarks/procedure.py --haustra build/release/tools/haustra --out OUT --minutes 10 --device cuda \
        --rates 1 2

A rate of 2 plays the camera's 25 frames a second at 50; without a rate the procedure is rendered and not run. Beside the
results of each run lies a table of the resident memory of the process every five seconds; its growth after the first two
minutes is printed. Exit code 1 when a run fails. Needs only the standard library.
"""

import argparse
import pathlib
import random
import subprocess
import sys
import time

# Kind and seconds, taken in turn.
EVENTS = [("redout", 1.4), ("jump", 0.44), ("bubbles", 1.4), ("blur", 1.0), ("water", 1.4), ("debris", 1.5), ("redout", 4.0)]
RESIDENT_EVERY_S, WARM_UP_S = 5.0, 120.0
FIRST_EVENT_S, LAST_EVENT_BEFORE_END_S, MIN_GAP_S, MAX_GAP_S = 18.0, 15.0, 14.0, 26.0


def event_script(seconds, seed):
    generator = random.Random(seed)
    script, start = [], FIRST_EVENT_S
    while start < seconds - LAST_EVENT_BEFORE_END_S:
        kind, duration = EVENTS[len(script) % len(EVENTS)]
        script.append(f"{kind}@{start:.2f}+{duration}")
        start += generator.uniform(MIN_GAP_S, MAX_GAP_S)
    return script


def resident_mb(process):
    try:
        for line in open(f"/proc/{process.pid}/status", encoding="ascii"):
            if line.startswith("VmRSS:"):
                return int(line.split()[1]) * 1024 / 1e6
    except OSError:
        pass
    return None  # it has ended


def run_watched(command, table):
    """Runs a command and writes its resident memory to a table as it goes. Returns seconds and megabytes of each."""
    samples, begin = [], time.monotonic()
    process = subprocess.Popen(command)
    while True:
        try:
            code = process.wait(RESIDENT_EVERY_S)
            break
        except subprocess.TimeoutExpired:
            if (now := resident_mb(process)) is not None:
                samples.append((time.monotonic() - begin, now))
    if code != 0:
        raise subprocess.CalledProcessError(code, command)
    table.write_text("seconds,resident_mb\n" + "".join(f"{at:.1f},{mb:.3f}\n" for at, mb in samples), encoding="ascii")
    return samples


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--haustra", required=True)
    parser.add_argument("--out", type=pathlib.Path, required=True)
    parser.add_argument("--minutes", type=float, default=10.0)
    parser.add_argument("--rates", type=float, nargs="*", default=[1.0])
    parser.add_argument("--device", default="cpu")
    parser.add_argument("--seed", type=int, default=77, help="of the colon and its path")
    parser.add_argument("--set", action="append", default=[], help="as for haustra run")
    arguments = parser.parse_args()

    seconds = 60.0 * arguments.minutes
    sequence = arguments.out / f"procedure_{arguments.minutes:g}min_seed_{arguments.seed}"
    if not (sequence / "groundtruth.txt").exists():
        script = event_script(seconds, 7)
        if not script:
            sys.exit(f"procedure.py: {arguments.minutes:g} minutes are too short for an event")
        arguments.out.mkdir(parents=True, exist_ok=True)
        subprocess.run([arguments.haustra, "render", sequence, "--preset", "losses", "--seconds", f"{seconds:g}", "--seed",
                        str(arguments.seed), "--events", ",".join(script), "--overwrite"], check=True)
    for rate in arguments.rates:
        out = arguments.out / f"rate_{rate:g}"
        settings = [part for setting in arguments.set for part in ("--set", setting)]
        samples = run_watched([arguments.haustra, "run", sequence, "--out", out, "--mode", "realtime", "--rate",
                               f"{rate:g}", "--device", arguments.device, "--overwrite", *settings], arguments.out / f"rate_{rate:g}.csv")
        end = seconds / rate  # results are written after that
        later = [mb for at, mb in samples if WARM_UP_S <= at < end]
        if later:
            print(f"resident memory {later[0]:.1f} MB after two minutes, then at most {max(later) - later[0]:+.2f} MB until "
                  f"the last frame, {max(mb for _, mb in samples) - later[0]:+.2f} MB while results are written")
        subprocess.run([arguments.haustra, "evaluate", out, "--groundtruth", sequence / "groundtruth.txt", "--json",
                        arguments.out / f"rate_{rate:g}.json", "--overwrite"], check=True)


if __name__ == "__main__":
    try:
        main()
    except subprocess.CalledProcessError as failure:
        sys.exit(f"procedure.py: {pathlib.Path(failure.cmd[0]).name} {failure.cmd[1]} failed")

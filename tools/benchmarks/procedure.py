#!/usr/bin/env python3
"""Whole procedures: renders minutes of colon in which tracking is lost again and again, maps them at the camera's pace, and
judges them by the ground truth. Several procedures of one patient follow each other: another path through the same colon,
whose wall has changed since, with the maps of those before. A procedure that is there already is not rendered again, and a
run that is there already is not repeated.

    python3 tools/benchmarks/procedure.py --haustra build/release/tools/haustra --out OUT --preset procedure --minutes 22 \\
        --losses 80 --procedures 2 --remodel 5 --device cuda --rates 1 2

A rate of 2 plays the camera's 25 frames a second at 50, a rate of 0 is sequential mode; without a rate the procedures are
rendered and not run. OUT/procedures.md has every run that is under OUT, and OUT/procedures.json its figures. With --results
both are written there as DATE-COMMIT-procedures. Beside each run lies a table of the resident memory of the process every
five seconds. Exit code 1 when a run fails. Needs only the standard library.
"""

import argparse
import concurrent.futures
import datetime
import json
import os
import pathlib
import random
import subprocess
import sys
import time

import results
import runs

# Kind and seconds, taken in turn.
EVENTS = [("redout", 1.4), ("jump", 0.44), ("bubbles", 1.4), ("blur", 1.0), ("water", 1.4), ("debris", 1.5), ("redout", 4.0)]
RESIDENT_EVERY_S, WARM_UP_S = 5.0, 120.0
FIRST_EVENT_S, LAST_EVENT_BEFORE_END_S, MIN_GAP_S, MAX_GAP_S = 18.0, 15.0, 14.0, 26.0
SEGMENT_MM = 1000
HEADINGS = ["device", "rate", "procedure", "live visible % (all)", "in a loaded map %", "maps", "losses",
            "relocalisations, merges, loops (false)", "recall: maps, losses", "RMS mm: map, of a metre", "p50, p99, p99.9, max ms",
            "missed, dropped", "keyframes, points", "evicted: keyframes, points", "peak MB, growth"]


def event_script(seconds, seed, losses=None):
    """Losses of several kinds, so many or one every 14 to 26 seconds."""
    generator = random.Random(seed)
    gaps = (MIN_GAP_S, MAX_GAP_S)
    if losses:
        gap = (seconds - FIRST_EVENT_S - LAST_EVENT_BEFORE_END_S) / losses
        gaps = (0.7 * gap, 1.3 * gap)
    script, start = [], FIRST_EVENT_S
    while start < seconds - LAST_EVENT_BEFORE_END_S:
        kind, duration = EVENTS[len(script) % len(EVENTS)]
        script.append(f"{kind}@{start:.2f}+{duration}")
        start += generator.uniform(*gaps)
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


def growth_mb(samples, end_s):
    """From two minutes after the start to the last frame; results are written after that. None: too short."""
    later = [mb for at, mb in samples if WARM_UP_S <= at < end_s]
    return max(later) - later[0] if later else None


def render_command(arguments, number, sequence):
    seconds = 60.0 * arguments.minutes
    script = event_script(seconds, 6 + number, arguments.losses)
    if not script:
        sys.exit(f"procedure.py: {arguments.minutes:g} minutes are too short for an event")
    command = [arguments.haustra, "render", sequence, "--preset", arguments.preset, "--seconds", f"{seconds:g}", "--seed",
               str(arguments.seed), "--events", ",".join(script), "--overwrite", "--quiet"]
    if arguments.size:
        command += ["--size", arguments.size]
    if number > 1:  # the first one is the colon as it is
        command += ["--path-seed", str(arguments.seed + number - 1), "--remodel", f"{arguments.remodel:g}"]
    return command + arguments.render


def sequence_of(arguments, number):
    name = f"procedure_{arguments.minutes:g}min_seed_{arguments.seed}"
    return arguments.out / (name if number == 1 else f"{name}_{number}")


def make_sequence(arguments, number):
    """Renders a procedure, unless it is there; one that was broken off does not count."""
    sequence = sequence_of(arguments, number)
    if (sequence / "groundtruth.txt").exists():
        return
    unfinished = sequence.with_name(sequence.name + ".part")
    subprocess.run(["nice", "-n", "5", *map(str, render_command(arguments, number, unfinished))], check=True)
    os.rename(unfinished, sequence)


def loaded_share(run):
    """Of the frames with a pose at the end, those in a map of an earlier procedure, in percent."""
    def rows(name):
        header, *lines = (run / name).read_text(encoding="utf-8").splitlines()
        return [dict(zip(header.split(","), line.split(","))) for line in lines]

    loaded = {row["map_id"] for row in rows("maps.csv") if row["loaded"] == "1"}
    if not loaded:
        return None
    placed = [row["map_id"] for row in rows("frames.csv") if row["map_id"] != "-1"]
    return 100 * sum(map_id in loaded for map_id in placed) / len(placed) if placed else None


def one_run(arguments, folder, rate, number):
    """Runs and judges one procedure, unless it is there; its figures."""
    sequence, out, figures = sequence_of(arguments, number), folder / f"procedure_{number}", folder / f"procedure_{number}.json"
    atlas, before = folder / f"atlas_{number}.hst", folder / f"atlas_{number - 1}.hst"
    command = [arguments.haustra, "run", sequence, "--out", out, "--device", arguments.device, "--report", "off", "--quiet",
               "--overwrite", "--threads", str(arguments.threads), *runs.settings_of(arguments)]
    command += ["--mode", "realtime", "--rate", f"{rate:g}"] if rate > 0 else ["--mode", "sequential"]
    if arguments.procedures > 1:
        command += ["--save-atlas", atlas] + (["--load-atlas", before] if number > 1 else [])
    made_with = {"program": runs.digest_of_file(arguments.haustra), "command": [str(part) for part in command],
                 "sequence": runs.digest_of_file(sequence / "groundtruth.txt")}
    if runs.is_made(folder / f"procedure_{number}_made_with.json", made_with, figures):
        return
    folder.mkdir(parents=True, exist_ok=True)
    samples = run_watched(command, folder / f"procedure_{number}.csv")
    evaluation = folder / f"procedure_{number}_evaluation.json"
    subprocess.run([arguments.haustra, "evaluate", out, "--groundtruth", sequence / "groundtruth.txt", "--segment",
                    str(SEGMENT_MM), "--json", evaluation, "--overwrite", "--quiet"], check=True, stdout=subprocess.DEVNULL)
    found = runs.figures_only(json.loads(evaluation.read_text(encoding="utf-8")))
    found["segments"] = json.loads(evaluation.read_text(encoding="utf-8"))["segments"]
    summary = json.loads((out / "summary.json").read_text(encoding="utf-8"))
    found |= {"rate": rate, "procedure": number, "pools": summary["memory"]["pools"], "evicted": summary["memory"]["evicted"],
              "frame_ms": summary["frame_ms"], "loaded_share": loaded_share(out), "preset": arguments.preset,
              "minutes": arguments.minutes, "growth_mb": growth_mb(samples, 60 * arguments.minutes / rate) if rate > 0 else None}
    figures.write_text(json.dumps(found, indent=1) + "\n", encoding="utf-8")
    (folder / f"procedure_{number}_made_with.json").write_text(json.dumps(made_with, indent=1) + "\n", encoding="utf-8")


def pair(figures, kind):
    recall = figures["recall"][kind]
    return f"{recall['taken']} of {recall['occasions']}" if recall and recall["occasions"] is not None else "-"


def own_rms(figures):
    """Of all stretches of a metre, each after a Sim(3) of its own."""
    known = [s for s in figures["segments"] if s["rms_own"] is not None]
    count = sum(s["own_frames"] for s in known)
    return (sum(s["own_frames"] * s["rms_own"] ** 2 for s in known) / count) ** 0.5 if count else None


def row(figures):
    def text(name, digits=1):
        return runs.text(figures[name], digits)

    joins, times = figures["join_counts"], figures["frame_ms"]
    return [figures["device"], "sequential" if figures["rate"] == 0 else f"{figures['rate']:g}", str(figures["procedure"]),
            f"{text('live_visible_coverage', 2)} ({text('live_coverage', 2)})", text("loaded_share"), str(figures["maps"]),
            str(figures["losses"]),
            ", ".join(str(joins[kind]["made"]) for kind in ("relocalisations", "merges", "loops")) + f" ({runs.count_false(figures)})",
            f"{pair(figures, 'merges')}, {pair(figures, 'relocalisations')}",
            f"{text('rms_ate', 2)}, {runs.text(own_rms(figures), 2)}",
            ", ".join(f"{times[key]:.1f}" for key in ("p50", "p99", "p999", "max")),
            f"{'-' if figures['deadline_misses'] is None else figures['deadline_misses']}, {figures['dropped']}",
            f"{figures['keyframes']}, {figures['map_points']}",
            f"{figures['evicted']['keyframes']}, {figures['evicted']['map_points']}",
            f"{figures['peak_rss_mb']:.0f}, {runs.text(figures['growth_mb'], 1)}"]


def segment_rows(all_figures):
    lines = ["| device | rate | procedure | " + "from mm | frames | with a pose | RMS mm, the map's | RMS mm, its own |", "|---" * 8 + "|"]
    for figures in all_figures:
        for s in figures["segments"]:
            lines.append(f"| {figures['device']} | {figures['rate']:g} | {figures['procedure']} | {s['begin']:.0f} | {s['frames']} | "
                         f"{s['localised']} | {runs.text(s['rms_ate'], 2)} | {runs.text(s['rms_own'], 2)} |")
    return "\n".join(lines) + "\n"


def tables(all_figures):
    lines = ["| " + " | ".join(HEADINGS) + " |", "|---" * len(HEADINGS) + "|"]
    lines += ["| " + " | ".join(row(figures)) + " |" for figures in all_figures]
    return ("\n".join(lines) + "\n\n*RMS*: of all maps after one Sim(3) each; of each metre of the true path after one of its own. "
            "*Growth*: of resident\nmemory from two minutes after the start to the last frame. Sequential mode has processing times, not "
            "latency.\n\n## Along the path\n\n" + segment_rows(all_figures))


def collect(arguments):
    """Every run under OUT, as a table and as figures; in --results, too, when that is asked for."""
    all_figures = [json.loads(path.read_text(encoding="utf-8")) for path in sorted(arguments.out.glob("*_rate_*/procedure_?.json"))]
    all_figures += [json.loads(path.read_text(encoding="utf-8")) for path in sorted(arguments.out.glob("*_rate_*/procedure_??.json"))]
    if not all_figures:
        return
    all_figures.sort(key=lambda f: (f["device"], f["rate"], f["procedure"]))
    date, commit = datetime.date.today().isoformat(), arguments.commit or results.present_commit()
    machine = results.machine(arguments.device)
    name = f"{date}-{commit}-procedures"
    command = " ".join(["python3 tools/benchmarks/procedure.py --haustra HAUSTRA --out OUT", f"--preset {arguments.preset}",
                        f"--minutes {arguments.minutes:g}", f"--losses {arguments.losses}" if arguments.losses else "",
                        f"--size {arguments.size}" if arguments.size else "",
                        " ".join(["--render", *(part.replace("--", "=", 1) for part in arguments.render)]) if arguments.render else "",
                        f"--procedures {arguments.procedures}",
                        f"--remodel {arguments.remodel:g}", f"--device {arguments.device}", "--rates",
                        *(f"{rate:g}" for rate in arguments.rates), *(f"--set {s}" for s in arguments.set)])
    document = {"date": date, "commit": commit, "machine": machine, "program": runs.digest_of_file(arguments.haustra),
                "command": command, "runs": all_figures}
    text = (f"# Whole procedures, {date}, commit {commit}\n\n- machine: {machine}\n- program: sha256 {document['program']}\n"
            f"- command, the last one: `{' '.join(command.split())}`\n- of every run: [{name}.json]({name}.json)\n\n{tables(all_figures)}")
    targets = [(arguments.out, "procedures")] + ([(arguments.results, name)] if arguments.results else [])
    for folder, stem in targets:
        folder.mkdir(parents=True, exist_ok=True)
        (folder / f"{stem}.md").write_text(text, encoding="utf-8")
        (folder / f"{stem}.json").write_text(json.dumps(document, indent=1) + "\n", encoding="utf-8")
    print(tables(all_figures))


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--haustra", type=pathlib.Path, required=True)
    parser.add_argument("--out", type=pathlib.Path, required=True)
    parser.add_argument("--preset", default="losses", help="of haustra render; `procedure` is 1.5 m of colon")
    parser.add_argument("--minutes", type=float, default=10.0)
    parser.add_argument("--losses", type=int, help="how many (default: one every 14 to 26 s)")
    parser.add_argument("--size", help="of the pictures (default: the preset's)")
    parser.add_argument("--render", nargs="*", default=[], metavar="OPTION", help="more options of haustra render, with = for --")
    parser.add_argument("--procedures", type=int, default=1, help="of the same patient, each with the maps of those before")
    parser.add_argument("--remodel", type=float, default=5.0, help="how far the wall differs in each but the first, %%")
    parser.add_argument("--rates", type=float, nargs="*", default=[1.0])
    parser.add_argument("--jobs", type=int, default=1, help="rates side by side")
    parser.add_argument("--device", default="cpu")
    parser.add_argument("--threads", type=int, default=0, help="of the CPU device, as for haustra run")
    parser.add_argument("--seed", type=int, default=77, help="of the colon and its path")
    parser.add_argument("--config", type=pathlib.Path, help="as for haustra run")
    parser.add_argument("--set", action="append", default=[], metavar="KEY=VALUE", help="as for haustra run")
    parser.add_argument("--results", type=pathlib.Path, help="write the results there, too")
    parser.add_argument("--commit", help="of the program (default: that of this tree)")
    arguments = parser.parse_args()
    arguments.haustra = arguments.haustra.resolve()
    arguments.render = [part.replace("=", "--", 1) if part.startswith("=") else part for part in arguments.render]
    if arguments.procedures < 1 or any(rate < 0 for rate in arguments.rates):
        sys.exit("procedure.py: at least one procedure, and no rate below 0")

    # The next procedure is rendered while one is run.
    arguments.out.mkdir(parents=True, exist_ok=True)
    numbers = range(1, arguments.procedures + 1)
    with concurrent.futures.ThreadPoolExecutor(1) as renderer, concurrent.futures.ThreadPoolExecutor(max(1, arguments.jobs)) as pool:
        rendered = {number: renderer.submit(make_sequence, arguments, number) for number in numbers}

        def series(rate):
            folder = arguments.out / f"{arguments.device}_rate_{rate:g}"
            _held = runs.claim(folder)
            for number in numbers:
                rendered[number].result()
                one_run(arguments, folder, rate, number)

        for done in [pool.submit(series, rate) for rate in arguments.rates] + list(rendered.values()):
            done.result()
    collect(arguments)


if __name__ == "__main__":
    try:
        main()
    except subprocess.CalledProcessError as failure:
        sys.exit(f"procedure.py: {pathlib.Path(failure.cmd[0]).name} {failure.cmd[1]} failed")

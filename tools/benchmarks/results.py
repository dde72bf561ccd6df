#!/usr/bin/env python3
"""The table of results in README.md: runs haustra on sequences with several seeds, judges every run, and writes

    tools/benchmarks/results/DATE-COMMIT.md      date, commit, machine, command, table
    tools/benchmarks/results/DATE-COMMIT.json    what `haustra evaluate` found, of every run
    README.md                                    the table, between its markers

    python3 tools/benchmarks/results.py --haustra build/release/tools/haustra --out OUT --seeds 10 --jobs 2 SEQUENCE...

A sequence is a folder with a groundtruth*.txt, or a clip as for real_clips.py (CLIP, CLIP:FIRST-LAST). Runs that are in OUT
already are made again only when the program, the settings or the sequence have changed. What other systems do on the same
sequences is taken from peers.json. Needs only the standard library.
"""

import argparse
import datetime
import json
import os
import pathlib
import platform
import re
import subprocess
import sys

import ablation
import real_clips
import runs

ROOT = pathlib.Path(__file__).resolve().parents[2]
BEGIN, END = "<!-- results: begin -->", "<!-- results: end -->"
NO_TRUE_ORIENTATIONS = {"sinus"}

HEADINGS = ["sequence", "runs", "live %", "at the end %", "maps", "largest map, frames", "losses", "false joins", "error",
            "ORB-SLAM3: %, maps, error"]

LEGEND = """Median over the seeds, in brackets the worst. *Live*: frames with a pose that was answered at the time, in a map that
exists at the end. *At the end*: frames with a pose when the run is over. Where `events.csv` says in which frames the scene
can be seen, both are shares of these. *False joins*: sum over the runs. *Error*: RMS of the camera centres after one Sim(3) a
map. In mm or units: all maps against the ground truth. In %: the largest map against a reference path, of the scene depth.
"""


class Colon:
    """A sequence with a ground truth."""

    def __init__(self, folder, truth):
        self.folder, self.truth, self.name = folder.resolve(), truth, folder.resolve().name
        self.judge_options = ["--positions-only"] if self.name in NO_TRUE_ORIENTATIONS else []

    def sequence(self, _):
        return self.folder

    def error(self, report):
        return report["rms_ate"]

    def unit(self, report):
        return report["unit"]


class RealClip(real_clips.Clip):
    """A clip with a reference path for a part of its frames, or none."""

    def error(self, report):
        return report["largest_map_rms_ate_percent_of_depth"]

    def unit(self, _):
        return "%"


def open_sequence(argument):
    folder = pathlib.Path(argument)
    truth = ablation.truth_of(folder) if folder.is_dir() else None
    return Colon(folder, truth) if truth else RealClip(argument)


def spread(values, digits):
    """One value, or the range of several."""
    low, high = (f"{value:.{digits}f}" for value in (min(values), max(values)))
    return low if low == high else f"{low} to {high}"


def peer_cell(peers, name):
    peer = peers["orb_slam3"]["sequences"].get(name)
    if peer is None:
        return "-"
    cells = [spread(peer["coverage"], 1), spread(peer["maps"], 0)]
    if "error" in peer:
        cells.append(f"{spread(peer['error'], 2)} {peer['unit']}")
    return ", ".join(cells)


def row(sequence, reports, peers):
    """Cells of one sequence; `reports` are what `haustra evaluate` found, a run each."""
    title = peers["orb_slam3"]["sequences"].get(sequence.name, {}).get("title", sequence.name)
    unit = sequence.unit(reports[0])
    error = real_clips.cell([sequence.error(r) for r in reports], 2, max)
    if error != "-":
        error = error.replace(" (", f" {unit} (", 1)
    return [title, str(len(reports)),
            real_clips.cell([ablation.live_coverage(r) for r in reports], 1, min),
            real_clips.cell([ablation.coverage(r) for r in reports], 1, min),
            real_clips.cell([r["maps"] for r in reports], 0, max),
            real_clips.cell([r["largest_map_frames"] for r in reports], 0, min),
            real_clips.cell([r["losses"] for r in reports], 0, max),
            str(sum(map(runs.count_false, reports))) if sequence.truth else "-",
            error, peer_cell(peers, sequence.name)]


def table(rows):
    lines = ["| " + " | ".join(HEADINGS) + " |", "|---" * len(HEADINGS) + "|"]
    return "\n".join(lines + ["| " + " | ".join(cells) + " |" for cells in rows]) + "\n"


def git(*arguments):
    done = subprocess.run(["git", "-C", ROOT, *arguments], capture_output=True, text=True, check=False)
    return done.stdout.strip() if done.returncode == 0 else ""


def present_commit():
    """Short name of the commit of this tree, with -changed when files differ from it."""
    commit = git("rev-parse", "--short=7", "HEAD") or "unknown"
    written = (":!README.md", ":!tools/benchmarks/results")  # by this script
    return commit + ("-changed" if git("status", "--porcelain", "--untracked-files=no", "--", ".", *written) else "")


def machine(device):
    """What a reader needs to judge times: processor, how many, memory, system, GPU. No names of hosts or people."""
    model = "unknown processor"
    try:
        found = re.search(r"^model name\s*: (.*)$", pathlib.Path("/proc/cpuinfo").read_text(encoding="utf-8"), re.MULTILINE)
        model = found[1] if found else platform.machine()
    except OSError:
        pass
    parts = [model, f"{len(os.sched_getaffinity(0))} logical processors"]
    try:
        parts.append(f"{os.sysconf('SC_PAGE_SIZE') * os.sysconf('SC_PHYS_PAGES') / 2**30:.0f} GiB")
    except (OSError, ValueError):
        pass
    try:
        release = pathlib.Path("/etc/os-release").read_text(encoding="utf-8")
        parts.append(re.search(r'^PRETTY_NAME="?([^"\n]*)', release, re.MULTILINE)[1])
    except (OSError, TypeError):
        pass
    if device == "cuda":
        done = subprocess.run("nvidia-smi --query-gpu=name,driver_version --format=csv,noheader", shell=True,
                              capture_output=True, text=True, check=False)
        if done.returncode == 0:
            parts.append("GPU " + done.stdout.splitlines()[0].replace(", ", ", driver "))
    return ", ".join(parts)


def shared_options(arguments):
    """Those of runs.add_arguments that say what is run, and the sequences, without the folders of one machine."""
    parts = [] if arguments.device == "cpu" else [f"--device {arguments.device}"]
    if arguments.config:
        parts.append(f"--config {arguments.config.name}")
    return parts + [f"--set {setting}" for setting in arguments.set] + [pathlib.Path(s).name for s in arguments.sequences]


def command_line(arguments):
    """The call, without the folders of one machine."""
    parts = ["python3 tools/benchmarks/results.py --haustra HAUSTRA --out OUT", f"--seeds {arguments.seeds}"]
    return " ".join(parts + shared_options(arguments))


def block(markdown, name, device, machine_text, date, commit):
    """What stands in the README between the markers."""
    return (f"{BEGIN}\n{markdown}\n{LEGEND}\n"
            f"Sequential mode, `--device {device}`, {date}, commit {commit}, {machine_text}.\n"
            f"Command and figures of every run: [{name}](tools/benchmarks/results/{name}).\n{END}")


def paste(readme, text):
    """Puts a block in the place of the one between the markers of a file; text that says why not, or None."""
    old = readme.read_text(encoding="utf-8")
    if old.count(BEGIN) != 1 or old.count(END) != 1 or old.index(BEGIN) > old.index(END):
        return f"{readme}: needs one {BEGIN} and, behind it, one {END}"
    readme.write_text(old[:old.index(BEGIN)] + text + old[old.index(END) + len(END):], encoding="utf-8")
    return None


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("sequences", nargs="+", help="SEQUENCE, CLIP or CLIP:FIRST-LAST")
    runs.add_arguments(parser, seeds=5)
    parser.add_argument("--commit", help="of the program (default: that of this tree)")
    parser.add_argument("--results", type=pathlib.Path, default=ROOT / "tools/benchmarks/results")
    parser.add_argument("--readme", type=pathlib.Path, default=ROOT / "README.md")
    parser.add_argument("--keep-readme", action="store_true", help="write the results and leave README.md as it is")
    parser.add_argument("--overwrite", action="store_true", help="replace results of the same day and commit")
    arguments = parser.parse_args()
    sequences = [open_sequence(argument) for argument in arguments.sequences]
    date, commit = datetime.date.today().isoformat(), arguments.commit or present_commit()
    name = f"{date}-{commit}"
    target = arguments.results / f"{name}.md"
    if target.exists() and not arguments.overwrite:
        sys.exit(f"{target} is there already (--overwrite replaces it)")
    peers = json.loads((ROOT / "tools/benchmarks/peers.json").read_text(encoding="utf-8"))

    reports, failed = runs.run_seeds(arguments, sequences)
    if failed:
        sys.exit(f"{failed} runs failed: no results are written")
    for report in (report for of_seed in reports.values() for report in of_seed.values()):
        report.pop("run", None)  # a folder of this machine

    rows = [row(s, [reports[s.name][seed] for seed in sorted(reports[s.name])], peers) for s in sequences]
    markdown, machine_text = table(rows), machine(arguments.device)
    pasted = block(markdown, f"{name}.md", arguments.device, machine_text, date, commit)
    arguments.results.mkdir(parents=True, exist_ok=True)
    target.write_text(
        f"# Results of {date}, commit {commit}\n\n- machine: {machine_text}\n- program: sha256 "
        f"{runs.digest_of_file(arguments.haustra)}\n- command: `{command_line(arguments)}`\n- of every run: "
        f"[{name}.json]({name}.json)\n- peers: [peers.json](../peers.json)\n\n{markdown}\n{LEGEND}", encoding="utf-8")
    document = {"date": date, "commit": commit, "machine": machine_text, "program": runs.digest_of_file(arguments.haustra),
                "command": command_line(arguments), "sequences": reports}
    target.with_suffix(".json").write_text(json.dumps(document, indent=1) + "\n", encoding="utf-8")
    print(markdown)
    print(f"{target}")
    if not arguments.keep_readme and (refusal := paste(arguments.readme, pasted)) is not None:
        sys.exit(refusal)
    return 0


if __name__ == "__main__":
    sys.exit(main())

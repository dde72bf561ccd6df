#!/usr/bin/env python3
"""How haustra does on real clips: runs each clip with several seeds, judges it by its reference model where there is one,
writes a Markdown table and all figures as JSON. Runs that are there already are made again only when the program, the
settings or the clip have changed.

    python3 tools/benchmarks/real_clips.py --haustra build/release/tools/haustra --out OUT --seeds 3 --jobs 2 CLIP...

A clip is a folder with frames/, times.txt, calib.yaml and, where there are, mask.png and reference.txt: poses of a part of
the frames (TUM, world_from_cam) in units of their own. CLIP:FIRST-LAST takes only these frames, counted from 0, both
included, by a folder of links under OUT. Needs only the standard library; with numpy and OpenCV recoveries are judged as well
(flow_judge.py).
"""

import argparse
import importlib.util
import json
import pathlib
import re
import shutil
import statistics
import sys

import runs

JUDGES_FLOW = all(importlib.util.find_spec(name) for name in ("cv2", "numpy"))
PICTURES = {".png", ".jpg", ".jpeg"}
SAME_STAMP_S = 1e-4

# Heading, key of the figures, digits, and which value is the worst of several: min, max, or None where none is worse.
COLUMNS = [
    ("live coverage %", "live_coverage", 1, min),
    ("coverage at the end %", "coverage", 1, min),
    ("maps begun", "maps_created", 0, None),
    ("maps at the end", "maps", 0, max),
    ("frames of the largest", "largest_map_frames", 0, min),
    ("losses", "losses", 0, max),
    ("relocalisations", "relocalisations", 0, None),
    ("merges", "merges", 0, None),
    ("loops", "loops", 0, None),
    ("error of the largest, % of depth", "largest_map_rms_ate_percent_of_depth", 2, max),
    ("ms a frame", "ms_per_frame", 1, max),
]


class Clip:
    """One clip, or some frames of it."""

    judge_options = ()

    def __init__(self, argument):
        found = re.fullmatch(r"(.+):(\d+)-(\d+)", argument)
        self.folder = pathlib.Path(found[1] if found else argument).resolve()
        self.frames = sorted(p for p in (self.folder / "frames").glob("*") if p.suffix.lower() in PICTURES)
        if not self.frames:
            sys.exit(f"{argument}: no pictures in {self.folder / 'frames'}")
        if not (self.folder / "times.txt").is_file():
            sys.exit(f"{argument}: no times.txt")
        lines = (self.folder / "times.txt").read_text(encoding="ascii").splitlines()
        self.times = [line for line in lines if line.strip() and not line.startswith("#")]
        if len(self.times) != len(self.frames):
            sys.exit(f"{argument}: {len(self.times)} times for {len(self.frames)} pictures")
        self.range = None
        self.name = self.folder.name
        if found:
            first, last = int(found[2]), int(found[3])
            if not first <= last < len(self.frames):
                sys.exit(f"{argument}: the clip has the frames 0 to {len(self.frames) - 1}")
            self.range = (first, last)
            self.name = f"{self.folder.name}_{first}-{last}"
            self.frames, self.times = self.frames[first:last + 1], self.times[first:last + 1]
        reference = self.folder / "reference.txt"
        self.truth = reference if reference.is_file() else None

    def sequence(self, out):
        """The folder for `haustra run`. Of some frames: a new one of links, in `out`."""
        if self.range is None:
            return self.folder
        sequence = out / "sequences" / self.name
        shutil.rmtree(sequence, ignore_errors=True)
        (sequence / "frames").mkdir(parents=True)
        for frame in self.frames:
            (sequence / "frames" / frame.name).symlink_to(frame)
        (sequence / "times.txt").write_text("\n".join(self.times) + "\n", encoding="ascii")
        for name in ("calib.yaml", "mask.png"):
            if (self.folder / name).exists():
                (sequence / name).symlink_to(self.folder / name)
        return sequence

    def reference_coverage(self):
        """Percent of the frames that the reference has, frames between two of its neighbouring images included."""
        if self.truth is None:
            return None
        lines = self.truth.read_text(encoding="utf-8").splitlines()
        stamps = sorted(float(line.split()[0]) for line in lines if line.strip() and not line.startswith("#"))
        gaps = [b - a for a, b in zip(stamps, stamps[1:])]
        step = statistics.median(gaps) if gaps else 0.0
        spans = [(a, b) for a, b in zip(stamps, stamps[1:]) if b - a < 1.5 * step] + [(s, s) for s in stamps]
        covered = sum(any(a - SAME_STAMP_S <= float(t) <= b + SAME_STAMP_S for a, b in spans) for t in self.times)
        return 100 * covered / len(self.times)


def figures_of(report):
    """What the table shows, of one run."""
    figures = {key: report.get(key) for _, key, _, _ in COLUMNS}
    times = [stage["mean"] for stage in report["stages"] if stage["stage"] == "frame/total"]
    figures["ms_per_frame"] = times[0] if times else None
    figures["pairs_of_maps"] = report["recall"]["merges"]
    figures["false_joins"] = runs.count_false(report)
    return figures


def flow_of(folder, sequence):
    """How many recoveries the run of `folder` has, how many were judged and are false; None where none can be judged."""
    run, record, product = folder / "run", folder / "recoveries_made_with.json", folder / "recoveries.json"
    if not JUDGES_FLOW or not (run / "frames.csv").is_file():
        return None
    import flow_judge  # pylint: disable=import-outside-toplevel
    made_with = [runs.digest_of_file(f) for f in (pathlib.Path(flow_judge.__file__), run / "frames.csv", run / "summary.json")]
    if not runs.is_made(record, made_with, product):
        try:
            found = flow_judge.judge(run, sequence)
        except (flow_judge.Refusal, OSError, ValueError) as error:
            print(f"{folder}: recoveries are not judged: {error}", file=sys.stderr)
            return None
        product.write_text(json.dumps(found, indent=2) + "\n", encoding="utf-8")
        record.write_text(json.dumps(made_with), encoding="utf-8")
    found = json.loads(product.read_text(encoding="utf-8"))
    return {"all": len(found["recoveries"]), "judged": found["judged"], "false": found["false"]}


def flow_cells(figures):
    flows = runs.known(f.get("recoveries_by_flow") for f in figures)
    if not flows:
        return ["-", "-"]
    judged, count, false = (sum(f[key] for f in flows) for key in ("judged", "all", "false"))
    return [f"{judged} of {count}", str(false)]


def cell(values, digits, worst):
    """Median of the seeds, and in brackets the worst, or the range where none is worse."""
    values = runs.known(values)
    if not values:
        return "-"
    middle = statistics.median(values)
    shown = runs.text(middle, digits if digits or middle == int(middle) else 1)
    if worst:
        return f"{shown} ({worst(values):.{digits}f})"
    return f"{shown} ({min(values):.{digits}f} to {max(values):.{digits}f})"


def pairs_cell(figures):
    pairs = runs.known(f["pairs_of_maps"] for f in figures)
    if not pairs:
        return "-"
    return f"{sum(p['taken'] for p in pairs)} of {sum(p['occasions'] for p in pairs)}"


def table(rows):
    """Markdown. Rows: clip's name, number of frames, coverage of the reference or None, figures of each seed."""
    headings = ["clip", "frames", "runs", "reference %", *(c[0] for c in COLUMNS), "recoveries judged", "false",
                "pairs joined", "false joins"]
    lines = ["| " + " | ".join(headings) + " |", "|---" * len(headings) + "|"]
    for name, frames, reference, figures in rows:
        cells = [name, str(frames), str(len(figures)), runs.text(reference, 1)]
        cells += [cell([f[key] for f in figures], digits, worst) for _, key, digits, worst in COLUMNS]
        judged = reference is not None and figures
        cells += flow_cells(figures)
        cells += [pairs_cell(figures), str(sum(f["false_joins"] for f in figures)) if judged else "-"]
        lines.append("| " + " | ".join(cells) + " |")
    return "\n".join(lines) + "\n"


LEGEND = """Median over the seeds, in brackets the worst, or the range where no value is worse than another. Reference: share of the
frames that its model has, those between two neighbouring images included. Pairs joined: pairs of maps that share a view
by the reference, of all seeds, and how many of them are one map at the end. Error: RMS of the camera centres after one
Sim(3), in percent of the median scene depth of that map. Recoveries judged: poses after a loss in a map that was there
before, of all seeds, that optical flow tells true or false. Time of a frame: mean of tracking and mapping in turn; runs
side by side make it longer.
"""


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("clips", nargs="+", help="CLIP or CLIP:FIRST-LAST")
    parser.add_argument("--judge", type=pathlib.Path, help="program that evaluates (default: the same)")
    runs.add_arguments(parser, seeds=3)
    arguments = parser.parse_args()
    clips = [Clip(argument) for argument in arguments.clips]
    reports, failed = runs.run_seeds(arguments, clips, judge=arguments.judge)
    if failed:
        sys.exit(f"{failed} runs failed: no results are written; the others are kept for the next call")
    figures = {name: {seed: figures_of(report) for seed, report in of_seed.items()} for name, of_seed in reports.items()}
    out = arguments.out.resolve()
    for clip in clips:
        for seed, of_seed in figures[clip.name].items():
            of_seed["recoveries_by_flow"] = flow_of(out / clip.name / f"seed_{seed}", clip.folder if clip.range is None
                                                    else out / "sequences" / clip.name)
    rows = [(clip.name, len(clip.frames), clip.reference_coverage(),
             [figures[clip.name][seed] for seed in sorted(figures[clip.name])]) for clip in clips]
    markdown = LEGEND + "\n" + table(rows)
    print(markdown, end="")
    (arguments.out / "table.md").write_text(markdown, encoding="utf-8")
    settings = [str(s) for s in runs.settings_of(arguments)]
    document = {"program": runs.digest_of_file(arguments.haustra), "settings": settings, "clips": [
        {"clip": name, "frames": frames, "reference_coverage": reference, "seeds": figures[name]}
        for name, frames, reference, _ in rows]}
    (arguments.out / "figures.json").write_text(json.dumps(document, indent=2) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()

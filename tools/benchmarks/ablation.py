#!/usr/bin/env python3
"""What each part of the system is worth: runs variants of the configuration over sequences and seeds, judges every run by
the ground truth, prints a Markdown table. Runs that are there already are not made again.

    python3 tools/benchmarks/ablation.py --haustra build/release/tools/haustra --out OUT --seeds 10 --jobs 2 SEQUENCE...

A sequence is a folder with a groundtruth.txt (or groundtruth_*.txt). Needs only the standard library.
"""

import argparse
import concurrent.futures
import json
import pathlib
import subprocess
import sys

# Name, what it switches off or exchanges, and the settings that do it.
VARIANTS = {
    "default": ("the default configuration", []),
    "no_merging": ("every loss leaves a map of its own", ["merging.enabled=false"]),
    "no_brute_force": ("no brute-force recovery in tracking", ["tracking.brute_force_recovery=false"]),
    "one_to_one": ("a common area is proven by 1 keyframe, not by 3", ["common_area.group_size=1"]),
    "vocabulary": ("retrieval by visual words, not by descriptors", ["retrieval.kind=vocabulary"]),
    "linear_noise": ("noise grows with scale, from 0 (paper's phantom: k 1)", ["noise.k=1", "noise.sigma_0_px=0"]),
    "paper_noise": ("the paper's affine model (k 2, sigma_0 5 px)", ["noise.k=2", "noise.sigma_0_px=5"]),
    "exact_founding": ("no noise floor between the two views of a founding", ["initialisation.noise_sigma_0_px=0"]),
    "root_sift": ("RootSIFT descriptors", ["features.root_sift=true"]),
}


def truth_of(sequence):
    return next(iter(sorted(sequence.glob("groundtruth*.txt"))), None)


def run_one(arguments, variant, sequence, seed):
    """Runs and judges; returns the figures, or the reason why there are none."""
    out = arguments.out / variant / sequence.name / f"seed_{seed}"
    figures = out / "evaluation.json"
    if not figures.exists():
        settings = list(VARIANTS[variant][1])
        if variant == "vocabulary":
            settings.append(f"retrieval.vocabulary={arguments.vocabulary}")
        command = [arguments.haustra, "run", sequence, "--out", out, "--mode", "sequential", "--seed", str(seed),
                   "--device", arguments.device, "--threads", "1"]
        for setting in settings:
            command += ["--set", setting]
        if arguments.config:
            command += ["--config", arguments.config]
        ran = subprocess.run(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
        if ran.returncode != 0:
            return f"run failed: {ran.stderr.strip()[-300:]}"
        command = [arguments.haustra, "evaluate", out, "--groundtruth", truth_of(sequence), "--json", figures]
        if sequence.name in arguments.positions_only:
            command.append("--positions-only")
        ran = subprocess.run(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
        if ran.returncode != 0:
            return f"evaluation failed: {ran.stderr.strip()[-300:]}"
    report = json.loads(figures.read_text())
    return report["runs"][0] if "runs" in report else report


def mean(values):
    values = [v for v in values if v is not None]
    return sum(values) / len(values) if values else None


def text(value, digits):
    return "-" if value is None else f"{value:.{digits}f}"


def coverage(run):
    return run["coverage"] if run["visible_coverage"] is None else run["visible_coverage"]


def count_false(run):
    return sum(run["join_counts"][kind]["false"] for kind in ("merges", "loops", "relocalisations"))


def recall(runs, kind):
    occasions = sum(r["recall"][kind]["occasions"] for r in runs if r["recall"][kind])
    taken = sum(r["recall"][kind]["taken"] for r in runs if r["recall"][kind])
    return None if occasions == 0 else 100 * taken / occasions


def print_table(arguments, results):
    print("Means over the seeds. Coverage: of the frames in which the scene can be seen, where that is known. Joins: merges,"
          "\nloops and relocalisations of all seeds, and how many of them are false by the ground truth.\n")
    print("| sequence | variant | runs | coverage % (worst) | maps | frames of the largest | merges | loops "
          "| relocalisations | false "
          "| merge recall % | relocalisation recall % | RMS ATE (worst) |")
    print("|---" * 13 + "|")
    for sequence in arguments.sequences:
        for variant in arguments.variants:
            runs = [r for r in results[variant, sequence] if isinstance(r, dict)]
            if not runs:
                continue
            covers = [coverage(r) for r in runs]
            errors = [r["rms_ate"] for r in runs if r["rms_ate"] is not None]
            print(f"| {sequence.name} | {variant} | {len(runs)} | {text(mean(covers), 1)} ({text(min(covers), 1)}) "
                  f"| {text(mean([r['maps'] for r in runs]), 1)} | {text(mean([r['largest_map_frames'] for r in runs]), 0)} "
                  f"| {text(mean([r['merges'] for r in runs]), 1)} | {text(mean([r['loops'] for r in runs]), 1)} "
                  f"| {text(mean([r['relocalisations'] for r in runs]), 1)} "
                  f"| {sum(map(count_false, runs))} "
                  f"| {text(recall(runs, 'merges'), 0)} | {text(recall(runs, 'relocalisations'), 0)} "
                  f"| {text(mean(errors), 2)} ({text(max(errors, default=None), 2)}) |")
    print()
    for variant in arguments.variants:
        print(f"- `{variant}`: {VARIANTS[variant][0]}" + "".join(f"; `--set {s}`" for s in VARIANTS[variant][1]))


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("sequences", nargs="+", type=pathlib.Path)
    parser.add_argument("--haustra", type=pathlib.Path, required=True, help="the program")
    parser.add_argument("--out", type=pathlib.Path, required=True, help="folder for the runs")
    parser.add_argument("--seeds", type=int, default=3, help="seeds 1 to N")
    parser.add_argument("--jobs", type=int, default=1, help="runs side by side")
    parser.add_argument("--device", default="cpu", choices=["cpu", "cuda"])
    parser.add_argument("--config", type=pathlib.Path, help="configuration that the variants start from")
    parser.add_argument("--vocabulary", type=pathlib.Path, help="visual words (haustra vocabulary), for that variant")
    parser.add_argument("--variants", nargs="+", default=list(VARIANTS), choices=list(VARIANTS))
    parser.add_argument("--positions-only", nargs="*", default=["sinus"],
                        help="sequences whose true orientations are not to be trusted")
    arguments = parser.parse_args()
    arguments.haustra = arguments.haustra.resolve()  # "./haustra" would lose its "./" and be looked for in PATH
    for sequence in arguments.sequences:
        if truth_of(sequence) is None:
            sys.exit(f"{sequence}: no groundtruth*.txt")
    if "vocabulary" in arguments.variants and not (arguments.vocabulary and arguments.vocabulary.is_file()):
        sys.exit("variant vocabulary: --vocabulary must name a file made by haustra vocabulary")

    # Seeds first: a series that is broken off has every variant.
    results = {(variant, sequence): [] for variant in arguments.variants for sequence in arguments.sequences}
    failed = 0
    with concurrent.futures.ThreadPoolExecutor(arguments.jobs) as pool:
        tasks = {}
        for seed in range(1, arguments.seeds + 1):
            for sequence in arguments.sequences:
                for variant in arguments.variants:
                    tasks[pool.submit(run_one, arguments, variant, sequence, seed)] = (variant, sequence, seed)
        for task in concurrent.futures.as_completed(tasks):
            variant, sequence, seed = tasks[task]
            result = task.result()
            results[variant, sequence].append(result)
            if isinstance(result, str):
                failed += 1
                print(f"{variant} {sequence.name} seed {seed}: {result}", file=sys.stderr)
    print_table(arguments, results)
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())

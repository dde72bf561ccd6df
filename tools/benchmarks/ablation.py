#!/usr/bin/env python3
"""What each part of the system is worth: runs variants of the configuration over sequences and seeds, judges every run by
the ground truth, prints a Markdown table. Runs that are there already are made again only when the program, the settings
or the sequence have changed.

    python3 tools/benchmarks/ablation.py --haustra build/release/tools/haustra --out OUT --seeds 10 --jobs 2 SEQUENCE...

A sequence is a folder with a groundtruth.txt (or groundtruth_*.txt). Needs only the standard library.
"""

import argparse
import functools
import pathlib
import sys

import runs

# Name, what it switches off or exchanges, and the settings that do it.
VARIANTS = {
    "default": ("the default configuration", []),
    "no_merging": ("every loss leaves a map of its own", ["merging.enabled=false"]),
    "no_brute_force": ("no brute-force recovery in tracking", ["tracking.brute_force_recovery=false"]),
    "one_to_one": ("a common area is proven by 1 keyframe, not by 3", ["common_area.group_size=1"]),
    "vocabulary": ("retrieval by visual words, not by descriptors", ["retrieval.kind=vocabulary"]),
    "fixed_noise": ("noise as configured, not as measured", ["noise.measured=false"]),
    "linear_noise": ("noise grows with scale, from 0 (paper's phantom: k 1)", ["noise.k=1", "noise.sigma_0_px=0", "noise.measured=false"]),
    "paper_noise": ("the paper's affine model (k 2, sigma_0 5 px)", ["noise.k=2", "noise.sigma_0_px=5", "noise.measured=false"]),
    "exact_founding": ("no noise floor between the two views of a founding", ["initialisation.noise_sigma_0_px=0"]),
    "plain_sift": ("SIFT descriptors, not RootSIFT", ["features.root_sift=false", "matching.min_similarity=0.80"]),
}


def truth_of(sequence):
    return next(iter(sorted(sequence.glob("groundtruth*.txt"))), None)


def run_one(arguments, variant, sequence, seed):
    """Runs and judges; returns the figures, or the reason why there are none."""
    settings, files = list(VARIANTS[variant][1]), []
    if variant == "vocabulary":
        settings.append(f"retrieval.vocabulary={arguments.vocabulary}")
        files.append(arguments.vocabulary)
    options = ["--mode", "sequential", "--seed", str(seed), "--device", arguments.device, "--threads", "1"]
    for setting in settings:
        options += ["--set", setting]
    if arguments.config:
        options += ["--config", arguments.config]
        files.append(arguments.config)
    return runs.judged_run(
        arguments.out / variant / sequence.name / f"seed_{seed}", arguments.haustra, sequence, options,
        truth=truth_of(sequence), files=files,
        judge_options=["--positions-only"] if sequence.name in arguments.positions_only else [])


def coverage(run):
    return run["coverage"] if run["visible_coverage"] is None else run["visible_coverage"]


def live_coverage(run):
    return run["live_coverage"] if run["live_visible_coverage"] is None else run["live_visible_coverage"]


def recall(reports, kind):
    occasions, taken = runs.sum_recall(reports, kind)
    return None if occasions == 0 else 100 * taken / occasions


def print_table(arguments, results):
    print("Means over the seeds. Coverage: of the frames in which the scene can be seen, where that is known; live: answered"
          "\nat the time of the frame. Joins: merges, loops, relocalisations and poses recovered by brute force of all seeds,"
          "\nand how many of them are false by the ground truth.\n")
    print("| sequence | variant | runs | live coverage % (worst) | coverage % (worst) | maps | frames of the largest | merges "
          "| loops | relocalisations | false | merge recall % | relocalisation recall % | RMS ATE (worst) |")
    print("|---" * 14 + "|")
    text, mean = runs.text, runs.mean
    for sequence in arguments.sequences:
        for variant in arguments.variants:
            reports = [r for r in results[variant, sequence] if isinstance(r, dict)]
            if not reports:
                continue
            live = [live_coverage(r) for r in reports]
            covers = [coverage(r) for r in reports]
            errors = runs.known(r["rms_ate"] for r in reports)
            print(f"| {sequence.name} | {variant} | {len(reports)} | {text(mean(live), 1)} ({text(min(live), 1)}) "
                  f"| {text(mean(covers), 1)} ({text(min(covers), 1)}) "
                  f"| {text(mean(r['maps'] for r in reports), 1)} "
                  f"| {text(mean(r['largest_map_frames'] for r in reports), 0)} "
                  f"| {text(mean(r['merges'] for r in reports), 1)} | {text(mean(r['loops'] for r in reports), 1)} "
                  f"| {text(mean(r['relocalisations'] for r in reports), 1)} "
                  f"| {sum(map(runs.count_false, reports))} "
                  f"| {text(recall(reports, 'merges'), 0)} | {text(recall(reports, 'relocalisations'), 0)} "
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
    tasks = {(variant, sequence, seed): functools.partial(run_one, arguments, variant, sequence, seed)
             for seed in range(1, arguments.seeds + 1) for sequence in arguments.sequences
             for variant in arguments.variants}
    results = {(variant, sequence): [] for variant in arguments.variants for sequence in arguments.sequences}
    failed = 0
    for (variant, sequence, seed), result in runs.run_all(arguments.jobs, tasks):
        results[variant, sequence].append(result)
        if isinstance(result, str):
            failed += 1
            print(f"{variant} {sequence.name} seed {seed}: {result}", file=sys.stderr)
    print_table(arguments, results)
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())

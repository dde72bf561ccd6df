#!/usr/bin/env python3
"""What one setting is worth: runs sequences with several of its values and seeds, judges every run, and writes

    tools/benchmarks/results/DATE-COMMIT-KEY.md      date, commit, machine, command, a table a sequence
    tools/benchmarks/results/DATE-COMMIT-KEY.json    the figures of every run

    python3 tools/benchmarks/sweep.py --haustra build/release/tools/haustra --out OUT --seeds 3 --jobs 2 \\
        --key mapping.redundant_share --values 0.6,0.7,0.8,0.9 SEQUENCE...

Sequences are those of results.py. Runs that are in OUT already are made again only when the program, the settings or the
sequence have changed. This folder and a program are enough: it needs no tree, no git, and only the standard library.
"""

import argparse
import datetime
import json
import pathlib
import statistics
import sys

import ablation
import real_clips
import results
import runs


def recall(report):
    """Percent of the pairs of maps that share a view and of the losses whose map came into view again that were joined."""
    shares = [ablation.recall([report], kind) for kind in ("merges", "relocalisations")]
    return runs.mean(shares)


# Heading, of a report and its sequence, digits, which of several is the worst, and whether the summary gives a ratio.
MEASURES = [
    ("live %", lambda r, _: ablation.live_coverage(r), 1, min, False),
    ("at the end %", lambda r, _: ablation.coverage(r), 1, min, False),
    ("maps", lambda r, _: r["maps"], 0, max, False),
    ("losses", lambda r, _: r["losses"], 0, max, False),
    ("joins taken %", lambda r, _: recall(r), 0, min, False),
    ("error", lambda r, sequence: sequence.error(r), 3, max, True),
    ("keyframes", lambda r, _: r["keyframes"], 0, max, True),
    ("map points", lambda r, _: r["map_points"], 0, max, True),
]


def markdown(headings, rows):
    return "".join("| " + " | ".join(cells) + " |\n" for cells in [headings, ["---"] * len(headings), *rows])


def false_joins(sequence, reports):
    return sum(map(runs.count_false, reports)) if sequence.truth else 0


def table(key, sequence, by_value):
    """One sequence; by_value: {value: reports}."""
    unit = sequence.unit(next(iter(by_value.values()))[0])
    headings = [f"`{key}`", "runs", *(f"error, {unit}" if h == "error" else h for h, *_ in MEASURES), "false joins"]
    return markdown(headings, [
        [value, str(len(reports)),
         *(real_clips.cell([of(r, sequence) for r in reports], digits, worst) for _, of, digits, worst, _ in MEASURES),
         str(false_joins(sequence, reports)) if sequence.truth else "-"] for value, reports in by_value.items()])


def summary(key, values, by_sequence):
    """All sequences; by_sequence: pairs of a sequence and {value: reports}."""
    def over_all(of, value, is_ratio):
        middles = [[runs.median(of(r, sequence) for r in by_value[v]) for v in (value, values[-1])]
                   for sequence, by_value in by_sequence]
        if not is_ratio:
            return runs.mean(here for here, _ in middles)
        ratios = [here / there for here, there in middles if here and there]
        return statistics.geometric_mean(ratios) if ratios else None

    return markdown([f"`{key}`", *(h for h, *_ in MEASURES), "false joins"], [
        [value, *(runs.text(over_all(of, value, is_ratio), 2 if is_ratio else 1) for _, of, _, _, is_ratio in MEASURES),
         str(sum(false_joins(sequence, by_value[value]) for sequence, by_value in by_sequence))] for value in values])


def command_line(arguments):
    """The call, without the folders of one machine."""
    parts = [f"python3 tools/benchmarks/sweep.py --haustra HAUSTRA --out OUT --seeds {arguments.seeds}",
             f"--key {arguments.key}", f"--values {arguments.values}"]
    return " ".join(parts + results.shared_options(arguments))


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("sequences", nargs="+", help="SEQUENCE, CLIP or CLIP:FIRST-LAST")
    runs.add_arguments(parser, seeds=3)
    parser.add_argument("--key", required=True, help="the setting")
    parser.add_argument("--values", required=True, help="A,B,...; the summary compares with the last one")
    parser.add_argument("--commit", help="of the program (default: that of this tree)")
    parser.add_argument("--results", type=pathlib.Path, default=pathlib.Path(__file__).resolve().parent / "results")
    parser.add_argument("--overwrite", action="store_true", help="replace results of the same day and commit")
    arguments = parser.parse_args()
    values = arguments.values.split(",")
    if len(values) < 2 or len(set(values)) < len(values) or not all(values):
        sys.exit(f"--values {arguments.values}: needs two values or more, separated by commas, each once")
    sequences = [results.open_sequence(argument) for argument in arguments.sequences]
    date, commit = datetime.date.today().isoformat(), arguments.commit or results.present_commit()
    target = arguments.results / f"{date}-{commit}-{arguments.key}.md"
    if target.exists() and not arguments.overwrite:
        sys.exit(f"{target} is there already (--overwrite replaces it)")

    found, failed = runs.run_variants(arguments, sequences, {v: [f"{arguments.key}={v}"] for v in values})
    if failed:
        sys.exit(f"{failed} runs failed: no results are written; the others are kept for the next call")
    by_sequence = [(s, {v: [found[v][s.name][seed] for seed in sorted(found[v][s.name])] for v in values}) for s in sequences]
    machine = results.machine(arguments.device)
    text = (f"# `{arguments.key}`, {date}, commit {commit}\n\n- machine: {machine}\n- program: sha256 "
            f"{runs.digest_of_file(arguments.haustra)}\n- command: `{command_line(arguments)}`\n- of every run: "
            f"[{target.stem}.json]({target.stem}.json)\n\n"
            f"All sequences: medians of the seeds, then the mean; errors and counts as shares of those at {values[-1]}, geometric mean.\n\n"
            f"{summary(arguments.key, values, by_sequence)}\n"
            "Each sequence: median over the seeds, in brackets the worst. What the columns say stands under the table of README.md.\n\n"
            + "\n".join(f"## {s.name}\n{table(arguments.key, s, by_value)}" for s, by_value in by_sequence))
    arguments.results.mkdir(parents=True, exist_ok=True)
    target.write_text(text, encoding="utf-8")
    kept = {value: {name: {seed: runs.figures_only(report) for seed, report in of_seed.items()}
                    for name, of_seed in of_name.items()} for value, of_name in found.items()}
    document = {"date": date, "commit": commit, "machine": machine, "program": runs.digest_of_file(arguments.haustra),
                "command": command_line(arguments), "key": arguments.key, "values": kept}
    target.with_suffix(".json").write_text(json.dumps(document) + "\n", encoding="utf-8")
    print(f"{text}\n{target}")
    return 0


if __name__ == "__main__":
    sys.exit(main())

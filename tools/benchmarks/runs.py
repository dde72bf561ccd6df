"""Runs of haustra that are made and judged once, for the benchmarks beside this file.

A run's folder holds `run/` (what `haustra run` wrote), `evaluation.json`, and two records of what these were made with:
digests of the program and of every input, and the settings. A run is made again when its record differs, and judged again
when only the judge or the ground truth do. Needs only the standard library.
"""

import concurrent.futures
import fcntl
import functools
import hashlib
import json
import pathlib
import statistics
import subprocess
import sys
import threading

TEXT_SUFFIXES = {".yaml", ".yml", ".txt", ".csv", ".xml", ".json"}
TRUTH_PATTERNS = ("groundtruth*", "reference.txt", "events.csv")  # of the judge, not of the run
_digest_lock = threading.Lock()  # the cache below would let two threads read the same file


@functools.lru_cache(maxsize=None)
def _read_digest(path):
    return hashlib.sha256(path.read_bytes()).hexdigest()


def digest_of_file(path):
    """Digest of a file, read once a process."""
    with _digest_lock:
        return _read_digest(path.resolve())


def digest_of_sequence(sequence):
    """Of a folder: names and sizes of all files, contents of the small ones. Pictures are known by their sizes."""
    if sequence.is_file():
        return digest_of_file(sequence)
    digest = hashlib.sha256()
    for path in sorted(p for p in sequence.rglob("*") if p.is_file()):
        if any(path.match(pattern) for pattern in TRUTH_PATTERNS):
            continue
        digest.update(f"{path.relative_to(sequence)} {path.stat().st_size}\n".encode())
        if path.suffix in TEXT_SUFFIXES or path.name == "mask.png":
            digest.update(digest_of_file(path).encode())
    return digest.hexdigest()


def claim(folder):
    """Two calls that work in one folder would take each other's frames away: the second one is refused, and says so. Returns
    what holds the claim for as long as it is kept."""
    folder.mkdir(parents=True, exist_ok=True)
    lock = open(folder / ".lock", "w", encoding="ascii")
    try:
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        sys.exit(f"{folder}: another call is at work there")
    return lock


def is_made(record, made_with, product):
    """Whether a record says that the product was made with just this."""
    try:
        return product.exists() and json.loads(record.read_text(encoding="utf-8")) == made_with
    except (OSError, ValueError):
        return False


def call(command):
    """Nothing when it went well, else the end of what the command said."""
    done = subprocess.run(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True, errors="replace",
                          check=False)
    return None if done.returncode == 0 else done.stderr.strip()[-300:] or f"exit code {done.returncode}"


def judged_run(folder, haustra, sequence, run_options, judge=None, truth=None, judge_options=(), files=()):
    """Makes a run and judges it, unless both are there already.

    folder         of this run alone
    haustra        the program; `judge`: the program that evaluates, if it is another
    run_options    of `haustra run`, without sequence and --out
    truth          file for --groundtruth; None: there is none
    files          that the options name: their contents count, too
    Returns what `haustra evaluate` found, a dictionary, or a text: the reason why there is none.
    """
    judge = judge or haustra
    out, figures = folder / "run", folder / "evaluation.json"
    run_record, judge_record = folder / "run_made_with.json", folder / "evaluation_made_with.json"
    run_with = {"program": digest_of_file(haustra), "sequence": digest_of_sequence(sequence),
                "options": [str(o) for o in run_options], "files": [digest_of_file(f) for f in files]}
    if not is_made(run_record, run_with, out / "summary.json"):
        for old in (run_record, judge_record, figures):
            old.unlink(missing_ok=True)
        folder.mkdir(parents=True, exist_ok=True)
        if (failure := call([haustra, "run", sequence, "--out", out, "--overwrite", "--report", "off", *run_options])) is not None:
            return f"run failed: {failure}"
        run_record.write_text(json.dumps(run_with, indent=2), encoding="utf-8")

    events = truth.parent / "events.csv" if truth else None
    judge_with = {"program": digest_of_file(judge), "run": run_with, "options": [str(o) for o in judge_options],
                  "truth": [digest_of_file(f) for f in (truth, events) if f and f.is_file()]}
    if not is_made(judge_record, judge_with, figures):
        command = [judge, "evaluate", out, "--json", figures, "--overwrite", *judge_options]
        if truth:
            command += ["--groundtruth", truth]
        if (failure := call(command)) is not None:
            return f"evaluation failed: {failure}"
        judge_record.write_text(json.dumps(judge_with, indent=2), encoding="utf-8")
    return json.loads(figures.read_text(encoding="utf-8"))


def run_all(jobs, tasks):
    """Calls each of `tasks` (key to function), `jobs` at a time, in their order. Yields (key, result) as they end."""
    with concurrent.futures.ThreadPoolExecutor(jobs) as pool:
        keys = {pool.submit(task): key for key, task in tasks.items()}
        for done in concurrent.futures.as_completed(keys):
            yield keys[done], done.result()


def add_arguments(parser, seeds):
    """What every script asks that makes runs of several sequences; `seeds`: the default."""
    parser.add_argument("--haustra", type=pathlib.Path, required=True, help="the program")
    parser.add_argument("--out", type=pathlib.Path, required=True, help="folder for the runs and what comes of them")
    parser.add_argument("--seeds", type=int, default=seeds, help="seeds 1 to N")
    parser.add_argument("--jobs", type=int, default=1, help="runs side by side")
    parser.add_argument("--device", default="cpu", choices=["cpu", "cuda"])
    parser.add_argument("--config", type=pathlib.Path, help="as for haustra run")
    parser.add_argument("--set", action="append", default=[], metavar="KEY=VALUE", help="as for haustra run")


def settings_of(arguments):
    settings = [part for setting in arguments.set for part in ("--set", setting)]
    return settings + (["--config", arguments.config.resolve()] if arguments.config else [])


def run_variants(arguments, sequences, variants, judge=None):
    """Makes and judges the runs of several sequences; the reasons of those that fail go to standard error.

    sequences    each with a name of its own, sequence(out): its folder for `haustra run`, truth: file or None, and
                 judge_options
    variants     name, which is a folder in --out as well, to settings KEY=VALUE beside those of the command line
    Returns {variant: {name: {seed: what `haustra evaluate` found}}} and how many failed.
    """
    for program in known([arguments.haustra, judge]):
        if not program.is_file():
            sys.exit(f"{program}: no such program")
    if len({sequence.name for sequence in sequences}) < len(sequences):
        sys.exit("two sequences have the same name")
    haustra, out = arguments.haustra.resolve(), arguments.out.resolve()
    _held = claim(out)
    folders = {sequence.name: sequence.sequence(out) for sequence in sequences}
    tasks = {}
    for seed in range(1, arguments.seeds + 1):  # seeds first: a series that is broken off has every sequence
        for sequence in sequences:
            for variant, settings in variants.items():
                options = ["--mode", "sequential", "--seed", str(seed), "--device", arguments.device, "--threads", "1",
                           *settings_of(arguments), *(part for setting in settings for part in ("--set", setting))]
                tasks[variant, sequence.name, seed] = functools.partial(
                    judged_run, out / variant / sequence.name / f"seed_{seed}", haustra, folders[sequence.name], options,
                    judge=judge.resolve() if judge else None, truth=sequence.truth, judge_options=sequence.judge_options,
                    files=known([arguments.config]))
    reports, failed = {variant: {sequence.name: {} for sequence in sequences} for variant in variants}, 0
    for (variant, name, seed), result in run_all(arguments.jobs, tasks):
        if isinstance(result, str):
            failed += 1
            print(f"{variant}{' ' if variant else ''}{name} seed {seed}: {result}", file=sys.stderr)
        else:
            reports[variant][name][seed] = result
    return reports, failed


def run_seeds(arguments, sequences, judge=None):
    """run_variants with the settings of the command line alone: {name: {seed: what was found}}, and how many failed."""
    reports, failed = run_variants(arguments, sequences, {"": []}, judge)
    return reports[""], failed


def known(values):
    return [v for v in values if v is not None]


def mean(values):
    values = known(values)
    return statistics.fmean(values) if values else None


def median(values):
    values = known(values)
    return statistics.median(values) if values else None


def text(value, digits):
    return "-" if value is None else f"{value:.{digits}f}"


def figures_only(report):
    """A report without its lists, tables and the folder of one machine: what a results file keeps of a run."""
    return {key: value for key, value in report.items()
            if key != "run" and (key in ("recall", "join_counts") or not isinstance(value, (dict, list)))}


def count_false(run):
    """Joins of all kinds that are false by the ground truth."""
    return sum(count["false"] for count in run["join_counts"].values())


def sum_recall(evaluations, kind):
    """Occasions and how many were taken, of all runs that know."""
    recalls = known(e["recall"][kind] for e in evaluations)
    return sum(r["occasions"] for r in recalls), sum(r["taken"] for r in recalls)

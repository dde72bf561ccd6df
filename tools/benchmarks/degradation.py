#!/usr/bin/env python3
"""How far haustra bears a harder world: for each hardship that `haustra render` knows, sequences of growing strength are
rendered, run on one thread of the CPU, judged by their ground truth, and drawn as one curve a figure. Writes

    tools/benchmarks/results/DATE-COMMIT-degradation.md      date, commit, machine, command, tables, where each curve breaks
    tools/benchmarks/results/DATE-COMMIT-degradation.json    the figures of every run
    tools/benchmarks/results/DATE-COMMIT-degradation.svg     the curves

    python3 tools/benchmarks/degradation.py --haustra build/release/tools/haustra --out OUT --seeds 10 --jobs 2 [CURVE...]

Seed N makes the colon and the run. The point of strength zero is the same for all curves. A point is made again only when
the program or its options have changed, so a sweep that was broken off goes on; its frames are deleted when it is judged.
This folder and a program are enough: it needs no tree, no git, and only the standard library; for the curves h264 and combined
ffmpeg.
"""

import argparse
import datetime
import functools
import json
import pathlib
import re
import shutil
import statistics
import sys
import xml.sax.saxutils

import ablation
import real_clips
import results
import runs

SECONDS, SIZE = 36, "360x270"
ENCODER = "--h264"  # stands among the options of rendering; with the constant rate factor of x264, larger is coarser
# Losses of several kinds; places are seen again. As shares of the length.
LOSSES = (("redout", 0.20, 1.4), ("jump", 0.425, 0.44), ("bubbles", 0.55, 1.4), ("water", 0.87, 1.4))
# Between them, as shares of the length. The first is the middle of the longest part without a loss.
SLIPS = (0.71, 0.32, 0.1, 0.49)


def wrong_focal(percent):
    return ["--calibration-error", f"{percent:g}"]


def wrong_centre(pixels):
    return ["--calibration-error", f"0,{pixels:g},{pixels:g},0"]


def wrong_k1(k1):
    return ["--calibration-error", f"0,0,0,{k1:g}"]


def option(name):
    return lambda strength: [f"--{name}", f"{strength:g}"]


def both_moves(percent):
    return ["--contraction", f"{percent:g}", "--breathing", f"{percent / 2:g}"]


def video(crf):
    """Of no program of ours: the pictures go through an encoder and back."""
    return [ENCODER, f"{crf:g}"]


def event(kind, share=0.71):
    """Of so many seconds, about that share of the length: by default the middle of the longest part between two losses."""
    return lambda seconds: ["--events", f"{kind}@{{{share:g}-{seconds / 2:g}}}+{seconds:g}"]


def slips(count):
    return ["--events", ",".join(f"slip@{{{share:g}}}+0.5" for share in SLIPS[:count])]


def all_together(strength):
    """A hard picture: what a procedure may have, all at once. Everything grows with the strength but the slip, which is whole."""
    parts = [(option("exposure"), 0.5), (video, 23), (wrong_focal, 1), (option("breathing"), 3), (option("contraction"), 3),
             (option("stool"), 20), (option("fluid"), 30), (option("lens-drops"), 8), (event("instrument", 0.32), 4),
             (event("redout", 0.49), 1.4), (event("narrowband", 0.65), 4)]
    return [word for make, most in parts for word in make(strength * most)] + slips(1)


# Name: what it is, unit, options of a strength, strengths (the first one changes nothing).
CURVES = {
    "focal": ("calibration: focal length too long", "%", wrong_focal, [0, 0.5, 1, 2, 4, 8]),
    "centre": ("calibration: centre off by x and y", "px", wrong_centre, [0, 2, 4, 8, 16]),
    "k1": ("calibration: k1 off", "", wrong_k1, [0, 0.005, 0.01, 0.02, 0.04]),
    "exposure": ("exposure", "of the frame period", option("exposure"), [0, 0.25, 0.5, 0.75, 1]),
    "readout": ("rolling shutter", "of the frame period", option("readout"), [0, 0.25, 0.5, 0.75, 1]),
    "fields": ("fields", "of the frame period", option("field-lag"), [0, 0.1, 0.25, 0.5]),
    "jpeg": ("compression: 100 less the JPEG quality", "", lambda s: ["--quality", f"{100 - s:g}"], [8, 30, 50, 70, 80, 90]),
    "h264": ("H.264 video: constant rate factor of x264", "", video, [0, 18, 23, 28, 33, 38]),
    "breathing": ("breathing", "% of the radius", option("breathing"), [0, 3, 6, 9, 12, 15]),
    "contraction": ("travelling contraction", "% of the radius", option("contraction"), [0, 3, 6, 9, 12, 15]),
    "tangential": ("sliding wall", "% of the radius", option("tangential"), [0, 3, 6, 9, 12, 15]),
    "peristalsis": ("contraction, with half as much breathing", "% of the radius", both_moves, [0, 3, 6, 9, 12, 15]),
    "lensdrops": ("drops on the lens", "of 12 % of the height", option("lens-drops"), [0, 4, 8, 16, 32]),
    "stool": ("film of stool", "% of the wall", option("stool"), [0, 10, 20, 40, 60]),
    "blood": ("blood", "% of the wall", option("blood"), [0, 10, 20, 40, 60]),
    "fluid": ("pools of liquid", "% of the radius deep", option("fluid"), [0, 15, 30, 45, 60]),
    "collapse": ("lumen that closes", "% of the radius", option("collapse"), [0, 5, 10, 20, 40]),
    "narrowband": ("narrow-band light", "s", event("narrowband"), [0, 1, 2, 4, 8]),
    "instrument": ("instrument in view", "s", event("instrument"), [0, 1, 2, 4, 8]),
    "slip": ("ground lost for good", "slips", slips, [0, 1, 2, 4]),
    "combined": ("hard picture: many hardships together", "of the full strength", all_together, [0, 0.25, 0.5, 0.75, 1]),
}


def live(figures):
    return ablation.live_coverage(figures)


def error(figures):
    """RMS ATE of all maps, each after a Sim(3) of its own, in percent of the scene depth."""
    if figures["rms_ate"] is None or not figures["scene_depth"]:
        return None
    return 100 * figures["rms_ate"] / figures["scene_depth"]


def occasions(figures):
    """Pairs of maps and losses that could have been joined, and how many were."""
    pairs = [runs.sum_recall([figures], kind) for kind in ("merges", "relocalisations")]
    return sum(p[0] for p in pairs), sum(p[1] for p in pairs)


def recall(figures):
    all_of_them, taken = occasions(figures)
    return 100 * taken / all_of_them if all_of_them else None


# Heading, of one run, digits, and which of several is the worst.
MEASURES = [("live %", live, 1, min), ("maps", lambda f: f["maps"], 0, max), ("error, % of depth", error, 2, max),
            ("joins taken, %", recall, 0, min)]


def start(seconds, place):
    """Of an event that is so much earlier than a share of the length."""
    return f"{max(0.0, float(place[1]) * seconds - float(place[2] or 0)):.2f}"


def render_options(curve, strength, seconds):
    """Options of `haustra render` without folder and seed."""
    options = ["--preset", "losses", "--seconds", f"{seconds:g}", "--size", SIZE, "--threads", "1", "--quiet"]
    options += ["--events", ",".join(f"{kind}@{share * seconds:.2f}+{lasts:g}" for kind, share, lasts in LOSSES)]
    _, _, make, strengths = CURVES[curve]
    if strength != strengths[0]:
        options += [re.sub(r"{([\d.]+)(?:-([\d.]+))?}", functools.partial(start, seconds), part) for part in make(strength)]
    return options


def point_name(curve, strength):
    return "zero" if strength == CURVES[curve][3][0] else f"{curve}_{strength:g}"


def split(render):
    """Options of `haustra render`, and the rate factor of the encoder or None."""
    if ENCODER not in render:
        return render, None
    at = render.index(ENCODER)
    return render[:at] + render[at + 2:], render[at + 1]


def encode(sequence, crf):
    """Replaces the pictures of a sequence by what H.264 video leaves of them. Nothing, or the reason why it failed."""
    if not shutil.which("ffmpeg"):
        return "H.264 needs ffmpeg"
    # Beside the sequence: what a broken sweep leaves in it `haustra render --overwrite` would refuse to delete.
    frames, film = sequence / "frames", sequence.parent / "film.mp4"
    before = sorted(frames.glob("*.jpg"))
    ffmpeg = ["ffmpeg", "-loglevel", "error", "-y", "-threads", "1"]
    commands = [[*ffmpeg, "-framerate", "25", "-i", frames / "%06d.jpg", "-c:v", "libx264", "-crf", crf, "-pix_fmt", "yuv420p", film],
                [*ffmpeg, "-i", film, "-start_number", "0", frames / "%06d.png"]]
    for command in commands:
        if (failure := runs.call(command)) is not None:
            return failure
    film.unlink()
    after = sorted(frames.glob("*.png"))
    if [p.stem for p in after] != [p.stem for p in before]:
        return f"the video has {len(after)} pictures of {len(before)}"
    for picture in before:
        picture.unlink()
    return None


def made_point(folder, haustra, seed, render, keep_frames):
    """Renders, runs and judges, unless that was done before. What `haustra evaluate` found, or the reason why not."""
    record, figures = folder / "made_with.json", folder / "figures.json"
    made_with = {"program": runs.digest_of_file(haustra), "render": render, "seed": seed}
    if runs.is_made(record, made_with, figures):
        return json.loads(figures.read_text(encoding="utf-8"))
    record.unlink(missing_ok=True)
    sequence = folder / "sequence"
    folder.mkdir(parents=True, exist_ok=True)
    rendering, crf = split(render)
    if (failure := runs.call([haustra, "render", sequence, "--seed", str(seed), "--overwrite", *rendering])) is not None:
        return f"rendering failed: {failure}"
    if crf is not None and (failure := encode(sequence, crf)) is not None:
        return f"encoding failed: {failure}"
    options = ["--mode", "sequential", "--seed", str(seed), "--device", "cpu", "--threads", "1"]
    found = runs.judged_run(folder, haustra, sequence, options, truth=sequence / "groundtruth.txt")
    if isinstance(found, str):
        return found
    found = runs.figures_only(found)
    figures.write_text(json.dumps(found), encoding="utf-8")
    record.write_text(json.dumps(made_with, indent=2), encoding="utf-8")
    if not keep_frames:
        shutil.rmtree(sequence / "frames")
        shutil.rmtree(folder / "run")
    return found


def middle(reports, measure):
    values = runs.known(map(measure, reports))
    return statistics.median(values) if values else None


def breaks(points):
    """(strength, the one before it, why) where a curve breaks first, or None.

    points: (strength, reports), the first one of strength zero.
    """
    base = [middle(points[0][1], measure) for _, measure, _, _ in MEASURES]
    for (before, _), (strength, reports) in zip(points, points[1:]):
        coverage, maps, error_percent, taken = (middle(reports, measure) for _, measure, _, _ in MEASURES)
        reasons = []
        if coverage is not None and base[0] is not None and coverage < base[0] - 5:
            reasons.append(f"live coverage {base[0]:.1f} to {coverage:.1f} %")
        if maps is not None and base[1] is not None and maps >= base[1] + 1:
            reasons.append(f"maps {base[1]:g} to {maps:g}")
        if error_percent is not None and error_percent > max(2.0, 2 * (base[2] or 0.0)):
            reasons.append(f"error {runs.text(base[2], 2)} to {error_percent:.2f} % of depth")
        if taken is not None and base[3] is not None and taken < base[3] - 20:
            reasons.append(f"joins taken {base[3]:.0f} to {taken:.0f} %")
        if reasons:
            return strength, before, ", ".join(reasons)
    return None


def table(curve, points):
    title, unit, _, _ = CURVES[curve]
    headings = [f"{title}{', ' + unit if unit else ''}", "runs", *(m[0] for m in MEASURES), "losses", "false joins"]
    lines = ["| " + " | ".join(headings) + " |", "|---" * len(headings) + "|"]
    for strength, reports in points:
        cells = [f"{strength:g}", str(len(reports))]
        cells += [real_clips.cell([measure(r) for r in reports], digits, worst) for _, measure, digits, worst in MEASURES]
        cells += [real_clips.cell([r["losses"] for r in reports], 0, max), str(sum(map(runs.count_false, reports)))]
        lines.append("| " + " | ".join(cells) + " |")
    found = breaks(points)
    verdict = "Does not break in this range."
    if found:
        verdict = f"Breaks between {found[1]:g} and {found[0]:g}{' ' + unit if unit else ''}: {found[2]}."
    return "\n".join(lines) + f"\n\n{verdict}\n"


def panel(curve, points, index, x, y, width, height):
    """One figure of one curve: the median as a line, the seeds as dots."""
    heading, measure, _, _ = MEASURES[index]
    values = [(strength, runs.known(map(measure, reports))) for strength, reports in points]
    high = max([(100, 2, 2, 100)[index], *(v for _, of_point in values for v in of_point)])
    last = points[-1][0] - points[0][0] or 1

    def place(strength, value):
        return x + width * (strength - points[0][0]) / last, y + height * (1 - value / high)

    out = [f'<rect x="{x}" y="{y}" width="{width}" height="{height}" fill="none" stroke="#bbb"/>',
           f'<text x="{x - 5}" y="{y + 9}" text-anchor="end">{high:.{0 if high >= 10 else 1}f}</text>',
           f'<text x="{x - 5}" y="{y + height}" text-anchor="end">0</text>',
           f'<text x="{x + 4}" y="{y - 5}">{xml.sax.saxutils.escape(heading)}</text>']
    for strength, _ in points:
        out.append(f'<text x="{place(strength, 0)[0]:.1f}" y="{y + height + 13}" text-anchor="middle">{strength:g}</text>')
    for strength, of_point in values:
        out += [f'<circle cx="{a:.1f}" cy="{b:.1f}" r="2" fill="#2e7d4f" fill-opacity="0.35"/>'
                for a, b in (place(strength, v) for v in of_point)]
    line = " ".join("%.1f,%.1f" % place(s, statistics.median(v)) for s, v in values if v)
    out.append(f'<polyline points="{line}" fill="none" stroke="#2e7d4f" stroke-width="2"/>')
    found = breaks(points)
    if found:
        a = place(found[0], 0)[0]
        out.append(f'<line x1="{a:.1f}" y1="{y}" x2="{a:.1f}" y2="{y + height}" stroke="#c0392b" stroke-dasharray="3 3"/>')
    return out


def page(curves):
    """All curves as one SVG picture: a row each; a dashed line where it breaks. curves: name to points."""
    row, left, width, gap = 150, 46, 180, 60
    whole_width, whole_height = left + 4 * width + 3 * gap + 16, row * len(curves) + 10
    out = [f'<svg xmlns="http://www.w3.org/2000/svg" width="{whole_width}" height="{whole_height}" '
           f'viewBox="0 0 {whole_width} {whole_height}" font-family="sans-serif" font-size="10" fill="#222">',
           f'<rect width="{whole_width}" height="{whole_height}" fill="#fff"/>']
    for i, (curve, points) in enumerate(curves.items()):
        title, unit, _, _ = CURVES[curve]
        top = row * i
        out.append(f'<text x="{left}" y="{top + 20}" font-size="13" font-weight="bold">'
                   f'{xml.sax.saxutils.escape(title + (", " + unit if unit else ""))}</text>')
        for k in range(len(MEASURES)):
            out += panel(curve, points, k, left + k * (width + gap), top + 44, width, 78)
    return "\n".join(out + ["</svg>"]) + "\n"


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("curves", nargs="*", metavar="CURVE", help=f"of {', '.join(CURVES)} (default: all)")
    parser.add_argument("--haustra", type=pathlib.Path, required=True, help="the program")
    parser.add_argument("--out", type=pathlib.Path, required=True, help="folder for the points that are made")
    parser.add_argument("--seeds", type=int, default=10, help="seeds 1 to N")
    parser.add_argument("--jobs", type=int, default=1, help="points made side by side, one thread each")
    parser.add_argument("--seconds", type=float, default=SECONDS, help="of each sequence")
    parser.add_argument("--ends-only", action="store_true", help="only the smallest and the largest strength")
    parser.add_argument("--keep-frames", action="store_true", help="leave what was rendered and run")
    parser.add_argument("--commit", help="of the program (default: that of this tree)")
    parser.add_argument("--results", type=pathlib.Path, default=pathlib.Path(__file__).resolve().parent / "results")
    parser.add_argument("--overwrite", action="store_true", help="replace results of the same day and commit")
    arguments = parser.parse_args()
    if not arguments.haustra.is_file():
        sys.exit(f"{arguments.haustra}: no such program")
    names = arguments.curves or list(CURVES)
    for name in names:
        if name not in CURVES:
            sys.exit(f"no curve '{name}'; there are {', '.join(CURVES)}")
    if arguments.seconds < 12:
        sys.exit("--seconds: the losses need at least 12")
    date, commit = datetime.date.today().isoformat(), arguments.commit or results.present_commit()
    target = arguments.results / f"{date}-{commit}-degradation.md"
    if target.exists() and not arguments.overwrite:
        sys.exit(f"{target} is there already (--overwrite replaces it)")
    haustra, out = arguments.haustra.resolve(), arguments.out.resolve()
    _held = runs.claim(out)

    strengths = {name: [CURVES[name][3][0], CURVES[name][3][-1]] if arguments.ends_only else CURVES[name][3] for name in names}
    tasks = {}
    for seed in range(1, arguments.seeds + 1):  # seeds first: a sweep that is broken off has every curve
        for name in names:
            for strength in strengths[name]:
                key = point_name(name, strength), seed
                render = render_options(name, strength, arguments.seconds)
                tasks[key] = functools.partial(made_point, out / key[0] / f"seed_{seed}", haustra, seed, render,
                                               arguments.keep_frames)
    found, failed = {}, 0
    for i, (key, result) in enumerate(runs.run_all(arguments.jobs, tasks), start=1):
        if isinstance(result, str):
            failed += 1
            print(f"{key[0]} seed {key[1]}: {result}", file=sys.stderr)
        else:
            found[key] = result
            print(f"{i} of {len(tasks)}: {key[0]} seed {key[1]}: live {live(result):.1f} %", flush=True)
    if failed:
        sys.exit(f"{failed} points failed: no results are written; the others are kept for the next call")

    curves = {name: [(s, [found[point_name(name, s), seed] for seed in range(1, arguments.seeds + 1)])
                     for s in strengths[name]] for name in names}
    command = (f"python3 tools/benchmarks/degradation.py --haustra HAUSTRA --out OUT --seeds {arguments.seeds} "
               f"--seconds {arguments.seconds:g}{' --ends-only' if arguments.ends_only else ''}"
               f"{' ' + ' '.join(arguments.curves) if arguments.curves else ''}")
    machine, program = results.machine("cpu"), runs.digest_of_file(haustra)
    arguments.results.mkdir(parents=True, exist_ok=True)
    text = (f"# A harder world, {date}, commit {commit}\n\n- machine: {machine}\n- program: sha256 {program}\n"
            f"- command: `{command}`\n- of every run: [{target.stem}.json]({target.stem}.json)\n\n"
            f"![The curves]({target.stem}.svg)\n\n"
            "Rendered colons (preset `losses`), "
            f"{arguments.seconds:g} s at {SIZE}; a colon a seed. Median over the seeds, in brackets the worst. *Live*: of the frames in\n"
            "which the scene can be seen, those with a pose at the time. *Error*: RMS of the camera centres, a Sim(3) a map. *Joins\n"
            "taken*: of the pairs of maps that share a view and the losses whose map came into view again.\n\n"
            "A curve breaks where the medians are worse than at the first strength, in one of four ways. Live coverage is more than 5\n"
            "points lower; there is one more map; the error is above 2 % of the depth and has doubled; or 20 points fewer joins are taken.\n\n"
            + "\n".join(f"## {name}\n{table(name, points)}" for name, points in curves.items()))
    target.write_text(text, encoding="utf-8")
    target.with_suffix(".svg").write_text(page(curves), encoding="utf-8")
    document = {"date": date, "commit": commit, "machine": machine, "program": program, "command": command,
                "points": {f"{name} {seed}": figures for (name, seed), figures in sorted(found.items())}}
    target.with_suffix(".json").write_text(json.dumps(document) + "\n", encoding="utf-8")
    print(f"\n{text}\n{target}")
    return 0


if __name__ == "__main__":
    sys.exit(main())

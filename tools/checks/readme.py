#!/usr/bin/env python3
"""Fails when what people read first is not in order.

    readme.py [ROOT]      ROOT defaults to the repository that this file lies in

- README.md has at most 120 lines. Every top folder has a README.md, with a section Contract and a section Limits.
- No sentence of a README.md, a decision record, CHANGELOG.md or CONTRIBUTING.md has more than 35 words, and no sentence of a
  cell of a README.md's table. Code, headings and comments do not count; a piece of inline code and a link's text are one word
  and its words.
- A decision record is a page at most: 60 lines.
- Source files and scripts that inline code of a README.md names are in the tree, at any place that ends with the name.
- Links to files of the tree resolve, in every .md file.
- README.md has one block of results between its markers, with a link to one results file. Its table is that file's, row by row.
- Every page of tools/benchmarks/results is linked by another page, and has its raw figures beside it, a .json of its name, but
  for the old ones that are listed here, in WITHOUT_JSON. What is listed is there.
- Any other table of a README.md with figures outside inline code (decimal fractions, and numbers with %, a unit of time or
  length, Hz, kB, MB or GB) has, on the line before it, <!-- figures: FILE... -->: paths from that README.md to results files,
  decision records or, for a limit or a default, the source that has it. Every number of the table occurs in one of them, and
  the README.md links to each, or it lies in decisions/ beside it.
- Figures in the prose of a README.md occur in such a file, or in a results file or decision record that it links to, or in one
  of decisions/ beside it. 1 % may stand there as 0.01. What is a part of a size, a date or a name there is no figure.

One line a violation, "path:line: what is wrong"; exit code 0 clean, 1 violations, 64 usage.
"""

import os
import re
import sys
from pathlib import Path

from checker import Violations, root_of, verdict

MAX_LINES, MAX_RECORD_LINES, MAX_WORDS = 120, 60, 35
PLAIN = ["README.md", "CHANGELOG.md", "CONTRIBUTING.md"]
TOP_FOLDERS = ["hal", "kernels", "capture", "engine", "platform", "toolchains", "config", "tests", "tools"]
SECTIONS = ["Contract", "Limits"]  # of the README of each top folder
BEGIN, END = "<!-- results: begin -->", "<!-- results: end -->"
RESULTS = "tools/benchmarks/results/"
# Results of before raw figures were kept.
WITHOUT_JSON = {
    "2026-11-22-aa07df5-h200", "2026-11-23-36db57d-joins", "2026-11-23-3e3d8e5", "2026-11-23-48a00ea-h200",
    "2026-11-25-0267916-surface", "2026-11-25-60ea58c-retrieval", "2026-11-26-14dd19a-depth-on-cuda", "2026-11-26-8f11f32-marks",
    "2026-11-27-125748f-surface", "2026-11-27-262b8e2-depth-peers", "2026-11-27-28bfdd7-surface-720x540",
    "2026-11-27-3e1cb4f-retrieval-cuda", "2026-11-28-ae2be7b-wall", "2026-11-30-527d133-wall",
}
FIGURES = re.compile(r"^<!-- figures: (.*) -->$")
# Where figures come from.
SOURCE = re.compile(r"(?:^|/)(?:benchmarks/results|decisions)/[^/]+\.md$")
# A number by itself: not a part of a name, a size (720x540), a version or a revision.
NUMBER = re.compile(r"(?<![\w./-])\d+(?:\.\d+)?(?![\w/]|\.\d|-\d)")
QUANTITY = re.compile(rf"({NUMBER.pattern})(?: ?(%|(?:us|ms|s|mm|seconds|minutes|hours|Hz|kB|MB|GB)\b))?")
SOURCE_FILE = re.compile(r"(?<![\w./*{])[\w-][\w./-]*\.(?:h|cc|cuh?|c|py|sh|cmake)(?![\w.])")
LINK = re.compile(r"!?\[[^\]]*\]\(([^)\s]+)[^)]*\)|\b(?:src|href)=\"([^\"]+)\"")


def lines_of(text):
    """(number, line) of everything that is not code."""
    fenced, blank_before, in_list = False, True, False
    for number, line in enumerate(text.splitlines(), start=1):
        if line.lstrip().startswith("```"):
            fenced = not fenced
            yield number, ""
            continue
        indented_code = line.startswith("    ") and blank_before and not in_list
        if fenced or indented_code:
            yield number, ""
            continue  # the line after it may be code, too
        blank_before = not line.strip()
        if re.match(r"\s*([-*+]|\d+\.) ", line):
            in_list = True
        elif line.strip() and not line.startswith(" "):
            in_list = False
        yield number, line


def is_table(line):
    return line.lstrip().startswith("|")


def paragraphs(text):
    """(number of the first line, text) of each paragraph, list items apart; no code, tables, headings, comments."""
    start, parts = 0, []
    for number, line in lines_of(text):
        ends = not line.strip() or is_table(line) or line.startswith(("#", "<!--", "<"))
        if parts and (ends or re.match(r"\s*([-*+]|\d+\.) ", line)):
            yield start, " ".join(parts)
            parts = []
        if not ends:
            start = start if parts else number
            parts.append(line.strip())
    if parts:
        yield start, " ".join(parts)


def words_of(sentence):
    return [word for word in sentence.split() if re.search(r"\w", word)]


def sentences(paragraph):
    plain = re.sub(r"`[^`]*`", "code", paragraph)
    plain = re.sub(r"!?\[([^\]]*)\]\([^)]*\)", r"\1", plain)
    plain = re.sub(r"^([-*+]|\d+\.) ", "", plain)
    return re.split(r"(?<=[.!?])[)*_\"]*\s+", plain)


def without_code(text):
    """Neither inline code nor the targets of links; as long as before."""
    return re.sub(r"`[^`]*`|\]\([^)]*\)", lambda match: " " * len(match.group()), text)


def numbers(text):
    return NUMBER.findall(without_code(text))


def figures(text):
    """(number, unit, place) of what is measured or limited: numbers with a unit, and decimal fractions."""
    return [(match[1], match[2] or "", match.start()) for match in QUANTITY.finditer(without_code(text))
            if match[2] or "." in match[1]]


def known_numbers(path):
    """By their value: 0.30 in a table is 0.3 in a JSON file. Of a page those that stand by themselves."""
    number = NUMBER if path.suffix == ".md" else re.compile(r"(?<![\w.])\d+(?:\.\d+)?")
    return {float(n) for n in number.findall(path.read_text(encoding="utf-8"))}


def line_at(text, first, place):
    """The line of a place in a paragraph that begins in line `first`."""
    for number, line in enumerate(text.splitlines()[first - 1:], start=first):
        place -= len(line.strip()) + 1
        if place < 0:
            return number
    return first


def linked_files(path, text):
    """What a reader of a page can follow."""
    shown = "\n".join(re.sub(r"`[^`]*`", "", line) for _, line in lines_of(text))
    return {(path.parent / (match[1] or match[2]).split("#")[0]).resolve() for match in LINK.finditer(shown)}


class Checker(Violations):
    def files(self):
        """Every file of the tree; what is built and what is hidden are no part of it, .github is."""
        for folder, folders, files in os.walk(self.root):
            is_root = Path(folder) == self.root
            folders[:] = sorted(f for f in folders if (not f.startswith(".") or f == ".github") and
                                not (is_root and f.startswith(("build", "out"))))
            for name in sorted(files):
                yield Path(folder) / name

    def check_lines(self, path, text, limit):
        if (count := len(text.splitlines())) > limit:
            self.report(path, count, f"{count} lines, {limit} are allowed")

    def check_names(self, path, text, places):
        for number, line in lines_of(text):
            for name in SOURCE_FILE.findall(" ".join(re.findall(r"`([^`]*)`", line))):
                if not any(place.endswith("/" + name) for place in places):
                    self.report(path, number, f"there is no {name}")

    def check_sentences(self, path, text):
        for line, paragraph in paragraphs(text):
            for sentence in sentences(paragraph):
                if (count := len(words_of(sentence))) > MAX_WORDS:
                    start = " ".join(sentence.split()[:6])
                    self.report(path, line, f"a sentence of {count} words, {MAX_WORDS} are allowed: {start} ...")

    def check_cells(self, path, text):
        for number, line in lines_of(text):
            for cell in line.strip().strip("|").split("|") if is_table(line) else []:
                for sentence in sentences(cell.strip()):
                    if (count := len(words_of(sentence))) > MAX_WORDS:
                        self.report(path, number, f"a cell with a sentence of {count} words, {MAX_WORDS} are allowed")

    def check_links(self, path, text):
        for number, line in lines_of(text):
            for match in LINK.finditer(re.sub(r"`[^`]*`", "", line)):
                target = (match.group(1) or match.group(2)).split("#")[0]
                if target and not re.match(r"[a-z][a-z+.-]*:", target) and not (path.parent / target).exists():
                    self.report(path, number, f"the link to {target} leads nowhere")

    def check_numbers(self, path, table, sources):
        """Whether each number of a table, [(line number, line)], occurs in one of the files."""
        known = set().union(*(known_numbers(source) for source in sources))
        for number, line in table:
            for found in numbers(line):
                if float(found) not in known:
                    self.report(path, number, f"{found} is not in {', '.join(s.name for s in sources)}")

    def check_figures(self, path, text):
        marker, table, line_before = None, [], ""
        for number, line in [*lines_of(text), (0, "")]:
            if is_table(line):
                if not table:
                    marker = FIGURES.match(line_before)
                table.append((number, line))
            elif table:
                self.check_table(path, marker, table)
                table = []
            line_before = line

    def check_table(self, path, marker, table):
        if marker is None:
            for number, line in table:
                for found, _, _ in figures(line):
                    self.report(path, number, f"a figure ({found}) without a results file or a decision record")
                    return
            return
        sources = [path.parent / name for name in marker.group(1).split()]
        if all(source.is_file() for source in sources):
            self.check_numbers(path, table, sources)

    def check_prose(self, path, text):
        """Whether each figure of the prose occurs in a source that a reader of this README finds."""
        linked = linked_files(path, text)
        own = set((path.parent / "decisions").resolve().glob("*.md"))
        named = [(number, (path.parent / name).resolve()) for number, line in enumerate(text.splitlines(), start=1)
                 if (marker := FIGURES.match(line)) for name in marker.group(1).split()]
        for number, source in named:
            if not source.is_file():
                self.report(path, number, f"figures of {source.name}, which is not there")
            elif source not in linked | own:
                self.report(path, number, f"figures of {source.name}, which this README does not link to")
        sources = {source for _, source in named} | {source for source in linked if SOURCE.search(source.as_posix())} | own
        known = set().union(*(known_numbers(source) for source in sources if source.is_file()))
        for first, paragraph in paragraphs(text):
            for found, unit, place in figures(paragraph):
                values = {float(found), round(float(found) / 100, 9)} if unit == "%" else {float(found)}
                if not values & known:
                    self.report(path, line_at(text, first, place),
                                f"a figure ({found}{unit}) that is in no results file or decision record that this README "
                                "links to, and in none of its own folder")

    def check_results(self, path, text):
        if text.count(BEGIN) != 1 or text.count(END) != 1 or text.index(BEGIN) > text.index(END):
            self.report(path, 1, f"one block of results, {BEGIN} to {END}, is wanted")
            return
        block = text[text.index(BEGIN):text.index(END)]
        linked = set(re.findall(rf"\(({RESULTS}[^)\s]+\.md)\)", block))
        first = text.count("\n", 0, text.index(BEGIN)) + 1
        if len(linked) != 1 or not (source := self.root / linked.pop()).is_file():
            self.report(path, first, f"the block of results links to no file in {RESULTS}, or to several")
            return
        table = [(first + i, line) for i, line in enumerate(block.splitlines()) if is_table(line)]
        measured = [line for line in source.read_text(encoding="utf-8").splitlines() if is_table(line)]
        for (number, line), row in zip(table, measured):
            if line != row:
                self.report(path, number, f"this row is not that of {source.name}: {row}")
        if not table or len(table) != len(measured):
            self.report(path, first, f"the table has {len(table)} lines, that of {source.name} {len(measured)}")

    def check_results_pages(self, linked):
        """`linked`: what the pages of the tree link to, each but itself."""
        for page in sorted((self.root / RESULTS).glob("*.md")):
            if page.resolve() not in linked:
                self.report(page, 0, "no page links to it")
            if page.stem not in WITHOUT_JSON and not page.with_suffix(".json").is_file():
                self.report(page, 0, "its raw figures, a .json beside it, are not there")
        for name in sorted(WITHOUT_JSON):
            if not (page := self.root / RESULTS / f"{name}.md").is_file():
                self.report(page, 0, "is not there, and WITHOUT_JSON lists it")

    def run(self):
        for folder in TOP_FOLDERS:
            readme = self.root / folder / "README.md"
            if not readme.is_file():
                self.report(self.root / folder, 0, "has no README.md")
                continue
            text = readme.read_text(encoding="utf-8")
            for section in SECTIONS:
                if not re.search(rf"^## {section}\b", text, re.MULTILINE):
                    self.report(readme, 1, f"has no section {section}")
        files = list(self.files())
        places = ["/" + path.relative_to(self.root).as_posix() for path in files]
        linked = set()
        for path in (path for path in files if path.suffix == ".md"):
            text = path.read_text(encoding="utf-8")
            self.check_links(path, text)
            linked |= linked_files(path, text) - {path.resolve()}
            if path.parent.name == "decisions":
                self.check_lines(path, text, MAX_RECORD_LINES)
            if path.parent.name == "decisions" or path.name in PLAIN:
                self.check_sentences(path, text)
            if path.name != "README.md":
                continue
            self.check_names(path, text, places)
            self.check_cells(path, text)
            self.check_prose(path, text)
            if path.parent == self.root:
                self.check_lines(path, text, MAX_LINES)
                self.check_results(path, text)
                if BEGIN in text and END in text:
                    inside = text[text.index(BEGIN):text.index(END)]
                    text = text.replace(inside, "\n" * inside.count("\n"))
            self.check_figures(path, text)
        self.check_results_pages(linked)
        return self.lines()


def main(arguments):
    root = root_of(arguments, __doc__, lambda root: None if (root / "README.md").is_file() else "has no README.md")
    return verdict(Checker(root).run(), "things to put in order", "readme: clean")


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))

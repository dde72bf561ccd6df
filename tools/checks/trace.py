#!/usr/bin/env python3
"""Traces requirements to the tests that prove them.

    trace.py [ROOT] [--matrix] [--ran FILE]      ROOT defaults to the repository that this file lies in

Requirements are the rows of tests/requirements.csv: id, hazard, requirement. A C++ test proves those that it records with
RecordProperty("req", "TRK-001,PUB-002"), a script those named in a comment "# req: TRK-001". Hazards are those of
platform/daemon/README.md, where a row begins with "| H1 |".

Fails on a requirement without a test, a test of a requirement that does not exist, a hazard without a requirement or
the other way round, and on ids that are doubled or malformed. --matrix prints the table in Markdown as well.

--ran: what `ctest --output-junit FILE --test-output-size-passed ...` wrote, of all tests; FILE is relative to ROOT.
Fails also on a requirement of which no test ran, but for one whose tests all lie in files named cuda or gpu: it is
named. A script ran when ctest ran something of its folder. Exit code 0 clean, 1 violations, 64 usage.
"""

import csv
import re
import sys
from xml.etree import ElementTree

from checker import root_of, verdict

REQUIREMENTS = "tests/requirements.csv"
HAZARDS = "platform/daemon/README.md"
ID = re.compile(r"^[A-Z]+-[0-9]{3}$")
TEST = re.compile(r"^TEST(?:_F|_P)?\((\w+), (\w+)\) \{", re.MULTILINE)
RECORD = re.compile(r'RecordProperty\("req", "([^"]*)"\)')
OUTCOME = re.compile(r"\[ +(OK|SKIPPED) +\] (?:\w+/)?(\w+\.\w+)")  # as GoogleTest prints it
NEEDS_DEVICE = re.compile(r"/[^/]*(?:cuda|gpu)[^/]*$")
SCRIPT = re.compile(r"^# req: (.*)$", re.MULTILINE)


def read_requirements(root, problems):
    """{id: (hazard, text)} in the order of the file."""
    requirements = {}
    with open(root / REQUIREMENTS, newline="", encoding="utf-8") as file:
        for line, row in enumerate(csv.reader(file), start=1):
            if line == 1:
                if row != ["id", "hazard", "requirement"]:
                    problems.append(f"{REQUIREMENTS}:1: the head must be id,hazard,requirement")
                continue
            if len(row) != 3 or not ID.match(row[0]) or not row[2].strip():
                problems.append(f"{REQUIREMENTS}:{line}: not 'id,hazard,requirement'")
            elif row[0] in requirements:
                problems.append(f"{REQUIREMENTS}:{line}: {row[0]} is there twice")
            else:
                requirements[row[0]] = (row[1], row[2])
    return requirements


def find_proofs(root, problems):
    """(id, test, "path:line") for every mark in tests/."""
    proofs = []
    for path in sorted((root / "tests").rglob("*")):
        if path.suffix not in (".cc", ".sh", ".py") or not path.is_file():
            continue
        text = path.read_text(encoding="utf-8", errors="replace")
        relative = path.relative_to(root).as_posix()
        tests = list(TEST.finditer(text))
        marks = RECORD if path.suffix == ".cc" else SCRIPT
        for mark in marks.finditer(text):
            place = f"{relative}:{text.count(chr(10), 0, mark.start()) + 1}"
            name = relative
            if path.suffix == ".cc":
                before = [test for test in tests if test.start() < mark.start()]
                if not before:
                    problems.append(f"{place}: a requirement outside a test")
                    continue
                name = f"{before[-1].group(1)}.{before[-1].group(2)}"
            for identity in re.split(r"[,\s]+", mark.group(1).strip()):
                proofs.append((identity, name, place))
    return proofs


def read_outcomes(path):
    """Names of what ran, GoogleTest's and ctest's, and of GoogleTest's that were skipped."""
    ran, skipped = set(), set()
    for case in ElementTree.parse(path).iter("testcase"):
        if case.get("status") == "run":
            ran.add(case.get("name"))
        for outcome, name in OUTCOME.findall(case.findtext("system-out") or ""):
            (ran if outcome == "OK" else skipped).add(name)
    return ran, skipped


def check_that_they_ran(tests_of, path, problems):
    """`tests_of`: {id: {test: "path:line"}}. The ids that only a device could have proved."""
    ran, skipped = read_outcomes(path)
    unproved = []
    for identity, tests in tests_of.items():
        folders = {"/".join(test.split("/")[1:-1]) + "/" for test in tests if "/" in test}
        if not tests or not ran.isdisjoint(tests) or any(name.startswith(tuple(folders)) for name in ran):
            continue
        if all(NEEDS_DEVICE.search(place) for place in tests.values()):
            unproved.append(identity)
        else:
            names = ", ".join(f"{test} (skipped)" if test in skipped else test for test in tests)
            problems.append(f"{REQUIREMENTS}: {identity}: no test of it ran: {names}")
    return unproved


def main(arguments):
    wants_matrix = "--matrix" in arguments
    arguments = [argument for argument in arguments if argument != "--matrix"]
    ran = None
    if "--ran" in arguments[:-1]:
        at = arguments.index("--ran")
        ran = arguments[at + 1]
        del arguments[at:at + 2]
    root = root_of(arguments, __doc__, lambda root: None if (root / REQUIREMENTS).is_file() else f"has no {REQUIREMENTS}")
    problems = []
    requirements = read_requirements(root, problems)
    tests_of = {identity: {} for identity in requirements}
    for identity, test, place in find_proofs(root, problems):
        if identity not in requirements:
            problems.append(f"{place}: proves {identity or 'nothing'}, which is no requirement")
        else:
            tests_of[identity].setdefault(test, place)
    for identity, tests in tests_of.items():
        if not tests:
            problems.append(f"{REQUIREMENTS}: {identity} has no test")

    hazards_file = root / HAZARDS
    text = hazards_file.read_text(encoding="utf-8") if hazards_file.is_file() else ""
    hazards = re.findall(r"^\| (H[0-9]+) \|", text, re.MULTILINE)
    for hazard in sorted(set(hazards), key=hazards.index):
        if not any(of == hazard for of, _ in requirements.values()):
            problems.append(f"{HAZARDS}: {hazard} has no requirement")
    for identity, (hazard, _) in requirements.items():
        if hazard not in hazards:
            problems.append(f"{REQUIREMENTS}: {identity} names {hazard}, which {HAZARDS} does not")

    if wants_matrix:
        print("| requirement | hazard | text | tests |\n|---|---|---|---|")
        for identity, (hazard, requirement) in requirements.items():
            print(f"| {identity} | {hazard} | {requirement} | {', '.join(tests_of[identity])} |")
    clean = None if wants_matrix else f"trace: {len(requirements)} requirements, each with a test"
    if ran is not None:
        for identity in check_that_they_ran(tests_of, root / ran, problems):
            print(f"trace: {identity}: skipped, all its tests need a GPU: {', '.join(tests_of[identity])}")
        clean = clean and clean + " that ran"
    return verdict(problems, "faults in the trace", clean)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))

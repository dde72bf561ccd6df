#!/usr/bin/env python3
"""Fails when an include or a CMake link crosses the layers of the project the wrong way.

    layers.py [ROOT]      ROOT defaults to the repository that this file lies in

The rules are the tables below. One line a violation, "path:line: what is wrong"; exit code 0 clean, 1 violations, 64 usage.
"""

import re
import sys

from checker import Violations, root_of, verdict

# What a folder may include and link, beside itself.
ALLOWED = {
    "hal": set(),
    "kernels": {"hal"},
    "capture": {"hal"},
    "engine": {"hal"},
    "platform": {"hal", "kernels", "capture", "engine"},
    "tools": {"hal", "kernels", "capture", "engine", "platform"},
    "tests": {"hal", "kernels", "capture", "engine", "platform", "tools"},
}

STANDARD_HEADERS = set(
    """
    algorithm any array atomic barrier bit bitset cassert cctype cerrno cfenv cfloat charconv chrono cinttypes climits
    clocale cmath codecvt compare complex concepts condition_variable coroutine csetjmp csignal cstdarg cstddef cstdint
    cstdio cstdlib cstring ctime cuchar cwchar cwctype deque exception execution filesystem format forward_list fstream
    functional future initializer_list iomanip ios iosfwd iostream istream iterator latch limits list locale map memory
    memory_resource mutex new numbers numeric optional ostream queue random ranges ratio regex scoped_allocator semaphore
    set shared_mutex source_location span sstream stack stdexcept stop_token streambuf string string_view strstream
    syncstream system_error thread tuple type_traits typeindex typeinfo unordered_map unordered_set utility valarray
    variant vector version
    """.split()
)
# Standard headers that stand for the operating system: threads and files are the business of platform and capture.
OPERATING_SYSTEM = {
    "barrier", "condition_variable", "filesystem", "fstream", "future", "iostream", "latch", "mutex", "semaphore",
    "shared_mutex", "stop_token", "syncstream", "thread",
}

# Third-party headers and link targets by folder; folders that are not named may use any but the forbidden ones. The
# longest matching path decides.
THIRD_PARTY_HEADERS = {
    "hal": [],
    "engine": ["Eigen/"],
    "engine/geometry": ["Eigen/", "immintrin.h"],  # of the compiler: lanes.h
    "engine/io": ["Eigen/", "zlib.h"],
    "engine/optim": ["Eigen/", "ceres/"],
}
THIRD_PARTY_TARGETS = {
    "hal": [],
    "engine": ["Eigen3::Eigen"],
    "engine/io": ["Eigen3::Eigen", "ZLIB::ZLIB"],
    "engine/optim": ["Eigen3::Eigen", "Ceres::ceres"],
}
# Only a yardstick: never part of the product.
FORBIDDEN_IN_PRODUCT = re.compile(r"opencv|^cv::", re.IGNORECASE)
# Targets of ours that have no folder: flags and nothing to link.
NEUTRAL_TARGETS = {"haustra_flags"}

# Headers for clients are installed side by side, and name each other so.
CLIENT_HEADER = re.compile(r"haustra_\w+\.h")

SOURCE_SUFFIXES = {".h", ".cc", ".cu", ".cuh", ".hpp", ".cpp", ".inc"}
INCLUDE = re.compile(r'^[ \t]*#[ \t]*include[ \t]*(?:"([^"]*)"|<([^>]*)>)', re.MULTILINE)
LINK_KEYWORDS = {"PUBLIC", "PRIVATE", "INTERFACE", "LINK_PUBLIC", "LINK_PRIVATE", "debug", "optimized", "general"}


def blank_comments(text):
    """C++ without comments; line breaks stay, so that line numbers do."""

    def blank(match):
        token = match.group(0)
        return token if token[0] in "\"'" else re.sub(r"[^\n]", " ", token)

    return re.sub(r'//[^\n]*|/\*.*?\*/|"(?:\\.|[^"\\\n])*"', blank, text, flags=re.DOTALL)


def longest_rule(rules, folder):
    """The value of the rule whose path is the longest prefix of `folder`, or None."""
    while folder:
        if folder in rules:
            return rules[folder]
        folder = folder.rpartition("/")[0]
    return None


def is_yardstick(folder):
    """Benchmarks and tests are not part of the product."""
    return folder.split("/")[0] == "tests" or "benchmarks" in folder.split("/")


class Checker(Violations):
    def files(self):
        for layer in ALLOWED:
            for path in sorted((self.root / layer).rglob("*")):
                if path.is_file():
                    yield layer, path

    # Includes.

    def check_source(self, layer, path):
        folder = path.parent.relative_to(self.root).as_posix()
        text = blank_comments(path.read_text(encoding="utf-8", errors="replace"))
        for match in INCLUDE.finditer(text):
            line = text.count("\n", 0, match.start()) + 1
            quoted, angled = match.groups()
            if quoted is not None:
                self.check_own_include(layer, path, line, quoted)
            else:
                self.check_foreign_include(layer, folder, path, line, angled)

    def check_own_include(self, layer, path, line, name):
        if CLIENT_HEADER.fullmatch(name) and CLIENT_HEADER.fullmatch(path.name) and (path.parent / name).is_file():
            return
        parts = name.split("/")
        if parts[0] not in ALLOWED or ".." in parts or len(parts) < 2:
            self.report(path, line, f'"{name}": include paths of ours start at the repository root')
        elif parts[0] != layer and parts[0] not in ALLOWED[layer]:
            self.report(path, line, f'{layer} must not include {parts[0]} ("{name}")')

    def check_foreign_include(self, layer, folder, path, line, name):
        first = name.split("/")[0]
        if first in ALLOWED and (self.root / name).is_file():
            self.check_own_include(layer, path, line, name)
            self.report(path, line, f'<{name}>: headers of ours are included with quotes')
            return
        if is_yardstick(folder):
            return
        if FORBIDDEN_IN_PRODUCT.search(name):
            self.report(path, line, f"<{name}> is for benchmarks and tests only")
            return
        if name in STANDARD_HEADERS:
            is_interface = layer == "hal" and path.suffix == ".h" and folder != "hal/fakes"
            if name in OPERATING_SYSTEM and (layer == "engine" or is_interface):
                self.report(path, line, f"{layer} must not use the operating system (<{name}>)")
            return
        allowed = longest_rule(THIRD_PARTY_HEADERS, folder)
        if allowed is not None and not any(name.startswith(prefix) for prefix in allowed):
            what = ", ".join(prefix.rstrip("/") for prefix in allowed) or "nothing else"
            self.report(path, line, f"<{name}>: {folder} may use the standard library and {what}")

    # Links.

    def cmake_commands(self, path):
        """(line, name, arguments) of every command; comments and quotes are gone, brackets inside arguments kept."""
        text = re.sub(r"#[^\n]*", "", path.read_text(encoding="utf-8", errors="replace"))
        for match in re.finditer(r"^[ \t]*(\w+)[ \t]*\(", text, re.MULTILINE):
            depth, end = 1, match.end()
            while end < len(text) and depth > 0:
                depth += {"(": 1, ")": -1}.get(text[end], 0)
                end += 1
            line = text.count("\n", 0, match.start()) + 1
            yield line, match.group(1).lower(), text[match.end() : end - 1].replace('"', "").split()

    def check_links(self, cmake_files):
        folder_of_target = {}
        for _, path in cmake_files:
            for _, name, arguments in self.cmake_commands(path):
                if name in ("add_library", "add_executable") and arguments and "${" not in arguments[0]:
                    folder_of_target[arguments[0]] = path.parent.relative_to(self.root).as_posix()
        for _, path in cmake_files:
            here = path.parent.relative_to(self.root).as_posix()
            for line, name, arguments in self.cmake_commands(path):
                if name != "target_link_libraries" or not arguments:
                    continue
                folder = folder_of_target.get(arguments[0], here)
                for library in arguments[1:]:
                    # $<LINK_ONLY:x>, $<$<BOOL:...>:x>: what counts is the library at the end.
                    library = library.rstrip(">").split(":")[-1] if library.startswith("$<") else library
                    if library not in LINK_KEYWORDS:
                        self.check_link(path, line, folder, arguments[0], library, folder_of_target)

    def check_link(self, path, line, folder, target, library, folder_of_target):
        layer = folder.split("/")[0]
        if library in NEUTRAL_TARGETS:
            return
        if library in folder_of_target:
            other = folder_of_target[library].split("/")[0]
            if other != layer and other not in ALLOWED[layer]:
                self.report(path, line, f"{layer} must not link {other} ({target} links {library})")
            elif is_yardstick(folder_of_target[library]) and not is_yardstick(folder):
                self.report(path, line, f"{target} links {library}, which is for benchmarks and tests only")
            return
        if is_yardstick(folder):
            return
        if FORBIDDEN_IN_PRODUCT.search(library):
            self.report(path, line, f"{target} links {library}, which is for benchmarks and tests only")
            return
        allowed = longest_rule(THIRD_PARTY_TARGETS, folder)
        if allowed is not None and library not in allowed:
            self.report(path, line, f"{target} links {library}: {folder} may link {', '.join(allowed) or 'nothing'}")

    def run(self):
        cmake_files = []
        for layer, path in self.files():
            if path.suffix in SOURCE_SUFFIXES:
                self.check_source(layer, path)
            elif path.name == "CMakeLists.txt" or path.suffix == ".cmake":
                cmake_files.append((layer, path))
        self.check_links(cmake_files)
        return self.lines()


def missing(root):
    return None if any((root / layer).is_dir() for layer in ALLOWED) else f"holds none of {', '.join(ALLOWED)}"


def main(arguments):
    root = root_of(arguments, __doc__, missing)
    return verdict(Checker(root).run(), "layer violations", "layers: clean")


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))

#!/usr/bin/env python3
"""The manual pages and completions that the build made, against what the programs say of themselves.

    manual_test.py SHARE HAUSTRA HAUSTRAD [CLASS...]

What needs a program that may not be there is a class of its own, and ctest shows it by its own name.
"""

import os
import pty
import re
import shutil
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path

SHARE = Path(sys.argv.pop(1)).resolve()
HAUSTRA = Path(sys.argv.pop(1)).resolve()
HAUSTRAD = Path(sys.argv.pop(1)).resolve()


def said(*command):
    return subprocess.run([str(c) for c in command], capture_output=True, text=True, check=True).stdout


def options_of(help_text):
    """Long options as the help lists them: at the beginning of a line."""
    return re.findall(r"^  (?:-\w,)?(--[\w-]+)", help_text, re.MULTILINE)


def commands():
    return re.findall(r"^  ([a-z]+)  ", said(HAUSTRA, "--help").split("Subcommands:")[1], re.MULTILINE)


def text_of(page):
    """What a reader sees, without roff's escapes."""
    return re.sub(r"\\f[A-Z]", "", page.read_text(encoding="utf-8")).replace("\\-", "-").replace("\\&", "")


class Pages(unittest.TestCase):
    def check(self, page, help_text):
        text = text_of(page)
        options = options_of(help_text)
        self.assertIn("--help", options)
        for option in options:
            self.assertRegex(text, rf"(?m)^(-\w, )?{re.escape(option)}( |$)", f"{option} is not in {page.name}")
        for least, most in re.findall(r"in \[(\S+) -\s+(\S+)\]", help_text):
            self.assertIn(f"From {least} to {most}.", text)
        codes = re.findall(r"^  (\d+) ", help_text.split("Exit codes:")[1], re.MULTILINE)
        self.assertGreater(len(codes), 5)
        for code in codes:
            self.assertIn(f"\n.B {code}\n", text)
        self.assertEqual(re.findall(r"(?m)^\.B (\D.*)$", text.split('.SH "EXIT STATUS"')[1]), [], "what is listed is codes")

    def test_every_command_has_a_page_with_all_options(self):
        names = commands()
        self.assertGreater(len(names), 10)
        for name in names:
            with self.subTest(command=name):
                self.check(SHARE / f"man/man1/haustra-{name}.1", said(HAUSTRA, name, "--help"))

    def test_every_page_is_of_a_command(self):
        pages = {page.name for page in (SHARE / "man/man1").iterdir()}
        self.assertEqual(pages, {"haustra.1"} | {f"haustra-{name}.1" for name in commands()})

    def test_program_and_service_have_pages(self):
        self.check(SHARE / "man/man1/haustra.1", said(HAUSTRA, "--help"))
        overview = text_of(SHARE / "man/man1/haustra.1")
        for name in commands():
            self.assertIn(f"\n{name}\n", overview)
            self.assertIn(f"haustra-{name} (1)", overview)
        self.check(SHARE / "man/man8/haustrad.8", said(HAUSTRAD, "--help"))

    def test_readme_of_the_service_has_its_exit_codes(self):
        listed = re.findall(r"(?m)^  (\d+) +(.+)$", said(HAUSTRAD, "--help").split("Exit codes:")[1])
        readme = (Path(__file__).resolve().parents[3] / "platform/daemon/README.md").read_text(encoding="utf-8")
        table = re.findall(r"(?m)^\| (\d+) \| (.+) \|$", readme.split("| code | meaning |")[1].split("\n\n")[0])
        self.assertEqual(table, listed)

    def test_every_key_is_in_the_page_of_the_configuration(self):
        text = text_of(SHARE / "man/man5/haustra.yaml.5")
        printed = said(HAUSTRAD, "--print-config")
        keys, sections = [], []
        for line in printed.splitlines():
            name, value = line.strip().split(":", 1)
            depth = (len(line) - len(line.lstrip())) // 2
            sections[depth:] = [name]
            if value.split("#")[0].strip():
                keys.append(".".join(sections))
        self.assertGreater(len(keys), 50)
        for key in keys:
            self.assertIn(f"\n{key}\n", text)


class Formatters(unittest.TestCase):
    def test_formatters_have_nothing_to_say(self):
        pages = sorted((SHARE / "man").rglob("*.[158]"))
        if shutil.which("mandoc"):
            for page in pages:
                # Without a date, on purpose: the same sources make the same page.
                lint = subprocess.run(["mandoc", "-T", "lint", "-W", "warning", page], capture_output=True, text=True)
                rest = [line for line in lint.stdout.splitlines() if "missing date" not in line]
                self.assertEqual(rest, [], page)
        elif shutil.which("groff"):
            for page in pages:
                done = subprocess.run(["groff", "-man", "-Tutf8", "-ww", "-Kutf8", page], capture_output=True, text=True)
                # A word that is longer than a line is no fault of the page.
                rest = [line for line in done.stderr.splitlines() if "cannot adjust line" not in line]
                self.assertEqual((done.returncode, rest), (0, []), page)
        else:
            self.skipTest("neither mandoc nor groff is installed")


def choices():
    """(words of a command line, what may follow them) of every option that the help lists with what it chooses from."""
    found = []
    for command in [[name] for name in commands()] + [["bench", "vision"]]:
        for option, choice in re.findall(r"(?m)^  (?:-\w,)?(--[\w-]+) \w+:\{([^}]*)\}", said(HAUSTRA, *command, "--help")):
            found.append((["haustra", *command, option], choice.split(",")))
    requests = re.search(r"request TEXT:\{([^}]*)\}", said(HAUSTRA, "control", "--help"))[1]
    return found + [(["haustra", "control"], requests.split(","))]


# Shows what zsh offers for each line of $LINES_FILE: the words a line of $OFFERED, and where files are, "FILES".
ZSH = r"""
PROMPT= RPROMPT=
fpath=($FUNCTIONS $fpath)
autoload -Uz compinit && compinit -u -D
compadd() {
  local -a hits
  if [[ " $* " != *" -"[OAD]" "* ]]; then builtin compadd -A hits "$@"; print -r -- "${(j: :)hits}" >> $OFFERED; fi
  builtin compadd "$@"
}
_files() { print FILES >> $OFFERED; return 1 }
offer_all() {
  local line
  for line in "${(@f)$(< $LINES_FILE)}"; do
    print -r -- "LINE" >> $OFFERED
    BUFFER="$line"; CURSOR=$#BUFFER
    zle list-choices
  done
  BUFFER='exit'; zle accept-line
}
zle -N offer_all
bindkey '^T' offer_all
print READY
"""


class Completion(unittest.TestCase):
    def complete(self, *words):
        """What bash offers after these words, the last of which is being typed."""
        script = f"""source {SHARE / "bash-completion/completions" / words[0]}
compopt() {{ if [[ $2 == default ]]; then echo FILES; fi; }}
COMP_WORDS=({" ".join(f"'{w}'" for w in words)}) COMP_CWORD={len(words) - 1}
_{words[0]}
printf '%s\\n' "${{COMPREPLY[@]}}" """
        return said("bash", "-c", script).split()

    def test_bash_completes_commands_options_and_values(self):
        self.assertEqual(set(self.complete("haustra", "")), set(commands()))
        self.assertEqual(self.complete("haustra", "eva"), ["evaluate"])
        for name in commands():
            offered = self.complete("haustra", name, "--")
            for option in options_of(said(HAUSTRA, name, "--help")):
                self.assertIn(option, offered, name)
        self.assertIn("noise.k=", self.complete("haustra", "run", "--set", "noise."))
        self.assertEqual(self.complete("haustra", "run", "--out", ""), ["FILES"])
        self.assertEqual(self.complete("haustra", "run", ""), ["FILES"])
        self.assertEqual(self.complete("haustra", "evaluate", "a", "b", ""), ["FILES"])
        self.assertEqual(self.complete("haustra", "run", "--seed", ""), [])

    def test_bash_goes_down_to_commands_of_commands(self):
        self.assertEqual(self.complete("haustra", "atlas", ""), ["info"])
        self.assertEqual(self.complete("haustra", "atlas", "info", ""), ["FILES"])
        self.assertIn("--features", self.complete("haustra", "bench", "vision", "--"))

    def test_bash_knows_what_is_the_value_of_an_option(self):
        self.assertEqual(self.complete("haustra", "control", "--folder", "status", "res"), ["resume"])
        self.assertEqual(self.complete("haustra", "control", "mark", "1", ""), [])
        self.assertEqual(self.complete("haustra", "run", "--device", "=", "cu"), ["cuda"])
        self.assertEqual(self.complete("haustra", "run", "--device", "="), ["auto", "cpu", "cuda"])
        self.assertEqual(self.complete("haustra", "run", "--out", "=", ""), ["FILES"])
        self.assertEqual(self.complete("haustra", "run", "--seed", "=", ""), [])

    def test_bash_offers_files_behind_a_colon_and_behind_a_key(self):
        self.assertEqual(self.complete("haustra", "run", "v4l2", ":", "/dev/vi"), ["FILES"])
        self.assertEqual(self.complete("haustra", "run", "v4l2", ":"), ["FILES"])
        self.assertEqual(self.complete("haustrad", "--source", "v4l2", ":", "/dev/vi"), ["FILES"])
        self.assertEqual(self.complete("haustrad", "--set", "source.path", "=", "/da"), ["FILES"])
        self.assertEqual(self.complete("haustrad", "--set", "source.path", "="), ["FILES"])
        self.assertEqual(self.complete("haustrad", "--set", "source.path", "=", "v4l2", ":", "/dev/vi"), ["FILES"])

    def test_bash_counts_what_a_colon_and_an_at_join_as_one_word(self):
        redout = ["haustra", "render", "--events", "redout", "@"]
        self.assertEqual(self.complete(*redout), [])
        self.assertEqual(self.complete(*redout, "5"), [])
        self.assertEqual(self.complete(*redout, "5", "ou"), ["FILES"])
        self.assertEqual(self.complete(*redout, "5", "ou", ""), [], "there is one place, OUT")
        self.assertEqual(self.complete("haustra", "control", "--folder", "a", ":", "b", "res"), ["resume"])
        self.assertEqual(self.complete("haustrad", "--set", "source.path", "=", "v4l2", ":", "/dev/video0", "--conf"), ["--config"])

    def test_bash_offers_every_choice(self):
        lines = choices()
        self.assertIn((["haustra", "run", "--device"], ["auto", "cpu", "cuda"]), lines)
        for wanted in ("haustra render --preset", "haustra render --events", "haustra control", "haustra export --format"):
            self.assertIn(wanted, [" ".join(words) for words, _ in lines])
        for words, values in lines:
            self.assertEqual(self.complete(*words, ""), values, words)

    def test_bash_completes_the_service(self):
        self.assertLessEqual(set(options_of(said(HAUSTRAD, "--help"))), set(self.complete("haustrad", "--")))
        self.assertEqual(self.complete("haustrad", "--config", ""), ["FILES"])
        self.assertEqual(self.complete("haustrad", "--set", "watchdog.work_"), ["watchdog.work_limit_ms="])

    def test_completion_of_zsh_has_all_options(self):
        path = SHARE / "zsh/site-functions/_haustra"
        text = path.read_text(encoding="utf-8")
        self.assertTrue(text.startswith("#compdef haustra\n"))
        for name in commands():
            part = text.split(f"_haustra_{name}() {{\n")[1].split("\n}\n")[0]
            for option in options_of(said(HAUSTRA, name, "--help")):
                self.assertIn(f"'*{option}[", part)


class Zsh(unittest.TestCase):
    def zsh_completes(self, lines):
        """What zsh itself offers, line by line; the last word of each is being typed."""
        with tempfile.TemporaryDirectory() as folder:
            offered, setup, to_do = (Path(folder) / name for name in ("offered", "setup", "lines"))
            setup.write_text(ZSH)
            to_do.write_text("\n".join(" ".join(words) for words in lines))
            environment = {"PATH": os.environ["PATH"], "HOME": folder, "TERM": "dumb", "OFFERED": str(offered),
                           "LINES_FILE": str(to_do), "FUNCTIONS": str(SHARE / "zsh/site-functions")}
            terminal, other_end = pty.openpty()
            shell = subprocess.Popen(["zsh", "-f", "-i"], stdin=other_end, stdout=other_end, stderr=other_end, cwd=folder,
                                     env=environment, start_new_session=True)
            os.close(other_end)
            os.write(terminal, f"source {setup}\n".encode())
            said_there = b""
            try:
                while True:
                    said_there += os.read(terminal, 65536)
                    if b"READY\r\n" in said_there:
                        os.write(terminal, b"\x14")
                        said_there = b""
            except OSError:
                pass  # the shell has ended
            finally:
                os.close(terminal)
                shell.wait()
            return [part.split() for part in offered.read_text().split("LINE\n")[1:]]

    @unittest.skipUnless(shutil.which("zsh"), "zsh is not installed")
    def test_zsh_can_read_its_completion(self):
        path = SHARE / "zsh/site-functions/_haustra"
        self.assertEqual(subprocess.run(["zsh", "-n", path], capture_output=True, text=True).stderr, "")

    @unittest.skipUnless(shutil.which("zsh"), "zsh is not installed")
    def test_zsh_offers_the_same(self):
        lines = [(words + [""], values) for words, values in choices()]
        files = ["FILES"]
        lines += [(["haustra", ""], commands()), (["haustra", "atlas", ""], ["info"]), (["haustra", "atlas", "info", ""], files),
                  (["haustra", "run", "--out", ""], files), (["haustra", "run", ""], files),
                  (["haustra", "run", "--seed", ""], []), (["haustra", "control", "mark", "1", ""], []),
                  (["haustra", "render", "--size", ""], []), (["haustra", "run", "--set", "noise.k"], ["noise.k="]),
                  (["haustra", "control", "--time"], ["--timeout"]), (["haustrad", "--source", ""], files),
                  (["haustrad", "--set", "watchdog.work_"], ["watchdog.work_limit_ms="])]
        for (words, values), offered in zip(lines, self.zsh_completes([words for words, _ in lines]), strict=True):
            self.assertEqual(set(offered), set(values), words)


if __name__ == "__main__":
    unittest.main()

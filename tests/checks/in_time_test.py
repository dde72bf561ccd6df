#!/usr/bin/env python3
"""tools/checks/in_time.sh tells what is too slow from what fails."""

import os
import subprocess
import time
import unittest
from pathlib import Path

SCRIPT = Path(__file__).resolve().parents[2] / "tools" / "checks" / "in_time.sh"


class InTimeTest(unittest.TestCase):
    def run_script(self, seconds, *command, done_before=None):
        environment = {key: value for key, value in os.environ.items() if key != "HAUSTRA_DONE_BEFORE"}
        if done_before is not None:
            environment["HAUSTRA_DONE_BEFORE"] = str(int(time.time()) + done_before)
        done = subprocess.run([SCRIPT, str(seconds), "a/part", *command], env=environment, capture_output=True, text=True,
                              check=False)
        return done.returncode, done.stdout

    def test_what_ends_in_time_keeps_its_code(self):
        for code in (0, 1, 77):
            self.assertEqual(self.run_script(60, "sh", "-c", f"exit {code}"), (code, ""))

    def test_what_is_too_slow_is_skipped_by_name(self):
        code, output = self.run_script(1, "sleep", "30")
        self.assertEqual(code, 77)
        self.assertIn("skipped: a/part", output)

    def test_no_time_is_not_endless_time(self):
        self.assertEqual(self.run_script(0, "sleep", "2")[0], 77)

    def test_what_is_killed_by_somebody_else_fails(self):
        self.assertEqual(self.run_script(60, "sh", "-c", "kill -9 $$")[0], 137)

    def test_nothing_is_begun_in_the_last_minute(self):
        code, output = self.run_script(300, "echo", "begun", done_before=40)
        self.assertEqual(code, 77)
        self.assertNotIn("begun", output)
        self.assertEqual(self.run_script(300, "echo", "begun", done_before=90), (0, "begun\n"))

    def test_wrong_arguments_are_a_usage_error(self):
        self.assertEqual(self.run_script("soon", "true")[0], 64)


if __name__ == "__main__":
    unittest.main()

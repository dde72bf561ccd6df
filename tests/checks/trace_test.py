#!/usr/bin/env python3
"""tools/checks/trace.py finds each fault that it is there for, in small trees made for it."""

import unittest

from checked_tree import run_checker

HEAD = "id,hazard,requirement\n"
TEST = 'TEST(Pose, IsWhole) {\n  RecordProperty("req", "%s");\n}\n'


class Trace(unittest.TestCase):
    def run_on(self, csv=HEAD + "A-001,H1,holds\n", test=TEST % "A-001", hazards="| H1 | x |\n", script="", more=()):
        files = {
            "tests/requirements.csv": csv,
            "tests/pose_test.cc": test,
            "tests/run.sh": script,
            "platform/daemon/README.md": hazards,
        }
        return run_checker("trace.py", files, *more)

    def test_tree_in_order_is_clean(self):
        self.assertEqual(self.run_on(), (0, "trace: 1 requirements, each with a test\n"))

    def test_requirement_without_test(self):
        code, out = self.run_on(csv=HEAD + "A-001,H1,holds\nA-002,H1,holds too\n")
        self.assertEqual(code, 1)
        self.assertIn("A-002 has no test", out)

    def test_test_of_no_requirement(self):
        code, out = self.run_on(test=TEST % "A-001,B-001")
        self.assertEqual(code, 1)
        self.assertIn("tests/pose_test.cc:2: proves B-001, which is no requirement", out)

    def test_doubled_and_malformed_ids(self):
        code, out = self.run_on(csv=HEAD + "A-001,H1,holds\nA-001,H1,again\nA1,H1,short\nA-003,H1,\n")
        self.assertEqual(code, 1)
        for text in (":3: A-001 is there twice", ":4: not", ":5: not"):
            self.assertIn(text, out)

    def test_hazards_and_requirements_belong_together(self):
        code, out = self.run_on(hazards="| H1 | x |\n| H2 | y |\n")
        self.assertEqual(code, 1)
        self.assertIn("H2 has no requirement", out)
        code, out = self.run_on(hazards="")
        self.assertEqual(code, 1)
        self.assertIn("A-001 names H1", out)

    def test_scripts_prove_and_the_matrix_names_them(self):
        code, out = self.run_on(csv=HEAD + "A-001,H1,holds\nA-002,H1,too\n", script="# req: A-002\n", more=["--matrix"])
        self.assertEqual(code, 0)
        self.assertIn("| A-001 | H1 | holds | Pose.IsWhole |", out)
        self.assertIn("| A-002 | H1 | too | tests/run.sh |", out)


if __name__ == "__main__":
    unittest.main()

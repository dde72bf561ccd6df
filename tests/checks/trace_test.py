#!/usr/bin/env python3
"""tools/checks/trace.py finds each fault that it is there for, in small trees made for it."""

import unittest

from checked_tree import run_checker

HEAD = "id,hazard,requirement\n"
TEST = 'TEST(Pose, IsWhole) {\n  RecordProperty("req", "%s");\n}\n'


class Trace(unittest.TestCase):
    def run_on(self, csv=HEAD + "A-001,H1,holds\n", test=TEST % "A-001", hazards="| H1 | x |\n", script="", more=(),
               **others):
        files = {
            **others,
            "tests/requirements.csv": csv,
            "tests/pose_test.cc": test,
            "tests/service/run.sh": script,
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
        self.assertIn("| A-002 | H1 | too | tests/service/run.sh |", out)

    def after(self, *cases, **tree):
        """The check of a test run: (name of ctest, its status, what it printed) of each."""
        junit = "".join(f'<testcase name="{name}" status="{status}"><system-out>{out}</system-out></testcase>'
                        for name, status, out in cases)
        return self.run_on(more=["--ran", "tests.xml"], **{"tests.xml": f"<testsuite>{junit}</testsuite>"}, **tree)

    def test_requirement_whose_test_ran(self):
        clean = (0, "trace: 1 requirements, each with a test that ran\n")
        for name in ("Pose.IsWhole", "Both/Pose.IsWhole/0, where GetParam() = 1"):
            self.assertEqual(self.after(("pose", "run", f"[ RUN      ] {name}\n[       OK ] {name} (0 ms)")), clean)

    def test_requirement_whose_tests_did_not_run(self):
        skipped = "[  SKIPPED ] Pose.IsWhole (0 ms)\n[       OK ] Pose.IsOther (0 ms)"
        for out, said in ((skipped, "Pose.IsWhole (skipped)\n"), ("[ RUN      ] Pose.IsWhole", "Pose.IsWhole\n")):
            code, text = self.after(("pose", "run", out))
            self.assertEqual(code, 1)
            self.assertIn("A-001: no test of it ran: " + said, text)

    def test_requirement_that_only_a_gpu_can_prove_is_named(self):
        code, text = self.after(("pose", "notrun", "[  SKIPPED ] Pose.IsWhole (0 ms)"), test="",
                                **{"tests/cuda_pose_test.cc": TEST % "A-001"})
        self.assertEqual((code, text.splitlines()[0]),
                         (0, "trace: A-001: skipped, all its tests need a GPU: Pose.IsWhole"))

    def test_script_ran_when_something_of_its_folder_did(self):
        for status, expected in (("run", 0), ("notrun", 1)):
            code, _ = self.after(("service/systemd", status, ""), test="", script="# req: A-001\n")
            self.assertEqual(code, expected)


if __name__ == "__main__":
    unittest.main()

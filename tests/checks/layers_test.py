#!/usr/bin/env python3
"""Proves that tools/checks/layers.py fails on a tree that breaks the rules, and only then."""

import unittest

from checked_tree import run_checker

GOOD_TREE = {
    "hal/CMakeLists.txt": "add_library(h STATIC core.cc)\ntarget_link_libraries(h PUBLIC haustra_flags)\n",
    "hal/core.h": '#pragma once\n#include <vector>\n#include "hal/other.h"\n',
    "hal/other.h": "#pragma once\n#include <cstdint>\n",
    "hal/fakes/device.h": "#include <mutex>\n",
    "kernels/sift.cc": '#include <immintrin.h>\n#include <thread>\n#include "hal/core.h"\n',
    "kernels/benchmarks/sift_benchmark.cc": "#include <opencv2/features2d.hpp>\n",
    "capture/CMakeLists.txt": "add_library(c STATIC png.cc)\ntarget_link_libraries(c PUBLIC h PRIVATE PNG::PNG)\n",
    "capture/png.cc": '#include <png.h>\n#include <unistd.h>\n#include "hal/core.h"\n',
    "engine/CMakeLists.txt": "add_library(e STATIC e.cc)\ntarget_link_libraries(e PUBLIC h Eigen3::Eigen)\n",
    "engine/pose.h": '#include <Eigen/Core>\n#include "hal/core.h"\n// #include "kernels/sift.h" in a comment\n',
    "engine/optim/CMakeLists.txt": "add_library(o STATIC ba.cc)\ntarget_link_libraries(o PUBLIC e PRIVATE Ceres::ceres)\n",
    "engine/optim/ba.cc": '#include <ceres/problem.h>\n#include "engine/pose.h"\n',
    "platform/CMakeLists.txt": "add_library(p STATIC p.cc)\ntarget_link_libraries(p PUBLIC e c h)\n",
    "platform/assemble.cc": '#include "engine/pose.h"\n#include "kernels/sift.h"\n#include "capture/png.h"\n',
    "platform/haustra_ring.h": "#include <stdint.h>\n",
    "platform/haustra_table.h": '#include "haustra_ring.h" /* beside this file */\n',
    "tools/main.cc": '#include <iostream>\n#include "platform/assemble.h"\n',
    "tests/engine/ba_test.cc": '#include <gtest/gtest.h>\n#include "tools/main.h"\n#include "tests/support/scene.h"\n',
    "tests/CMakeLists.txt": "add_executable(t t.cc)\ntarget_link_libraries(t PRIVATE p e opencv_core GTest::gtest)\n",
}

# What is added to the good tree, and what the checker must say about it.
BAD_FILES = [
    ("platform/haustra_view.h", '#include "haustra_none.h"\n', "start at the repository root"),
    ("platform/a.h", '#include "haustra_ring.h"\n', "start at the repository root"),
    ("engine/a.cc", '#include "kernels/sift.h"\n', "engine/a.cc:1: engine must not include kernels"),
    ("engine/a.cc", "\n\n#include \"capture/png.h\"\n", "engine/a.cc:3: engine must not include capture"),
    ("engine/a.cc", '#include "platform/assemble.h"\n', "engine must not include platform"),
    ("engine/a.cc", '#include "tests/support/scene.h"\n', "engine must not include tests"),
    ("engine/a.cc", "#include <ceres/problem.h>\n", "engine may use the standard library and Eigen"),
    ("engine/deep/er/a.cc", "#include <ceres/problem.h>\n", "engine/deep/er may use the standard library and Eigen"),
    ("engine/a.cc", "#include <yaml-cpp/yaml.h>\n", "<yaml-cpp/yaml.h>"),
    ("engine/a.cc", "#include <unistd.h>\n", "<unistd.h>"),
    ("engine/a.cc", "#include <fstream>\n", "engine must not use the operating system"),
    ("engine/optim/a.cc", "#include <opencv2/core.hpp>\n", "for benchmarks and tests only"),
    ("kernels/a.cc", '#include "engine/pose.h"\n', "kernels must not include engine"),
    ("kernels/a.cc", '#  include   "engine/pose.h"\n', "kernels must not include engine"),
    ("kernels/a.cc", "#include <opencv2/core.hpp>\n", "for benchmarks and tests only"),
    ("capture/a.cc", '#include "kernels/sift.h"\n', "capture must not include kernels"),
    ("hal/a.h", '#include "engine/pose.h"\n', "hal must not include engine"),
    ("hal/a.h", "#include <Eigen/Core>\n", "hal may use the standard library and nothing else"),
    ("hal/a.h", "#include <mutex>\n", "hal must not use the operating system"),
    ("hal/a.h", "#include <linux/videodev2.h>\n", "<linux/videodev2.h>"),
    ("platform/a.cc", '#include "tools/main.h"\n', "platform must not include tools"),
    ("tools/a.cc", '#include "tests/support/scene.h"\n', "tools must not include tests"),
    ("engine/a.cc", '#include "pose.h"\n', "start at the repository root"),
    ("engine/a.cc", '#include "../kernels/sift.h"\n', "start at the repository root"),
    ("engine/a.cc", '#include "engine/../kernels/sift.h"\n', "start at the repository root"),
    ("kernels/a.cc", "#include <engine/pose.h>\n", "kernels must not include engine"),
    ("engine/x/CMakeLists.txt", "add_library(x x.cc)\ntarget_link_libraries(x\n  PUBLIC h\n  PRIVATE c)\n",
     "engine/x/CMakeLists.txt:2: engine must not link capture (x links c)"),
    ("engine/x/CMakeLists.txt", "add_library(x x.cc)\ntarget_link_libraries(x PRIVATE Ceres::ceres)\n",
     "x links Ceres::ceres: engine/x may link Eigen3::Eigen"),
    ("engine/x/CMakeLists.txt", "add_library(x x.cc)\ntarget_link_libraries(x PRIVATE $<LINK_ONLY:c>)\n",
     "engine must not link capture"),
    ("hal/x/CMakeLists.txt", "add_library(x x.cc)\ntarget_link_libraries(x PUBLIC e)\n", "hal must not link engine"),
    ("hal/x/CMakeLists.txt", "add_library(x x.cc)\ntarget_link_libraries(x PUBLIC Eigen3::Eigen)\n",
     "x links Eigen3::Eigen: hal/x may link nothing"),
    ("kernels/x/CMakeLists.txt", "add_library(x x.cc)\ntarget_link_libraries(x PUBLIC ${OpenCV_LIBS})\n",
     "for benchmarks and tests only"),
    # A link made from another folder belongs to the folder of its target.
    ("tests/x/CMakeLists.txt", "target_link_libraries(e PUBLIC c)\n", "engine must not link capture (e links c)"),
    ("platform/x/CMakeLists.txt", "add_library(x x.cc)\ntarget_link_libraries(x PUBLIC t)\n",
     "platform must not link tests"),
]


class LayersTest(unittest.TestCase):
    def check(self, files):
        return run_checker("layers.py", files)

    def test_tree_that_keeps_the_rules_passes(self):
        code, output = self.check(GOOD_TREE)
        self.assertEqual(code, 0, output)

    def test_each_violation_fails_and_is_named(self):
        for name, text, message in BAD_FILES:
            with self.subTest(file=name, text=text):
                self.assertNotIn(name, GOOD_TREE)
                code, output = self.check({**GOOD_TREE, name: text})
                self.assertEqual(code, 1, output)
                self.assertIn(message, output)

    def test_all_violations_are_listed(self):
        bad = {"engine/a.cc": '#include "kernels/a.h"\n#include "tools/b.h"\n', "hal/a.h": "#include <Eigen/Core>\n"}
        code, output = self.check({**GOOD_TREE, **bad})
        self.assertEqual(code, 1)
        self.assertIn("3 layer violations", output)

    def test_folder_that_is_no_tree_is_a_usage_error(self):
        code, _ = self.check({"readme.txt": "nothing"})
        self.assertEqual(code, 64)


if __name__ == "__main__":
    unittest.main()

#!/usr/bin/env bash
# The main job on input it makes itself: installs what is missing, builds, renders a colon of about 20 s, maps it and
# compares the result with the ground truth. Results stay in build/demo, with the picture of the README;
# build/demo/result/report.html shows them.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
bash tools/setup.sh
cmake --preset release > /dev/null
cmake --build --preset release --target haustra
haustra=build/release/tools/haustra
out=build/demo
mkdir -p "$out"
"$haustra" render "$out/colon" --seconds 20 --overwrite
"$haustra" run "$out/colon" --out "$out/result" --mode sequential --overwrite --report off
"$haustra" evaluate "$out/result" --groundtruth "$out/colon/groundtruth.txt"
python3 tools/report/picture.py "$out/colon" "$out/result" "$out/picture.svg"
"$haustra" report "$out/result" --html "$out/result/report.html" --groundtruth "$out/colon/groundtruth.txt" \
  --sequence "$out/colon" --overwrite --quiet
echo
echo "open in a browser: $PWD/$out/result/report.html"

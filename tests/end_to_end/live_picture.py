#!/usr/bin/env python3
"""The picture of a running engine in tools/view/README.md: the window of `haustra view --marking` in a headless Chromium.

    live_picture.py HAUSTRA HAUSTRAD SEQUENCE PICTURE.jpg FRAME

SEQUENCE is a rendered colon: never show a patient's. It runs at a fifth of its speed. A mark is set half way to FRAME; the
picture is taken as soon as it is in sight from FRAME on.
"""

import sys
import tempfile
from pathlib import Path

import browser
from served_view import ServedView, Service, click_a_mark

if len(sys.argv) != 6:
    sys.exit(__doc__)
haustra, haustrad, sequence, picture = (Path(path).resolve() for path in sys.argv[1:5])
frame = int(sys.argv[5])
LIMIT_S = 600
with tempfile.TemporaryDirectory() as folder, Service(haustrad, sequence, Path(folder), ["depth.step_px=4", "source.rate=0.2"]), \
        ServedView(haustra, "--folder", folder, "--marking") as view, browser.Browser(1280, 800) as page:
    page.open(view.address)
    if not page.wait_for(f"Number(document.body.dataset.picture) >= {frame // 2} && document.body.dataset.state === 'tracking'", LIMIT_S):
        sys.exit(f"the scene is not tracked: {page.messages}")
    places = ((0.25 + 0.1 * (i % 6), 0.3 + 0.1 * (i // 6 % 5)) for i in range(90))
    if not any(click_a_mark(page, u, v) for u, v in places):
        sys.exit("no place could be marked")
    page.value("document.getElementById('marking-answer').textContent = ''")
    ready = (f"Number(document.body.dataset.picture) >= {frame} && document.body.dataset.state === 'tracking' && "
             "document.body.dataset.rings === '1' && document.body.dataset.surface === 'shown'")
    if not page.wait_for(ready, LIMIT_S):
        sys.exit(f"the mark does not come into sight: {page.messages}")
    picture.write_bytes(page.picture(jpeg_quality=82))

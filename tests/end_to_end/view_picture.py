#!/usr/bin/env python3
"""The picture of tools/view/README.md: the window of `haustra view OUT` in a headless Chromium.

    view_picture.py HAUSTRA OUT PICTURE.jpg|PICTURE.png [FRAME [LOOK [ALONG]]]

FRAME is where the slider stands (default: at the end), LOOK a button of the scene: outside, cut (the default), along or scope. ALONG
is the place along the lumen, from 0 to 1. OUT must be of a rendered colon: never show a patient's.
"""

import sys
from pathlib import Path

import browser
from served_view import ServedView

if not 4 <= len(sys.argv) <= 7:
    sys.exit(__doc__)
haustra, out, picture = sys.argv[1:4]
with ServedView(haustra, out) as view, browser.Browser(1280, 800) as page:
    page.open(view.address)
    if not page.wait_for("document.body.dataset.ready === 'run'"):
        sys.exit(f"the page does not get ready: {page.messages}")
    if Path(out, "surface").is_dir() and not page.wait_for("document.body.dataset.surface === 'shown'"):
        sys.exit(f"the surface is not shown: {page.messages}")
    if len(sys.argv) > 4:
        page.slide("#slider", int(sys.argv[4]))
    if len(sys.argv) > 5:
        page.value(f"document.querySelector('button[data-look={sys.argv[5]}]').click()")
    if len(sys.argv) > 6:
        page.slide(".way-through input", float(sys.argv[6]))
    page.wait_for_drawing()
    Path(picture).write_bytes(page.picture(jpeg_quality=70 if picture.endswith(".jpg") else None))

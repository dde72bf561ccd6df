#!/usr/bin/env python3
"""The picture of tools/report/README.md: the wall in a report, in a headless Chromium.

    report_picture.py REPORT.html PICTURE.jpg|PICTURE.png [LOOK [ALONG]]

LOOK is a button of the first scene: outside, cut or along; ALONG is where the slider stands, from 0 to 1. The report must be of a
rendered colon: never show a patient's.
"""

import sys
from pathlib import Path

import browser

if len(sys.argv) not in (3, 4, 5):
    sys.exit(__doc__)
report, picture = Path(sys.argv[1]).resolve(), sys.argv[2]
with browser.Browser(1280, 900) as page:
    page.open(report.as_uri())
    if not page.wait_for("document.querySelector('.scene .looks') !== null"):
        sys.exit(f"the report shows no wall: {page.messages}")
    if len(sys.argv) > 3:
        page.value(f"document.querySelector('.scene button[data-look={sys.argv[3]}]').click()")
    if len(sys.argv) > 4:
        page.slide(".scene .way-through input", float(sys.argv[4]))
    page.value("document.querySelector('.scene').scrollIntoView({block: 'center'})")
    page.wait_for_drawing()
    x, y, width, height = page.box(".scene")
    left, top = page.value("[scrollX, scrollY]")
    Path(picture).write_bytes(page.picture(clip=(x + left, y + top, width, height),
                                           jpeg_quality=85 if picture.endswith(".jpg") else None))

#!/usr/bin/env python3
"""The page of `haustra view`, and that of the report, in a headless Chromium: what they say, and that they draw.

    view_page_test.py HAUSTRA HAUSTRAD SEQUENCE RESULT LIVE

RESULT is a run of SEQUENCE, a rendered colon. LIVE is another, in which the scope passes a part of the lumen. Skipped (exit
code 77) where there is no Chromium. With HAUSTRA_VIEW_PICTURES set to a folder the windows are kept there as PNG, for a person
to look at.
"""

import contextlib
import csv
import json
import math
import os
import shutil
import subprocess
import sys
import tempfile
import time
import unittest
import urllib.error
import urllib.request
from pathlib import Path

import browser
from png_pixels import pixels
from served_view import CLICK_PICTURE, ServedView, Service, click_a_mark

HAUSTRA, HAUSTRAD, SEQUENCE, RESULT, LIVE = (Path(path).resolve() for path in sys.argv[1:6])
PICTURES = os.environ.get("HAUSTRA_VIEW_PICTURES")
LABEL = '<b>&"x'
PIN_IS_SHOWN = "(pin => pin !== null && getComputedStyle(pin).visibility === 'visible')(document.querySelector('.pin'))"
# How many marks were in the pictures, from now on.
RINGS_ARE_WATCHED = ("window.ringsSeen = new Set(); new MutationObserver(() => ringsSeen.add(document.body.dataset.rings))"
                     ".observe(document.body, {attributes: true}); 0")
# In the place of the engine's stream: `tell(event, data)` of the test.
SCRIPTED_STREAM = """
window.EventSource = class {
  constructor() { this.handlers = {}; window.tell = (name, data) => this.handlers[name]({data: JSON.stringify(data)}); }
  addEventListener(name, handle) { this.handlers[name] = handle; }
};
window.poseAt = (t_s, map = 0) => ({frame: 25 * t_s, t_s, published_ms: 9, state: 'tracking', reason: 'none', is_predicted: false,
  map, epoch: 0, features: 500, inliers: 100, position: [0, 0, t_s], orientation: [0, 0, 0, 1],
  marks: [{id: 1, state: 'in_front', distance: 1}]});
window.mapOf = id => ({map: id, procedure: 3, epoch: 0, num_points: 2, num_keyframes: 2, num_maps: 1, points: btoa('\\0'.repeat(24)),
  keyframes: btoa('\\0'.repeat(24)), marks: [{id: 1, label: 'polyp', map: id, position: [0, 0, 1]}]});
window.wallOf = (id, t_s) => ({map: id, epoch: 0, t_s, keyframes: 2, depths: 2, triangles: 0, refused_blocks: 0, scope: 0.5,
  lumen: {found: true, passed_radii: 4}, wall_coverage: 0.5, seen_poorly: 0.25, picture: 'iVBORw0KGgoAAAANSUhEUgAAAAEAAAABCAIAAACQd1PeAAAADElEQVR4nGNgYPgPAAEDAQAIicLsAAAAAElFTkSuQmCC'});
"""
# Of a page that is scripted: what was asked for, and pictures of 40x20 pixels, every fourth one of their frame.
ASKED_FOR = """
window.asked = [];
window.fetch = async request => { asked.push(decodeURIComponent(request)); return {ok: true, text: async () => 'done'}; };
window.pictureOf = frame => ({frame, procedure: 3, width: 40, height: 20, step: 4, num_matched: 0, points: [], marks: [],
  jpeg: document.createElement('canvas').toDataURL('image/jpeg').split(',')[1]});
"""
# A tube along x, green inside, with a gap all along in the wall that is up; `tube.show(look)`.
TUBE = """
window.tube = (() => {
  const place = document.createElement('div');
  place.style.cssText = 'position: fixed; left: 0; top: 0; width: 600px; height: 300px; z-index: 9; overflow: hidden';
  document.body.append(place);
  const positions = [], colours = [], index = [], line = [], around = 60, long = 80;
  for (let i = 0; i <= long; ++i) {
    line.push(i / 10, 0, 0);
    for (let j = 0; j < around; ++j) {
      const angle = 2 * Math.PI * (j + 0.5) / around, a = i * around + j, b = i * around + (j + 1) % around;
      positions.push(i / 10, Math.cos(angle), Math.sin(angle));
      colours.push(0.2, 0.6, 0.2);
      if (i < long && j > 3 && j < around - 4) index.push(a, a + around, b, b, a + around, b + around);
    }
  }
  const geometry = new THREE.BufferGeometry(), scene = new haustra.Scene3D(place);
  geometry.setAttribute('position', new THREE.BufferAttribute(new Float32Array(positions), 3));
  geometry.setAttribute('color', new THREE.BufferAttribute(new Float32Array(colours), 3));
  geometry.setIndex(index);
  scene.frame(new Float32Array(line), new Float32Array(positions));
  scene.addSurface(geometry, line);
  const bar = document.createElement('div');
  haustra.addLooks(scene, bar, ['outside', 'cut', 'along']);
  const show = look => {
    bar.querySelector(`button[data-look=${look}]`).click();
    return new Promise(done => requestAnimationFrame(() => requestAnimationFrame(() => done(place.dataset.look))));
  };
  return {place, scene, bar, show, geometry};
})();
"""
GROUND = (0x14, 0x1A, 0x22)  # of the scene
UNSEEN = (0x2F, 0x5D, 0x8C)  # the same from inside
SEEN_WELL, SEEN_NEVER = (0x56, 0xB4, 0xE9), (0, 0, 0)  # of the unrolled wall
# Until the scope has passed a part of the lumen at the speed of Service, on a machine that has other work.
WALL_LIMIT_S = 180


def live_service(folder):
    """Quick and coarse: what is tested is the page."""
    return Service(HAUSTRAD, LIVE, folder, ["depth.step_px=8", "depth.iterations=1", "depth.newer_keyframes=1",
                                            "features.max=800", "memory.max_keyframes=300", "source.rate=0.1"])


def put_marks(run):
    """A copy of the run with a mark that the scope sees at the end: in front in the last frame, hidden in the one before."""
    shutil.copytree(RESULT, run)
    with open(run / "frames.csv", newline="") as file:
        frames = [int(row["frame_idx"]) for row in csv.DictReader(file)]
    x, y, z, qx, qy, qz, qw = map(float, (run / "trajectory/map_0000.tum").read_text().split("\n")[-2].split()[1:])
    # A little way along the axis of the camera.
    ahead = [2 * (qx * qz + qy * qw), 2 * (qy * qz - qx * qw), 1 - 2 * (qx * qx + qy * qy)]
    place = [p + 0.3 * a for p, a in zip((x, y, z), ahead)]
    summary = json.loads((run / "summary.json").read_text())
    summary["marks"] = {"refused": [], "set": [{"label": LABEL, "map_id": 0, "position": place, "session": 0, "frame_idx": 0,
                                                "of_this_run": True}]}
    (run / "summary.json").write_text(json.dumps(summary))
    (run / "marks.csv").write_text("frame_idx,mark,u_px,v_px,state,distance_in_depths\n"
                                   f"{frames[-2]},{LABEL},9,9,hidden,1.2\n{frames[-1]},{LABEL},9,9,in_front,1.5\n")


def take_maps(run):
    """A copy of the run as it would be, had nothing been tracked."""
    shutil.copytree(RESULT, run)
    rows = list(csv.DictReader((run / "frames.csv").read_text().splitlines()))
    with open(run / "frames.csv", "w", newline="") as file:
        writer = csv.DictWriter(file, rows[0], lineterminator="\n")
        writer.writeheader()
        writer.writerows({**row, "state": "initialising", "live_map_id": -1, "map_id": -1, "keyframe_id": -1} for row in rows)
    for name in ("maps.csv", "events.csv"):
        (run / name).write_text((run / name).read_text().split("\n")[0] + "\n")
    for path in [*(run / "maps").iterdir(), *(run / "trajectory").glob("map_*")]:
        shutil.rmtree(path) if path.is_dir() else path.unlink()


@contextlib.contextmanager
def page_of(make):
    """A page and the run that it shows: what `make` writes into the folder that it is given."""
    with tempfile.TemporaryDirectory() as scratch, browser.Browser() as page:
        run = Path(scratch, "run")
        make(run)
        with ServedView(HAUSTRA, run) as server:
            page.open(server.address)
            if not page.wait_for("document.body.dataset.ready === 'run'"):
                raise AssertionError(page.messages)
            yield page, run


def move_slider(page, place):
    """To a place that is written in JavaScript, of the slider s."""
    page.slide("#slider", place)


def keep(page, name):
    if PICTURES:
        Path(PICTURES, name).write_bytes(page.picture())


class PageTest(unittest.TestCase):
    def assert_scene_is_drawn(self, page, scene="#scene", above_px=60, below_px=140):
        """A fair part of the scene is not its ground, in many colours; of switches above and legends below nothing counts.

        A live map grows: it may become so within a minute."""
        self.assertTrue(page.wait_for(f"Number(document.querySelector('{scene}').dataset.drawn) > 500"))
        for _ in range(60):
            x, y, width, height = page.box(scene)
            left, top = page.value("[scrollX, scrollY]")
            clip = (x + left, y + top + above_px, width, height - above_px - below_px)
            colours = [pixel for row in pixels(page.picture(0.25, clip)) for pixel in row]
            drawn = [c for c in colours if sum(abs(a - b) for a, b in zip(c, GROUND)) > 60]
            if len(drawn) > 0.01 * len(colours) and len(set(drawn)) > 20:
                return
            time.sleep(1.0)
        self.fail(f"{len(drawn)} of {len(colours)} pixels are drawn, in {len(set(drawn))} colours")

    def assert_mark_is_shown(self, page):
        """One that is set by a click comes into the picture, the list and the scene.

        The scope goes on while the engine answers. So places come first that stay in view for long, far ahead of it; and a
        ring counts whenever it was there."""
        page.value(RINGS_ARE_WATCHED)
        spiral = [(0.1 + 0.003 * i, 2.4 * i) for i in range(96)]
        places = [(0.5 + r * math.cos(angle), 0.5 + r * math.sin(angle)) for r, angle in spiral]
        self.assertTrue(any(click_a_mark(page, u, v) for u, v in places), "no place")
        page.messages[:] = [message for message in page.messages if " 409 " not in message]  # places that could not be
        self.assertTrue(page.wait_for("document.body.dataset.marks === '1'"), page.messages)
        self.assertEqual(page.value("document.querySelector('#marks th').textContent"), "polyp")
        self.assertTrue(page.wait_for("ringsSeen.has('1')"), page.value("[...ringsSeen].join()"))
        self.assertTrue(page.wait_for(PIN_IS_SHOWN), page.messages)

    def assert_mark_is_removed(self, page):
        button = "document.querySelector('#marks .remove')"
        page.value(f"{button}.click()")
        self.assertEqual(page.value(f"{button}.textContent"), "remove?")
        page.value(f"{button}.click()")
        self.assertTrue(page.wait_for("document.body.dataset.marks === '0'"), page.messages)

    def assert_picture_is_shown(self, page):
        """The recording has moments in which the lens is covered: then a later picture."""
        for _ in range(60):
            shown = {pixel for row in pixels(page.picture(0.5, page.box("#picture"))) for pixel in row}
            if len(shown) > 500:
                return
            time.sleep(0.5)
        self.fail(f"{len(shown)} colours")

    def assert_wall_is_unrolled(self, page):
        """There is a picture of it, in which some was seen well and some was not, and its text says the same."""
        text = "document.getElementById('wall-text').textContent"
        self.assertTrue(page.wait_for("Number(document.body.dataset.wall) > 0.05", WALL_LIMIT_S), page.value(text))
        self.assertFalse(page.value("document.getElementById('wall-panel').hidden"))
        self.assertRegex(page.value(text), r"^\d+ % seen well, \d+ % poorly, \d+ % never, along \d\.\d radii of the lumen")
        self.assertFalse(page.value("document.getElementById('wall').hidden"))
        page.value("document.getElementById('wall').scrollIntoView({block: 'center'})")
        x, y, width, height = page.box("#wall")
        left, top = page.value("[scrollX, scrollY]")
        colours = [pixel for row in pixels(page.picture(1.0, (x + left, y + top, width, height))) for pixel in row]
        for name, colour in (("well", SEEN_WELL), ("never", SEEN_NEVER)):
            share = sum(max(abs(a - b) for a, b in zip(c, colour)) < 12 for c in colours) / len(colours)
            self.assertGreater(share, 0.05, name)
        page.value("scrollTo(0, 0)")

    def assert_depth_is_told(self, folder):
        """The service says what depth does."""
        control = [HAUSTRA, "control", "--folder", folder]
        status = subprocess.run([*control, "status"], capture_output=True, text=True, check=True).stdout
        self.assertRegex(status, r"(?m)^depth on$")
        self.assertRegex(status, r"(?m)^keyframes_with_depth [1-9]\d*$")
        self.assertRegex(status, r"(?m)^depths_late \d+$")
        metrics = subprocess.run([*control, "metrics"], capture_output=True, text=True, check=True).stdout
        self.assertRegex(metrics, r'(?m)^haustra_depths_total\{result="found"\} [1-9]\d*$')

    def test_finished_run(self):
        with tempfile.TemporaryDirectory() as scratch, browser.Browser() as page:
            surface = Path(scratch, "surface")
            subprocess.run([HAUSTRA, "surface", RESULT, "--sequence", SEQUENCE, "--out", surface, "--quiet"], check=True)
            with ServedView(HAUSTRA, RESULT, "--surface", surface) as server:
                page.open(server.address)
                self.assertTrue(page.wait_for("document.body.dataset.ready === 'run'"), page.messages)
                self.assertTrue(page.wait_for("document.body.dataset.surface === 'shown'"), page.messages)
                self.assertIn(page.value("document.getElementById('state').textContent"), ("Tracking", "Placed later"))
                self.assert_scene_is_drawn(page)
                keep(page, "run.png")

                # The slider moves the scope and the words.
                last = page.value("Number(document.body.dataset.frame)")
                page.slide("#slider", 0)
                self.assertEqual(page.value("document.body.dataset.frame"), "0")
                self.assertEqual(page.value("document.querySelector('#facts dd').textContent"), "0")
                self.assertGreater(last, 0)
                page.slide("#slider", last)
                # So short a way has no lumen.
                self.assertTrue(page.value("document.querySelector('button[data-look=along]').disabled"))
                for look in ("outside", "cut", "scope"):
                    page.value(f"document.querySelector('button[data-look={look}]').click()")
                    self.assertTrue(page.wait_for(f"document.getElementById('scene').dataset.look === '{look}'"), look)
                    self.assert_scene_is_drawn(page)
                    keep(page, look + ".png")
                # Without the wall the points are there, and the other way round.
                page.value("document.getElementById('whole').click()")
                page.value("document.querySelector('[data-layer=surface]').click()")
                page.value("document.querySelector('[data-layer=points]').click()")
                self.assert_scene_is_drawn(page)

                # Nothing came from elsewhere, nothing was refused, nothing failed.
                self.assertEqual(page.messages, [])
                origins = page.value("[...new Set(performance.getEntriesByType('resource').map(e => new URL(e.name).origin))]")
                self.assertEqual(origins, [page.value("location.origin")])
            self.assertEqual(server.code, 130)

    def test_marks_of_a_run(self):
        with page_of(put_marks) as (page, run):
            row = ("[...document.querySelectorAll('#marks tr')]"
                   ".map(row => [...row.children].map(cell => cell.textContent).join('|'))")
            for index, state in enumerate(("in front|1.5", "hidden|1.2", "not known|")):
                move_slider(page, f"s.max - {index}")
                self.assertEqual(page.value(row), [f"{LABEL}|0|{state}"])
            self.assertTrue(page.wait_for(PIN_IS_SHOWN), "from outside it is there, however the scope sees it")
            self.assertEqual(page.value("document.querySelector('.pin span').textContent"), LABEL)
            # Through the scope it is only there when it is in front.
            page.value("document.querySelector('button[data-look=scope]').click()")
            self.assertTrue(page.wait_for("!" + PIN_IS_SHOWN))
            move_slider(page, "s.max")
            self.assertTrue(page.wait_for(PIN_IS_SHOWN))
            page.value("document.querySelector('[data-layer=pins]').click()")
            self.assertTrue(page.wait_for("!" + PIN_IS_SHOWN))
            self.assertEqual(page.value("document.querySelectorAll('b').length"), 0, "a label is no HTML")
            self.assertEqual(page.messages, [])
            report = run.parent / "report.html"
            subprocess.run([HAUSTRA, "report", run, "--html", report], check=True, stdout=subprocess.DEVNULL)
            page.open(report.as_uri())
            self.assertTrue(page.wait_for(PIN_IS_SHOWN), page.messages)
            self.assertEqual(page.value("document.querySelector('.pin span').textContent"), LABEL)
            self.assertEqual(page.value("document.querySelector('#marks-section td').textContent"), LABEL)
            self.assertEqual(page.value("document.querySelectorAll('b').length"), 0)
            self.assertEqual(page.messages, [])

    def test_run_without_a_map(self):
        with page_of(take_maps) as (page, _):
            text = "document.getElementById('state-text').textContent"
            self.assertEqual(page.value(text), "the run has no map: nothing was tracked")
            move_slider(page, "3")
            self.assertEqual(page.value("document.body.dataset.frame"), "3")
            self.assertEqual(page.value(text), "the run has no map: nothing was tracked")
            self.assertEqual(page.messages, [])

    def test_report(self):
        with browser.Browser() as page:
            page.open((RESULT / "report.html").as_uri())
            self.assertTrue(page.wait_for("document.querySelector('.scene') !== null"), page.messages)
            page.value("document.querySelector('.scene').scrollIntoView({block: 'center'})")
            self.assert_scene_is_drawn(page, ".scene", 10, 10)
            keep(page, "report.png")
            self.assertEqual(page.messages, [])

    def test_report_with_a_surface(self):
        with tempfile.TemporaryDirectory() as scratch, browser.Browser() as page:
            surface, report = Path(scratch, "surface"), Path(scratch, "report.html")
            subprocess.run([HAUSTRA, "surface", RESULT, "--sequence", SEQUENCE, "--out", surface, "--quiet"], check=True)
            subprocess.run([HAUSTRA, "report", RESULT, "--surface", surface, "--html", report, "--quiet"], check=True)
            page.open(report.as_uri())
            self.assertTrue(page.wait_for("document.querySelector('.scene') !== null"), page.messages)
            page.value("document.querySelector('.scene').scrollIntoView({block: 'center'})")
            self.assert_scene_is_drawn(page, ".scene", 10, 10)
            # Triangles, and not the points of the map.
            self.assertTrue(page.wait_for("Number(document.querySelector('.scene').dataset.drawn) > 8000"))
            for look in ("outside", "cut"):
                page.value(f"document.querySelector('.scene button[data-look={look}]').click()")
                self.assertTrue(page.wait_for(f"document.querySelector('.scene').dataset.look === '{look}'"), look)
                self.assert_scene_is_drawn(page, ".scene", 10, 10)
            keep(page, "report_surface.png")
            self.assertEqual(page.messages, [])

    def test_both_sides_of_the_wall_are_lit(self):
        with tempfile.TemporaryDirectory() as folder, browser.Browser() as page, ServedView(HAUSTRA, "--folder", folder) as server:
            page.open(server.address)
            self.assertTrue(page.wait_for("document.body.dataset.ready === 'live'"), page.messages)
            page.value(TUBE + "; 0")

            def kinds(look):
                """Shares of what is seen: ground, gap (from inside), dark, inside of the wall and its outside."""
                self.assertEqual(page.value(f"tube.show('{look}')"), look)
                counts = dict.fromkeys(("ground", "gap", "dark", "inside", "outside"), 0)
                seen = [c for row in pixels(page.picture(0.5, (0, 0, 600, 300))) for c in row]
                for c in seen:
                    near = [name for name, of in (("ground", GROUND), ("gap", UNSEEN)) if max(abs(a - b) for a, b in zip(c, of)) < 8]
                    name = near[0] if near else "dark" if max(c) < 60 else "inside" if c[1] > c[0] else "outside"
                    counts[name] += 1
                return {name: count / len(seen) for name, count in counts.items()}

            outside = kinds("outside")
            self.assertGreater(outside["outside"], 0.1)
            self.assertLess(outside["dark"], 0.05 * outside["outside"], outside)
            cut = kinds("cut")
            self.assertGreater(cut["inside"], 0.1)
            self.assertLess(cut["outside"], 0.1 * cut["inside"], cut)
            # Without the near half nothing of the silhouette is lost but the gap, and the light reaches all of it.
            self.assertLess(cut["dark"], 0.1 * cut["inside"], cut)
            along = kinds("along")
            self.assertGreater(along["inside"], 0.5)
            self.assertGreater(along["gap"], 0.03)
            self.assertEqual((along["outside"], along["ground"]), (0, 0))
            # The slider goes through the lumen, and back.
            self.assertFalse(page.value("tube.bar.querySelector('.way-through').hidden"))
            where = "tube.scene.scope_camera.position.toArray().concat(tube.scene.scope_camera.getWorldDirection(new THREE.Vector3()).toArray())"
            page.value("(s => { s.value = 0.9; s.dispatchEvent(new Event('input')); })(tube.bar.querySelector('input'))")
            page.value("tube.show('along')")
            there = page.value(where)
            self.assertAlmostEqual(there[0] - page.value("tube.scene.root.position.x"), 7.2, delta=0.05)
            self.assertGreater(there[3], 0.99)
            page.value("tube.bar.querySelector('.way-through button').click()")
            page.value("tube.show('along')")
            self.assertLess(page.value(where)[3], -0.99)
            # A wall whose line is not known can be cut, too: then by what faces the eye.
            page.value("tube.scene.clear('surface'); tube.scene.addSurface(tube.geometry.clone())")
            self.assertTrue(page.value("tube.bar.querySelector('button[data-look=along]').disabled"))
            cut = kinds("cut")
            self.assertGreater(cut["inside"], 0.1)
            self.assertEqual(cut["outside"], 0)
            page.value("tube.scene.clear('surface')")
            self.assertTrue(page.value("tube.bar.querySelector('button[data-look=cut]').disabled"), "there is nothing to cut")
            self.assertEqual(page.messages, [])

    def test_another_page_learns_nothing(self):
        with ServedView(HAUSTRA, RESULT) as server, browser.Browser() as page:
            # A page of another origin in the same browser, which even knows the address.
            page.open("data:text/html,<title>other</title>")
            self.assertTrue(page.wait_for("document.title === 'other'"))
            outcome = page.value(f"fetch('{server.address}run.json').then(a => a.text(), () => 'refused')")
            self.assertEqual(outcome, "refused")
            with self.assertRaises(urllib.error.HTTPError) as refused:
                urllib.request.urlopen(server.address.rsplit("/", 2)[0] + "/")
            self.assertEqual(refused.exception.code, 403)
            refused.exception.close()

    def assert_no_scope(self, page, word):
        self.assertEqual(page.value("document.getElementById('state').textContent"), word)
        self.assertEqual(page.value("document.getElementById('facts').textContent"), "")
        self.assertTrue(page.value("document.getElementById('picture-panel').classList.contains('old')"))
        self.assertIn("not known", page.value("document.getElementById('marks').textContent"))

    def test_where_the_scope_was_is_not_where_it_is(self):
        """Of an engine whose camera or itself has gone silent."""
        with tempfile.TemporaryDirectory() as folder, browser.Browser() as page, ServedView(HAUSTRA, "--folder", folder) as server:
            page.before_pages(SCRIPTED_STREAM)
            page.open(server.address)
            self.assertTrue(page.wait_for("window.tell !== undefined"), page.messages)
            say = "tell('service', {state: '%s', text: 'words', has_engine: true})"
            # A page that is opened late is told of what was before.
            page.value(say % "no_signal" + "; tell('map', mapOf(0)); tell('poses', [poseAt(1)])")
            self.assert_no_scope(page, "No signal")
            for state, word in (("no_signal", "No signal"), ("silent", "No answer"), ("source_over", "Over")):
                page.value(say % "running" + "; tell('poses', [poseAt(2)])")
                self.assertEqual(page.value("document.getElementById('state').textContent"), "Tracking")
                self.assertIn("in front", page.value("document.getElementById('marks').textContent"))
                page.value(say % state)
                self.assert_no_scope(page, word)
                self.assertEqual(page.value("document.getElementById('state-text').textContent"), "words")
            # It says that it runs, and tells nothing.
            page.value(say % "running" + "; tell('poses', [poseAt(3)])")
            self.assertTrue(page.wait_for("document.getElementById('state').textContent === 'No pose'", 10))
            self.assert_no_scope(page, "No pose")
            self.assertEqual(page.messages, [])

    def test_a_click_marks_the_pixel_of_the_frame_that_is_shown(self):
        with tempfile.TemporaryDirectory() as folder, browser.Browser() as page, \
                ServedView(HAUSTRA, "--folder", folder, "--marking") as server:
            page.before_pages(SCRIPTED_STREAM + ASKED_FOR)
            page.open(server.address)
            self.assertTrue(page.wait_for("window.tell !== undefined"), page.messages)
            page.value("tell('service', {state: 'running', text: '', has_engine: true}); tell('map', mapOf(0))")
            begin, picture = "document.getElementById('marking-begin').click()", "document.body.dataset.picture"
            page.value(begin)
            self.assertFalse(page.value("haustra.marking.isAiming()"), "there is no picture")
            page.value("tell('picture', pictureOf(7))")
            self.assertTrue(page.wait_for(f"{picture} === '7'"))
            page.value(CLICK_PICTURE % (0.5, 0.5))
            self.assertEqual(page.value("asked"), [], "nobody wanted to mark")
            page.value(begin)
            page.value("tell('picture', pictureOf(8))")
            time.sleep(1)
            self.assertEqual(page.value(picture), "7", "it stands still")
            # The middle of pixel 10, 5 of 40x20 that are every fourth one of the frame.
            page.value(CLICK_PICTURE % (10.5 / 40, 5.5 / 20))
            words = page.value("asked")[0].split()
            self.assertEqual([words[0], *words[3:]], ["do?request=mark", "mark-1", "7", "3"])
            # The mouse stands on whole pixels of the screen, which are half as large as those of the frame.
            self.assertAlmostEqual(float(words[1]), 40, delta=0.6)
            self.assertAlmostEqual(float(words[2]), 20, delta=0.6)
            page.value("tell('picture', pictureOf(9))")
            self.assertTrue(page.wait_for(f"{picture} === '9'"), "it goes on")
            # A label of one's own; names that are taken are not proposed; Escape leaves it.
            page.value("document.getElementById('marking-label').value = ' fold.2 '; " + begin)
            page.value(CLICK_PICTURE % (0, 0))
            self.assertEqual(page.value("asked[1]"), "do?request=mark 0.0 0.0 fold.2 9 3")
            page.value("tell('map', {...mapOf(0), marks: [{id: 1, label: 'mark-1', map: 0, position: [0, 0, 1]}]}); " + begin)
            page.value("document.dispatchEvent(new KeyboardEvent('keydown', {key: 'Escape'}))")
            page.value(CLICK_PICTURE % (0.5, 0.5))
            self.assertEqual(page.value("asked.length"), 2)
            page.value(begin)
            page.value(CLICK_PICTURE % (0, 0))
            self.assertEqual(page.value("asked[2]"), "do?request=mark 0.0 0.0 mark-2 9 3")
            # One click removes nothing, and the row stays the same while poses come.
            page.value("document.querySelector('#marks .remove').click(); tell('poses', [poseAt(2)])")
            self.assertEqual(page.value("asked.length"), 3)
            page.value("document.querySelector('#marks .remove').click()")
            self.assertEqual(page.value("asked[3]"), "do?request=unmark mark-1 3")
            # Of a procedure that has ended nothing can be pointed at.
            page.value("tell('fresh', {}); " + begin)
            self.assertFalse(page.value("haustra.marking.isAiming()"))
            self.assertEqual(page.messages, [])

    def test_without_the_option_nothing_can_be_marked(self):
        with tempfile.TemporaryDirectory() as folder, browser.Browser() as page, ServedView(HAUSTRA, "--folder", folder) as server:
            page.open(server.address)
            self.assertTrue(page.wait_for("document.body.dataset.ready === 'live'"), page.messages)
            self.assertTrue(page.value("document.getElementById('marking').hidden"))
            self.assertEqual(page.value("fetch('do?request=unmark%20x', {method: 'POST'}).then(answer => answer.status)"), 404)

    def test_the_wall_is_that_of_the_map_that_the_scope_is_in(self):
        with tempfile.TemporaryDirectory() as folder, browser.Browser() as page, ServedView(HAUSTRA, "--folder", folder) as server:
            page.before_pages(SCRIPTED_STREAM)
            page.open(server.address)
            self.assertTrue(page.wait_for("window.tell !== undefined"), page.messages)
            # Poses go on: without them the scope is nowhere after a while.
            page.value("tell('service', {state: 'running', text: '', has_engine: true}); window.now = [1, 0];"
                       "window.going = setInterval(() => tell('poses', [poseAt(...now)]), 100); tell('poses', [poseAt(1)])")
            page.value("tell('map', mapOf(0)); tell('wall', wallOf(0, 1))")
            is_hidden = "document.getElementById('wall-panel').hidden"
            # Yellow, the scope, in the middle column of the picture.
            has_bar = ("(wall => { const at = wall.getContext('2d').getImageData(Math.round(wall.width / 2), 5, 1, 1).data;"
                       "return at[0] > 200 && at[2] < 100; })(document.getElementById('wall'))")
            self.assertFalse(page.value(is_hidden))
            self.assertTrue(page.wait_for(has_bar, 10))
            text = "document.getElementById('wall-text').textContent"
            self.assertNotIn("cut off", page.value(text))
            page.value("tell('wall', {...wallOf(0, 1), refused_blocks: 7})")
            self.assertIn("The mesh is cut off", page.value(text))
            page.value("now = [30, 0]")
            self.assertTrue(page.wait_for(f"!{has_bar}", 10), "it was there long ago")
            self.assertFalse(page.value(is_hidden))
            page.value("now = [31, 1]")
            self.assertTrue(page.wait_for(is_hidden, 10), "the scope is in another map")
            page.value("now = [32, 0]; tell('wall', wallOf(0, 32))")
            self.assertTrue(page.wait_for(has_bar, 10))
            page.value("clearInterval(going); tell('poses', [{...poseAt(33, -1), state: 'lost', position: undefined}])")
            self.assertTrue(page.wait_for(f"!{has_bar}", 10), "nobody knows where it is")
            self.assertFalse(page.value(is_hidden))
            page.value("tell('map', mapOf(2))")
            self.assertTrue(page.value(is_hidden), "the map is another one")
            self.assertEqual(page.messages, [])

    def test_live(self):
        folder = Path(tempfile.mkdtemp(prefix="haustra_view_"))
        try:
            with ServedView(HAUSTRA, "--folder", folder, "--marking") as server, browser.Browser() as page, \
                    browser.Browser() as other:
                for each in (page, other):
                    each.open(server.address)
                    self.assertTrue(each.wait_for("document.body.dataset.service === 'none'"), each.messages)
                self.assertEqual(page.value("document.getElementById('state').textContent"), "No engine")
                self.assertEqual(page.value("document.getElementById('state-text').textContent"), "No engine is running.")
                # Its pictures come up late, as on a busy machine.
                other.value("window.Image = class extends Image { set onload(f) { super.onload = () => setTimeout(f, 2000); } }; 0")
                for attempt in range(2):  # the engine comes, and comes anew
                    shutil.rmtree(folder / "state", ignore_errors=True)
                    with live_service(folder):
                        for each in (page, other):
                            self.assertTrue(each.wait_for("Number(document.body.dataset.points) > 50"), each.messages)
                            self.assertTrue(each.wait_for("document.body.dataset.state === 'tracking'"),
                                            each.value("document.getElementById('state').textContent"))
                            self.assertTrue(each.wait_for("Number(document.body.dataset.matched) > 50"), each.messages)
                        if attempt == 0:
                            # First what lasts only as long as the recording: the lens is covered later, and it ends.
                            self.assert_picture_is_shown(page)
                            self.assert_mark_is_shown(page)
                            self.assertTrue(other.wait_for("document.body.dataset.marks === '1'"), other.messages)
                            # The wall comes while the scope moves, and fills the scene: first points are too few for it.
                            self.assertTrue(page.wait_for("document.body.dataset.surface === 'shown'"), page.messages)
                            self.assert_scene_is_drawn(page)
                            self.assert_wall_is_unrolled(page)
                            self.assert_depth_is_told(folder)
                            self.assert_mark_is_removed(page)
                        keep(page, f"live_{attempt}.png")
                    for each in (page, other):
                        self.assertTrue(each.wait_for("document.getElementById('state').textContent === 'No engine'"))
                        # What it showed was a patient's.
                        self.assertTrue(each.wait_for("document.body.dataset.poses === '0'"))
                        self.assertTrue(each.wait_for("document.getElementById('picture-panel').hidden"))
                        self.assertTrue(each.wait_for("document.getElementById('wall-panel').hidden"))
                        self.assertEqual(each.value("document.body.dataset.surface"), "none")
                    time.sleep(2.5)
                    for each in (page, other):
                        self.assertTrue(each.value("document.getElementById('picture-panel').hidden"))
                        each.value("document.body.dataset.points = document.body.dataset.matched = 0")
                self.assertEqual(page.messages, [])
        finally:
            shutil.rmtree(folder, ignore_errors=True)


if __name__ == "__main__":
    if browser.program() is None:
        print("skipped: chromium is not installed")
        sys.exit(77)
    unittest.main(argv=sys.argv[:1])

// The page of a running engine: the event stream "live" (tools/view/live_stream.h).
'use strict';
(() => {
  const {byId, decode, setState, setFacts, eventItem, latencyPlot, connectSwitches, showMarks, drawRings, showWall, marking} = haustra;
  const SHOWN_S = 20, MAX_TRAIL = 3000, MAX_EVENTS = 200;
  // After so long without a pose nobody knows where the scope is.
  const MAX_SILENCE_MS = 2000;
  const WORDS = {running: 'No pose', no_signal: 'No signal', source_over: 'Over', silent: 'No answer'};

  byId('time').hidden = true;
  byId('map-choice').hidden = true;
  byId('way-text').textContent = 'keyframes of the map, in order';
  byId('travelled-text').textContent = 'last positions';
  byId('latency-title').textContent = 'Latency, frame to pose';

  const scene = new haustra.Scene3D(byId('scene'));
  const plot = latencyPlot(null, [-SHOWN_S, 0]);
  // The picture of the wall comes late; a scope that was there longer ago is not drawn into it.
  const MAX_SCOPE_AGE_S = 5;
  let map, wall, told_wall = '', trail, latencies, newest, num_poses, framed_extent, is_ours, service = null, num_forgotten = 0;
  let heard_ms = -Infinity;  // when the last poses came

  // Until somebody turns it by hand the picture follows the map as it grows.
  const frame = () => {
    is_ours = true;
    framed_extent = 0;
    follow();
  };
  const extentOf = points => {
    let low = [Infinity, Infinity, Infinity], high = [-Infinity, -Infinity, -Infinity];
    for (let i = 0; i < points.length; ++i) {
      low[i % 3] = Math.min(low[i % 3], points[i]);
      high[i % 3] = Math.max(high[i % 3], points[i]);
    }
    return Math.max(0, high[0] - low[0], high[1] - low[1], high[2] - low[2]);
  };
  const follow = () => {
    if (!map || !is_ours) return;
    const extent = extentOf(map.keyframes) + 1e-9;
    if (extent < 1.25 * framed_extent) return;
    framed_extent = extent;
    scene.frame(map.keyframes, map.points);
  };
  if (scene.works) scene.controls.addEventListener('start', () => { is_ours = false; });

  // All marks in the list, those of the map in the scene, as the newest frame sees them.
  const showLiveMarks = () => {
    const sightings = new Map((newest && newest.marks || []).map(sighting => [sighting.id, sighting]));
    const of = mark => sightings.get(mark.id) || {state: 'not_known', distance: null};
    const rows = (map ? map.marks : []).map(mark => ({...mark, ...of(mark)}));
    showMarks(rows);
    marking.onMarks(rows, map && map.procedure);
    scene.setPins(rows.filter(mark => mark.map === map.map));
  };

  const forget = () => {
    ++num_forgotten;
    map = null;
    hideWall();
    trail = [];
    latencies = [];
    newest = null;
    num_poses = 0;
    framed_extent = 0;
    is_ours = true;
    for (const part of ['points', 'path']) scene.clear(part);
    scene.setScope(null);
    marking.forget();
    showLiveMarks();
    byId('events').replaceChildren();
    byId('picture-panel').hidden = true;
    byId('picture-panel').classList.remove('old');
    byId('picture').width = byId('picture').width;  // what it showed is cleared
    setFacts([]);
    plot.show([], -SHOWN_S, 0);
    document.body.dataset.poses = 0;
  };

  const showLayer = (name, is_shown) => {
    document.querySelector(`[data-layer=${name}]`).checked = is_shown;
    scene.setLayer(name, is_shown);
  };
  const hideMesh = () => {
    scene.clear('surface');
    scene.draw();
    document.querySelector('[data-layer=surface]').parentElement.hidden = true;
    showLayer('points', true);
    document.body.dataset.surface = document.body.dataset.mesh = 'none';
  };
  const hideWall = () => {
    wall = null;
    hideMesh();
    showLiveWall();
  };
  // The wall of the map that the scope is in. While that is not known it may be that of the map shown.
  const showLiveWall = is_new => {
    const of = newest && newest.map >= 0 ? newest.map : map ? map.map : wall && wall.map;
    const is_shown = wall !== null && wall.map === of;
    const has_scope = is_shown && newest && newest.position && newest.map === wall.map && newest.t_s - wall.t_s < MAX_SCOPE_AGE_S;
    const told = is_shown ? (has_scope ? 'with scope' : 'alone') : 'none';
    if (told === told_wall && !is_new) return;
    told_wall = document.body.dataset.liveWall = told;
    if (!is_shown) return showWall(null);
    showWall(wall, wall.picture ? 'data:image/png;base64,' + wall.picture : null, has_scope ? wall.scope : undefined);
  };
  // A mesh from before its map was moved lies elsewhere.
  const fitsMap = surface => map && surface && surface.map === map.map && surface.epoch === map.epoch;

  // By itself: it is large, and not every page can draw it.
  const fetchMesh = () => {
    const data = wall;
    if (!scene.works || !fitsMap(data) || data.triangles === 0) return;
    fetch('wall.ply').then(answer => answer.ok ? answer.arrayBuffer() : Promise.reject(new Error(answer.status))).then(bytes => {
      // A newer one is on its way, or none any more.
      if (wall !== data || !fitsMap(data)) return;
      scene.clear('surface');
      scene.addSurface(new THREE.PLYLoader().parse(bytes), data.lumen.line || []);
      // Points of a wall that is drawn are noise in front of it; where the mesh is cut off there is nothing else.
      const cut = data.refused_blocks > 0 ? 'cut' : 'whole';
      if (document.body.dataset.mesh !== cut) showLayer('points', cut === 'cut');
      document.body.dataset.mesh = cut;
      document.querySelector('[data-layer=surface]').parentElement.hidden = false;
      document.body.dataset.surface = 'shown';
    }).catch(() => {});  // the next one comes in seconds
  };
  const onWall = data => {
    if (data.map === undefined) return hideWall();
    wall = data;
    showLiveWall(true);
    fetchMesh();
  };

  const drawPaths = () => {
    scene.clear('path');
    if (!map) return;
    const pairs = list => list.flatMap((p, i) => i > 0 && p && list[i - 1] ? [...list[i - 1], ...p] : []);
    const keyframes = [];
    for (let i = 0; i + 2 < map.keyframes.length; i += 3) keyframes.push(map.keyframes.subarray(i, i + 3));
    scene.addLine(pairs(keyframes), haustra.SCENE_COLOURS.way, 2);
    scene.addLine(pairs(trail.map(pose => pose.position || null)), haustra.SCENE_COLOURS.travelled, 3.5);
    trail.forEach((pose, i) => {
      if (i > 0 && !pose.position && trail[i - 1].position) scene.addMark(new THREE.Vector3(...trail[i - 1].position));
    });
  };

  // Nothing that is shown says where the scope is now: what was seen last stays, as that.
  const showNoScope = (word, text) => {
    newest = null;
    setState('off');
    byId('state').textContent = word;
    byId('state-text').textContent = text;
    setFacts([]);
    scene.setScope(null);
    byId('picture-panel').classList.add('old');
    showLiveMarks();
    showLiveWall();
  };
  const wordOf = data => (data.has_engine && WORDS[data.state]) || (data.state === 'idle' ? 'Waiting' : 'No engine');

  const onService = data => {
    service = data;
    document.body.dataset.service = data.state;
    if (data.state !== 'running') return showNoScope(wordOf(data), data.text);
    byId('state-text').textContent = data.text;
    heard_ms = performance.now();  // from now on poses are to come
  };
  setInterval(() => {
    if (document.body.dataset.state === 'off' || !service || service.state !== 'running') return;
    if (performance.now() - heard_ms > MAX_SILENCE_MS) showNoScope(WORDS.running, 'The engine has told no pose for seconds.');
  }, 250);

  const onMap = data => {
    const is_other = !map || map.map !== data.map || map.epoch !== data.epoch;
    map = {...data, points: decode(Float32Array, data.points), keyframes: decode(Float32Array, data.keyframes)};
    // Poses in another map, or from before it was moved, do not compare with this one.
    if (is_other) {
      framed_extent = 0;
      trail = trail.filter(pose => !pose.position || (pose.map === map.map && pose.epoch === map.epoch));
      hideMesh();
      fetchMesh();
    }
    showLiveWall();
    follow();
    scene.clear('points');
    scene.addPoints(map.points, null);
    drawPaths();
    showLiveMarks();
    document.body.dataset.points = data.num_points;
  };

  const onPoses = poses => {
    for (const pose of poses) {
      latencies.push({x: pose.t_s, y: pose.published_ms});
      if (!map || !pose.position || (pose.map === map.map && pose.epoch === map.epoch)) trail.push(pose);
    }
    num_poses += poses.length;
    document.body.dataset.poses = num_poses;
    const last = poses[poses.length - 1];
    while (latencies.length > 0 && latencies[0].x < last.t_s - SHOWN_S) latencies.shift();
    if (trail.length > MAX_TRAIL) trail.splice(0, trail.length - MAX_TRAIL);
    plot.show(latencies.map(p => ({x: p.x - last.t_s, y: p.y})), -SHOWN_S, 0);
    drawPaths();
    // A page that was opened late is told of the seconds before, too.
    if (!service || service.state !== 'running') return;
    newest = last;
    heard_ms = performance.now();
    setState(newest.state);
    if (newest.is_predicted) byId('state').textContent = 'Predicted';
    byId('state-text').textContent = (newest.map >= 0 ? 'map ' + newest.map + ' · ' : '') + newest.reason.replaceAll('_', ' ');
    const fits = map && newest.position && newest.map === map.map && newest.epoch === map.epoch;
    scene.setScope(fits ? newest.position : null, newest.orientation);
    showLiveMarks();
    showLiveWall();
    const first = latencies[0], span = newest.t_s - first.x;
    const sorted = latencies.map(p => p.y).sort((a, b) => a - b);
    const quantile = q => sorted[Math.floor(q * (sorted.length - 1))].toFixed(1) + ' ms';
    setFacts([['frame', newest.frame], ['map', newest.map >= 0 ? newest.map + (map ? ' of ' + map.num_maps : '') : 'none'],
              ['matched points', newest.inliers + ' of ' + newest.features + ' features'],
              ['latency', newest.published_ms.toFixed(1) + ' ms'], ['median, longest', quantile(0.5) + ', ' + quantile(1)],
              ['poses a second', span > 1 ? ((latencies.length - 1) / span).toFixed(1) : ''],
              ['keyframes, points', map ? map.num_keyframes + ', ' + map.num_points : 'none yet']]);
  };

  // Points of the map that tracking has found in the picture.
  const onPicture = data => {
    const image = new Image(), of = num_forgotten;
    image.onload = () => {
      // Loading takes its time: it may be of another patient by now.
      if (of !== num_forgotten || marking.isAiming()) return;
      const canvas = byId('picture'), context = canvas.getContext('2d'), scale = 2;
      byId('picture-panel').hidden = false;
      byId('picture-panel').classList.toggle('old', document.body.dataset.state === 'off');
      canvas.width = scale * data.width;
      canvas.height = scale * data.height;
      context.drawImage(image, 0, 0, canvas.width, canvas.height);
      context.strokeStyle = '#f0e442';
      context.lineWidth = 1.5;
      for (let i = 0; i + 1 < data.points.length; i += 2) {
        context.beginPath();
        context.arc(scale * (data.points[i] + 0.5), scale * (data.points[i + 1] + 0.5), 3.5, 0, 2 * Math.PI);
        context.stroke();
      }
      // The label of a new mark comes with the next map.
      const labels = new Map((map ? map.marks : []).map(mark => [mark.id, mark.label]));
      drawRings(context, scale, data.marks.map(mark => ({...mark, label: labels.get(mark.id) || ''})));
      marking.onPicture(data);
      document.body.dataset.rings = data.marks.length;
      document.body.dataset.picture = data.frame;
      document.body.dataset.matched = data.num_matched;
    };
    image.src = 'data:image/jpeg;base64,' + data.jpeg;
  };

  const onEvents = events => {
    for (const event of events) {
      const counts = event.keyframes > 0 ? event.keyframes + ' keyframes, ' + event.points + ' points' : '';
      byId('events').prepend(eventItem({...event, time: 'frame ' + event.frame, details: counts}, null));
    }
    while (byId('events').children.length > MAX_EVENTS) byId('events').lastChild.remove();
  };

  forget();
  connectSwitches(scene, frame);
  const source = new EventSource('live');
  const on = (name, handle) => source.addEventListener(name, message => handle(JSON.parse(message.data)));
  on('fresh', forget);
  on('service', onService);
  on('map', onMap);
  on('poses', onPoses);
  on('events', onEvents);
  on('picture', onPicture);
  on('wall', onWall);
  source.addEventListener('open', () => { document.body.dataset.ready = 'live'; });
  // The browser tries again by itself.
  source.addEventListener('error', () => {
    onService({state: 'unreachable', text: 'haustra view does not answer. This page tries again.', has_engine: false});
  });
})();

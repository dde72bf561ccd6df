// The page of a finished run: run.json (tools/view/run_data.h) with a slider over its frames.
'use strict';
(() => {
  const {byId, MAP_COLOURS, STATES, decode, clock, setState, setFacts, eventItem, latencyPlot, connectSwitches, showMarks} = haustra;
  const NOT_TRACKED = 255, MAX_PATH_SEGMENTS = 20000, MAX_PLOT_POINTS = 1500;

  const fail = text => {
    setState('error');
    byId('state').textContent = 'Error';
    byId('state-text').textContent = text;
    document.body.dataset.ready = 'error';
  };

  const show = run => {
    const columns = {index: Int32Array, time_s: Float32Array, map: Int32Array, live_map: Int32Array, state: Uint8Array,
                     inliers: Int32Array, latency_ms: Float32Array, position: Float32Array, orientation: Float32Array};
    const frames = {};
    for (const [name, type] of Object.entries(columns)) frames[name] = decode(type, run.frames[name]);
    const count = frames.index.length;
    const stateOf = i => frames.live_map[i] >= 0 ? 'tracking' : frames.map[i] >= 0 ? 'placed' : run.states[frames.state[i]];
    document.title = 'haustra view: ' + run.name;
    byId('name').textContent = run.name;
    byId('note').textContent = run.mode + ' run' + (run.device ? ', ' + run.device : '') + ' · lengths are map units, not millimetres';

    // --- The scene, one map at a time.
    const scene = new haustra.Scene3D(byId('scene'));
    const maps = new Map();
    for (const map of run.maps) {
      maps.set(map.id, {...map, points: decode(Float32Array, map.points), rgb: decode(Uint8Array, map.rgb), geometry: null});
    }
    for (const map of maps.values()) {
      const path = [], segments = [], ends = [], losses = [];
      for (let i = 0; i < count; ++i) {
        if (frames.map[i] !== map.id) continue;
        path.push(frames.position[3 * i], frames.position[3 * i + 1], frames.position[3 * i + 2]);
      }
      const step = Math.max(1, Math.ceil(path.length / 3 / MAX_PATH_SEGMENTS));
      let last = -1;
      for (let i = 0; i < count; ++i) {
        if (frames.map[i] !== map.id) { last = -1; continue; }
        if (last >= 0 && i - last < step && i + 1 < count && frames.map[i + 1] === map.id) continue;
        if (last >= 0) {
          segments.push(...frames.position.subarray(3 * last, 3 * last + 3), ...frames.position.subarray(3 * i, 3 * i + 3));
          ends.push(i);
        }
        last = i;
      }
      for (let i = 1; i < count; ++i) {
        if (frames.map[i - 1] === map.id && frames.live_map[i - 1] >= 0 && run.states[frames.state[i]] === 'lost') losses.push(i - 1);
      }
      Object.assign(map, {path: new Float32Array(path), segments, ends, losses});
    }

    let shown = null, travelled = () => {};
    const frameMap = () => shown && scene.frame(shown.path, shown.geometry ? shown.geometry.getAttribute('position').array : shown.points);
    const showLayer = (name, is_shown) => {
      document.querySelector(`[data-layer=${name}]`).checked = is_shown;
      scene.setLayer(name, is_shown);
    };
    const addSurface = map => {
      if (map !== shown || !map.geometry) return;
      scene.clear('surface');
      scene.addSurface(map.geometry.clone(), map.wall && map.wall.lumen.line || []);
      // Points of a wall that is drawn are noise in front of it.
      showLayer('points', false);
    };
    const showMap = id => {
      const map = maps.get(id);
      if (!map || map === shown) return;
      shown = map;
      for (const part of ['points', 'surface', 'path']) scene.clear(part);
      frameMap();
      scene.addPoints(map.points, map.rgb);
      scene.addLine(map.segments, haustra.SCENE_COLOURS.way, 1.5);
      travelled = scene.addLine(map.segments, haustra.SCENE_COLOURS.travelled, 3.5);
      if (scene.works) for (const i of map.losses) scene.addMark(new THREE.Vector3(...frames.position.subarray(3 * i, 3 * i + 3)));
      document.querySelector('[data-layer=surface]').parentElement.hidden = !map.surface;
      haustra.showWall(map.wall, map.wall && map.wall.picture);
      showLayer('points', true);
      byId('map').value = String(id);
      document.body.dataset.map = id;
      if (map.geometry) addSurface(map);
      else if (map.surface && scene.works) {
        fetch(map.surface).then(answer => answer.ok ? answer.arrayBuffer() : Promise.reject(new Error(answer.status))).then(bytes => {
          const geometry = new THREE.PLYLoader().parse(bytes);
          if (!geometry.index) return;  // a mesh without a triangle
          map.geometry = geometry;
          if (map === shown) frameMap();
          addSurface(map);
          document.body.dataset.surface = 'shown';
        }).catch(error => { byId('state-text').textContent = map.surface + ' cannot be shown: ' + error.message; });
      }
    };
    for (const map of maps.values()) byId('map').add(new Option(map.id + ' (' + map.num_points + ' points)', map.id));
    const marks = run.marks.map(mark => {
      return {...mark, state: decode(Uint8Array, mark.state), distance: decode(Float32Array, mark.distance)};
    });
    // At a frame: as it was answered at the time, at the place of the end.
    const goMarks = i => {
      const rows = marks.map(mark => {
        const is_tracked = mark.state[i] !== NOT_TRACKED;
        const state = is_tracked ? run.mark_states[mark.state[i]] : frames.index[i] <= mark.frame ? 'not_set_yet' : 'not_known';
        return {...mark, state, distance: is_tracked ? mark.distance[i] : null};
      });
      showMarks(rows);
      scene.setPins(rows.filter(mark => mark.position && shown && mark.map === shown.id));
    };
    byId('map-choice').hidden = maps.size < 2;
    byId('map').addEventListener('change', () => { showMap(Number(byId('map').value)); go(current); });
    connectSwitches(scene, frameMap);

    // --- Latency: of each stretch the longest, so that no peak is lost.
    const measured = frames.latency_ms.some(ms => !Number.isNaN(ms));
    byId('latency-panel').hidden = !measured;
    byId('latency-title').textContent = run.mode === 'realtime' ? 'Latency, frame to pose' : 'Time spent on each frame';
    const plot = latencyPlot(run.mode === 'realtime' ? run.period_ms : null, [0, Math.max(frames.time_s[count - 1], 0.1)]);
    const bin = Math.max(1, Math.ceil(count / MAX_PLOT_POINTS)), points = [];
    for (let i = 0; i < count; i += bin) {
      let ms = NaN;
      for (let k = i; k < Math.min(count, i + bin); ++k) if (!(frames.latency_ms[k] <= ms)) ms = Number.isNaN(frames.latency_ms[k]) ? ms : frames.latency_ms[k];
      points.push({x: frames.time_s[i], y: ms});
    }
    plot.show(points);

    // --- Events.
    const indexOf = new Map();
    frames.index.forEach((index, i) => indexOf.set(index, i));
    const items = [];
    for (const event of run.events) {
      const i = indexOf.get(event.frame);
      const item = eventItem({...event, time: i === undefined ? '' : clock(frames.time_s[i])}, i === undefined ? null : () => go(i));
      items.push({item, at: i === undefined ? -1 : i});
      byId('events').append(item);
    }
    if (items.length === 0) byId('events').textContent = 'None.';
    if (run.num_events > items.length) {
      const rest = document.createElement('li');
      rest.textContent = 'The first ' + items.length + ' of ' + run.num_events + ' are listed; events.csv has all.';
      byId('events').append(rest);
    }

    // --- The strip: states, and below them maps where there are several.
    const drawStrip = () => {
      const strip = byId('strip'), ratio = window.devicePixelRatio, width = Math.max(1, Math.round(strip.clientWidth * ratio));
      strip.width = width;
      strip.height = Math.round(22 * ratio);
      const context = strip.getContext('2d'), upper = maps.size > 1 ? Math.round(12 * ratio) : strip.height;
      for (let x = 0; x < width; ++x) {
        const first = Math.floor(x * count / width), end = Math.max(first + 1, Math.floor((x + 1) * count / width));
        // A loss of one frame is seen, too.
        let worst = first;
        for (let i = first; i < end; ++i) if (frames.map[i] < 0 || (frames.live_map[i] < 0 && frames.map[worst] >= 0)) worst = i;
        context.fillStyle = (STATES[stateOf(worst)] || STATES.lost).colour;
        context.fillRect(x, 0, 1, upper);
        if (maps.size < 2) continue;
        context.fillStyle = frames.map[first] >= 0 ? MAP_COLOURS[frames.map[first] % MAP_COLOURS.length] : '#fff';
        context.fillRect(x, upper + 2, 1, strip.height - upper - 2);
      }
    };
    const present = new Set();
    for (let i = 0; i < count; ++i) present.add(stateOf(i));
    for (const [name, state] of Object.entries(STATES)) {
      if (!present.has(name)) continue;
      const item = document.createElement('li'), colour = document.createElement('i');
      colour.style.background = state.colour;
      item.append(colour, state.word.toLowerCase() + ': ' + state.meaning);
      byId('strip-legend').append(item);
    }
    if (maps.size > 1) {
      for (const id of maps.keys()) {
        const item = document.createElement('li'), colour = document.createElement('i');
        colour.style.background = MAP_COLOURS[id % MAP_COLOURS.length];
        item.append(colour, 'map ' + id);
        byId('strip-legend').append(item);
      }
    }
    new ResizeObserver(drawStrip).observe(byId('strip'));

    // --- Time.
    let current = -1;
    const go = i => {
      current = Math.min(Math.max(i, 0), count - 1);
      byId('slider').value = current;
      if (frames.map[current] >= 0 && document.activeElement !== byId('map')) showMap(frames.map[current]);
      const state = stateOf(current), has_pose = frames.map[current] >= 0 && shown && frames.map[current] === shown.id;
      setState(state);
      byId('state-text').textContent = maps.size === 0 ? 'the run has no map: nothing was tracked' :
          frames.map[current] >= 0 ? 'map ' + frames.map[current] : (STATES[state] || {meaning: ''}).meaning;
      scene.setScope(has_pose ? frames.position.subarray(3 * current, 3 * current + 3) : null,
                     frames.orientation.subarray(4 * current, 4 * current + 4));
      goMarks(current);
      if (shown) {
        let low = 0, high = shown.ends.length;
        while (low < high) {
          const middle = (low + high) >> 1;
          if (shown.ends[middle] <= current) low = middle + 1; else high = middle;
        }
        travelled(low);
      }
      byId('clock').textContent = clock(frames.time_s[current]) + ' of ' + clock(frames.time_s[count - 1]) + ' min';
      const ms = frames.latency_ms[current], map = maps.get(frames.map[current]);
      setFacts([['frame', frames.index[current]], ['map', map ? map.id + (maps.size > 1 ? ', one of ' + maps.size : ', the only one') : 'none'],
                ['matched points', frames.inliers[current]],
                [run.mode === 'realtime' ? 'latency' : 'time spent', Number.isNaN(ms) ? 'not known' : ms.toFixed(1) + ' ms'],
                ['keyframes, points', map ? map.keyframes + ', ' + map.num_points : 'none']]);
      plot.at(frames.time_s[current]);
      let newest = null;
      for (const each of items) {
        each.item.classList.remove('current');
        if (each.at >= 0 && each.at <= current) newest = each;
      }
      if (newest) {
        newest.item.classList.add('current');
        const list = byId('events'), top = newest.item.offsetTop;
        if (top < list.scrollTop || top + newest.item.offsetHeight > list.scrollTop + list.clientHeight) {
          list.scrollTop = top - list.clientHeight / 2;
        }
      }
      document.body.dataset.frame = current;
    };
    byId('slider').max = count - 1;
    byId('slider').addEventListener('input', () => { stop(); go(Number(byId('slider').value)); });

    let timer = null;
    const stop = () => {
      cancelAnimationFrame(timer);
      timer = null;
      byId('play').textContent = 'Play';
    };
    byId('play').addEventListener('click', () => {
      if (timer !== null) return stop();
      if (current >= count - 1) go(0);
      byId('play').textContent = 'Pause';
      let before = performance.now(), time_s = frames.time_s[current];
      const step = now => {
        time_s += (now - before) / 1000;
        before = now;
        let i = current;
        while (i + 1 < count && frames.time_s[i + 1] <= time_s) ++i;
        if (i !== current) go(i);
        if (current >= count - 1) return stop();
        timer = requestAnimationFrame(step);
      };
      timer = requestAnimationFrame(step);
    });

    // The largest map first: a run may begin or end without one.
    let largest = null;
    for (const map of maps.values()) if (largest === null || map.path.length > largest.path.length) largest = map;
    if (largest) showMap(largest.id);
    let last = count - 1;
    while (last > 0 && largest && frames.map[last] !== largest.id) --last;
    go(largest ? last : 0);
    document.body.dataset.ready = 'run';
  };

  fetch('run.json').then(answer => answer.ok ? answer.json() : Promise.reject(new Error('the server answers ' + answer.status)))
      .then(show).catch(error => fail('The run cannot be shown: ' + error.message));
})();

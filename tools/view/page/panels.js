// What the page of a finished run and the live one have in common: words and colours of states, columns of numbers,
// events, the plot of latencies, and the switches of the scene.
'use strict';
window.haustra = window.haustra || {};
(() => {
  const byId = id => document.getElementById(id);

  // Told apart on white, also with a weakness for red and green; of maps the same as in the report.
  const MAP_COLOURS = ['#0072b2', '#d55e00', '#009e73', '#8c3fa8', '#b8860b', '#00a6c8', '#c2185b', '#556b2f',
                       '#5a4fcf', '#8b4513', '#2f4f4f', '#e0822f'];
  const STATES = {
    tracking: {word: 'Tracking', kind: 'tracking', colour: '#0072b2', meaning: 'pose known at the time'},
    placed: {word: 'Placed later', kind: 'placed', colour: '#9fd3f3', meaning: 'pose known since its map stands'},
    initialising: {word: 'Starting', kind: '', colour: '#c9d1da', meaning: 'a map is being started'},
    lost: {word: 'Lost', kind: 'lost', colour: '#d55e00', meaning: 'no pose'},
    dropped: {word: 'Skipped', kind: 'off', colour: '#3d4653', meaning: 'frame was too late or damaged'},
  };
  const EVENTS = {
    map_created: 'Map begun', map_dropped: 'Map given up', map_stored: 'Map set aside', map_evicted: 'Map made room',
    map_refused: 'Map refused', merged: 'Maps joined', loop_closed: 'Loop closed', lost: 'Tracking lost',
    relocalised: 'Found again', frame_found: 'Found again', recovered: 'Recovered by brute force',
    procedure_begun: 'Procedure begun', procedure_ended: 'Procedure ended',
  };

  const decode = (type, text) => {
    const bytes = Uint8Array.from(atob(text), c => c.charCodeAt(0));
    return new type(bytes.buffer);
  };

  const clock = seconds => {
    const tenths = Math.round(10 * seconds), minutes = Math.floor(tenths / 600), rest = (tenths - 600 * minutes) / 10;
    return minutes + ':' + (rest < 10 ? '0' : '') + rest.toFixed(1);
  };

  const setState = name => {
    const state = STATES[name] || {word: name, kind: ''};
    byId('state').textContent = state.word;
    byId('state').className = 'chip ' + state.kind;
    document.body.dataset.state = name;
  };

  // Rows of [name, value].
  const setFacts = rows => {
    byId('facts').replaceChildren(...rows.flatMap(([name, value]) => {
      const term = document.createElement('dt'), answer = document.createElement('dd');
      term.textContent = name;
      answer.textContent = value;
      return [term, answer];
    }));
  };

  // The unrolled wall with its legend. coverage: an entry of surface.json with its map, or null: no panel. url: of the
  // picture, or null. scope: where along it the scope is, share of its width, or undefined.
  let newest_wall = 0;
  const showWall = (coverage, url, scope) => {
    const own = ++newest_wall;
    byId('wall-panel').hidden = coverage === null;
    if (coverage === null) {
      byId('wall').width = byId('wall').width;  // what it showed is cleared
      return;
    }
    const has_lumen = coverage.lumen.found, percent = share => Math.round(100 * share) + ' %';
    const is_shown = has_lumen && url !== null;
    byId('wall').hidden = byId('wall-legend').hidden = !is_shown;
    byId('wall-title').textContent = 'The wall of map ' + coverage.map + (is_shown ? ', unrolled: length to the right, angle downwards' : '');
    byId('wall-text').textContent = has_lumen
        ? percent(coverage.wall_coverage) + ' seen well, ' + percent(coverage.seen_poorly) + ' poorly, ' +
          percent(1 - coverage.wall_coverage - coverage.seen_poorly) + ' never, along ' +
          coverage.lumen.passed_radii.toFixed(1) + ' radii of the lumen that the scope passed' +
          (coverage.depths < coverage.keyframes ? '; of ' + coverage.keyframes + ' keyframes ' + coverage.depths + ' have a depth' : '')
        : 'No lumen: ' + coverage.lumen.reason;
    if (coverage.refused_blocks > 0) byId('wall-text').textContent += '. The mesh is cut off: its volume is full';
    if (!is_shown) return;
    const image = new Image();
    image.onload = () => {
      if (own !== newest_wall) return;  // forgotten, or another one has come
      const canvas = byId('wall'), context = canvas.getContext('2d'), ratio = window.devicePixelRatio;
      canvas.width = Math.max(1, Math.round(canvas.clientWidth * ratio));
      canvas.height = Math.max(1, Math.round(canvas.clientHeight * ratio));
      context.imageSmoothingEnabled = false;
      context.drawImage(image, 0, 0, canvas.width, canvas.height);
      if (scope >= 0 && scope <= 1) {
        context.fillStyle = '#f0e442';
        context.fillRect(Math.round(scope * (canvas.width - 3 * ratio)), 0, 3 * ratio, canvas.height);
      }
      document.body.dataset.wall = coverage.wall_coverage.toFixed(4);
    };
    image.src = url;
  };

  // event: {time (text), event, map, other_map, details}; onChosen: none, or what a click does.
  const eventItem = (event, onChosen) => {
    const item = document.createElement('li'), row = document.createElement(onChosen ? 'button' : 'div');
    const time = document.createElement('time'), text = document.createElement('span'), more = document.createElement('small');
    time.textContent = event.time;
    text.textContent = EVENTS[event.event] || event.event.replaceAll('_', ' ');
    const maps = event.other_map >= 0 ? 'maps ' + event.map + ' and ' + event.other_map : event.map >= 0 ? 'map ' + event.map : '';
    // Counts of the checks are for who looks closer.
    const words = event.details.split(' ').filter(word => !word.includes('=')).join(' ').replaceAll('_', ' ');
    more.textContent = [maps, words].filter(part => part).join(' · ');
    item.title = event.details;
    text.append(more);
    row.append(time, text);
    if (onChosen) row.addEventListener('click', onChosen);
    item.append(row);
    return item;
  };

  // A line of latencies over seconds; `limit_ms` is dashed, null: none. Returns {chart, show(points), at(seconds)}.
  const latencyPlot = (limit_ms, span_s) => {
    let cursor_s = null;
    Chart.defaults.font.family = getComputedStyle(document.body).fontFamily;
    Chart.defaults.font.size = 12;
    Chart.defaults.color = '#17202b';
    const chart = new Chart(byId('latency'), {
      type: 'line',
      data: {datasets: [{data: [], borderColor: '#0072b2', borderWidth: 1.2, pointRadius: 0, pointHitRadius: 0, spanGaps: false}]},
      options: {
        animation: false, responsive: true, maintainAspectRatio: false, parsing: false, normalized: true, events: [],
        scales: {
          x: {type: 'linear', min: span_s[0], max: span_s[1], grid: {color: '#e8ecf0'}, title: {display: true, text: 'time (s)'},
              ticks: {maxRotation: 0, maxTicksLimit: 7, includeBounds: false}},
          y: {min: 0, suggestedMax: limit_ms ? 1.15 * limit_ms : 10, grid: {color: '#e8ecf0'}, title: {display: true, text: 'ms'},
              ticks: {maxTicksLimit: 6}},
        },
        plugins: {legend: {display: false}, tooltip: {enabled: false}},
      },
      plugins: [{
        id: 'lines',
        afterDatasetsDraw({ctx, chartArea, scales}) {
          ctx.save();
          ctx.lineWidth = 1.5;
          if (limit_ms && limit_ms <= scales.y.max) {
            const y = scales.y.getPixelForValue(limit_ms);
            ctx.strokeStyle = ctx.fillStyle = '#b34700';
            ctx.setLineDash([6, 4]);
            ctx.beginPath();
            ctx.moveTo(chartArea.left, y);
            ctx.lineTo(chartArea.right, y);
            ctx.stroke();
            ctx.fillText('one frame, ' + limit_ms.toFixed(0) + ' ms', chartArea.left + 4, y - 4);
          }
          if (cursor_s !== null) {
            const x = scales.x.getPixelForValue(cursor_s);
            ctx.strokeStyle = '#17202b';
            ctx.setLineDash([]);
            ctx.beginPath();
            ctx.moveTo(x, chartArea.top);
            ctx.lineTo(x, chartArea.bottom);
            ctx.stroke();
          }
          ctx.restore();
        },
      }],
    });
    return {
      show(points, from_s, to_s) {
        chart.data.datasets[0].data = points;
        if (from_s !== undefined) [chart.options.scales.x.min, chart.options.scales.x.max] = [from_s, to_s];
        chart.update('none');
      },
      at(seconds) {
        cursor_s = seconds;
        chart.draw();
      },
    };
  };

  // The longest bar of 1, 2 or 5 units in a power of ten that is not wider than 160 px.
  const showScaleAndLegend = scene => {
    byId('scale').hidden = scene.is_inside;
    // Neither path nor scope is drawn inside; what has no wall has no gaps.
    byId('space').dataset.eye = scene.is_inside ? 'inside' : 'outside';
    byId('space').dataset.wall = scene.hasWall() ? 'drawn' : 'none';
    const largest = 160 / scene.px_per_unit, decade = Math.pow(10, Math.floor(Math.log10(largest)));
    const units = [5, 2, 1].map(k => k * decade).find(length => length <= largest) || decade;
    byId('scale-bar').style.width = units * scene.px_per_unit + 'px';
    byId('scale-text').textContent = Number(units.toPrecision(1)) + ' map units (not mm)';
  };

  // The switches above the scene. `frame` shows the whole map.
  const connectSwitches = (scene, frame) => {
    if (scene.works) scene.onDrawn = showScaleAndLegend;
    for (const box of document.querySelectorAll('input[data-layer]')) {
      box.addEventListener('change', () => scene.setLayer(box.dataset.layer, box.checked));
    }
    haustra.addLooks(scene, byId('looks'), ['outside', 'cut', 'along', 'scope']);
    byId('whole').addEventListener('click', () => {
      // Also where the look only waits for a pose, or for a wall.
      if (scene.look === 'along' || scene.look === 'scope') scene.setLook('cut');
      frame();
    });
  };

  Object.assign(haustra, {byId, MAP_COLOURS, STATES, decode, clock, setState, setFacts, eventItem, latencyPlot, showWall, connectSwitches});
})();

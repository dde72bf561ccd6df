// Draws the plots of a page from the script element "chart-data" (tools/report/chart_data.h) with Chart.js 3.
'use strict';
(() => {
  const data = JSON.parse(document.getElementById('chart-data').textContent);

  // Told apart on white, also with a weakness for red and green; maps beyond the last begin again.
  const MAP_COLOURS = ['#0072b2', '#d55e00', '#009e73', '#8c3fa8', '#b8860b', '#00a6c8', '#c2185b', '#556b2f',
                       '#5a4fcf', '#8b4513', '#2f4f4f', '#e0822f'];
  const GREY = '#c8c8c8', LIGHT_GREY = '#e6e6e6', INK = '#111', GRID = '#e2e2e2', RED = '#d00000';
  const STATES = {'-1': ['no pose', GREY], '-2': ['initialising', LIGHT_GREY], '-3': ['dropped', '#888'],
                  '-4': ['scene hidden', '#444']};
  const colourOf = map => MAP_COLOURS[map % MAP_COLOURS.length];
  const MARKS = {
    merge: {label: 'merge', pointStyle: 'triangle', colour: '#006400', radius: 7},
    loop: {label: 'loop closed', pointStyle: 'circle', colour: '#4b0082', radius: 6},
    relocalisation: {label: 'relocalisation', pointStyle: 'rectRot', colour: '#0050c8', radius: 6},
    recovery: {label: 'recovery by brute force', pointStyle: 'rect', colour: '#8b6914', radius: 4},
    loss: {label: 'loss', pointStyle: 'crossRot', colour: INK, radius: 5},
  };
  const Y_AXIS_WIDTH = 96;  // the same for all plots over time, so that they can be compared by eye

  Chart.defaults.font.family = '"DejaVu Sans", Arial, Helvetica, sans-serif';
  Chart.defaults.font.size = 12;
  Chart.defaults.color = INK;
  Chart.defaults.animation = false;
  Chart.defaults.responsive = true;
  Chart.defaults.maintainAspectRatio = false;
  Chart.defaults.plugins.legend.labels.usePointStyle = true;
  Chart.defaults.plugins.legend.labels.boxHeight = 8;

  const chart = (id, config) => new Chart(document.getElementById(id), config);
  const title = text => ({display: true, text});
  const number = (value, digits) => Number(value).toFixed(digits);

  // Seconds, and minutes with seconds in long videos.
  const clock = seconds => {
    const rounded = Math.round(seconds * 10) / 10;
    if (data.duration_s < 180) return String(rounded);
    const minutes = Math.floor(rounded / 60), rest = Math.round(rounded - 60 * minutes);
    return minutes + ':' + String(rest).padStart(2, '0');
  };
  const timeAxis = () => ({
    type: 'linear', min: 0, max: data.duration_s, grid: {color: GRID},
    title: title(data.duration_s < 180 ? 'time (s)' : 'time (min:s)'),
    ticks: {includeBounds: false, maxRotation: 0, callback: clock},
  });
  const fixedWidth = scale => { scale.width = Y_AXIS_WIDTH; };

  // A dashed line at `value` of the axis.
  const lineAt = (axis, value, label) => ({
    id: 'line-at',
    afterDatasetsDraw(chart) {
      const scale = chart.scales[axis], area = chart.chartArea, context = chart.ctx;
      if (value === null || value < scale.min || value > scale.max) return;
      const at = scale.getPixelForValue(value), is_x = axis === 'x';
      context.save();
      context.strokeStyle = RED;
      context.setLineDash([6, 4]);
      context.beginPath();
      context.moveTo(is_x ? at : area.left, is_x ? area.top : at);
      context.lineTo(is_x ? at : area.right, is_x ? area.bottom : at);
      context.stroke();
      context.font = '11px ' + Chart.defaults.font.family;
      const x = is_x ? at + 4 : area.left + 6, y = is_x ? area.bottom - 6 : at - 5;
      context.fillStyle = 'rgba(255, 255, 255, 0.85)';
      context.fillRect(x - 2, y - 10, context.measureText(label).width + 4, 13);
      context.fillStyle = RED;
      context.fillText(label, x, y);
      context.restore();
    },
  });

  // --- Coverage.

  const drawCoverage = () => {
    const rows = data.coverage.map(row => row.name);
    const datasets = new Map();  // by map or state
    for (const row of data.coverage) {
      for (const [begin, end, value] of row.segments) {
        if (row.name === 'scene hidden' && value !== -4) continue;
        if (!datasets.has(value)) {
          const [label, colour] = value >= 0 ? ['map ' + value, colourOf(value)] : STATES[value];
          datasets.set(value, {type: 'bar', label, backgroundColor: colour, data: [], grouped: false, order: 2,
                               barThickness: 24, borderWidth: 0, minBarLength: 1, pointStyle: 'rect'});
        }
        datasets.get(value).data.push({x: [begin, end], y: row.name});
      }
    }
    const bars = [...datasets.entries()].sort(([a], [b]) => (a < 0) - (b < 0) || (a < 0 ? b - a : a - b));
    const marks = [];
    for (const [kind, style] of Object.entries(MARKS)) {
      const own = data.marks.filter(mark => mark.kind === kind);
      if (own.length === 0) continue;
      const colours = own.map(mark => mark.verdict === 'false' ? RED : style.colour);
      marks.push({type: 'scatter', label: style.label, pointStyle: style.pointStyle, radius: style.radius, order: 1,
                  hitRadius: 6, pointBackgroundColor: colours, pointBorderColor: colours, borderWidth: 2,
                  backgroundColor: style.colour, borderColor: style.colour,
                  data: own.map(mark => ({x: mark.t, y: 'events', mark}))});
    }
    chart('coverage', {
      type: 'bar',
      data: {labels: ['events', ...rows], datasets: [...bars.map(([, dataset]) => dataset), ...marks]},
      options: {
        indexAxis: 'y',
        interaction: {mode: 'nearest', intersect: true},
        scales: {x: timeAxis(), y: {type: 'category', afterFit: fixedWidth, grid: {display: false}}},
        plugins: {
          legend: {position: 'bottom'},
          tooltip: {callbacks: {
            title: () => '',
            label(item) {
              const mark = item.raw.mark;
              if (mark) {
                return MARKS[mark.kind].label + ', frame ' + mark.frame + ', ' + clock(mark.t) + ': ' + mark.text +
                       (mark.verdict ? ' (' + mark.verdict + ')' : '');
              }
              return item.dataset.label + ': ' + number(item.raw.x[0], 2) + ' to ' + number(item.raw.x[1], 2) + ' s';
            },
          }},
        },
      },
      plugins: [{
        // Thin lines from the marks down through the bars.
        id: 'mark-lines',
        beforeDatasetsDraw(chart) {
          const {ctx, chartArea, scales} = chart;
          ctx.save();
          ctx.strokeStyle = '#999';
          ctx.setLineDash([2, 3]);
          for (const mark of data.marks) {
            if (mark.kind === 'loss' || mark.kind === 'recovery') continue;
            const x = scales.x.getPixelForValue(mark.t);
            ctx.beginPath();
            ctx.moveTo(x, chartArea.top);
            ctx.lineTo(x, chartArea.bottom);
            ctx.stroke();
          }
          ctx.restore();
        },
      }],
    });
  };

  // --- Views.

  const viewConfig = (view, vertical, label) => {
    const lines = [];
    if (view.truth.length > 0) {
      lines.push({type: 'line', label: 'ground truth', borderColor: INK, backgroundColor: INK, borderWidth: 1,
                  pointRadius: 0, pointHitRadius: 0, pointStyle: 'line', order: 1,
                  data: view.truth.map(p => ({x: p[0], y: p[vertical]}))});
    }
    for (const map of view.maps) {
      const colour = colourOf(map.map);
      const path = [];
      map.lines.forEach((line, i) => {
        if (i > 0) path.push({x: NaN, y: NaN});
        for (const p of line) path.push({x: p[0], y: p[vertical]});
      });
      lines.push({type: 'line', label: 'map ' + map.map, borderColor: colour, backgroundColor: colour, borderWidth: 2.5,
                  pointRadius: 0, pointHitRadius: 0, spanGaps: false, pointStyle: 'line', order: 2, data: path});
      lines.push({type: 'scatter', label: 'points of map ' + map.map, pointRadius: 0.9, pointHitRadius: 0,
                  pointBackgroundColor: colour + '55', pointBorderWidth: 0, backgroundColor: colour + '55', order: 3,
                  borderWidth: 0, data: map.points.map(p => ({x: p[0], y: p[vertical]}))});
    }
    const axis = text => ({type: 'linear', grid: {color: GRID}, title: title(text + ' (' + view.unit + ')'),
                           ticks: {includeBounds: false, maxRotation: 0}});
    return {
      type: 'scatter',
      data: {datasets: lines},
      options: {
        scales: {x: axis('along 1st axis'), y: axis('along ' + (vertical === 1 ? '2nd' : '3rd') + ' axis')},
        plugins: {legend: {position: 'bottom', labels: {filter: item => !item.text.startsWith('points of')}},
                  title: title(label), tooltip: {enabled: false}},
      },
    };
  };

  // Extent of paths and nearly all points along one axis: a few points far off must not shrink the rest.
  const extentOf = (view, axis) => {
    const paths = view.truth.map(p => p[axis]), points = [];
    for (const map of view.maps) {
      for (const line of map.lines) for (const p of line) paths.push(p[axis]);
      for (const p of map.points) points.push(p[axis]);
    }
    points.sort((a, b) => a - b);
    let low = Infinity, high = -Infinity;
    for (const v of paths) { low = Math.min(low, v); high = Math.max(high, v); }
    if (points.length > 0) {
      low = Math.min(low, points[Math.floor(0.01 * (points.length - 1))]);
      high = Math.max(high, points[Math.ceil(0.99 * (points.length - 1))]);
    }
    if (!(high > low)) { low -= 1; high += 1; }
    return [low, high];
  };

  // One unit is as long in both directions and in both views.
  const makeEqual = (charts, extents) => {
    const size = range => range[1] - range[0];
    let unitsPerPx = 0;
    charts.forEach((view, i) => {
      const area = view.chartArea;
      unitsPerPx = Math.max(unitsPerPx, size(extents[0]) / (area.right - area.left),
                            size(extents[i + 1]) / (area.bottom - area.top));
    });
    unitsPerPx *= 1.08;
    const centred = (scale, range, px) => {
      const middle = (range[0] + range[1]) / 2;
      scale.min = middle - unitsPerPx * px / 2;
      scale.max = middle + unitsPerPx * px / 2;
    };
    charts.forEach((view, i) => {
      const area = view.chartArea;
      centred(view.options.scales.x, extents[0], area.right - area.left);
      centred(view.options.scales.y, extents[i + 1], area.bottom - area.top);
      view.update();
    });
  };

  // The line along the middle of the lumen of a map, where it is known, turned likewise.
  const lineOf = (id, turn) => {
    const maps = JSON.parse(document.getElementById('surface-maps').textContent);
    const line = new Float32Array(((maps.find(map => map.map_id === id) || {}).lumen || {}).line || []);
    new THREE.Matrix4().set(...turn, 0, 0, 0, 1).applyToBufferAttribute(new THREE.BufferAttribute(line, 3));
    return line;
  };

  // The surface of a map, where the page holds one; `turn` are three rows of a matrix.
  const meshOf = (id, turn) => {
    const ply = document.getElementById('mesh-' + id);
    if (!ply) return null;
    const geometry = new THREE.PLYLoader().parse(Uint8Array.from(atob(ply.textContent), c => c.charCodeAt(0)).buffer);
    if (geometry.getAttribute('position').count === 0) return null;
    geometry.applyMatrix(new THREE.Matrix4().set(...turn, 0, 0, 0, 1));
    return geometry;
  };

  const drawScene = (place, view) => {
    const scene = new haustra.Scene3D(place);
    if (!scene.works) return;
    // The wheel scrolls the page until somebody has taken hold of the scene.
    scene.controls.enableZoom = false;
    place.addEventListener('mousedown', () => { scene.controls.enableZoom = true; });
    place.addEventListener('mouseleave', () => { scene.controls.enableZoom = false; });
    const segmentsOf = line => line.flatMap((p, i) => i > 0 ? [...line[i - 1], ...p] : []);
    const points = view.maps.flatMap(map => map.points.flat());
    const path = view.maps.flatMap(map => map.lines.flat(2));
    scene.frame(path, points);
    for (const map of view.maps) {
      const colour = Number('0x' + colourOf(map.map).slice(1));
      const mesh = meshOf(map.map, map.shown_from_map);
      // Points of a wall that is drawn are noise in front of it.
      if (mesh) scene.addSurface(mesh, lineOf(map.map, map.shown_from_map));
      else scene.addPoints(new Float32Array(map.points.flat()), Uint8Array.from(atob(map.rgb), c => c.charCodeAt(0)), colour);
      scene.addLine(map.lines.flatMap(segmentsOf), colour, 3);
    }
    scene.addLine(segmentsOf(view.truth), haustra.SCENE_COLOURS.truth, 1);
    scene.setPins(view.maps.flatMap(map => map.pins));
    if (!scene.hasWall()) return;
    const bar = document.createElement('div');
    bar.className = 'looks';
    place.append(bar);
    haustra.addLooks(scene, bar, ['outside', 'cut', 'along']);
  };

  const drawViews = () => {
    const place = document.getElementById('views');
    if (data.views.length === 0) place.textContent = 'No map has a frame at the end.';
    data.views.forEach((view, index) => {
      const heading = document.createElement('h3');
      heading.textContent = view.title;
      const pair = document.createElement('div');
      pair.className = 'two';
      const space = document.createElement('div');
      space.className = 'scene';
      place.append(heading, space, pair);
      drawScene(space, view);
      const charts = [[1, 'top view'], [2, 'side view']].map(([vertical, label]) => {
        const plot = document.createElement('div'), canvas = document.createElement('canvas');
        plot.className = 'plot';
        plot.style.height = '460px';
        canvas.id = 'view-' + index + '-' + vertical;
        plot.append(canvas);
        pair.append(plot);
        return new Chart(canvas, viewConfig(view, vertical, label));
      });
      makeEqual(charts, [extentOf(view, 0), extentOf(view, 1), extentOf(view, 2)]);
    });
  };

  const drawErrors = () => {
    if (document.getElementById('errors') === null) return;
    chart('errors', {
      type: 'scatter',
      data: {datasets: data.errors.map(map => ({
        label: 'map ' + map.map, backgroundColor: colourOf(map.map), borderColor: colourOf(map.map), pointRadius: 1.5,
        pointBorderWidth: 0, data: map.samples.map(([x, y]) => ({x, y})),
      }))},
      options: {
        scales: {x: timeAxis(), y: {min: 0, grace: '6%', afterFit: fixedWidth, grid: {color: GRID},
                                    title: title('error (' + data.unit + ')')}},
        plugins: {legend: {position: 'bottom'},
                  tooltip: {callbacks: {label: item => item.dataset.label + ', ' + clock(item.raw.x) + ': ' +
                                                       number(item.raw.y, 3) + ' ' + data.unit}}},
      },
    });
  };

  // --- Times.

  const STAGE_COLOURS = {frame: '#000000', tracking: '#0072b2', mapping: '#d55e00', place: '#009e73',
                         merging: '#8c3fa8', relocalisation: '#b8860b'};
  const stageColour = stage => STAGE_COLOURS[stage.split('/')[0]] || '#666';
  const totals = data.times.filter(time => time.stage.endsWith('/total'));

  // Stages that had nothing to do took microseconds: they would stretch a logarithmic axis over decades that say nothing.
  const drawn = ms => Math.max(ms, 0.1);

  const drawTimesOverTime = (id, stages, deadline_ms) => {
    if (document.getElementById(id) === null) return;
    chart(id, {
      type: 'scatter',
      data: {datasets: stages.map(time => ({
        label: time.stage, backgroundColor: stageColour(time.stage), borderColor: stageColour(time.stage),
        pointRadius: time.stage === 'merging/total' ? 5 : 1.6, pointBorderWidth: 0,
        pointStyle: time.stage === 'merging/total' ? 'triangle' : 'circle',
        data: time.samples.map(([x, y]) => ({x, y: drawn(y)})),
      }))},
      options: {
        scales: {x: timeAxis(), y: {type: 'logarithmic', afterFit: fixedWidth, grid: {color: GRID}, title: title('time (ms)'),
                                    ticks: {callback: logTick, autoSkip: false}}},
        plugins: {legend: {position: 'bottom'},
                  tooltip: {callbacks: {label: item => item.dataset.label + ' at ' + clock(item.raw.x) + ': ' +
                                                       number(item.raw.y, 1) + ' ms'}}},
      },
      plugins: [lineAt('y', deadline_ms, 'deadline ' + deadline_ms + ' ms')],
    });
  };

  // 1, 2, 5 of each decade, over many decades 1 only; the others would overlap.
  function logTick(value) {
    const digit = value / Math.pow(10, Math.floor(Math.log10(value) + 1e-9));
    const labelled = this.max > 1000 * this.min ? [1] : [1, 2, 5];
    return labelled.some(d => Math.abs(d - digit) < 1e-6) ? String(Number(value.toPrecision(3))) : '';
  }

  const logTimeAxis = () => ({type: 'logarithmic', grid: {color: GRID}, title: title('time (ms)'),
                              ticks: {callback: logTick, autoSkip: false, maxRotation: 0}});

  const drawShares = () => {
    if (document.getElementById('time-shares') === null) return;
    chart('time-shares', {
      type: 'scatter',
      data: {datasets: totals.map(time => {
        const sorted = time.samples.map(sample => sample[1]).sort((a, b) => a - b);
        // At most 400 steps, the slowest ones all.
        const step = Math.max(1, Math.floor(sorted.length / 400));
        const points = [];
        for (let i = 0; i < sorted.length; i += i + 50 < sorted.length ? step : 1) {
          points.push({x: drawn(sorted[i]), y: 100 * (i + 1) / sorted.length});
        }
        return {type: 'line', label: time.stage, borderColor: stageColour(time.stage),
                backgroundColor: stageColour(time.stage), borderWidth: 1.8, pointRadius: 0, stepped: 'before',
                pointStyle: 'line', data: points};
      })},
      options: {
        scales: {x: logTimeAxis(),
                 y: {min: 0, max: 100, grid: {color: GRID}, title: title('done within that time (%)')}},
        plugins: {legend: {position: 'bottom'}, title: title('share of the runs of a stage'),
                  tooltip: {enabled: false}},
      },
      plugins: [lineAt('x', data.deadline_ms, 'deadline')],
    });
  };

  const drawRanges = () => {
    if (document.getElementById('stage-ranges') === null) return;
    const names = data.times.map(time => time.stage);
    chart('stage-ranges', {
      type: 'bar',
      data: {labels: names, datasets: [
        {type: 'scatter', label: 'maximum', pointStyle: 'crossRot', radius: 4, borderColor: INK, borderWidth: 1.5, order: 1,
         data: data.times.map(time => ({x: time.max, y: time.stage}))},
        {type: 'bar', label: 'median to 99th percentile', grouped: false, barThickness: 12, order: 2, pointStyle: 'rect',
         backgroundColor: data.times.map(time => stageColour(time.stage) + 'aa'),
         data: data.times.map(time => ({x: [time.p50, Math.max(time.p99, time.p50 * 1.01)], y: time.stage}))},
      ]},
      options: {
        indexAxis: 'y',
        scales: {x: logTimeAxis(),
                 y: {type: 'category', grid: {display: false}, ticks: {autoSkip: false}}},
        plugins: {legend: {position: 'bottom'}, title: title('median, 99th percentile and maximum'),
                  tooltip: {callbacks: {title: () => '', label(item) {
                    const time = data.times.find(t => t.stage === item.raw.y);
                    return time.stage + ': p50 ' + number(time.p50, 1) + ', p99 ' + number(time.p99, 1) + ', max ' +
                           number(time.max, 1) + ' ms';
                  }}}},
      },
      plugins: [lineAt('x', data.deadline_ms, 'deadline')],
    });
  };

  // --- Rejected candidates.

  const filterRejections = () => {
    const choice = document.getElementById('reason-filter');
    if (choice === null) return;
    const rows = document.querySelectorAll('#rejections tbody tr');
    const show = () => {
      let shown = 0;
      for (const row of rows) {
        const is_shown = choice.value === '' || row.children[1].textContent === choice.value;
        row.hidden = !is_shown;
        shown += is_shown ? 1 : 0;
      }
      document.getElementById('reason-count').textContent = shown + ' of ' + rows.length;
    };
    choice.addEventListener('change', show);
    show();
  };

  drawCoverage();
  drawViews();
  drawErrors();
  drawTimesOverTime('frame-times', totals.filter(time => /^(frame|tracking)\//.test(time.stage)), data.deadline_ms);
  drawTimesOverTime('mapping-times', totals.filter(time => !/^(frame|tracking)\//.test(time.stage)), null);
  drawShares();
  drawRanges();
  filterRejections();
})();

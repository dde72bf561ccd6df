// Marks of a doctor on the page, of a run and of a running engine: their list, and rings in the picture. Labels are a
// user's text.
'use strict';
window.haustra = window.haustra || {};
(() => {
  const {byId} = haustra;
  const RING_PX = 11;

  const cell = (tag, text) => {
    const element = document.createElement(tag);
    element.textContent = text;
    return element;
  };

  // rows: {label, map, state (a word), distance (in depths of the scene, null: not known)}. Without any there is no list.
  const showMarks = rows => {
    byId('marks-panel').hidden = rows.length === 0;
    byId('pins-choice').hidden = rows.length === 0;
    byId('marks').replaceChildren(...rows.map(mark => {
      const row = document.createElement('tr');
      row.dataset.state = mark.state;
      row.append(cell('th', mark.label), cell('td', mark.map), cell('td', mark.state.replaceAll('_', ' ')),
                 cell('td', mark.distance === null ? '' : mark.distance.toFixed(1)));
      row.firstChild.title = mark.label;
      return row;
    }));
    document.body.dataset.marks = rows.length;
  };

  // Around the place of each mark {label, state, x, y}; what may be hidden is fainter and dashed. `scale`: pixels of the
  // canvas for one of the picture.
  const drawRings = (context, scale, marks) => {
    context.save();
    context.font = 'bold 22px "DejaVu Sans", Arial, sans-serif';
    context.textBaseline = 'middle';
    context.lineJoin = 'round';
    for (const mark of marks) {
      const x = scale * (mark.x + 0.5), y = scale * (mark.y + 0.5), is_sure = mark.state === 'in_front';
      context.globalAlpha = is_sure ? 1 : 0.6;
      context.setLineDash(is_sure ? [] : [6, 5]);
      for (const [width, colour] of [[7, '#10151c'], [3.5, haustra.PIN_COLOUR]]) {
        context.lineWidth = width;
        context.strokeStyle = colour;
        context.beginPath();
        context.arc(x, y, RING_PX * scale / 2 + 4, 0, 2 * Math.PI);
        context.stroke();
      }
      // On the side that has room.
      const gap = RING_PX * scale / 2 + 12, is_left = x + gap + context.measureText(mark.label).width > context.canvas.width;
      context.textAlign = is_left ? 'right' : 'left';
      context.setLineDash([]);
      context.lineWidth = 5;
      context.strokeStyle = '#10151c';
      context.strokeText(mark.label, is_left ? x - gap : x + gap, y);
      context.fillStyle = haustra.PIN_COLOUR;
      context.fillText(mark.label, is_left ? x - gap : x + gap, y);
    }
    context.restore();
  };

  Object.assign(haustra, {showMarks, drawRings});
})();

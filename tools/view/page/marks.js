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

  const newRow = label => {
    const row = document.createElement('tr'), name = cell('th', label);
    name.title = row.dataset.label = label;
    row.append(name, cell('td', ''), cell('td', ''), cell('td', ''));
    if (haustra.removeButton) {
      row.append(cell('td', ''));
      row.lastChild.append(haustra.removeButton(label));
    }
    return row;
  };

  // rows: {label, map, state (a word), distance (in depths of the scene, null: not known)}. Without any there is no list.
  // A row stays while its mark does: it may have a button that somebody is about to press.
  const showMarks = rows => {
    byId('marks-panel').hidden = rows.length === 0;
    byId('pins-choice').hidden = rows.length === 0;
    const place = byId('marks');
    if (rows.length !== place.rows.length || rows.some((mark, i) => mark.label !== place.rows[i].dataset.label)) {
      place.replaceChildren(...rows.map(mark => newRow(mark.label)));
    }
    rows.forEach((mark, i) => {
      const cells = place.rows[i].cells;
      place.rows[i].dataset.state = mark.state;
      cells[1].textContent = mark.map;
      cells[2].textContent = mark.state.replaceAll('_', ' ');
      cells[3].textContent = mark.distance === null ? '' : mark.distance.toFixed(1);
    });
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

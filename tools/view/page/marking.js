// Marks are set and removed on the page of a running engine, where the program allows it (haustra view --marking). The
// picture stands still while a place is pointed at: the wall in it would move on.
'use strict';
window.haustra = window.haustra || {};
(() => {
  const {byId} = haustra;
  // So long a removal waits for its second click.
  const MAX_DOUBT_MS = 5000;
  let shown = null;  // the picture on the canvas: frame, procedure, step, width, height
  let is_aiming = false;
  let labels = new Set();
  let listed = null;  // the procedure whose marks these are

  const say = (text, is_error = false) => {
    byId('marking-answer').textContent = text;
    byId('marking-answer').classList.toggle('error', is_error);
  };

  // One request of platform/control/control_protocol.h. Says how it went; true: it was done.
  const ask = async request => {
    try {
      const answer = await fetch('do?request=' + encodeURIComponent(request), {method: 'POST'});
      say((await answer.text()).trim(), !answer.ok);
      return answer.ok;
    } catch (error) {
      say('haustra view does not answer', true);
      return false;
    }
  };

  // The first of mark-1, mark-2 and so on that no mark has.
  const freeLabel = () => {
    let number = 1;
    while (labels.has('mark-' + number)) ++number;
    return 'mark-' + number;
  };

  const aim = is_on => {
    is_aiming = is_on;
    byId('marking-begin').hidden = is_on;
    byId('marking-cancel').hidden = !is_on;
    byId('picture').classList.toggle('aiming', is_on);
    say(is_on ? 'Click the place in the picture, which stands still meanwhile.' : '');
  };

  const setMark = async event => {
    if (!is_aiming) return;
    const {frame, procedure, step, width, height} = shown, box = byId('picture').getBoundingClientRect();
    // Centres of pixels are whole numbers.
    const inFrame = (offset, length, pixels) => (Math.max(0, offset / length * pixels - 0.5) * step).toFixed(1);
    const x = inFrame(event.clientX - box.left, box.width, width), y = inFrame(event.clientY - box.top, box.height, height);
    const label = byId('marking-label').value.trim() || freeLabel();
    aim(false);
    if (await ask(`mark ${x} ${y} ${label} ${frame} ${procedure}`)) byId('marking-label').value = '';
  };

  // Removes a mark with the second click of two: one could be a slip.
  const removeButton = label => {
    const button = document.createElement('button');
    let doubt = null;
    const name = (text, spoken) => {
      button.textContent = text;
      button.setAttribute('aria-label', spoken + ' ' + label);
    };
    const settle = () => {
      clearTimeout(doubt);
      doubt = null;
      name('×', 'Remove');
    };
    settle();
    button.type = 'button';
    button.className = 'remove';
    button.addEventListener('click', () => {
      if (doubt !== null) {
        settle();
        ask(`unmark ${label} ${listed}`);
        return;
      }
      name('remove?', 'Really remove');
      doubt = setTimeout(settle, MAX_DOUBT_MS);
    });
    return button;
  };

  haustra.marking = {
    isAiming: () => is_aiming,
    onPicture: picture => { shown = picture; },
    onMarks: (marks, procedure) => {
      labels = new Set(marks.map(mark => mark.label));
      listed = procedure;
    },
    // The procedure has ended: nothing of it may be pointed at.
    forget: () => {
      shown = null;
      labels = new Set();
      byId('marking-label').value = '';
      aim(false);
    },
  };

  if (document.body.dataset.marking !== 'on') return;
  haustra.removeButton = removeButton;
  byId('marking').hidden = false;
  byId('marks').parentElement.tHead.rows[0].append(document.createElement('td'));
  byId('marking-begin').addEventListener('click', () => aim(shown !== null));
  byId('marking-cancel').addEventListener('click', () => aim(false));
  byId('picture').addEventListener('click', setMark);
  document.addEventListener('keydown', event => {
    if (event.key === 'Escape' && is_aiming) aim(false);
  });
})();

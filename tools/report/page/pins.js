// Places with a label, in front of a scene in 3D (scene_3d.js). A pin is text of the page and no part of the picture:
// it stays as large, and its label is never taken for HTML.
'use strict';
window.haustra = window.haustra || {};
(() => {
  // On dark ground and on red tissue, told apart from path, scope and losses.
  const COLOUR = '#5ef2c2';
  const STEM_PX = 16, ROW_PX = 20, MAX_ROWS = 8, EDGE_PX = 2;

  const styled = (tag, style) => {
    const element = document.createElement(tag);
    Object.assign(element.style, {position: 'absolute', left: '0', top: '0', ...style});
    return element;
  };

  class Pins {
    // In front of what `place` holds, which has a size; the mouse reaches what is behind.
    constructor(place) {
      this.layer = styled('div', {right: '0', bottom: '0', overflow: 'hidden', pointerEvents: 'none'});
      this.pins = [];
      place.append(this.layer);
    }

    // pins: {label, position}, and `state` where it is known how the scope sees it: in_front, hidden, unsure, out_of_view.
    set(pins) {
      this.pins = pins.map(pin => {
        const dot = styled('i', {width: '9px', height: '9px', margin: '-5px 0 0 -5px', boxSizing: 'border-box',
                                 borderRadius: '50%', background: COLOUR, border: '1px solid #10151c'});
        const stem = styled('i', {width: '1px', background: COLOUR});
        const label = styled('span', {maxWidth: '240px', padding: '0 5px', boxSizing: 'border-box', overflow: 'hidden',
                                      textOverflow: 'ellipsis', whiteSpace: 'nowrap',
                                      font: '12px/17px "DejaVu Sans", Arial, sans-serif', color: '#fff',
                                      background: 'rgba(16, 21, 28, 0.82)', border: '1px solid ' + COLOUR, borderRadius: '4px'});
        label.textContent = pin.label;
        const element = styled('div', {});
        element.className = 'pin';
        element.append(stem, dot, label);
        return {...pin, at: new THREE.Vector3(...pin.position), element, stem, label};
      });
      this.layer.replaceChildren(...this.pins.map(pin => pin.element));
    }

    // Through the scope only what it sees is shown, fainter where that is not sure; from outside all are. A label that
    // would cover another stands higher.
    draw(camera, root, is_shown, is_through) {
      this.layer.style.visibility = is_shown ? 'visible' : 'hidden';
      if (!is_shown) return;
      const width = this.layer.clientWidth, height = this.layer.clientHeight, taken = [];
      const placed = this.pins.map(pin => {
        return {pin, p: pin.at.clone().applyMatrix4(root.matrixWorld).project(camera), w: pin.label.offsetWidth};
      });
      for (const {pin, p, w} of placed.sort((a, b) => a.p.x - b.p.x)) {
        const is_seen = !is_through || pin.state === 'in_front' || pin.state === 'unsure';
        const is_inside = Math.abs(p.x) <= 1 && Math.abs(p.y) <= 1 && Math.abs(p.z) <= 1;
        pin.element.style.visibility = is_seen && is_inside ? 'inherit' : 'hidden';
        if (!is_seen || !is_inside) continue;
        const x = (p.x + 1) / 2 * width, y = (1 - p.y) / 2 * height;
        const left = Math.min(Math.max(x - w / 2, EDGE_PX), width - w - EDGE_PX);
        let top = y - STEM_PX - ROW_PX, row = 0;
        for (; row < MAX_ROWS; ++row, top -= ROW_PX) {
          if (!taken.some(t => left < t.right && left + w > t.left && top < t.top + ROW_PX && top + ROW_PX > t.top)) break;
        }
        // Below its place where there is no room above.
        if (top < EDGE_PX) top = y + STEM_PX;
        taken.push({left, right: left + w, top});
        const is_above = top < y, edge = is_above ? top + ROW_PX - 1 : y;
        // A long stem is behind the labels that it passes.
        pin.element.style.zIndex = MAX_ROWS - row;
        pin.element.style.transform = `translate(${x}px, ${y}px)`;
        pin.element.style.opacity = is_through && pin.state === 'unsure' ? '0.55' : '1';
        pin.label.style.transform = `translate(${left - x}px, ${top - y}px)`;
        pin.stem.style.transform = `translate(0, ${edge - y}px)`;
        pin.stem.style.height = (is_above ? y - edge : top - y) + 'px';
      }
    }
  }

  haustra.Pins = Pins;
  haustra.PIN_COLOUR = COLOUR;
})();

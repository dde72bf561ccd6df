// The switches of where the eye is (scene_3d.js): buttons, and a slider along the lumen.
'use strict';
window.haustra = window.haustra || {};
(() => {
  const WORDS = {outside: ['Outside', 'The wall from outside'], cut: ['Cut open', 'Without the half of the wall that is nearer to the eye'],
                 along: ['Inside', 'Along the middle of the lumen'], scope: ['Through the scope', 'From where the scope is']};

  const element = (tag, properties) => Object.assign(document.createElement(tag), properties);

  // Puts them into `place`. looks: of WORDS, in this order.
  haustra.addLooks = (scene, place, looks) => {
    if (!scene.works) return;
    const group = element('span', {className: 'group'}), buttons = new Map();
    group.setAttribute('role', 'group');
    group.setAttribute('aria-label', 'Where the eye is');
    for (const look of looks) {
      const button = element('button', {type: 'button', textContent: WORDS[look][0], title: WORDS[look][1]});
      button.dataset.look = look;
      button.addEventListener('click', () => scene.setLook(look));
      group.append(button);
      buttons.set(look, button);
    }
    const way = element('span', {className: 'way-through'});
    const slider = element('input', {type: 'range', min: 0, max: 1, step: 0.002});
    slider.setAttribute('aria-label', 'Along the lumen');
    slider.addEventListener('input', () => scene.setAlong(Number(slider.value)));
    const turn = element('button', {type: 'button', textContent: 'Turn round'});
    turn.addEventListener('click', () => scene.turnRound());
    way.append(slider, turn);
    place.append(group, way);
    scene.onLook = () => {
      const chosen = scene.canLook(scene.look) ? scene.look : 'outside';
      for (const [look, button] of buttons) {
        button.setAttribute('aria-pressed', look === chosen);
        button.disabled = !scene.canLook(look);
      }
      way.hidden = chosen !== 'along';
      slider.value = scene.along;
    };
    scene.onLook();
  };
})();

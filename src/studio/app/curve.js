// @ts-check
// What an effect that a search found does: the residual over the variables that it reads, and the change of the prediction with all that was found.

import { ask } from './api.js';
import { binned } from './charts.js';
import { h } from './dom.js';

/**
 * Draws the curve of each effect into its place, one after the other.
 * @param {import('./main.js').App} app
 * @param {HTMLElement} into
 */
export async function draw(app, into) {
  for (const place of into.querySelectorAll('[data-curve]')) {
    if (!place.isConnected) return;
    const effect = /** @type {HTMLElement} */ (place).dataset.curve;
    /** @type {import('./api.js').Curve | import('./api.js').Missing} */
    const found = await ask('curve', { effect });
    place.replaceChildren(...('why' in found ? [h('p', { class: 'quiet' }, `${found.why}.`)] : pictures(app, found)));
    place.setAttribute('data-drawn', 'yes');
  }
}

/**
 * @param {import('./main.js').App} app
 * @param {import('./api.js').Curve} found
 */
function pictures(app, found) {
  const channel = app.overview.channels[found.channel];
  const drawn = found.panels.filter((panel) => panel.before.length > 0);
  if (drawn.length === 0) return [h('p', { class: 'quiet' }, 'No recorded variable varies with it.')];
  const one = (/** @type {typeof drawn[number]} */ panel) =>
    h(
      'figure',
      { 'data-variable': panel.name },
      h('figcaption', { class: 'quiet' }, panel.read ? `over ${panel.name}, which it reads` : `over ${panel.name}`),
      binned(panel.before, panel, channel, { after: panel.after, change: panel.change }),
    );
  return [
    h('div', { class: 'row' }, drawn.map(one)),
    h(
      'p',
      { class: 'quiet' },
      'Points: what the searched model leaves, with 95 % intervals; squares: what is left with all that was found. Dashed: the change of the whole prediction. Where it runs through the points, nothing is left.',
    ),
  ];
}

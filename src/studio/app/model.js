// @ts-check
// Model: effects with their switches and numbers, the user's own formula, the errors over the steps taken, the history.

import { ask } from './api.js';
import { waterfall } from './charts.js';
import { choice, h } from './dom.js';
import { editor } from './editor.js';
import { interval, measure, number, shorter } from './format.js';
import { read, slide } from './place.js';
import { stack } from './plots.js';

/** @type {import('./plots.js').Stack | null} */
let plots = null;
/** Effects whose numbers are shown, kept while the app is open. */
const open = new Set();

/**
 * @param {import('./main.js').App} app
 * @param {HTMLElement} into
 */
export async function show(app, into) {
  const place = read();
  /** @type {import('./api.js').Model} */
  const model = await ask('model');
  if (read().view !== 'model') return;
  const channel = app.overview.channels[place.channel];
  const pictures = h('div', { class: 'stack', id: 'model-plots' });
  const preview = previewer(app, pictures, channel);
  const [baseline, own] = [true, false].map((is) => model.effects.filter((effect) => effect.baseline === is));
  const scroll = into.querySelector('.effects')?.scrollTop ?? 0;
  into.replaceChildren(
    h(
      'div',
      { class: 'columns model' },
      h(
        'div',
        { class: 'effects' },
        calibration(app, model),
        own.map((effect) => effectCard(app, effect, preview)),
        adder(app, model),
        editor(app),
        h('h2', {}, 'Baseline'),
        baseline.map((effect) => effectCard(app, effect, preview)),
      ),
      h('div', { class: 'watch' }, falls(app), residual(app, pictures, channel), steps(app)),
    ),
  );
  const effects = into.querySelector('.effects');
  if (effects) effects.scrollTop = scroll;
  await preview.start();
}

export function hide() {
  plots?.destroy();
  plots = null;
}

/**
 * @param {import('./main.js').App} app
 * @param {import('./api.js').Model} model
 */
function calibration(app, model) {
  const found = model.calibration;
  const text = found
    ? `calibrated on ${found.rows} rows, condition number ${number(found.condition_number)}`
    : 'not calibrated since a number was moved, or as it was opened';
  return h(
    'div',
    { class: 'card' },
    h(
      'header',
      {},
      h('h2', {}, model.name),
      h('span', { class: 'gap' }),
      h(
        'button',
        { type: 'button', id: 'calibrate', class: found ? '' : 'main', onclick: () => app.edit({ do: 'calibrate' }) },
        'Calibrate',
      ),
    ),
    h('p', { class: 'quiet' }, `${model.vehicle}; ${text}`),
    model.doubts.length
      ? h(
          'ul',
          { class: 'doubts' },
          model.doubts.map((doubt) => h('li', {}, doubt)),
        )
      : null,
  );
}

/**
 * @typedef {{ start: () => Promise<void>, move: (moved: import('./api.js').Moved) => void }} Preview
 */

/**
 * @param {import('./main.js').App} app
 * @param {import('./api.js').Effect} effect
 * @param {Preview} preview
 */
function effectCard(app, effect, preview) {
  const box = h('input', {
    type: 'checkbox',
    role: 'switch',
    checked: effect.enabled,
    'data-switch': effect.name,
    'aria-label': `${effect.name} takes part`,
    onchange: async () => {
      if (!(await app.edit({ do: 'switch', effect: effect.name, on: box.checked }))) box.checked = effect.enabled;
    },
  });
  const details = h(
    'details',
    { open: open.has(effect.name), ontoggle: () => (details.open ? open.add(effect.name) : open.delete(effect.name)) },
    h('summary', {}, 'numbers and formula'),
    effect.numbers.filter((one) => !one.fixed).map((one) => slider(app, effect, one, preview)),
    h('pre', {}, shorter(effect.formula)),
    effect.baseline
      ? null
      : h(
          'button',
          {
            type: 'button',
            'data-remove': effect.name,
            onclick: () => app.edit({ do: 'remove', effect: effect.name }),
          },
          'Take it out',
        ),
  );
  return h(
    'article',
    { class: effect.enabled ? 'card effect' : 'card effect off', 'data-effect': effect.name },
    h(
      'header',
      {},
      h('label', { class: 'switch' }, box, h('b', {}, effect.name)),
      h('span', { class: 'gap' }),
      h(
        'span',
        { class: 'tag' },
        effect.baseline
          ? 'baseline'
          : effect.added_by === 'diagnose'
            ? 'found'
            : effect.kind === 'formula'
              ? 'own formula'
              : 'added',
      ),
    ),
    h('p', {}, effect.meaning),
    details,
  );
}

/** How long a slider rests before its number is taken, ms. */
const REST_MS = 600;

/**
 * @param {import('./main.js').App} app
 * @param {import('./api.js').Effect} effect
 * @param {import('./api.js').Numeral} one
 * @param {Preview} preview
 */
function slider(app, effect, one, preview) {
  const [low, high] = one.slider;
  const id = `n-${effect.name}-${one.name}`;
  const shown = h('output', { for: id }, measure(one.value, one.unit));
  const moved = () => ({ effect: effect.name, number: one.name, value: Number(input.value) });
  // Keys that follow each other are one step.
  let rests = 0;
  const rest = () => {
    window.clearTimeout(rests);
    rests = window.setTimeout(() => app.edit({ do: 'move', ...moved() }), REST_MS);
  };
  const input = h('input', {
    type: 'range',
    id,
    min: String(low),
    max: String(high),
    step: String((high - low) / 1000),
    disabled: !effect.enabled,
    'data-number': `${effect.name}.${one.name}`,
    oninput: () => {
      shown.replaceChildren(measure(Number(input.value), one.unit));
      preview.move(moved());
    },
    onchange: rest,
  });
  input.value = String(one.value);
  const says = [
    one.ci95 ? `95 % interval ${interval(one.ci95)}` : 'no interval',
    one.usual ? `usually ${interval(one.usual)}` : '',
    one.by_flight
      ? `${one.by_flight[0]} flights with values of their own, ${number(one.by_flight[1])} … ${number(one.by_flight[2])}`
      : '',
  ];
  return h(
    'div',
    { class: 'number' },
    h('label', { for: id, title: one.meaning }, h('b', {}, one.name), ` ${one.meaning}`),
    shown,
    input,
    h('small', { class: 'quiet' }, says.filter(Boolean).join('; ')),
  );
}

/**
 * The residual of the stretch that Compare shows, redrawn while a number is moved.
 * @param {import('./main.js').App} app
 * @param {HTMLElement} pictures
 * @param {import('./api.js').Channel} channel
 * @returns {Preview}
 */
function previewer(app, pictures, channel) {
  let waits = /** @type {import('./api.js').Moved | null} */ (null);
  let runs = false;
  const place = read();
  const flight = Math.min(place.flight, app.overview.flights.length - 1);
  const fetchTrace = async (/** @type {import('./api.js').Moved | null} */ moved) => {
    const wanted = {
      flight,
      channel: place.channel,
      from_s: place.from,
      to_s: place.to,
      against: moved ? app.steps.steps[app.steps.at].id : null,
      moved,
      pixels: Math.round(plots?.width() ?? 600),
    };
    /** @type {import('./api.js').Trace} */
    const trace = await ask('trace', wanted);
    plots?.draw(trace.against ? trace : { ...trace, against: [], against_residual: trace.t.map(() => null) });
    const told = pictures.parentElement?.querySelector('[data-told]');
    told?.replaceChildren(
      `root mean square ${number(trace.rmse)} ${channel.unit}${trace.against_rmse === null ? '' : `, before ${number(trace.against_rmse)}`}`,
    );
    pictures.dataset.rmse = String(trace.rmse);
  };
  const run = async () => {
    runs = true;
    while (waits) {
      const moved = waits;
      waits = null;
      try {
        await fetchTrace(moved);
      } catch (error) {
        app.failed(error);
      }
    }
    runs = false;
  };
  return {
    async start() {
      plots?.destroy();
      plots = stack(
        pictures,
        channel,
        'now',
        'before',
        {
          zoom: (from, to) => slide({ from, to }),
          whole: () => slide({ from: null, to: null }),
          which: 'residual',
        },
      );
      await fetchTrace(null);
    },
    move(moved) {
      waits = moved;
      if (!runs) run();
    },
  };
}

/**
 * @param {import('./main.js').App} app
 * @param {HTMLElement} pictures
 * @param {import('./api.js').Channel} channel
 */
function residual(app, pictures, channel) {
  const place = read();
  const flight = app.overview.flights[Math.min(place.flight, app.overview.flights.length - 1)];
  const stretch = place.from === null ? 'the whole flight' : `${number(place.from, 4)} s to ${number(place.to, 4)} s`;
  return h(
    'section',
    { class: 'card' },
    h('h2', {}, `Residual of ${channel.symbol} in ${flight.name}, ${stretch}`),
    h('p', { class: 'quiet', 'data-told': true }),
    pictures,
  );
}

/** @param {import('./main.js').App} app */
function falls(app) {
  const { steps, overview } = app;
  const path = steps.steps.slice(0, steps.at + 1);
  const chosen = read().channel;
  return h(
    'section',
    { class: 'card', id: 'waterfall', 'aria-label': 'Errors over the steps taken' },
    h('h2', {}, 'Error after each step, on flights no fit sees'),
    h(
      'div',
      { class: 'falls-grid' },
      overview.channels.map((channel, index) =>
        waterfall(channel, path, index === chosen, () => slide({ channel: index })),
      ),
    ),
    h(
      'p',
      { class: 'quiet' },
      `${steps.judged_on}, with 95 % intervals${steps.own_from_other_half ? '; each half of a flight is judged with what its other half says of it, as some state has numbers of each flight' : ''}.`,
    ),
  );
}

/** @param {import('./main.js').App} app */
function steps(app) {
  const { steps: all, at } = app.steps;
  const item = (/** @type {import('./api.js').Step} */ step, /** @type {number} */ index) =>
    h(
      'li',
      { class: index > at ? 'undone' : '' },
      h(
        'button',
        {
          type: 'button',
          'aria-current': index === at ? 'step' : null,
          'data-step': String(step.id),
          onclick: () => app.step('go_to', { state: step.id }),
        },
        `${index + 1}. ${step.did}`,
      ),
      index === at
        ? null
        : h(
            'button',
            {
              type: 'button',
              class: 'plain',
              title: 'lay it beside the present state in Compare',
              onclick: () => slide({ view: 'compare', against: step.id }),
            },
            'compare',
          ),
    );
  return h(
    'section',
    { class: 'card', id: 'history' },
    h('h2', {}, 'Steps'),
    h('ol', { class: 'steps' }, all.map(item)),
  );
}

/**
 * @param {import('./main.js').App} app
 * @param {import('./api.js').Model} model
 */
function adder(app, model) {
  if (model.addable.length === 0) return null;
  let chosen = model.addable[0][0];
  const says = h('p', { class: 'quiet' }, model.addable[0][1]);
  const pick = choice(
    'Effect of the catalogue',
    'addable',
    model.addable.map(([name]) => [name, name]),
    chosen,
    (value) => {
      chosen = value;
      says.replaceChildren(model.addable.find(([name]) => name === value)?.[1] ?? '');
    },
  );
  return h(
    'div',
    { class: 'card' },
    h('h2', {}, 'Add an effect'),
    h(
      'div',
      { class: 'bar' },
      pick,
      h(
        'button',
        { type: 'button', id: 'add-effect', onclick: () => app.edit({ do: 'add', effect: chosen }) },
        'Add and calibrate',
      ),
    ),
    says,
  );
}

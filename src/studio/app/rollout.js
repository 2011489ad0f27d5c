// @ts-check
// Roll out: the model integrated forward from one moment of a flight, beside what was measured and yardsticks that predict no change; and the mean
// errors over all starts on flights that no fit sees.

import { ask } from './api.js';
import { choice, h, scroller } from './dom.js';
import { measure, number, percent, time } from './format.js';
import { DASHES, legend, lines, tables } from './lines.js';
import { read, slide } from './place.js';
import { stack, timeWidth } from './plots.js';
import { networksOf } from './runs.js';

/** @type {import('./plots.js').Stack | null} */
let strip = null;
let asked = 0;
/** What a key press moves. */
let drawn = { at: 0, ahead: 1 };

const AHEAD = [0.2, 0.5, 1, 2, 5, 10];

/**
 * Quantities with the names of their components.
 * @type {{ key: 'position' | 'velocity' | 'attitude' | 'rates', unit: string, title: string, of: string[] }[]}
 */
const QUANTITIES = [
  { key: 'position', unit: 'm', title: 'Position', of: ['north', 'east', 'down'] },
  { key: 'velocity', unit: 'm/s', title: 'Velocity', of: ['north', 'east', 'down'] },
  { key: 'attitude', unit: 'rad', title: 'Attitude', of: ['roll', 'pitch', 'yaw'] },
  { key: 'rates', unit: 'rad/s', title: 'Rates', of: ['wx', 'wy', 'wz'] },
];

/** Lines of predictors, in the order in which they come: both yardsticks, then the model, then the network. */
const LOOKS = [
  { colour: 3, dash: DASHES[2] },
  { colour: 2, dash: DASHES[1] },
  { colour: 1, dash: '', wide: true },
  { colour: 4, dash: DASHES[3], wide: true },
];

/** @param {string} name */
const named = (name) => name.replace('rates held', 'ω held');

/**
 * @param {import('./main.js').App} app
 * @param {HTMLElement} into
 */
export async function show(app, into) {
  const place = read();
  const { overview } = app;
  const flight = Math.min(place.flight, overview.flights.length - 1);
  const channel = overview.channels[place.channel];
  const mine = ++asked;
  const pixels = Math.min(4000, Math.round(timeWidth(into.clientWidth) * devicePixelRatio));
  const at_s = place.at ?? place.from;
  /** @type {import('./api.js').Runs} */
  const runs = await ask('runs');
  const networks = networksOf(runs);
  const network = networks.includes(place.network) ? place.network : null;
  /** @type {[import('./api.js').Trace, import('./api.js').Rollout | import('./api.js').Missing]} */
  const [trace, found] = await Promise.all([
    ask('trace', { flight, channel: place.channel, from_s: place.from, to_s: place.to, pixels, against: null }),
    ask('rollout', { flight, at_s, ahead_s: place.ahead, network }),
  ]);
  if (mine !== asked || read().view !== 'rollout') return;
  const where = h('div', { class: 'stack', id: 'rollout-strip' });
  const all = h('section', { class: 'card', id: 'rollout-all' }, h('h2', {}, 'Over all starts'), h('p', { class: 'quiet' }, 'Rolling out …'));
  const one = 'why' in found ? missing(found) : single(found);
  strip?.destroy();
  into.replaceChildren(controls(app, flight, found, networks), where, one, all);
  drawn = { at: 'why' in found ? trace.whole_s[0] : found.at_s, ahead: place.ahead };
  strip = stack(where, channel, 'model', null, {
    zoom: (from, to) => slide({ from, to }),
    whole: () => slide({ from: null, to: null }),
    which: 'residual',
    pick: (at) => slide({ at: rounded(at) }),
    mark: 'why' in found ? undefined : [found.at_s, found.at_s + place.ahead],
  });
  strip.draw(trace);
  /** @type {import('./api.js').Rollouts | import('./api.js').Missing} */
  const errors = await ask('rollouts', { ahead_s: place.ahead, network });
  if (mine !== asked || read().view !== 'rollout') return;
  all.replaceWith('why' in errors ? missing(errors, 'rollout-all') : over(errors));
}

export function hide() {
  asked += 1;
  strip?.destroy();
  strip = null;
}

/** @param {number} at */
const rounded = (at) => Number(at.toFixed(2));

/**
 * @param {import('./main.js').App} app
 * @param {number} flight
 * @param {import('./api.js').Rollout | import('./api.js').Missing} found
 * @param {string[]} networks
 */
function controls(app, flight, found, networks) {
  const { flights } = app.overview;
  const { ahead, from, to, network } = read();
  const to_flight = (/** @type {number} */ index) =>
    slide({ flight: Math.min(flights.length - 1, Math.max(0, index)), from: null, to: null, at: null });
  const start = h('input', {
    type: 'text',
    id: 'rollout-at',
    inputmode: 'decimal',
    size: '7',
    value: 'why' in found ? '' : String(rounded(found.at_s)),
    onchange: () => {
      const at = Number(start.value.replace(',', '.').replace('−', '-'));
      if (start.value.trim() !== '' && Number.isFinite(at)) slide({ at });
      else app.note('a time of the flight in seconds is expected');
    },
  });
  const known = AHEAD.includes(ahead) ? AHEAD : [...AHEAD, ahead].sort((left, right) => left - right);
  return h(
    'div',
    { class: 'bar' },
    choice(
      'Flight',
      'flight',
      flights.map((one, index) => [
        String(index),
        `${one.name} · ${time(one.duration_s)}${one.judges > 0.999 ? ' · unseen' : one.judges > 0 ? ' · partly unseen' : ''}`,
      ]),
      String(flight),
      (value) => to_flight(Number(value)),
    ),
    h('button', { type: 'button', title: 'the flight before, key [', onclick: () => to_flight(flight - 1) }, '‹'),
    h('button', { type: 'button', title: 'the next flight, key ]', onclick: () => to_flight(flight + 1) }, '›'),
    h('label', { class: 'field', for: 'rollout-at' }, h('span', {}, 'From, s'), start),
    choice(
      'Ahead',
      'ahead',
      known.map((seconds) => [String(seconds), `${seconds} s`]),
      String(ahead),
      (value) => slide({ ahead: Number(value) }),
    ),
    networks.length
      ? choice(
          'Network',
          'rollout-network',
          [['', 'none'], ...networks.map((name) => /** @type {[string, string]} */ ([name, name]))],
          networks.includes(network) ? network : '',
          (value) => slide({ network: value }),
        )
      : null,
    h('span', { class: 'gap' }),
    from !== null || to !== null
      ? h('button', { type: 'button', onclick: () => slide({ from: null, to: null }) }, 'Whole flight')
      : h('small', { class: 'quiet' }, 'click the residual: roll out from there'),
  );
}

/**
 * What the log lacks, and what to do.
 * @param {import('./api.js').Missing} found
 * @param {string} [id]
 */
function missing(found, id = 'rollout-one') {
  return h('section', { class: 'card', id }, h('div', { class: 'empty' }, h('h2', {}, 'Nothing can be rolled out'), h('p', {}, `${found.why}.`)));
}

/**
 * One rollout: the errors, then the components, a column for each quantity.
 * @param {import('./api.js').Rollout} found
 */
function single(found) {
  const { ahead_s: x, measured, paths } = found;
  const end = x[x.length - 1];
  const looks = paths.map((path, index) => ({ name: named(path.name), ...LOOKS[Math.min(index, LOOKS.length - 1)] }));
  const across = { name: 'after the start', unit: 's' };
  /** @type {(of: typeof QUANTITIES[number]) => import('./lines.js').Picture} */
  const errors = ({ key, unit, title }) =>
    ({
      title: `size of the error in ${title.toLowerCase()}`,
      across,
      up: { name: 'error', unit },
      x,
      curves: looks.map((look, index) => ({ ...look, y: paths[index].error[key] })),
      at_least: [0, 0],
      small: true,
      bare: true,
    });
  /** @type {(of: typeof QUANTITIES[number], axis: number) => import('./lines.js').Picture} */
  const component = ({ key, unit, of }, axis) =>
    ({
      title: `${of[axis]} ${key === 'rates' ? 'rate' : key}`,
      across,
      up: { name: of[axis], unit },
      x,
      curves: [
        { name: 'measured', colour: 0, dash: '', y: measured[key][axis] },
        ...looks.slice(1).map((look, index) => ({ ...look, y: paths[index + 1].states[key][axis] })),
      ],
      small: true,
      bare: true,
    });
  const pictures = (/** @type {typeof QUANTITIES[number]} */ quantity) => {
    const all = [errors(quantity), ...quantity.of.map((_, axis) => component(quantity, axis))];
    return [...all.map(lines), tables(...all)];
  };
  const stopped = paths.filter((path) => path.stopped_s !== null);
  return h(
    'section',
    { class: 'card', id: 'rollout-one', 'data-at': String(found.at_s), 'data-end': String(end) },
    h('h2', {}, `From ${rounded(found.at_s)} s, ${measure(end, 's')} ahead under the measured controls`),
    legend([{ name: 'measured', colour: 0, dash: '', y: [] }, ...looks.map((look) => ({ ...look, y: [] }))]),
    h(
      'div',
      { class: 'row four' },
      QUANTITIES.map((quantity) =>
        h(
          'div',
          { class: 'quantity', 'data-quantity': quantity.key, 'data-error': String(paths[paths.length - 1].error[quantity.key].at(-1)) },
          h('h3', {}, quantity.title),
          pictures(quantity),
        ),
      ),
    ),
    stopped.map((path) =>
      h('p', { class: 'rise' }, `${named(path.name)} runs out of bounds after ${measure(path.stopped_s, 's')}; from there on it stays where it was.`),
    ),
    found.note ? h('p', { class: 'quiet' }, found.note) : null,
    h('p', { class: 'quiet' }, 'On top the size of the error, below what was measured and predicted: position from the start and velocity north, east, down; angles of roll, pitch, yaw; body rates.'),
  );
}

/**
 * Mean errors over all starts.
 * @param {import('./api.js').Rollouts} found
 */
function over({ rollouts, basis, caution, legend: meaning }) {
  const { rows, horizon, step_s } = rollouts;
  const looks = rows.map((row, index) => ({ name: named(row.name), ...LOOKS[Math.min(index, LOOKS.length - 1)] }));
  const every = Math.max(1, Math.ceil(horizon / 200));
  const steps = [...Array(horizon + 1).keys()].filter((step) => step % every === 0 || step === horizon);
  const picture = (/** @type {typeof QUANTITIES[number]} */ { key, unit, title }) =>
    h(
      'div',
      { class: 'quantity' },
      h('h3', {}, title),
      lines({
        title: `mean size of the error in ${title.toLowerCase()} over all starts`,
        across: { name: 'after the start', unit: 's' },
        up: { name: 'mean error', unit },
        x: steps.map((step) => step * step_s),
        curves: looks.map((look, index) => ({ ...look, y: steps.map((step) => (step === 0 ? 0 : rows[index].error[key][step - 1])) })),
        at_least: [0, 0],
        small: true,
        bare: true,
      }),
    );
  const cell = (/** @type {typeof rows[number]} */ row, /** @type {typeof QUANTITIES[number]} */ { key, unit }) => {
    const change = row.difference_percent[key];
    const ends = row.difference_percent_ci95[key];
    const sure = ends !== null && (ends[1] < 0 || ends[0] > 0);
    return h(
      'td',
      {},
      measure(row.error[key].at(-1), unit),
      row.name === rollouts.relative_to || change === null
        ? null
        : h(
            'small',
            {
              class: sure ? (change < 0 ? 'fall' : 'rise') : 'quiet',
              title: `sum of the error over the horizon, ${ends ? `95 % interval ${percent(ends[0] / 100)} … ${percent(ends[1] / 100)}` : 'no interval'}`,
            },
            ` ${change < 0 ? '▼' : '▲'} ${percent(Math.abs(change) / 100)} in sum`,
          ),
    );
  };
  return h(
    'section',
    { class: 'card', id: 'rollout-all', 'data-starts': String(rows[0].n) },
    h('h2', {}, 'Over all starts'),
    h('p', { class: 'quiet' }, `${basis}. ${caution ?? ''}`),
    legend(looks.map((look) => ({ ...look, y: [] }))),
    h('div', { class: 'row four' }, QUANTITIES.map(picture)),
    scroller(
      'Errors over all starts',
      h(
        'table',
        { class: 'numbers' },
        h('caption', {}, `Mean error after ${measure(horizon * step_s, 's')}; its sum over the horizon beside that of ${named(rollouts.relative_to)}`),
        h('thead', {}, h('tr', {}, h('th', { scope: 'col' }, 'predictor'), QUANTITIES.map((one) => h('th', { scope: 'col' }, one.title)), h('th', { scope: 'col' }, 'diverged'))),
        h(
          'tbody',
          {},
          rows.map((row) =>
            h('tr', {}, h('th', { scope: 'row' }, named(row.name)), QUANTITIES.map((one) => cell(row, one)), h('td', {}, `${row.diverged} of ${row.n}`)),
          ),
        ),
      ),
    ),
    rollouts.position_from_velocity
      ? h('p', { class: 'quiet' }, 'No position in the log of some flights: the way that the recorded velocity makes stands for it.')
      : null,
    h('details', {}, h('summary', {}, 'What these figures are'), h('p', { class: 'quiet' }, meaning)),
  );
}

/** @param {KeyboardEvent} event */
export function key(event) {
  const step = { ArrowLeft: -0.5, ArrowRight: 0.5 }[event.key];
  if (!step) return;
  event.preventDefault();
  slide({ at: rounded(Math.max(0, drawn.at + step * drawn.ahead)) });
}

// @ts-check
// Compare: measured beside predicted for a stretch of a flight, with the residual and the sticks.

import { ask } from './api.js';
import { choice, h } from './dom.js';
import { number, percent, time } from './format.js';
import { go, read, slide } from './place.js';
import { stack, timeWidth } from './plots.js';

/** @type {import('./plots.js').Stack | null} */
let plots = null;
/** Of the trace that is drawn: what a key press moves. */
let drawn = { from: 0, to: 1, first: 0, last: 1 };
let asked = 0;

/**
 * @param {import('./main.js').App} app
 * @param {HTMLElement} into
 */
export async function show(app, into) {
  const place = read();
  const { overview, steps } = app;
  const flight = Math.min(place.flight, overview.flights.length - 1);
  const now = steps.steps[steps.at];
  const other = steps.steps.find((step) => step.id === place.against && step.id !== now.id) ?? null;
  const channel = overview.channels[place.channel];
  const wanted = {
    flight,
    channel: place.channel,
    from_s: place.from,
    to_s: place.to,
    pixels: Math.min(4000, Math.round(timeWidth(into.clientWidth) * devicePixelRatio)),
    against: other?.id ?? null,
  };
  const mine = ++asked;
  // Asked before anything is drawn: what is shown stays if nobody answers.
  /** @type {import('./api.js').Trace} */
  const trace = await ask('trace', wanted);
  if (mine !== asked || read().view !== 'compare') return;
  const line = h('p', { class: 'quiet', id: 'compare-line' });
  const pictures = h('div', { class: 'stack', id: 'compare-plots', 'data-flight': overview.flights[flight].name });
  plots?.destroy();
  into.replaceChildren(controls(app, flight, other), line, pictures);
  plots = stack(
    pictures,
    channel,
    name(now),
    other ? name(other) : null,
    { zoom: (from, to) => slide({ from, to }), whole: () => slide({ from: null, to: null }) },
  );
  plots.draw(trace);
  const [first, last] = trace.whole_s;
  drawn = { from: place.from ?? first, to: place.to ?? last, first, last };
  const fine =
    trace.samples_per_point > 1
      ? `each point the least or the largest of ${number(2 * trace.samples_per_point, 2)} samples`
      : 'every sample drawn';
  const beside =
    trace.against_rmse === null
      ? ''
      : `, ${other ? name(other) : ''} ${number(trace.against_rmse)} ${channel.unit} (${percent(trace.rmse / trace.against_rmse - 1)} from there to now)`;
  line.replaceChildren(
    h('b', {}, `${channel.name}, ${channel.symbol}`),
    `: root mean square error ${number(trace.rmse)} ${channel.unit} from ${number(drawn.from, 4)} s to ${number(drawn.to, 4)} s${beside}; ${fine}.`,
  );
  pictures.dataset.points = String(trace.t.length);
}

export function hide() {
  plots?.destroy();
  plots = null;
}

/** @param {import('./api.js').Step} step */
function name(step) {
  return step.did.length > 28 ? `${step.did.slice(0, 27)}…` : step.did;
}

/**
 * @param {import('./main.js').App} app
 * @param {number} flight
 * @param {import('./api.js').Step | null} other
 */
function controls(app, flight, other) {
  const { overview, steps } = app;
  const shown = overview.flights[flight];
  const label = (/** @type {import('./api.js').Flight} */ one) =>
    `${one.name} · ${time(one.duration_s)}${one.judges > 0.999 ? ' · unseen' : one.judges > 0 ? ' · partly unseen' : ''}`;
  const flights = choice(
    'Flight',
    'flight',
    overview.flights.map((one, index) => [String(index), label(one)]),
    String(flight),
    (value) => slide({ flight: Number(value), from: null, to: null }),
  );
  const states = steps.steps.map(
    (step, index) => /** @type {[string, string]} */ ([String(step.id), `${index + 1}. ${step.did}`]),
  );
  const beside = choice(
    'Beside',
    'against',
    [['', 'nothing'], ...states.filter(([id]) => id !== String(steps.steps[steps.at].id))],
    other ? String(other.id) : '',
    (value) => slide({ against: value === '' ? null : Number(value) }),
  );
  const button = (
    /** @type {string} */ id,
    /** @type {string} */ text,
    /** @type {string} */ title,
    /** @type {() => void} */ act,
  ) => h('button', { type: 'button', id, title, onclick: act }, text);
  const jump = async (/** @type {boolean} */ typical) => {
    try {
      const found = await ask('place', { part: read().part, by: read().by, channel: read().channel, typical });
      if (found) slide({ flight: found.flight, from: found.from_s, to: found.to_s });
    } catch (error) {
      app.failed(error);
    }
  };
  return h(
    'div',
    { class: 'bar' },
    flights,
    button('before', '‹', 'the flight before, key [', () =>
      slide({ flight: Math.max(0, flight - 1), from: null, to: null }),
    ),
    button('after', '›', 'the next flight, key ]', () =>
      slide({ flight: Math.min(overview.flights.length - 1, flight + 1), from: null, to: null }),
    ),
    beside,
    h('span', { class: 'gap' }),
    button('worst', 'Worst 10 s', 'of this channel on flights that no fit sees', () => jump(false)),
    button('typical', 'Typical 10 s', 'the median error of this channel', () => jump(true)),
    button('from-here', 'Roll out', 'from the beginning of what is shown', () => go({ view: 'rollout', at: drawn.from })),
    button('whole', 'Whole flight', 'key 0', () => slide({ from: null, to: null })),
    shown.derived ? h('small', { class: 'quiet' }, 'accelerations derived from velocity and rates') : null,
  );
}

/** @param {KeyboardEvent} event */
export function key(event) {
  const { from, to, first, last } = drawn;
  const width = to - from;
  const within = (/** @type {number} */ start, /** @type {number} */ length) => {
    const size = Math.min(length, last - first);
    const begin = Math.min(Math.max(first, start), last - size);
    slide(size >= last - first ? { from: null, to: null } : { from: begin, to: begin + size });
  };
  const acts = /** @type {Record<string, () => void>} */ ({
    ArrowLeft: () => within(from - 0.25 * width, width),
    ArrowRight: () => within(from + 0.25 * width, width),
    '+': () => within(from + 0.25 * width, 0.5 * width),
    '=': () => within(from + 0.25 * width, 0.5 * width),
    '-': () => within(from - 0.5 * width, 2 * width),
    0: () => slide({ from: null, to: null }),
  });
  const act = acts[event.key];
  if (!act) return;
  event.preventDefault();
  act();
}

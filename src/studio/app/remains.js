// @ts-check
// The lower half of Where it fails: regions of flight that hold the error, and the residual in time: how long it lasts, its spectrum, the sticks.

import { h, scroller } from './dom.js';
import { interval, measure, number, percent } from './format.js';
import { DASHES, lines } from './lines.js';
import { go } from './place.js';

/** Names of the sticks. */
const STICKS = { u1: 'lateral', u2: 'longitudinal', u3: 'tail', u4: 'collective' };

/**
 * Why there is nothing, in the place of what would be there.
 * @param {string} why
 */
const empty = (why) => h('p', { class: 'quiet' }, `${why}.`);

/**
 * The rules of a region, none of which is broken at the end of a line, and what stays with the last one.
 * @param {string} rule
 * @param {HTMLElement | null} behind
 */
function rules(rule, behind) {
  const parts = rule.split(', ');
  return h(
    'code',
    {},
    parts.flatMap((part, index) => [index < parts.length - 1 ? h('span', {}, `${part},`) : h('span', {}, part, ' ', behind), ' ']),
  );
}

/**
 * A way to the ten seconds that hold most of a region's error.
 * @param {import('./api.js').Spot} worst
 * @param {string} rule
 */
function visit(worst, rule) {
  const to = () => go({ view: 'compare', flight: worst.flight, from: worst.from_s, to: worst.to_s });
  return h('button', { type: 'button', class: 'plain visit', 'aria-label': `the worst ten seconds of ${rule}`, title: 'its worst ten seconds', onclick: to }, '→');
}

/**
 * Regions as a table with bars.
 * @param {import('./api.js').Channel} channel
 * @param {import('./api.js').Regions} found
 */
export function regions(channel, found) {
  const title = h('h2', {}, `Regions of flight that hold the error of ${channel.symbol}`);
  const { whole } = found;
  if (!whole) return h('section', { class: 'card', id: 'regions' }, title, empty(found.why ?? ''));
  const most = Math.max(whole.rmse, ...found.regions.map((one) => one.rmse)) || 1;
  const row = (/** @type {import('./api.js').Region} */ one) => {
    const bar = h('i');
    bar.style.width = `${(100 * one.rmse) / most}%`;
    const dense = one !== whole && one.share_of_error > one.share_of_time;
    return h(
      'tr',
      { 'data-rule': one.rule },
      h('th', { scope: 'row' }, one === whole ? one.rule : rules(one.rule, one.worst ? visit(one.worst, one.rule) : null)),
      h('td', { class: 'fill' }, h('div', { class: 'track' }, bar)),
      h('td', {}, number(one.rmse), one.ci95 ? h('small', { class: 'quiet' }, ` [${interval(one.ci95)}]`) : null),
      h('td', { class: dense ? 'rise' : '' }, percent(one.share_of_error)),
      h('td', {}, percent(one.share_of_time)),
      h('td', {}, String(one.blocks), one.blocks < 5 ? h('small', { class: 'quiet' }, ' few') : null),
    );
  };
  const heads = ['region', '', `error, ${channel.unit}`, 'of the error', 'of the time', 'blocks'];
  return h(
    'section',
    { class: 'card', id: 'regions', 'aria-label': 'Regions that hold the error' },
    title,
    scroller(
      'Regions',
      h(
        'table',
        { class: 'numbers wide' },
        h('thead', {}, h('tr', {}, heads.map((text) => (text ? h('th', { scope: 'col' }, text) : h('td'))))),
        h('tbody', {}, [whole, ...found.regions].map(row)),
      ),
    ),
    h(
      'p',
      { class: 'quiet' },
      found.even
        ? 'The error is even: no rule finds a region in which it is a quarter larger than in all flights.'
        : 'Simple rules part the flights so that the error differs from part to part. A part with more of the error than of the time is where the model lacks something, or where the air is rougher. Errors of means over tenths of a second, with 95 % intervals from blocks of ten seconds; an arrow leads to the ten seconds that hold most of it.',
    ),
  );
}

/**
 * The residual in time, as three pictures side by side.
 * @param {import('./api.js').Channel} channel
 * @param {import('./api.js').InTime} found
 */
export function inTime(channel, found) {
  const { autocorrelation, spectrum, sticks } = found;
  if (!autocorrelation)
    return h('section', { class: 'card', id: 'in-time' }, h('h2', {}, 'The residual in time'), empty(found.why ?? ''));
  return h(
    'section',
    { class: 'row', id: 'in-time', 'aria-label': 'The residual in time' },
    lasting(channel, autocorrelation),
    spectral(channel, spectrum),
    following(channel, sticks),
  );
}

/**
 * @param {import('./api.js').Channel} channel
 * @param {NonNullable<import('./api.js').InTime['autocorrelation']>} found
 */
function lasting(channel, { lag_s, correlation, lasts_s }) {
  const picture = lines({
    title: `autocorrelation of the residual of ${channel.symbol}`,
    across: { name: 'lag', unit: 's' },
    up: { name: 'correlation', unit: '1' },
    x: lag_s,
    curves: [{ name: channel.symbol, y: correlation, colour: 1, wide: true }],
    at_least: [0, 1],
    mark: { at: Math.exp(-1), text: '1/e' },
  });
  const last = lag_s[lag_s.length - 1];
  return h(
    'article',
    { class: 'card', 'data-lasts': lasts_s === null ? '' : String(lasts_s) },
    h('h2', {}, 'How long it lasts'),
    picture,
    h(
      'p',
      { class: 'quiet' },
      h('b', {}, lasts_s === null ? `More than ${measure(last, 's')}` : measure(lasts_s, 's')),
      ' until it falls to 1/e. Sensor noise drops at once, gusts in about half a second; a slow fall means that something with a memory, or with the pace of the manoeuvres, is missing.',
    ),
  );
}

/**
 * @param {import('./api.js').Channel} channel
 * @param {import('./api.js').InTime['spectrum']} found
 */
function spectral(channel, found) {
  return h(
    'article',
    { class: 'card' },
    h('h2', {}, 'Its spectrum'),
    found
      ? lines({
          title: `spectrum of the residual of ${channel.symbol}`,
          across: { name: 'frequency', unit: 'Hz' },
          up: { name: 'density', unit: `(${channel.unit})²/Hz` },
          x: found.frequency_hz,
          curves: [{ name: channel.symbol, y: found.density, colour: 1, wide: true }],
          log: true,
        })
      : empty('No stretch without a gap is long enough for a spectrum; longer flights would have one'),
    h(
      'p',
      { class: 'quiet' },
      found ? `Mean of ${found.segments} segments. ` : '',
      'A hump at the pace of the manoeuvres, below 1 Hz, is physics that is missing; a narrow peak is a vibration, or a lag near the frequencies of the stick itself.',
    ),
  );
}

/**
 * The stick that the residual follows most, in units of what chance reaches.
 * @param {import('./api.js').Following[]} sticks
 */
function follows(sticks) {
  const all = sticks.flatMap((one) =>
    one.lag_s.map((lag, index) => ({ stick: one.stick, lag, value: one.correlation[index], chance: one.band95[index] })),
  );
  const behind = all.filter(({ lag, chance }) => lag >= 0 && chance !== null && chance > 0);
  const most = behind.reduce((best, one) => (Math.abs(one.value) / Number(one.chance) > Math.abs(best.value) / Number(best.chance) ? one : best), behind[0]);
  if (!most) return '';
  return `Most of all it follows ${most.stick}: ${number(most.value, 2)} after ${measure(most.lag, 's')}, where chance reaches ±${number(most.chance, 2)}.`;
}

/**
 * @param {import('./api.js').Channel} channel
 * @param {import('./api.js').Following[]} sticks
 */
function following(channel, sticks) {
  const title = h('h2', {}, 'Whether the sticks follow it');
  if (sticks.length === 0) return h('article', { class: 'card' }, title, empty('No stick varies in these flights'));
  const stickName = (/** @type {string} */ stick) => `${stick} ${/** @type {Record<string, string>} */ (STICKS)[stick] ?? ''}`;
  const widest = sticks[0].lag_s.map((_, lag) => {
    const halves = sticks.map((one) => one.band95[lag]).filter((half) => half !== null);
    return halves.length ? Math.max(...halves) : null;
  });
  const answers = sticks.filter((one) => one.feedback_warning).map((one) => one.stick);
  return h(
    'article',
    { class: 'card', 'data-answers': answers.join(' ') },
    title,
    lines({
      title: `correlation of the sticks with the residual of ${channel.symbol}`,
      across: { name: 'lag of the residual behind the stick', unit: 's' },
      up: { name: 'correlation', unit: '1' },
      x: sticks[0].lag_s,
      curves: sticks.map((one, index) => ({
        name: stickName(one.stick),
        y: one.correlation,
        colour: [5, 2, 3, 4][index],
        dash: DASHES[index],
      })),
      band: widest,
      at_least: [-0.1, 0.1],
    }),
    h(
      'p',
      { class: answers.length ? 'rise' : 'quiet' },
      answers.length
        ? `${answers.join(', ')} ${answers.length > 1 ? 'answer' : 'answers'} to the residual: left of zero it comes first. The pilot or an autopilot corrects what the model does not know, so what this stick seems to explain need not be its effect.`
        : `Within the band all is chance (95 %). ${follows(sticks)} Right of zero the residual follows the stick, as a delay or a lag that is missing would make it. Left of zero the stick would answer to the residual: none clearly does.`,
    ),
  );
}

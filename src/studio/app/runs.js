// @ts-check
// Runs: the models and networks in the folder of the model beside the present state, with their errors on flights that no fit sees. Reads only.

import { ask } from './api.js';
import { h, prose, scroller, toggle } from './dom.js';
import { interval, measure, number, percent } from './format.js';
import { read, slide } from './place.js';

let asked = 0;

/**
 * Names of the networks that read, the newest first.
 * @param {import('./api.js').Runs} found
 */
export const networksOf = (found) => found.rows.filter((run) => run.kind === 'network' && run.error === null).map((run) => run.name);

/**
 * A row of the table: the present state, or a file.
 * @typedef {object} Row
 * @property {import('./api.js').Run | null} run none for the present state
 * @property {import('./api.js').RunErrors | null} errors
 * @property {string | null} fault why there are no errors
 */

/**
 * @param {import('./main.js').App} app
 * @param {HTMLElement} into
 */
export async function show(app, into) {
  const mine = ++asked;
  /** @type {import('./api.js').Runs} */
  const found = await ask('runs');
  const isHere = () => mine === asked && read().view === 'runs';
  if (!isHere()) return;
  /** @type {Row[]} */
  const rows = [{ run: null, errors: null, fault: null }, ...found.rows.map((run) => ({ run, errors: null, fault: run.error }))];
  const draw = () => into.replaceChildren(page(app, found, rows));
  draw();
  judge(rows, isHere, draw).catch(app.failed);
}

export function hide() {
  asked += 1;
}

/**
 * Asks for the errors of one row after the other, as networks take their time.
 * @param {Row[]} rows
 * @param {() => boolean} isHere whether the page still shows them
 * @param {() => void} draw
 */
async function judge(rows, isHere, draw) {
  for (const row of rows.filter((one) => one.fault === null)) {
    /** @type {import('./api.js').RunErrors | import('./api.js').Missing} */
    const answer = await ask('run_errors', { name: row.run?.name ?? null });
    if ('why' in answer) row.fault = answer.why;
    else row.errors = answer;
    if (!isHere()) return;
    draw();
  }
}

/**
 * @param {import('./main.js').App} app
 * @param {import('./api.js').Runs} found
 * @param {Row[]} rows
 */
function page(app, found, rows) {
  const { channels } = app.overview;
  const { channel, sort } = read();
  const key = (/** @type {number} */ index) => /** @type {keyof import('./api.js').PerChannel} */ (channels[index].symbol);
  const of = (/** @type {Row} */ row) => row.errors?.rmse[key(channel)] ?? Infinity;
  const [now, ...files] = rows;
  if (sort === 'error') files.sort((left, right) => of(left) - of(right));
  const best = channels.map((_, index) => clearlyLeast(rows, key(index)));
  const sorts = /** @type {[string, string][]} */ ([
    ['date', 'Newest first'],
    ['error', `Least error of ${channels[channel].symbol} first`],
  ]);
  const waits = rows.filter((row) => row.errors === null && row.fault === null).length;
  const bases = [...new Set(rows.flatMap((row) => (row.errors ? [row.errors.basis] : [])))];
  return h(
    'section',
    { class: 'card', id: 'runs', 'aria-label': 'Runs', 'data-waits': String(waits) },
    h('h2', {}, 'Models and networks in ', h('code', {}, found.folder)),
    h(
      'div',
      { class: 'bar' },
      toggle('Order', sorts, sort, (value) => slide({ sort: /** @type {'date' | 'error'} */ (value) })),
      h('p', { class: 'progress', role: 'status' }, waits ? h('span', { class: 'spin', 'aria-hidden': 'true' }) : null, waits ? `judging, ${waits} to go` : ''),
    ),
    scroller(
      'Runs',
      h(
        'table',
        { class: 'numbers wide runs' },
        h(
          'thead',
          {},
          h(
            'tr',
            {},
            ['run', 'written'].map((text) => h('th', { scope: 'col' }, text)),
            channels.map((one, index) =>
              h('th', { scope: 'col', title: one.name, class: index === channel ? 'chosen' : '' }, one.symbol, h('small', {}, ` ${one.unit}`)),
            ),
          ),
        ),
        h('tbody', {}, [now, ...files].map((row) => line(app, row, now, best))),
      ),
    ),
    found.why ? h('p', { class: 'rise' }, `${found.why}; save the model, and its folder is looked into.`) : null,
    files.length === 0 && !found.why
      ? h('p', { class: 'quiet' }, 'No model file (.toml) and no network (a run folder, or .safetensors) lies there: save the model, or train a network into this folder.')
      : null,
    found.left_out ? h('p', { class: 'quiet' }, `${found.left_out} older files are left out.`) : null,
    h(
      'p',
      { class: 'quiet' },
      `Root mean square errors; in bold the one whose 95 % interval lies below all others of its column; below each how it differs from the present state. ${bases.join('; ')}${bases.length ? '. ' : ''}A run that was fitted on these very flights is judged too well: what it was fitted on stands in its file.`,
    ),
  );
}

/**
 * The row whose error is less than all others' by more than their intervals, if there is one.
 * @param {Row[]} rows
 * @param {keyof import('./api.js').PerChannel} channel
 */
function clearlyLeast(rows, channel) {
  const judged = rows.flatMap((row) => {
    const ends = row.errors?.ci95[channel];
    return ends ? [{ row, ends }] : [];
  });
  const clear = judged.find((one) => judged.every((other) => other === one || one.ends[1] < other.ends[0]));
  return judged.length > 1 && clear ? clear.row : null;
}

/**
 * @param {import('./main.js').App} app
 * @param {Row} row
 * @param {Row} now the present state
 * @param {(Row | null)[]} best by channel
 */
function line(app, row, now, best) {
  const { channels } = app.overview;
  const { run, errors, fault } = row;
  const steps = app.steps.steps;
  const cell = (/** @type {import('./api.js').Channel} */ of, /** @type {number} */ index) => {
    const key = /** @type {keyof import('./api.js').PerChannel} */ (of.symbol);
    const value = errors?.rmse[key] ?? null;
    const before = now.errors?.rmse[key] ?? null;
    const change = run && before && value !== null ? value / before - 1 : null;
    const much = change !== null && Math.abs(change) >= 0.0005;
    return h(
      'td',
      { title: errors ? `${of.name}: ${measure(value, of.unit)} [${interval(errors.ci95[of.symbol])}]` : '', 'data-channel': of.symbol, 'data-rmse': value },
      best[index] === row ? h('b', {}, number(value)) : errors ? number(value) : '…',
      change === null
        ? null
        : h('small', { class: much ? (change < 0 ? 'fall' : 'rise') : 'quiet' }, much ? `${change < 0 ? '▼' : '▲'} ${percent(Math.abs(change))}` : '='),
    );
  };
  return h(
    'tr',
    { 'data-run': run ? run.name : '' },
    h(
      'th',
      { scope: 'row' },
      run ? h('code', {}, run.name) : 'the present state',
      run?.kind === 'network' ? h('span', { class: 'tag' }, 'network') : null,
      run?.open ? h('span', { class: 'tag' }, 'open') : null,
      h('small', { class: 'quiet' }, run ? run.says : steps[app.steps.at].did),
    ),
    h('td', {}, run ? new Date(1000 * run.written_s).toLocaleString(undefined, { dateStyle: 'short', timeStyle: 'short' }) : app.steps.saved ? 'saved' : 'not saved'),
    fault === null ? channels.map(cell) : h('td', { class: 'rise fault-cell', colspan: String(channels.length) }, prose(fault)),
  );
}

// @ts-check
// Where it fails: the error by manoeuvre or regime and channel, the residual over recorded variables, and below them what `remains.js` draws.

import { ask } from './api.js';
import { binned, surface } from './charts.js';
import { choice, h, toggle } from './dom.js';
import { interval, measure, number, percent } from './format.js';
import { go, read, slide } from './place.js';
import * as remains from './remains.js';

/**
 * @param {import('./main.js').App} app
 * @param {HTMLElement} into
 */
export async function show(app, into) {
  const { part, by, channel, second, variable } = read();
  const [map, dependence, regions, inTime] = await Promise.all([
    ask('map', { part, by }),
    ask('dependence', { part, channel }),
    ask('regions', { part, channel }),
    ask('in_time', { part, channel }),
  ]);
  const first =
    dependence.variables.find((/** @type {{ name: string }} */ one) => one.name === variable) ??
    dependence.variables[0];
  /** @type {import('./api.js').Surface | null} */
  const over =
    second && first && second !== first.name
      ? await ask('surface', { part, channel, variables: [first.name, second] })
      : null;
  if (read().view !== 'where') return;
  const parts = /** @type {[string, string][]} */ ([
    ['judged', 'Flights no fit sees'],
    ['all', 'All flights'],
  ]);
  const kinds = /** @type {[string, string][]} */ ([
    ['manoeuvre', 'Manoeuvre'],
    ['regime', 'Regime'],
  ]);
  // What is missing: asked at once, where nothing has been asked yet, and shown in Learn.
  const diagnose = async () => {
    try {
      const job = await ask('job');
      if (!job.diagnosis && job.progress === 'idle') await ask('diagnose');
      go({ view: 'learn' });
    } catch (error) {
      app.failed(error);
    }
  };
  into.replaceChildren(
    h(
      'div',
      { class: 'bar' },
      toggle('Part of the data', parts, part, (value) => slide({ part: /** @type {'judged' | 'all'} */ (value) })),
      toggle('Rows', kinds, by, (value) => slide({ by: /** @type {'manoeuvre' | 'regime'} */ (value) })),
      h('span', { class: 'gap' }),
      h('small', { class: 'quiet' }, 'click a cell: its worst ten seconds'),
      h('button', { type: 'button', class: 'main', id: 'to-learn', onclick: diagnose }, 'Diagnose'),
    ),
    h(
      'div',
      { class: 'columns' },
      h('div', { class: 'below' }, table(app, map), remains.regions(app.overview.channels[channel], regions)),
      variables(app, dependence, over),
    ),
    remains.inTime(app.overview.channels[channel], inTime),
  );
}

/**
 * @param {import('./main.js').App} app
 * @param {import('./api.js').ErrorMap} map
 */
function table(app, map) {
  const { channels } = app.overview;
  const { channel: chosen, by, part } = read();
  const visit = async (/** @type {string | null} */ name, /** @type {number} */ channel) => {
    try {
      const found = await ask('place', { part, by, name, channel });
      if (found) go({ view: 'compare', flight: found.flight, from: found.from_s, to: found.to_s, channel });
      else app.note('nothing is judged there');
    } catch (error) {
      app.failed(error);
    }
  };
  const cell =
    (/** @type {import('./api.js').MapRow} */ row, /** @type {string | null} */ name) =>
    (/** @type {import('./api.js').MapCell} */ one, /** @type {number} */ index) => {
      const of = channels[index];
      const says = `${of.name} in ${row.name}: ${measure(one.rmse, of.unit)}${one.ci95 ? ` [${interval(one.ci95)}]` : ''}, ${percent(one.relative)} of the channel's standard deviation; ${row.n} samples in ${row.blocks} blocks`;
      const button = h(
        'button',
        {
          type: 'button',
          title: says,
          'aria-label': says,
          'data-row': row.name,
          'data-channel': of.symbol,
          onclick: () => visit(name, index),
        },
        number(one.rmse),
      );
      button.style.backgroundColor = one.paper;
      button.style.color = one.ink;
      return h('td', { class: index === chosen ? 'chosen' : '' }, button);
    };
  const row = (/** @type {import('./api.js').MapRow} */ one, /** @type {string | null} */ name) =>
    h(
      'tr',
      {},
      h(
        'th',
        { scope: 'row', title: one.rule ?? '' },
        name ?? 'all',
        one.blocks < 5
          ? h('small', { class: 'quiet', title: 'fewer than five blocks of ten seconds: a rough guide' }, ' few')
          : null,
      ),
      h('td', { class: 'count' }, String(one.n)),
      one.cells.map(cell(one, name)),
    );
  return h(
    'section',
    { class: 'card', 'aria-label': 'Error map' },
    h('h2', {}, 'Root mean square error'),
    h(
      'div',
      { class: 'scroll' },
      h(
        'table',
        { class: 'map', id: 'map' },
        h(
          'thead',
          {},
          h(
            'tr',
            {},
            h('th', { scope: 'col' }, read().by),
            h('th', { scope: 'col' }, 'n'),
            channels.map((of) => h('th', { scope: 'col', title: of.name }, of.symbol, h('small', {}, of.unit))),
          ),
        ),
        h(
          'tbody',
          {},
          row(map.whole, null),
          map.rows.map((one) => row(one, one.name)),
        ),
      ),
    ),
    h(
      'p',
      { class: 'quiet' },
      `Dark is worse: the error over the channel's standard deviation, 1 and more being as bad as predicting the mean. ${map.basis}. ${map.caution ?? ''}`,
    ),
  );
}

/**
 * @param {import('./main.js').App} app
 * @param {import('./api.js').Dependence} dependence
 * @param {import('./api.js').Surface | null} over a second variable
 */
function variables(app, dependence, over) {
  const { channel, variable: wanted } = read();
  const of = app.overview.channels[channel];
  const variable = dependence.variables.find((one) => one.name === wanted) ?? dependence.variables[0];
  const title = h('h2', {}, `What the residual of ${of.symbol} depends on`);
  if (!variable)
    return h('section', { class: 'card' }, title, h('p', { class: 'quiet' }, 'No recorded variable varies here.'));
  const options = dependence.variables.map(
    (one) => /** @type {[string, string]} */ ([one.name, `${one.name} · ${percent(one.share)}`]),
  );
  const bar = (/** @type {typeof variable} */ one) => {
    const fill = h('i');
    fill.style.width = `${Math.max(1, (100 * one.share) / Math.max(0.01, dependence.variables[0].share))}%`;
    return h(
      'button',
      {
        type: 'button',
        'aria-pressed': String(one === variable),
        'data-variable': one.name,
        onclick: () => slide({ variable: one.name }),
      },
      h('span', {}, one.name),
      h('span', { class: 'track' }, fill),
      h('span', {}, percent(one.share)),
    );
  };
  return h(
    'section',
    { class: 'card', 'aria-label': 'Residual over a variable' },
    title,
    h(
      'div',
      { class: 'bar' },
      choice('Variable', 'variable', options, variable.name, (value) => slide({ variable: value })),
      choice(
        'and',
        'second',
        [
          ['', 'nothing more'],
          ...options
            .filter(([name]) => name !== variable.name)
            .map(([name]) => /** @type {[string, string]} */ ([name, name])),
        ],
        over ? read().second : '',
        (value) => slide({ second: value }),
      ),
    ),
    over ? surface(over, of) : binned(variable.bins, variable, of),
    h(
      'p',
      { class: 'quiet' },
      over
        ? `Mean of measured − predicted in each cell, orange above zero, blue below, full at ${measure(largest(over), of.unit)}; small where fewer than five blocks carry it. Both together account for ${percent(over.surface?.share)} of the residual.`
        : `Mean of measured − predicted in each bin with its 95 % interval from blocks of ten seconds; hollow where fewer than five blocks carry it. A flat line on zero is what a complete model leaves.`,
    ),
    h(
      'div',
      { class: 'shares', 'aria-label': 'Share of the residual by variable' },
      dependence.variables.slice(0, 8).map(bar),
    ),
  );
}

/** @param {import('./api.js').Surface} over */
function largest(over) {
  return Math.max(0, ...(over.surface?.cells ?? []).filter((cell) => !cell.thin).map((cell) => Math.abs(cell.mean)));
}

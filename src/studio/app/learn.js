// @ts-check
// Learn: the search for missing effects, watched while it runs, and what it found.

import { ask } from './api.js';
import { range } from './charts.js';
import * as curve from './curve.js';
import { diagnosisDialog } from './dialog.js';
import { h, prose } from './dom.js';
import { interval, measure, number, percent, shorter } from './format.js';
import { go, read } from './place.js';

/** How often a running search is asked how far it is, ms. */
const LOOK_MS = 300;

let timer = 0;

/**
 * @param {import('./main.js').App} app
 * @param {HTMLElement} into
 */
export async function show(app, into) {
  window.clearTimeout(timer);
  /** @type {[import('./api.js').Job, import('./api.js').Model]} */
  const [job, model] = await Promise.all([ask('job'), ask('model')]);
  if (read().view !== 'learn') return;
  const has = new Set(model.effects.filter((effect) => effect.enabled).map((effect) => effect.name));
  into.replaceChildren(control(app, job, into), job.diagnosis ? findings(app, job, has) : invitation(job));
  const runs = job.progress === 'running' || job.progress === 'stopping';
  if (runs) watch(app, into);
  else curve.draw(app, into).catch(app.failed);
}

export function hide() {
  window.clearTimeout(timer);
}

/**
 * @param {import('./main.js').App} app
 * @param {HTMLElement} into
 */
function watch(app, into) {
  timer = window.setTimeout(async () => {
    try {
      /** @type {import('./api.js').Job} */
      const job = await ask('job');
      if (read().view !== 'learn') return;
      if (job.progress !== 'running' && job.progress !== 'stopping') {
        await show(app, into);
        return;
      }
      into.querySelector('.progress')?.replaceWith(progress(job));
      watch(app, into);
    } catch (error) {
      app.failed(error);
    }
  }, LOOK_MS);
}

/** @param {import('./api.js').Job} job */
function progress(job) {
  const text = {
    idle: '',
    running: job.stage || 'starting',
    stopping: 'stopping at the next step',
    stopped: 'stopped; nothing was changed',
    failed: job.error ?? '',
    done: '',
  }[job.progress];
  const runs = job.progress === 'running' || job.progress === 'stopping';
  return h(
    'p',
    { class: 'progress', role: 'status', 'data-progress': job.progress },
    runs ? h('span', { class: 'spin', 'aria-hidden': 'true' }) : null,
    text,
    runs ? h('small', {}, ` ${job.seconds.toFixed(0)} s`) : null,
  );
}

/**
 * @param {import('./main.js').App} app
 * @param {import('./api.js').Job} job
 * @param {HTMLElement} into
 */
function control(app, job, into) {
  const runs = job.progress === 'running' || job.progress === 'stopping';
  const act = async (/** @type {'diagnose' | 'stop'} */ name) => {
    try {
      await ask(name);
    } catch (error) {
      app.failed(error);
    }
    await show(app, into);
  };
  const now = app.steps.steps[app.steps.at];
  const other =
    job.diagnosis && job.state !== now.id
      ? h('small', { class: 'quiet' }, `what is said here is of the model before: “${job.state_did}”`)
      : null;
  return h(
    'div',
    { class: 'bar' },
    runs
      ? h(
          'button',
          { type: 'button', id: 'stop', disabled: job.progress === 'stopping', onclick: () => act('stop') },
          'Stop',
        )
      : h(
          'button',
          { type: 'button', id: 'diagnose', class: 'main', onclick: () => act('diagnose') },
          job.diagnosis ? 'Diagnose again' : 'Diagnose',
        ),
    progress(job),
    h('span', { class: 'gap' }),
    other,
    job.diagnosis
      ? h('button', { type: 'button', id: 'save-diagnosis', onclick: () => diagnosisDialog(app) }, 'Save the page …')
      : null,
  );
}

/** @param {import('./api.js').Job} job */
function invitation(job) {
  if (job.progress === 'running' || job.progress === 'stopping') {
    return h(
      'p',
      { class: 'empty' },
      'Every effect of the catalogue is tried beside the model and judged on blocks of flight that its numbers have not seen. You may look at the other views meanwhile.',
    );
  }
  return h(
    'div',
    { class: 'empty' },
    h('h2', {}, 'Which physics is missing?'),
    h(
      'p',
      {},
      'Diagnose tries every effect of the catalogue beside the present model: by the error on blocks of flight that its numbers have not seen, by chance, and once more on flights that the whole search has not seen.',
    ),
    h(
      'p',
      { class: 'quiet' },
      'It takes seconds to minutes, by the length of the flights and by how much is missing; the other views go on meanwhile.',
    ),
  );
}

/**
 * @param {import('./main.js').App} app
 * @param {import('./api.js').Job} job
 * @param {Set<string>} has effects that take part already
 */
function findings(app, job, has) {
  const found = /** @type {import('./api.js').Diagnosis} */ (job.diagnosis);
  const order = (found.worth ?? []).map((worth) => worth.effect);
  const place = (/** @type {string} */ name) => (order.includes(name) ? order.indexOf(name) : order.length);
  const steps = [...found.steps].sort((left, right) => place(left.effect) - place(right.effect));
  const open = steps.filter((step) => !has.has(step.effect));
  const all =
    open.length > 1
      ? h(
          'button',
          { type: 'button', id: 'add-all', onclick: () => app.edit({ do: 'add_all' }) },
          `Add all ${open.length}`,
        )
      : null;
  return h(
    'div',
    { id: 'findings' },
    steps.length > open.length
      ? h('p', { class: 'fall', id: 'added' }, `${steps.length - open.length} of ${steps.length} in the model${open.length ? `, ${open.length} left` : ': all that was found'}.`)
      : null,
    h('div', { class: 'verdict' }, h('p', {}, steps.length > open.length ? h('b', {}, 'Before anything was added: ') : null, prose(found.summary)), all),
    steps.map((step) => effect(app, found, step, has.has(step.effect))),
    (found.unknown ?? []).map((one) => unknown(app, one)),
    found.notes.length
      ? h(
          'details',
          { class: 'card' },
          h('summary', {}, `What to know besides (${found.notes.length})`),
          h(
            'ul',
            {},
            found.notes.map((note) => h('li', {}, prose(note))),
          ),
        )
      : null,
    tried(found),
  );
}

/**
 * @param {import('./main.js').App} app
 * @param {import('./api.js').Diagnosis} found
 * @param {import('./api.js').Found} step
 * @param {boolean} isIn whether it takes part already
 */
function effect(app, found, step, isIn) {
  const worth = found.worth?.find((one) => one.effect === step.effect);
  const falls = worth
    ? Object.entries(worth.share).map(
        ([channel, share]) =>
          /** @type {[string, number, [number, number] | null]} */ ([channel, share.share, share.ci95]),
      )
    : Object.entries(step.held_out_mse_fall).map(
        ([channel, fall]) => /** @type {[string, number, [number, number] | null]} */ ([channel, fall, null]),
      );
  falls.sort((left, right) => right[1] - left[1]);
  const add = h(
    'button',
    {
      type: 'button',
      class: isIn ? '' : 'main',
      disabled: isIn,
      'data-add': step.effect,
      onclick: async () => {
        if (await app.edit({ do: 'add', effect: step.effect })) app.note(`${step.effect} added and calibrated`);
      },
    },
    isIn ? 'in the model' : 'Add',
  );
  const coefficients = step.coefficients.map((one) =>
    h(
      'tr',
      {},
      h('th', { scope: 'row' }, one.name),
      h('td', {}, measure(one.value, one.unit)),
      h('td', {}, interval(one.ci95)),
      h('td', {}, range(one.value, one.ci95, one.expected)),
      h(
        'td',
        {},
        one.expected ? `usually ${interval(one.expected)}` : '',
        one.sign === 'wrong' ? h('b', { class: 'rise' }, ' wrong sign') : null,
      ),
    ),
  );
  const parameters = step.parameters
    .filter((one) => !one.fixed)
    .map((one) =>
      h(
        'tr',
        {},
        h('th', { scope: 'row' }, one.name),
        h('td', {}, measure(one.value, one.unit)),
        h('td', {}, interval(one.profile)),
        h('td', {}, range(one.value, one.profile, null)),
        h('td'),
      ),
    );
  return h(
    'article',
    { class: 'card found', 'data-effect': step.effect },
    h(
      'header',
      {},
      h('h3', {}, step.effect),
      h('span', { class: 'tag' }, step.stability),
      h('span', { class: 'gap' }),
      h(
        'a',
        {
          href: '#',
          onclick: (/** @type {Event} */ event) => {
            event.preventDefault();
            go({ view: 'model' });
          },
        },
        'open in Model',
      ),
      add,
    ),
    h('p', {}, prose(step.meaning)),
    h(
      'div',
      { class: 'falls' },
      falls
        .slice(0, 6)
        .map(([channel, share, ci95]) =>
          h(
            'span',
            { title: ci95 ? `95 % interval ${percent(ci95[0])} … ${percent(ci95[1])}` : '' },
            h('b', {}, channel),
            ` ${percent(share)}`,
          ),
        ),
      h(
        'small',
        { class: 'quiet' },
        worth
          ? 'of the squared error on unseen flights would come back if it alone were taken out of all that was found; added by itself it brings less'
          : 'of the squared error on held-out blocks removed',
      ),
    ),
    h('div', { 'data-curve': step.effect }),
    h(
      'table',
      { class: 'numbers' },
      h('caption', {}, 'Fitted together with all that was found; without the rest it comes out otherwise'),
      h('tbody', {}, coefficients, parameters),
    ),
    h('pre', {}, shorter(step.formula)),
    step.indistinguishable.length
      ? h(
          'p',
          {},
          prose(`These flights cannot tell it from ${step.indistinguishable.join(', ')}. What would: ${step.would_tell_apart}`),
        )
      : null,
    step.fault_of_log ? h('p', { class: 'quiet' }, prose(`Or the log: ${step.fault_of_log}`)) : null,
    step.rests_on_flight ? h('p', { class: 'rise' }, `It rests on one flight: ${step.rests_on_flight}`) : null,
    h(
      'small',
      { class: 'quiet' },
      `p = ${number(step.p_value, 2)}; the best in ${percent(step.selection_frequency)} of resampled data sets`,
    ),
  );
}

/**
 * @param {import('./main.js').App} app
 * @param {NonNullable<import('./api.js').Diagnosis['unknown']>[number]} one
 */
function unknown(app, one) {
  const use = async () => {
    const channel = app.overview.channels.findIndex((of) => of.symbol === one.channel);
    if (
      await app.edit({
        do: 'formula',
        name: `suggested_${one.channel}`,
        owner: { channel },
        formula: one.suggested_formula,
      })
    )
      app.note('formula added and calibrated');
  };
  return h(
    'article',
    { class: 'card' },
    h(
      'header',
      {},
      h('h3', {}, `${one.channel}: a dependence outside the catalogue`),
      h('span', { class: 'gap' }),
      one.suggested_formula ? h('button', { type: 'button', onclick: use }, 'Add the formula') : null,
    ),
    h(
      'p',
      {},
      `Measured variables predict ${percent(one.r2)} of what is left, most of all ${one.depends_on
        .slice(0, 3)
        .map((on) => on.variable)
        .join(', ')}: ${one.shape}`,
    ),
    one.suggested_formula ? h('pre', {}, one.suggested_formula) : null,
  );
}

/** @param {import('./api.js').Diagnosis} found */
function tried(found) {
  const left = found.candidates.filter((one) => one.status !== 'accepted');
  const words = /** @type {Record<string, string>} */ ({
    negligible: 'removes too little',
    not_significant: 'could be chance',
    not_excited: 'these flights cannot show it',
    implausible: 'only with numbers that physics forbids',
    same_physics: 'the physics of one that was found',
  });
  return h(
    'details',
    { class: 'card' },
    h('summary', {}, `What was tried and not named (${left.length})`),
    h(
      'table',
      { class: 'numbers' },
      h(
        'tbody',
        {},
        left.map((one) =>
          h(
            'tr',
            {},
            h('th', { scope: 'row' }, one.effect),
            h('td', {}, words[one.status] ?? one.status),
            h('td', {}, prose(one.reason)),
          ),
        ),
      ),
    ),
  );
}

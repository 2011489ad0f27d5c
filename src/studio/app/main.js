// @ts-check
// The frame of the app: head, scores, banner, keys, and which view is shown.

import { ask } from './api.js';
import * as banner from './banner.js';
import * as compare from './compare.js';
import { keysHelp, saveDialog } from './dialog.js';
import { byId, h } from './dom.js';
import { number, percent, time } from './format.js';
import * as learn from './learn.js';
import * as model from './model.js';
import { go, read, slide, VIEWS } from './place.js';
import { repaint } from './plots.js';
import * as rollout from './rollout.js';
import * as runs from './runs.js';
import * as train from './train.js';
import * as where from './where.js';

/**
 * What all views share.
 * @typedef {object} App
 * @property {import('./api.js').Overview} overview
 * @property {import('./api.js').Steps} steps
 * @property {(edit: object) => Promise<boolean>} edit changes the model; whether it was done
 * @property {(name: string, body?: object) => Promise<boolean>} step undo, redo, go_to
 * @property {(error: unknown) => void} failed tells a person
 * @property {(text: string) => void} note says something in passing
 * @property {() => Promise<void>} refresh asks for the history again and draws anew
 */

/**
 * A view: builds itself into an element, and goes when it is told to.
 * @typedef {{ show: (app: App, into: HTMLElement) => void | Promise<void>, hide?: () => void }} View
 */

/** @type {Record<string, View>} */
const views = { compare, where, rollout, learn, model, train, runs };
const NAMES = {
  compare: 'Compare',
  where: 'Where it fails',
  rollout: 'Roll out',
  learn: 'Learn',
  model: 'Model',
  train: 'Train',
  runs: 'Runs',
};
/** What goes on while other views are looked at: the view that it belongs to, and what is said when it ends. */
const WORKS = /** @type {const} */ ([
  { of: 'search', view: 'learn', goes: ', a search runs', ended: 'Diagnose has ended: see Learn.' },
  { of: 'training', view: 'train', goes: ', a network is trained', ended: 'The network is trained: see Train.' },
]);
const THEME = 'phyture-theme';
/** How often is asked whether what is shown is still so, ms. */
const PULSE_MS = 1500;

/** @type {App} */
let app;
let shown = '';
let busy = 0;
/**
 * How far each work was at the last look.
 * @type {Record<'search' | 'training', import('./api.js').Job['progress']>}
 */
let works = { search: 'idle', training: 'idle' };

/** @param {unknown} error */
function failed(error) {
  banner.tell(error, app);
}

/** @param {string} text */
function note(text) {
  byId('note').textContent = text;
  byId('note').classList.add('on');
  window.setTimeout(() => byId('note').classList.remove('on'), 4000);
}

/**
 * Work that a person waits for.
 * @template T
 * @param {() => Promise<T>} work
 * @returns {Promise<T | null>}
 */
async function working(work) {
  busy += 1;
  document.body.classList.add('busy');
  try {
    return await work();
  } catch (error) {
    failed(error);
    return null;
  } finally {
    busy -= 1;
    if (busy === 0) document.body.classList.remove('busy');
  }
}

async function edit(/** @type {object} */ wanted) {
  return step('edit', wanted);
}

async function step(/** @type {string} */ name, /** @type {object} */ body = {}) {
  const steps = await working(() => ask(name, body));
  if (!steps) {
    // What was moved or switched on the page goes back to what is.
    await draw();
    return false;
  }
  banner.clear();
  app.steps = steps;
  await draw();
  return true;
}

async function refresh() {
  app.steps = await ask('steps');
  await draw();
}

/** Looks whether another tab, another program or a search changed what is shown, and whether the program still runs. */
async function look() {
  if (document.hidden || busy > 0) return;
  try {
    /** @type {import('./api.js').Pulse} */
    const pulse = await ask('pulse');
    if (busy > 0) return;
    if (banner.isGone()) {
      banner.isBack();
      note('The studio answers again.');
      await refresh();
      return;
    }
    for (const { of, view, ended } of WORKS) {
      if (works[of] === 'running' && pulse[of] === 'done' && read().view !== view) note(ended);
    }
    const isNew = pulse.revision !== app.steps.revision || pulse.file_changed !== app.steps.file_changed;
    if (!isNew && WORKS.every(({ of }) => pulse[of] === works[of])) return;
    works = { search: pulse.search, training: pulse.training };
    const before = app.steps;
    app.steps = await ask('steps');
    const path = (/** @type {typeof before} */ of) => JSON.stringify([of.at, of.steps.map((step) => step.id)]);
    if (path(before) === path(app.steps)) frame();
    else await draw();
  } catch (error) {
    if (!banner.isGone()) failed(error);
  }
}

async function watch() {
  await look();
  window.setTimeout(watch, PULSE_MS);
}

function head() {
  const { view } = read();
  const { steps, overview } = app;
  const tab = (/** @type {typeof VIEWS[number]} */ name, /** @type {number} */ index) =>
    h(
      'a',
      {
        href: '#',
        'data-view': name,
        'aria-current': name === view ? 'page' : null,
        title: `key ${index + 1}`,
        onclick: (/** @type {Event} */ event) => {
          event.preventDefault();
          go({ view: name });
        },
      },
      NAMES[name],
      WORKS.filter(({ of, view }) => view === name && works[of] === 'running').map(({ goes }) =>
        h('i', { class: 'spin', role: 'img', 'aria-label': goes }),
      ),
    );
  const tool = (
    /** @type {string} */ id,
    /** @type {string} */ text,
    /** @type {string} */ title,
    /** @type {boolean} */ on,
    /** @type {() => void} */ act,
  ) => h('button', { type: 'button', id, title, disabled: !on, onclick: act }, text);
  byId('head').replaceChildren(
    h('div', { class: 'brand' }, h('h1', {}, 'phyture'), h('span', { title: overview.data }, short(overview.data))),
    h('nav', { 'aria-label': 'Views' }, VIEWS.map(tab)),
    h(
      'div',
      { class: 'tools' },
      h(
        'span',
        { class: 'state', title: `${steps.steps[steps.at].did}; ${steps.file ?? 'no model file yet'}` },
        h('span', { id: 'state-name' }, steps.steps[steps.at].did),
        h('small', {}, steps.saved ? 'saved' : 'not saved'),
      ),
      tool('undo', '↶ Undo', 'key u', steps.at > 0, () => step('undo')),
      tool('redo', '↷ Redo', 'key r', steps.at < steps.steps.length - 1, () => step('redo')),
      tool('save', 'Save …', 'key s', true, () => saveDialog(app)),
      tool('theme', '◐', 'light or dark', true, theme),
      tool('help', '?', 'keys and words', true, keysHelp),
    ),
  );
  // Where the tabs are wider than the screen, the one that is shown stands in it.
  byId('head').querySelector('nav [aria-current]')?.scrollIntoView({ block: 'nearest', inline: 'nearest' });
}

/** @param {string} path */
function short(path) {
  const parts = path.split(/[\\/]/).filter(Boolean);
  return parts.slice(-2).join('/');
}

/** The six errors, on top of every view. */
function score() {
  const { channel } = read();
  const { steps, overview } = app;
  const [first, now] = [steps.steps[0], steps.steps[steps.at]];
  const cell = (/** @type {import('./api.js').Channel} */ of, /** @type {number} */ index) => {
    const key = /** @type {keyof import('./api.js').PerChannel} */ (of.symbol);
    const [before, after] = [first.rmse?.[key] ?? null, now.rmse?.[key] ?? null];
    const change = before && after !== null ? after / before - 1 : 0;
    const fell = steps.at > 0 && Math.abs(change) >= 0.0005;
    const predicted = now.r2?.[key] ?? null;
    const r2 = predicted === null ? '' : `R² ${predicted.toFixed(3)}`.replace('-', '−');
    // Learn counts squares, as they add up over effects.
    const square = fell ? `; its square ${change < 0 ? 'fell' : 'rose'} by ${percent(Math.abs((1 + change) ** 2 - 1))}` : '';
    return h(
      'button',
      {
        type: 'button',
        class: 'cell',
        'data-channel': of.symbol,
        'aria-pressed': String(index === channel),
        title: `${of.name}, root mean square error on ${app.steps.judged_on}${square}${r2 && `. ${r2}: share of the variance that is predicted`}`,
        onclick: () => slide({ channel: index }),
      },
      h('span', { class: 'what' }, h('b', {}, of.symbol), ` ${of.name.replace(' acceleration', '')}${fell ? `, was ${number(before)}` : ''}`),
      h('span', { class: 'rmse' }, number(after), h('small', {}, ` ${of.unit}`)),
      h(
        'span',
        { class: fell ? (change < 0 ? 'fall' : 'rise') : 'quiet' },
        fell ? `${change < 0 ? '▼' : '▲'} ${percent(Math.abs(change))}` : r2,
      ),
    );
  };
  byId('score').replaceChildren(
    h('h2', { class: 'unseen' }, 'Errors'),
    ...overview.channels.map(cell),
    h(
      'p',
      { class: 'basis' },
      // The head has no room for it on a narrow screen.
      h('span', { class: 'narrow' }, h('b', {}, now.did), ` (${steps.saved ? 'saved' : 'not saved'}): `),
      `Root mean square errors; ${steps.judged_on}`,
    ),
  );
}

/** All but the view. */
function frame() {
  head();
  score();
  banner.warn(app);
}

async function draw() {
  // What is shown stays until there is something to show.
  if (banner.isGone()) return;
  const { view } = read();
  frame();
  if (shown && shown !== view) views[shown].hide?.();
  shown = view;
  document.title = `${NAMES[view]} · phyture studio`;
  await working(async () => views[view].show(app, byId('main')));
}

function theme() {
  const dark = document.documentElement.dataset.theme
    ? document.documentElement.dataset.theme === 'dark'
    : matchMedia('(prefers-color-scheme: dark)').matches;
  document.documentElement.dataset.theme = dark ? 'light' : 'dark';
  localStorage.setItem(THEME, document.documentElement.dataset.theme);
  draw();
}

/** Paper is light. */
function onPaper() {
  const root = document.documentElement;
  window.addEventListener('beforeprint', () => {
    root.dataset.theme = 'light';
    repaint();
  });
  window.addEventListener('afterprint', () => {
    const before = localStorage.getItem(THEME);
    if (before) root.dataset.theme = before;
    else delete root.dataset.theme;
    repaint();
  });
}

/** @param {KeyboardEvent} event */
function key(event) {
  const target = /** @type {HTMLElement} */ (event.target);
  if (target.closest('input, textarea, select, dialog') || event.altKey) return;
  const control = event.ctrlKey || event.metaKey;
  const letter = event.key.toLowerCase();
  if (control && letter !== 'z') return;
  const { flight } = read();
  const tab = VIEWS[Number(letter) - 1];
  const acts = {
    u: () => step('undo'),
    r: () => step('redo'),
    s: () => saveDialog(app),
    '?': keysHelp,
    z: () => control && step(event.shiftKey ? 'redo' : 'undo'),
    '[': () => slide({ flight: Math.max(0, flight - 1), from: null, to: null, at: null }),
    ']': () => slide({ flight: Math.min(app.overview.flights.length - 1, flight + 1), from: null, to: null, at: null }),
  };
  const act = tab ? () => go({ view: tab }) : /** @type {Record<string, () => void>} */ (acts)[letter];
  if (act) {
    event.preventDefault();
    act();
  } else if (read().view === 'compare') {
    compare.key(event);
  } else if (read().view === 'rollout') {
    rollout.key(event);
  }
}

async function start() {
  const chosen = localStorage.getItem(THEME);
  if (chosen) document.documentElement.dataset.theme = chosen;
  try {
    const [overview, steps] = await Promise.all([ask('overview'), ask('steps')]);
    app = { overview, steps, edit, step, failed, note, refresh };
  } catch (error) {
    byId('main').replaceChildren(h('p', { class: 'quiet' }, 'Nothing can be shown.'));
    failed(error);
    return;
  }
  overviewNote();
  if (!new URLSearchParams(location.hash.slice(1)).has('channel')) slide({ channel: worst() });
  window.addEventListener('hashchange', () => draw());
  window.addEventListener('keydown', key);
  // Another tab may have changed the model, or another program its file.
  window.addEventListener('focus', look);
  // Plots are drawn in the colours of a theme: the system's may change in the evening.
  matchMedia('(prefers-color-scheme: dark)').addEventListener('change', () => draw());
  onPaper();
  await draw();
  document.body.dataset.ready = 'yes';
  watch();
}

/** The channel of which the model opened predicts the least. */
function worst() {
  const { steps, overview } = app;
  const r2 = overview.channels.map(({ symbol }) => {
    return steps.steps[steps.at].r2?.[/** @type {keyof import('./api.js').PerChannel} */ (symbol)] ?? Infinity;
  });
  return r2.indexOf(Math.min(...r2));
}

function overviewNote() {
  const { overview } = app;
  byId('score').title =
    `${overview.flights.length} flights, ${time(overview.duration_s)}; judged on ${overview.judging} (${time(overview.parts_s[1])})`;
}

start();

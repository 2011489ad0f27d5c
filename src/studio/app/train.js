// @ts-check
// Train: a network on what the present state leaves over, watched while it learns; and who explains what, once it has.

import { ask, Refused } from './api.js';
import { choice, h, prose, s, scroller } from './dom.js';
import { interval, measure, number, percent } from './format.js';
import { lines } from './lines.js';
import { go, read, slide } from './place.js';
import { networksOf } from './runs.js';

/** How often a running training is asked how far it is, ms. */
const LOOK_MS = 500;

/** Samples of history and widths that are offered. */
const HISTORIES = [64, 128, 256, 512];
const WIDTHS = [16, 32, 64];

/** More epochs than these are asked about. */
const MANY_EPOCHS = 1000;

/** The unit of a loss: squared errors summed over the channels. */
const LOSS = '(m/s²)² + (rad/s²)²';

/** Who explains: key, words, colour of the style sheet. */
const PARTS = /** @type {const} */ ([
  ['physics', 'physics', 'c1'],
  ['linear', 'linear history', 'c6'],
  ['network', 'network', 'c3'],
  ['neither', 'neither', 'none'],
]);

let timer = 0;
let asked = 0;

/**
 * @param {import('./main.js').App} app
 * @param {HTMLElement} into
 */
export async function show(app, into) {
  window.clearTimeout(timer);
  const mine = ++asked;
  // How the training stands is asked first: what it leaves behind at its end is then there, or it is looked at again.
  /** @type {import('./api.js').Training} */
  const training = await ask('training');
  if (mine !== asked) return;
  /** @type {[import('./api.js').TrainingPlan, import('./api.js').Runs]} */
  const [plan, runs] = await Promise.all([ask('training_plan'), ask('runs')]);
  const isHere = () => mine === asked && read().view === 'train';
  if (!isHere()) return;
  const goes = running(training);
  const networks = networksOf(runs);
  into.replaceChildren(
    h(
      'div',
      { class: goes ? 'train' : 'columns train' },
      goes ? null : h('div', { class: 'below' }, form(app, plan, into), unfinished(app, plan, into)),
      watched(app, training, into),
    ),
    h('section', { class: 'card', id: 'explained' }),
  );
  if (goes) watch(app, into, isHere);
  explain(app, training, networks, isHere).catch(app.failed);
}

export function hide() {
  asked += 1;
  window.clearTimeout(timer);
}

/** @param {import('./api.js').Training} training */
const running = (training) => training.progress === 'running' || training.progress === 'stopping';

/**
 * @param {import('./main.js').App} app
 * @param {HTMLElement} into
 * @param {() => boolean} isHere
 */
function watch(app, into, isHere) {
  timer = window.setTimeout(async () => {
    try {
      /** @type {import('./api.js').Training} */
      const training = await ask('training');
      if (!isHere()) return;
      if (!running(training)) return void (await show(app, into));
      into.querySelector('#training')?.replaceWith(watched(app, training, into));
      watch(app, into, isHere);
    } catch (error) {
      app.failed(error);
    }
  }, LOOK_MS);
}

/**
 * What a new run is told.
 * @param {import('./main.js').App} app
 * @param {import('./api.js').TrainingPlan} plan
 * @param {HTMLElement} into
 */
function form(app, plan, into) {
  const folder = h('input', { type: 'text', id: 'train-folder', value: plan.folder, spellcheck: 'false', autocomplete: 'off' });
  const epochs = h('input', { type: 'text', id: 'train-epochs', inputmode: 'numeric', size: '5', value: String(plan.epochs) });
  const linear = h('input', { type: 'checkbox', id: 'train-linear' });
  const told = h('p', { class: 'told', role: 'status', id: 'train-told' });
  const chosen = { history: plan.history, width: plan.width };
  const seconds = (/** @type {number} */ samples) => `${number(samples * plan.step_s)} s`;
  let asked_about = 0;
  const wrong = (/** @type {(Node | string)[]} */ ...what) => {
    told.dataset.state = 'wrong';
    told.replaceChildren(...what);
  };
  const begin = async (/** @type {'refuse' | 'replace'} */ earlier) => {
    const count = Number(epochs.value);
    if (!Number.isInteger(count) || count < 1) {
      wrong('Epochs: a whole number of 1 and more is expected.');
      return;
    }
    if (count > MANY_EPOCHS && asked_about !== count) {
      asked_about = count;
      wrong(`${count.toLocaleString('en')} epochs may take days: press Train once more if they are meant.`);
      return;
    }
    try {
      await ask('train', { folder: folder.value, ...chosen, epochs: count, linear: linear.checked, earlier });
      await show(app, into);
    } catch (error) {
      const exists = error instanceof Refused && error.kind === 'exists';
      const replace = h('button', { type: 'button', id: 'train-replace', onclick: () => begin('replace') }, 'Train anew in its place');
      wrong(error instanceof Error ? `${error.message}. ` : '', exists ? replace : '');
    }
  };
  return h(
    'form',
    {
      class: 'card',
      id: 'train-form',
      onsubmit: (/** @type {Event} */ event) => {
        event.preventDefault();
        begin('refuse');
      },
    },
    h('h2', {}, 'Train a network on what physics leaves over'),
    h(
      'p',
      { class: 'quiet' },
      'On the state “',
      app.steps.steps[app.steps.at].did,
      '”. It learns from the flights that fits see, a fifth of them in ten-second pieces validates, and the weights of the best epoch are kept. ',
      'What physics can name is better named first: see Learn.',
    ),
    h('label', { class: 'field wide', for: 'train-folder' }, h('span', {}, 'Folder'), folder),
    h(
      'div',
      { class: 'bar' },
      choice('History', 'train-history', HISTORIES.map((one) => [String(one), seconds(one)]), String(plan.history), (value) => {
        chosen.history = Number(value);
      }),
      choice('Width', 'train-width', WIDTHS.map((one) => [String(one), String(one)]), String(plan.width), (value) => {
        chosen.width = Number(value);
      }),
      h('label', { class: 'field', for: 'train-epochs' }, h('span', {}, 'Epochs'), epochs),
      h(
        'label',
        { class: 'switch', for: 'train-linear', title: 'a ridge regression of what physics leaves over on the last rows of the log, before the network' },
        linear,
        'linear history first',
      ),
    ),
    h('div', { class: 'bar' }, h('button', { type: 'submit', id: 'train', class: 'main' }, 'Train')),
    told,
  );
}

/**
 * Runs that can be gone on with.
 * @param {import('./main.js').App} app
 * @param {import('./api.js').TrainingPlan} plan
 * @param {HTMLElement} into
 */
function unfinished(app, plan, into) {
  if (plan.unfinished.length === 0) return null;
  const resume = async (/** @type {string} */ folder) => {
    try {
      await ask('train', { folder, history: 0, width: 0, epochs: 0, earlier: 'go_on' });
      await show(app, into);
    } catch (error) {
      app.failed(error);
    }
  };
  return h(
    'section',
    { class: 'card', id: 'unfinished' },
    h('h2', {}, 'Not at their end'),
    plan.unfinished.map((run) =>
      h(
        'div',
        { class: 'offer', 'data-unfinished': run.name },
        h('p', {}, h('code', {}, run.name), ` ${run.says}`, run.why ? h('small', { class: 'rise' }, ` ${run.why}`) : null),
        run.why ? null : h('button', { type: 'button', 'data-go-on': run.name, onclick: () => resume(run.folder) }, 'Go on'),
      ),
    ),
  );
}

/**
 * The run under way, or the last one.
 * @param {import('./main.js').App} app
 * @param {import('./api.js').Training} training
 * @param {HTMLElement} into
 */
function watched(app, training, into) {
  const { progress, steps, epochs, curve, trained } = training;
  if (progress === 'idle') {
    return h(
      'section',
      { class: 'card', id: 'training', 'data-progress': progress },
      h('h2', {}, 'What happens'),
      h('p', {}, 'The losses of training and validation are drawn here while it learns. It may be stopped and gone on with; a checkpoint is written every half minute. The other views go on meanwhile.'),
      h('p', { class: 'quiet' }, 'With the sizes given here it takes some minutes for an hour of flight; time left is told from the first steps on.'),
    );
  }
  const stop = async () => {
    try {
      await ask('stop_training');
    } catch (error) {
      app.failed(error);
    }
    await show(app, into);
  };
  return h(
    'section',
    { class: 'card', id: 'training', 'data-progress': progress, 'data-epochs': String(epochs[0]) },
    h(
      'header',
      {},
      h('h2', {}, h('code', {}, training.name), ` ${training.says}`),
      h('span', { class: 'gap' }),
      running(training) ? h('button', { type: 'button', id: 'train-stop', disabled: progress === 'stopping', onclick: stop }, 'Stop') : null,
    ),
    h('p', { class: 'quiet' }, 'Of the state “', training.state_did ?? '', '”', sizes(training)),
    h(
      'p',
      { class: 'progress', role: 'status', 'data-progress': progress },
      running(training) ? h('span', { class: 'spin', 'aria-hidden': 'true' }) : null,
      says(training),
    ),
    steps[1] ? bar(steps[0] / steps[1]) : null,
    curve.length > 1 ? losses(training) : null,
    trained
      ? h(
          'div',
          { class: 'bar' },
          h('button', { type: 'button', id: 'roll-network', onclick: () => go({ view: 'rollout', network: training.name }) }, 'Roll it out'),
          h('button', { type: 'button', onclick: () => go({ view: 'runs' }) }, 'Beside other runs'),
        )
      : null,
  );
}

/** @param {import('./api.js').Training} training */
function sizes({ parameters, windows }) {
  if (parameters === null) return '.';
  return `: ${parameters.toLocaleString('en')} parameters, ${windows[0].toLocaleString('en')} windows train and ${windows[1].toLocaleString('en')} validate.`;
}

/**
 * How far it is, in words.
 * @param {import('./api.js').Training} training
 */
function says({ progress, steps, epochs, loss, seconds, left_s, error, trained, gate, folder }) {
  const at = `epoch ${Math.min(epochs[0] + 1, epochs[1])} of ${epochs[1]}, step ${steps[0]} of ${steps[1]}`;
  const left = left_s === null ? '' : `, about ${roughly(left_s)} left`;
  if (progress === 'stopping') return 'stopping after this step; it saves where it is';
  if (progress === 'running') return steps[1] ? `${at}${loss === null ? '' : `, loss ${number(loss)}`}${left}` : 'reading the windows';
  if (progress === 'stopped') return `stopped after step ${steps[0]} of ${steps[1]}, and saved in ${folder}: go on whenever you like`;
  if (progress === 'failed') return error ?? '';
  if (!trained) return '';
  const validation = trained.validation_loss === null ? '' : `, validation loss ${number(trained.validation_loss)}`;
  return `trained in ${roughly(seconds)}: weights of epoch ${trained.epoch} of ${trained.curve.length}, training loss ${number(trained.training_loss)}${validation}${gate === null ? '' : `; ${gate}`}`;
}

/**
 * A time that nobody needs to the second.
 * @param {number} seconds
 */
const roughly = (seconds) => {
  if (seconds < 100) return `${Math.max(1, Math.round(seconds))} s`;
  if (seconds < 100 * 60) return `${Math.round(seconds / 60)} min`;
  return seconds < 48 * 3600 ? `${Math.round(seconds / 3600)} h` : `${Math.round(seconds / 86400)} days`;
};

/** @param {number} share */
function bar(share) {
  return h('progress', { max: '1', value: share, 'aria-label': 'share of the steps done' });
}

/** @param {import('./api.js').Training} training */
function losses({ curve }) {
  const validates = curve.some((epoch) => epoch.validation !== null);
  return lines({
    title: 'losses by epoch',
    across: { name: 'epoch', unit: '1', whole: true },
    up: { name: 'loss', unit: LOSS },
    x: curve.map((_, index) => index + 1),
    log: 'up',
    curves: [
      { name: 'training, with dropout', colour: 2, dash: '8 4', y: curve.map((epoch) => epoch.training) },
      ...(validates ? [{ name: 'validation', colour: 1, wide: true, y: curve.map((epoch) => epoch.validation) }] : []),
    ],
  });
}

/**
 * Who explains what, by the network that is chosen: the one trained here, or the newest.
 * @param {import('./main.js').App} app
 * @param {import('./api.js').Training} training
 * @param {string[]} networks
 * @param {() => boolean} isHere
 */
async function explain(app, training, networks, isHere) {
  const place = () => /** @type {HTMLElement} */ (document.getElementById('explained'));
  const { network } = read();
  const own = training.trained && networks.includes(training.name) ? training.name : networks[0];
  const name = networks.includes(network) ? network : own;
  const head = h('h2', {}, 'Who explains what');
  if (!name) {
    place().replaceChildren(
      head,
      h('p', { class: 'quiet' }, 'Once a network lies beside the model: which share of the accelerations physics explains, which only the network does, and what neither does, on flights that no fit sees.'),
    );
    return;
  }
  const which = choice('Network', 'explained-network', networks.map((one) => [one, one]), name, (value) => slide({ network: value }));
  place().replaceChildren(h('header', {}, head, which), h('p', { class: 'progress', role: 'status' }, h('span', { class: 'spin', 'aria-hidden': 'true' }), 'judging'));
  /** @type {import('./api.js').Explained | import('./api.js').Missing} */
  const found = await ask('explained', { name });
  if (!isHere()) return;
  const body = 'why' in found ? [h('p', { class: 'rise' }, prose(found.why))] : table(found, app.overview.channels);
  place().replaceChildren(h('header', {}, head, which), ...body);
  place().dataset.network = name;
}

/**
 * Shares of one channel, in the order of PARTS.
 * @param {import('./api.js').Explained} found
 * @param {keyof import('./api.js').PerChannel} key
 */
function shares({ shares: of }, key) {
  const linear = of.of_network?.linear_history[key] ?? null;
  return [of.physics[key], linear, of.of_network ? of.of_network.network_itself[key] : of.network[key], of.neither[key]];
}

/**
 * @param {import('./api.js').Explained} found
 * @param {import('./api.js').Channel[]} channels
 */
function table(found, channels) {
  const hasLinear = found.shares.of_network !== null;
  const parts = PARTS.map((part, index) => /** @type {const} */ ([...part, index])).filter(([key]) => hasLinear || key !== 'linear');
  const row = (/** @type {import('./api.js').Channel} */ { symbol, unit, name }) => {
    const key = /** @type {keyof import('./api.js').PerChannel} */ (symbol);
    const all = shares(found, key);
    const [before, after] = found.rmse.map((rmse) => rmse[key]);
    const ends = found.ci95.map((of) => of[symbol]);
    return h(
      'tr',
      { 'data-channel': symbol },
      h('th', { scope: 'row' }, h('b', {}, symbol), h('small', { class: 'quiet' }, ` ${name.replace(' acceleration', '')}`)),
      h('td', { class: 'fill' }, stacked(symbol, all, parts.slice(1))),
      parts.map(([, words, , index]) => {
        const one = all[index];
        return h('td', { title: one?.ci95 ? `${words}: 95 % interval ${percent(one.ci95[0])} … ${percent(one.ci95[1])}` : '' }, percent(one?.share));
      }),
      h('td', { title: ends[0] ? interval(ends[0]) : '' }, measure(before, unit)),
      h('td', { title: ends[1] ? interval(ends[1]) : '' }, measure(after, unit)),
    );
  };
  return [
    h('p', { class: 'quiet' }, `${found.says}. ${found.basis}.`),
    h(
      'p',
      { class: 'legend' },
      parts.slice(1).map(([, words, colour]) => h('span', {}, s('svg', { width: 14, height: 10, 'aria-hidden': 'true' }, s('rect', { class: `part ${colour}`, width: 14, height: 10 })), ` ${words}`)),
    ),
    scroller(
      'Who explains what',
      h(
        'table',
        { class: 'numbers wide explained' },
        h('caption', {}, 'Bars: who takes what of that which physics leaves. Numbers: shares of the variance of what was measured, and the root mean square error without and with the network'),
        h('thead', {}, h('tr', {}, ['acceleration', '', ...parts.map(([, words]) => words), 'physics alone', 'with network'].map((text) => (text ? h('th', { scope: 'col' }, text) : h('td'))))),
        h('tbody', {}, channels.map(row)),
      ),
    ),
    h('p', { class: 'quiet' }, '“Neither” holds noise, gusts and what neither has learned; a share below zero makes the error larger. What the network explains is physics without a name: see Learn, and train again with what is found there.'),
  ];
}

/**
 * Who takes what of that which physics leaves, as one bar; a share below zero has no length.
 * @param {string} symbol
 * @param {(import('./api.js').Share | null)[]} all
 * @param {(readonly ['physics' | 'linear' | 'network' | 'neither', string, string, number])[]} parts
 */
function stacked(symbol, all, parts) {
  const lengths = parts.map(([, , , index]) => Math.max(0, all[index]?.share ?? 0));
  const whole = lengths.reduce((sum, one) => sum + one, 0) || 1;
  let at = 0;
  const pieces = parts.map(([, words, colour, index], order) => {
    const [x, width] = [(200 * at) / whole, (200 * lengths[order]) / whole];
    at += lengths[order];
    return s('rect', { class: `part ${colour}`, x, width, y: 0, height: 14 }, s('title', {}, `${words} ${percent(all[index]?.share)}`));
  });
  const says = parts.map(([, words, , index]) => `${words} ${percent(all[index]?.share)}`).join(', ');
  return s('svg', { class: 'shares-bar', viewBox: '0 0 200 14', preserveAspectRatio: 'none', role: 'img', 'aria-label': `${symbol}: ${says}` }, pieces);
}

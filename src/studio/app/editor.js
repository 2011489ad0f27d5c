// @ts-check
// The user's own formula: checked while it is written, with a mark under the character that is wrong.

import { ask } from './api.js';
import { choice, h } from './dom.js';
import { read } from './place.js';

/** Pause after a key before a formula is checked, ms. */
const PAUSE_MS = 200;

/** What was written, kept while the app is open. */
const draft = { name: 'my_effect', owner: '', formula: '' };

/**
 * @param {string} owner
 * @returns {object}
 */
function ownerOf(owner) {
  return /^\d$/.test(owner) ? { channel: Number(owner) } : { signal: owner };
}

/** @param {import('./main.js').App} app */
export function editor(app) {
  const { channels, signals, names } = app.overview;
  if (draft.owner === '') draft.owner = String(read().channel);
  let timer = 0;
  let asked = 0;
  const told = h('p', { class: 'told', id: 'formula-told', role: 'status' });
  const caret = h('pre', { class: 'caret', 'aria-hidden': 'true' });
  const formula = h('input', {
    type: 'text',
    id: 'formula',
    value: draft.formula,
    placeholder: 'airspeed * vx',
    spellcheck: 'false',
    autocomplete: 'off',
    'aria-describedby': 'formula-told',
    oninput: () => {
      draft.formula = formula.value;
      window.clearTimeout(timer);
      timer = window.setTimeout(check, PAUSE_MS);
    },
  });
  const name = h('input', {
    type: 'text',
    id: 'formula-name',
    value: draft.name,
    spellcheck: 'false',
    autocomplete: 'off',
    oninput: () => {
      draft.name = name.value;
    },
  });
  const add = h('button', { type: 'submit', id: 'formula-add', disabled: true }, 'Add and calibrate');
  async function check() {
    const mine = ++asked;
    if (draft.formula.trim() === '') {
      tell(null);
      add.disabled = true;
      told.replaceChildren();
      return;
    }
    try {
      /** @type {import('./api.js').FormulaCheck} */
      const found = await ask('check_formula', { owner: ownerOf(draft.owner), formula: draft.formula });
      if (mine !== asked) return;
      tell(found);
    } catch (error) {
      app.failed(error);
    }
  }
  /** @param {import('./api.js').FormulaCheck | null} found */
  function tell(found) {
    const wrong = Boolean(found?.message);
    formula.setAttribute('aria-invalid', String(wrong));
    add.disabled = found === null || wrong;
    caret.replaceChildren(wrong && found?.at !== null ? `${draft.formula}\n${' '.repeat(found?.at ?? 0)}^` : '');
    told.dataset.state = found === null ? 'empty' : wrong ? 'wrong' : 'right';
    told.replaceChildren(
      wrong
        ? `${found?.message}${found?.at === null ? '' : ` (character ${(found?.at ?? 0) + 1})`}`
        : (found?.caution ?? 'the formula is right'),
    );
  }
  const owners = /** @type {[string, string][]} */ ([
    ...channels.map((of, index) => [String(index), `${of.symbol}, ${of.name}`]),
    ...signals.map(([signal, unit]) => [signal, `signal ${signal}, ${unit}`]),
  ]);
  const submit = async (/** @type {Event} */ event) => {
    event.preventDefault();
    if (await app.edit({ do: 'formula', name: draft.name, owner: ownerOf(draft.owner), formula: draft.formula })) {
      draft.formula = '';
      draft.name = 'my_effect_2';
    }
  };
  if (draft.formula) check();
  return h(
    'form',
    { class: 'card', onsubmit: submit },
    h('h2', {}, 'A formula of your own'),
    h(
      'div',
      { class: 'bar' },
      h('label', { class: 'field', for: 'formula-name' }, h('span', {}, 'Name'), name),
      choice('Adds to', 'formula-owner', owners, draft.owner, (value) => {
        draft.owner = value;
        check();
      }),
    ),
    h('label', { class: 'field wide', for: 'formula' }, h('span', {}, 'coefficient ×'), formula),
    caret,
    told,
    add,
    h(
      'details',
      {},
      h('summary', {}, 'names it may read'),
      h('p', { class: 'names' }, [...new Set([...names, ...signals.map(([signal]) => signal)])].join('  ')),
    ),
  );
}

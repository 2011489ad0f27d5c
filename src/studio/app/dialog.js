// @ts-check
// Dialogs: saving, and the keys.

import { ask, Refused } from './api.js';
import { h } from './dom.js';

/**
 * A dialog that goes when it is closed.
 * @param {string} title
 * @param {...(Node | string)} content
 */
function dialog(title, ...content) {
  const close = h('button', { type: 'button', class: 'plain', 'aria-label': 'Close', onclick: () => box.close() }, '×');
  const box = h('dialog', { 'aria-label': title }, h('header', {}, h('h2', {}, title), close), ...content);
  box.addEventListener('close', () => box.remove());
  document.body.append(box);
  box.showModal();
  return box;
}

export function keysHelp() {
  const keys = [
    ['1 … 7', 'Compare, Where it fails, Roll out, Learn, Model, Train, Runs'],
    ['u  or  Ctrl Z', 'undo'],
    ['r  or  Ctrl Shift Z', 'redo'],
    ['s', 'save'],
    ['[  ]', 'the flight before, the next'],
    ['← →', 'earlier, later (Compare, Roll out)'],
    ['+ −', 'closer, further (Compare)'],
    ['0', 'the whole flight (Compare)'],
    ['drag', 'zoom to what is marked; double click: the whole flight'],
  ];
  const words = [
    ['residual', 'measured less predicted acceleration, at each sample'],
    ['unseen', 'flights that no fit and no search is given: errors are judged on these'],
    ['95 % interval', 'from blocks of flight drawn again and again, so that neighbours in time count once'],
    ['effect', 'a piece of physics with a formula and a few numbers, which a model has or lacks'],
    ['p', 'the chance that an effect which is not there would look at least as good'],
    ['cannot tell it from', 'effects that would do nearly as well on these flights; which one it is, other flights would tell'],
    ['would come back', 'how much of the squared error is there again if this effect alone is taken out'],
  ];
  const list = (/** @type {string[][]} */ pairs, /** @type {string} */ kind) =>
    h('dl', { class: kind }, pairs.flatMap(([name, says]) => [h('dt', {}, name), h('dd', {}, says)]));
  dialog('Keys and words', list(keys, 'keys'), h('h3', {}, 'Words'), list(words, 'keys words'));
}

/** @param {import('./main.js').App} app */
export function saveDialog(app) {
  const { file } = app.steps;
  const model = row(
    app,
    'save',
    'Model file',
    file ? file.replace(/(-studio)?\.toml$/, '-studio.toml') : 'model-studio.toml',
    'The model with its numbers, for calibrate, diagnose, train. What a search found goes into a ledger beside it.',
  );
  const page = row(
    app,
    'save_page',
    'Page',
    file ? file.replace(/[^\\/]*$/, 'studio.html') : 'studio.html',
    'Measured against predicted, before the changes and now, as one file to give away.',
  );
  dialog('Save', model, page);
}

/** @param {import('./main.js').App} app */
export function diagnosisDialog(app) {
  const page = row(
    app,
    'save_diagnosis',
    'Page of the diagnosis',
    'diagnosis.html',
    'What was found, what was tried and not named, and pictures of where the model fails, as one file to give away.',
  );
  dialog('Save the page', page);
}

/**
 * @param {import('./main.js').App} app
 * @param {'save' | 'save_page' | 'save_diagnosis'} request
 * @param {string} label
 * @param {string} path
 * @param {string} says
 */
function row(app, request, label, path, says) {
  const input = h('input', {
    type: 'text',
    id: `${request}-path`,
    value: path,
    spellcheck: 'false',
    autocomplete: 'off',
  });
  const told = h('p', { class: 'told', role: 'status', id: `${request}-told` });
  const save = async (/** @type {boolean} */ overwrite) => {
    told.replaceChildren('Writing …');
    try {
      /** @type {import('./api.js').Saved} */
      const saved = await ask(request, { path: input.value, overwrite });
      const kept = saved.kept ? `; what was there is kept as ${saved.kept}` : '';
      told.replaceChildren(`Written to ${saved.file}${kept}${saved.ledger ? `; ledger: ${saved.ledger}` : ''}.`);
      await app.refresh();
    } catch (error) {
      const exists = error instanceof Refused && error.kind === 'exists';
      told.replaceChildren(
        error instanceof Error ? `${error.message}. ` : '',
        exists
          ? h('button', { type: 'button', id: `${request}-overwrite`, onclick: () => save(true) }, 'Overwrite it')
          : '',
      );
    }
  };
  const submit = (/** @type {Event} */ event) => {
    event.preventDefault();
    save(false);
  };
  return h(
    'form',
    { class: 'saving', onsubmit: submit },
    h('label', { for: input.id }, h('b', {}, label), h('small', {}, says)),
    h('div', { class: 'line' }, input, h('button', { type: 'submit', id: `${request}-do`, class: 'main' }, 'Save')),
    told,
  );
}

// @ts-check
// What a person has to know above every view: a fault, that the program is gone, a file that others changed, steps that were left unsaved.

import { Refused } from './api.js';
import { byId, h } from './dom.js';

/** Whether nobody answered last time, or somebody who does not know this page. */
let gone = false;

export const isGone = () => gone;

/**
 * Tells what went wrong.
 * @param {unknown} error
 * @param {import('./main.js').App | undefined} app
 */
export function tell(error, app) {
  const text = error instanceof Error ? error.message : String(error);
  const status = error instanceof Refused ? error.status : -1;
  const hint = {
    0: 'Start it again with the same command and open the address that it prints. Model files that were saved are as they were.',
    401: 'Open the address that the program printed; it carries a key that this page lacks.',
    403: 'The studio was perhaps started anew: open the address that it printed last.',
  }[status];
  gone = hint !== undefined;
  const kept = app?.steps.kept && gone ? ` Steps that are not saved lie in ${app.steps.kept} and are offered then.` : '';
  const stays = app && gone ? ' This page shows what it had.' : '';
  const close = h('button', { type: 'button', class: 'plain', 'aria-label': 'Close', onclick: clear }, '×');
  clear();
  byId('banner').prepend(
    h(
      'div',
      { class: 'fault', 'data-gone': gone },
      h('p', {}, h('strong', {}, text), hint ? ` ${hint}` : '', kept, stays),
      gone ? null : close,
    ),
  );
}

/** What was told goes; what lasts stays. */
export function clear() {
  byId('banner')
    .querySelectorAll('.fault:not(.lasting)')
    .forEach((told) => told.remove());
}

/** The program answers again. */
export function isBack() {
  gone = false;
  clear();
}

/**
 * What lasts: it is drawn anew with the head.
 * @param {import('./main.js').App} app
 */
export function warn(app) {
  const { overview, steps } = app;
  const lasting = steps.left.map((left) => offer(app, left));
  if (overview.fault) lasting.push(h('p', {}, `The check of the log found a fault: ${overview.check}`));
  if (steps.file_changed)
    lasting.push(
      h(
        'p',
        {},
        `${steps.file} was changed by another program since the studio read or wrote it. The model here is as it was; save it under another name, or start the studio again to read the file. Saved over it, the file is kept beside with the date.`,
      ),
    );
  if (steps.unkept) lasting.push(h('p', {}, `Steps are not kept on disk until they are saved: ${steps.unkept}`));
  const banner = byId('banner');
  banner.querySelectorAll('.lasting').forEach((old) => old.remove());
  banner.append(...lasting.map((one) => h('div', { class: 'fault lasting' }, one)));
}

/**
 * Steps that an earlier studio left unsaved.
 * @param {import('./main.js').App} app
 * @param {import('./api.js').Left} left
 */
function offer(app, left) {
  const when = new Date(1000 * left.written_s).toLocaleString();
  const count = left.steps.length === 1 ? 'One step was' : `${left.steps.length} steps were`;
  const what = [...left.steps, ...(left.search ? [`a search: ${left.search}`] : [])].join('; ');
  const says = left.fault
    ? `Steps were not saved when a studio ended (${when}), and cannot be taken up: ${left.fault}`
    : `${left.steps.length ? count : 'A search was'} not saved when a studio ended (${when}): ${what}.`;
  const body = { file: left.file };
  // What cannot be had back is asked twice.
  let asked = false;
  const away = h(
    'button',
    {
      type: 'button',
      'data-discard': left.file,
      onclick: () => {
        if (asked) app.step('discard', body);
        asked = true;
        away.replaceChildren('Throw away for good');
      },
    },
    'Throw away',
  );
  return h(
    'div',
    { class: 'offer' },
    h('p', {}, says),
    left.fault
      ? null
      : h(
          'button',
          { type: 'button', class: 'main', 'data-take-up': left.file, onclick: () => app.step('take_up', body) },
          'Take up',
        ),
    away,
  );
}

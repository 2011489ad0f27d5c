// @ts-check
// Where a person is: the view and what it shows, kept in the address, so that a reload or a second tab shows the same.

/**
 * @typedef {object} Place
 * @property {string} token secret of the running studio
 * @property {'compare' | 'where' | 'rollout' | 'learn' | 'model' | 'train' | 'runs'} view
 * @property {number} flight index
 * @property {number} channel index
 * @property {number | null} from s
 * @property {number | null} to s
 * @property {number | null} at moment from which is rolled out, s
 * @property {number} ahead how far is rolled out, s
 * @property {number | null} against state that is laid beside
 * @property {'judged' | 'all'} part
 * @property {'manoeuvre' | 'regime'} by
 * @property {'date' | 'error'} sort order of runs
 * @property {string} variable name; empty is the one on which the error depends most
 * @property {string} network a network in the folder of the model; empty is none, or the newest
 * @property {string} second name of a second variable; empty is none
 */

export const VIEWS = /** @type {const} */ (['compare', 'where', 'rollout', 'learn', 'model', 'train', 'runs']);

/** @returns {Place} */
export function read() {
  const given = new URLSearchParams(location.hash.slice(1));
  const whole = (/** @type {string} */ key) => Math.max(0, Math.trunc(Number(given.get(key) ?? 0)) || 0);
  const real = (/** @type {string} */ key) => {
    const text = given.get(key);
    return text === null || text === '' || !Number.isFinite(Number(text)) ? null : Number(text);
  };
  /**
   * @template {string} T
   * @param {string} key
   * @param {readonly T[]} known
   * @returns {T}
   */
  const oneOf = (key, known) => known.find((name) => name === given.get(key)) ?? known[0];
  return {
    token: given.get('token') ?? '',
    view: oneOf('view', VIEWS),
    flight: whole('flight'),
    channel: Math.min(5, whole('channel')),
    from: real('from'),
    to: real('to'),
    at: real('at'),
    ahead: Math.min(60, Math.max(0.05, real('ahead') ?? 1)),
    against: real('against'),
    part: oneOf('part', /** @type {const} */ (['judged', 'all'])),
    by: oneOf('by', /** @type {const} */ (['manoeuvre', 'regime'])),
    sort: oneOf('sort', /** @type {const} */ (['date', 'error'])),
    variable: given.get('variable') ?? '',
    network: given.get('network') ?? '',
    second: given.get('second') ?? '',
  };
}

/**
 * The address with some of it changed.
 * @param {Partial<Place>} change
 */
function hash(change) {
  const next = { ...read(), ...change };
  const text = new URLSearchParams();
  for (const [key, value] of Object.entries(next)) {
    if (value !== null && value !== '') text.set(key, String(value));
  }
  return `#${text}`;
}

/**
 * Goes somewhere: a step that the browser's back button takes back.
 * @param {Partial<Place>} change
 */
export function go(change) {
  location.hash = hash(change);
}

/**
 * The same without a step for the back button: for moving about in one picture.
 * @param {Partial<Place>} change
 */
export function slide(change) {
  history.replaceState(null, '', hash(change));
  window.dispatchEvent(new HashChangeEvent('hashchange'));
}

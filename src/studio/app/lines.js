// @ts-check
// Lines over one axis as SVG, with few points: correlations over lags, a spectrum, errors over a horizon. The numbers of each stand below as a table.

import { h, s, scroller } from './dom.js';
import { measure, number, ticks, tickText } from './format.js';
import { scale } from './charts.js';

/**
 * @typedef {{ name: string, y: (number | null)[], colour: number, dash?: string, wide?: boolean }} Curve a colour of the style sheet, 1 to 6; 0 is that
 *   of text
 * @typedef {{ name: string, unit: string, whole?: boolean }} Axis `whole`: it counts, and has no ticks between whole numbers
 * @typedef {object} Picture
 * @property {string} title
 * @property {Axis} across
 * @property {Axis} up
 * @property {number[]} x
 * @property {Curve[]} curves
 * @property {(number | null)[]} [band] half the width of a band about zero within which values are chance
 * @property {boolean | 'up'} [log] logarithmic axes, or the upright one alone; what is not above zero is left out
 * @property {[number, number]} [at_least] what the upright axis shows in any case
 * @property {{ at: number, text: string }} [mark] a line across at a value
 * @property {boolean} [small] a picture of a row of four
 * @property {boolean} [bare] one of several pictures that share a legend and tables
 */

/** Dashes that tell lines apart without colour. */
export const DASHES = ['', '8 4', '2 3', '10 3 2 3'];

/** @param {Axis} axis */
const named = ({ name, unit }) => (unit === '1' || unit === '' ? name : `${name}, ${unit}`);

/**
 * Ticks of a logarithmic axis: powers of ten, or 1, 2 and 5 of each where there are few.
 * @param {number} low
 * @param {number} high
 */
function decades(low, high) {
  const [first, last] = [Math.floor(Math.log10(low)), Math.ceil(Math.log10(high))];
  const steps = last - first > 3 ? [1] : [1, 2, 5];
  const all = [];
  for (let power = first; power <= last; power += 1) all.push(...steps.map((step) => step * 10 ** power));
  const within = all.filter((at) => at >= 0.999 * low && at <= 1.001 * high);
  const every = Math.ceil(within.length / 7);
  return within.filter((_, index) => index % every === 0);
}

/**
 * Range of some numbers with room above and below.
 * @param {number[]} values
 * @param {boolean} log
 * @returns {[number, number]}
 */
function extent(values, log) {
  const [low, high] = [Math.min(...values), Math.max(...values)];
  if (log) return [low / 1.3, high * 1.3];
  const room = 0.06 * (high - low || Math.abs(high) || 1);
  return [low < 0 ? low - room : low, high + room];
}

/**
 * A figure with its legend and its numbers.
 * @param {Picture} picture
 */
export function lines(picture) {
  const { x, log = false, small = false } = picture;
  const shown = (/** @type {number | null} */ value) => value !== null && Number.isFinite(value) && (!log || value > 0);
  const kept = x.map((_, index) => index).filter((index) => log !== true || x[index] > 0);
  const values = picture.curves.flatMap((curve) => kept.map((index) => curve.y[index])).filter(shown);
  const band = (picture.band ?? []).flatMap((half) => (half === null ? [] : [half, -half]));
  const all = /** @type {number[]} */ ([...values, ...band, ...(picture.at_least ?? [])]);
  if (all.length === 0 || kept.length === 0) return h('p', { class: 'quiet' }, 'Nothing finite to draw.');
  const [width, height, left, bottom, top] = small ? [300, 190, 56, 40, 10] : [420, 260, 60, 44, 12];
  const [low, high] = extent(all, log !== false);
  const same = (/** @type {number} */ value) => value;
  const [across, up] = [log === true ? Math.log10 : same, log ? Math.log10 : same];
  const flat = scale(across(x[kept[0]]), across(x[kept[kept.length - 1]]), left, width - 12);
  const rise = scale(up(low), up(high), height - bottom, top);
  const [right, base] = [width - 12, height - bottom];
  const place = { x: (/** @type {number} */ value) => flat(across(value)), y: (/** @type {number} */ value) => rise(up(value)) };
  const frame = axes(picture, place, [low, high], { left, right, base, top, height });
  const path = (/** @type {Curve} */ curve) =>
    s('path', {
      class: `curve c${curve.colour}`,
      'stroke-width': curve.wide ? 2.5 : 1.5,
      'stroke-dasharray': curve.dash || null,
      d: strokes(kept, (index) => (shown(curve.y[index]) ? [place.x(x[index]), place.y(Number(curve.y[index]))] : null)),
    });
  const svg = s(
    'svg',
    { class: 'chart', viewBox: `0 0 ${width} ${height}`, role: 'img', 'aria-label': `${picture.title}: ${says(picture)}` },
    shade(picture, kept, place, base, top),
    frame,
    picture.curves.map(path),
    readings(picture, kept, place, { left, right, base, top }),
  );
  return h(
    'figure',
    { class: 'lines', 'aria-label': picture.title },
    picture.curves.length > 1 && !picture.bare ? legend(picture.curves) : null,
    svg,
    picture.bare ? null : tables(picture),
  );
}

/**
 * The strokes of a line that breaks where there is nothing.
 * @param {number[]} kept
 * @param {(index: number) => [number, number] | null} at
 */
function strokes(kept, at) {
  let pen = 'M';
  let path = '';
  for (const index of kept) {
    const point = at(index);
    path += point ? `${pen}${point[0].toFixed(1)} ${point[1].toFixed(1)}` : '';
    pen = point ? 'L' : 'M';
  }
  return path;
}

/**
 * What a picture shows, for those who hear it: where each line begins and ends.
 * @param {Picture} picture
 */
function says(picture) {
  const { curves, up } = picture;
  const of = (/** @type {Curve} */ curve) => {
    const values = curve.y.filter((value) => value !== null);
    return `${curve.name} from ${number(values[0])} to ${measure(values[values.length - 1], up.unit)}`;
  };
  return `${named(up)} over ${named(picture.across)}; ${curves.map(of).join('; ')}`;
}

/**
 * @typedef {{ x: (value: number) => number, y: (value: number) => number }} Places
 */

/**
 * Grid, ticks and names.
 * @param {Picture} picture
 * @param {Places} place
 * @param {[number, number]} range
 * @param {{ left: number, right: number, base: number, top: number, height: number }} box
 */
function axes(picture, place, [low, high], { left, right, base, top, height }) {
  const { x, log = false, small = false } = picture;
  const first = log ? x.find((value) => value > 0) ?? x[0] : x[0];
  const last = x[x.length - 1];
  const atX = log === true ? decades(first, last) : ticks(first, last, picture.across.whole ? Math.min(6, last - first) : small ? 4 : 6);
  const atY = log ? decades(low, high) : ticks(low, high, small ? 4 : 5);
  const textX = log === true ? short : tickText(atX);
  const textY = log ? short : tickText(atY);
  return [
    ...atX.map((at) =>
      s(
        'g',
        {},
        s('line', { class: 'grid', x1: place.x(at), x2: place.x(at), y1: top, y2: base }),
        s('text', { x: place.x(at), y: base + 15, 'text-anchor': 'middle' }, textX(at)),
      ),
    ),
    ...atY.map((at) =>
      s(
        'g',
        {},
        s('line', { class: 'grid', x1: left, x2: right, y1: place.y(at), y2: place.y(at) }),
        s('text', { x: left - 6, y: place.y(at) + 4, 'text-anchor': 'end' }, textY(at)),
      ),
    ),
    !log && low < 0 ? s('line', { class: 'zero', x1: left, x2: right, y1: place.y(0), y2: place.y(0) }) : null,
    !log && first < 0 ? s('line', { class: 'zero', x1: place.x(0), x2: place.x(0), y1: top, y2: base }) : null,
    picture.mark
      ? s(
          'g',
          {},
          s('line', { class: 'mark', x1: left, x2: right, y1: place.y(picture.mark.at), y2: place.y(picture.mark.at) }),
          s('text', { x: right - 2, y: place.y(picture.mark.at) - 5, 'text-anchor': 'end' }, picture.mark.text),
        )
      : null,
    s('text', { class: 'name', x: (left + right) / 2, y: height - 6, 'text-anchor': 'middle' }, named(picture.across)),
    s(
      'text',
      { class: 'name', transform: `translate(12 ${(top + base) / 2}) rotate(-90)`, 'text-anchor': 'middle' },
      named(picture.up),
    ),
  ];
}

/**
 * A power of ten without zeros to count.
 * @param {number} value
 */
function short(value) {
  const power = Math.floor(Math.log10(value) + 1e-9);
  if (power >= -2 && power <= 3) return String(Number(value.toPrecision(2)));
  const factor = Math.round(value / 10 ** power);
  const digits = String(Math.abs(power)).replace(/\d/g, (digit) => '⁰¹²³⁴⁵⁶⁷⁸⁹'[Number(digit)]);
  return `${factor === 1 ? '' : `${factor}·`}10${power < 0 ? '⁻' : ''}${digits}`;
}

/**
 * The band about zero.
 * @param {Picture} picture
 * @param {number[]} kept
 * @param {Places} place
 * @param {number} base
 * @param {number} top
 */
function shade(picture, kept, place, base, top) {
  const { band, x } = picture;
  if (!band) return null;
  const within = (/** @type {number} */ value) => Math.min(base, Math.max(top, place.y(value)));
  const known = kept.filter((index) => band[index] !== null);
  if (known.length < 2) return null;
  const edge = (/** @type {number} */ sign) =>
    known.map((index) => `${place.x(x[index]).toFixed(1)},${within(sign * Number(band[index])).toFixed(1)}`);
  return s('polygon', { class: 'band', points: [...edge(1), ...edge(-1).reverse()].join(' ') });
}

/**
 * For the pointer: what all lines are at each place.
 * @param {Picture} picture
 * @param {number[]} kept
 * @param {Places} place
 * @param {{ left: number, right: number, base: number, top: number }} box
 */
function readings(picture, kept, place, { left, right, base, top }) {
  const { x, curves, across, up } = picture;
  const spots = kept.map((index) => place.x(x[index]));
  return kept.map((index, order) => {
    const from = order === 0 ? left : (spots[order - 1] + spots[order]) / 2;
    const to = order === spots.length - 1 ? right : (spots[order] + spots[order + 1]) / 2;
    const text = curves.map((curve) => `${curves.length > 1 ? `${curve.name} ` : ''}${measure(curve.y[index], up.unit)}`);
    return s(
      'g',
      { class: 'reading' },
      s('line', { x1: spots[order], x2: spots[order], y1: top, y2: base }),
      s(
        'rect',
        { x: from, width: Math.max(0.5, to - from), y: top, height: base - top },
        s('title', {}, `${across.name} ${measure(x[index], across.unit)}: ${text.join(', ')}`),
      ),
    );
  });
}

/** @param {Curve[]} curves */
export function legend(curves) {
  return h(
    'p',
    { class: 'legend' },
    curves.map((curve) =>
      h(
        'span',
        {},
        s(
          'svg',
          { width: 26, height: 10, 'aria-hidden': 'true' },
          s('line', {
            class: `curve c${curve.colour}`,
            'stroke-width': curve.wide ? 2.5 : 1.5,
            'stroke-dasharray': curve.dash || null,
            x1: 0,
            x2: 26,
            y1: 5,
            y2: 5,
          }),
        ),
        ` ${curve.name}`,
      ),
    ),
  );
}

/** Rows of a table at most: it is read from top to bottom. */
const ROWS = 24;

/**
 * The numbers of some pictures as tables, every k-th place where there are many; shut until they are wanted.
 * @param {...Picture} pictures
 */
export function tables(...pictures) {
  const title = pictures.length > 1 ? 'As tables' : 'As a table';
  return h('details', {}, h('summary', {}, title), pictures.map((picture) => scroller(picture.title, table(picture))));
}

/** @param {Picture} picture */
function table({ x, curves, across, up, title }) {
  const every = Math.ceil(x.length / ROWS);
  const rows = x.map((_, index) => index).filter((index) => index % every === 0 || index === x.length - 1);
  const head = [named(across), ...curves.map((curve) => (curves.length > 1 ? curve.name : named(up)))];
  return h(
    'table',
    { class: 'numbers' },
    h('caption', {}, curves.length > 1 ? `${title}, ${up.unit}` : title),
    h('thead', {}, h('tr', {}, head.map((text) => h('th', { scope: 'col' }, text)))),
    h(
      'tbody',
      {},
      rows.map((index) =>
        h(
          'tr',
          {},
          h('th', { scope: 'row' }, number(x[index])),
          curves.map((curve) => h('td', {}, number(curve.y[index]))),
        ),
      ),
    ),
  );
}

// @ts-check
// Small pictures as SVG: the residual over a variable, an interval beside its usual range, the errors over the steps.

import { h, s } from './dom.js';
import { interval, measure, number, percent, ticks, tickText } from './format.js';

/**
 * A scale from numbers to pixels.
 * @param {number} low
 * @param {number} high
 * @param {number} from
 * @param {number} to
 */
export function scale(low, high, from, to) {
  const size = high > low ? high - low : 1;
  return (/** @type {number} */ value) => from + ((value - low) / size) * (to - from);
}

/**
 * Means of the residual in bins of a variable, with their intervals; thin bins hollow.
 * @param {import('./api.js').Bin[]} bins
 * @param {{ name: string, unit: string }} variable
 * @param {import('./api.js').Channel} channel
 * @param {{ after: import('./api.js').Bin[], change: import('./api.js').Bin[] }} [found] what is left with what was found, and the change of the
 *   prediction
 */
export function binned(bins, variable, channel, found) {
  const [width, height, left, bottom, top] = [520, 290, 60, 44, 12];
  // Bins that few blocks carry have intervals that would leave nothing of the rest.
  const ends = bins.flatMap((bin) => (bin.ci95 && bin.blocks >= 5 ? bin.ci95 : [bin.mean]));
  ends.push(...(found?.change ?? []).map((bin) => bin.mean));
  const [low, high] = [Math.min(0, ...ends), Math.max(0, ...ends)];
  const room = 0.08 * (high - low || 1);
  const [first, last] = [bins[0].at, bins[bins.length - 1].at];
  const x = scale(first, last, left + 14, width - 14);
  const y = scale(low - room, high + room, height - bottom, top);
  const within = (/** @type {number} */ value) => Math.min(height - bottom, Math.max(top, y(value)));
  const dot = (/** @type {import('./api.js').Bin} */ bin) =>
    s(
      'g',
      {},
      bin.ci95
        ? s('line', {
            class: 'whisker',
            x1: x(bin.at),
            x2: x(bin.at),
            y1: within(bin.ci95[0]),
            y2: within(bin.ci95[1]),
          })
        : null,
      s(
        'circle',
        { class: bin.blocks < 5 ? 'thin' : 'dot', cx: x(bin.at), cy: y(bin.mean), r: 4 },
        s(
          'title',
          {},
          `${variable.name} ${measure(bin.at, variable.unit)}: ${measure(bin.mean, channel.unit)} [${interval(bin.ci95)}], ${bin.n} samples in ${bin.blocks} blocks`,
        ),
      ),
    );
  const [atX, atY] = [ticks(first, last, 7), ticks(low - room, high + room, 5)];
  const [textX, textY] = [tickText(atX), tickText(atY)];
  const across = atX.map((at) =>
    s(
      'g',
      {},
      s('line', { class: 'grid', x1: x(at), x2: x(at), y1: top, y2: height - bottom }),
      s('text', { x: x(at), y: height - bottom + 16, 'text-anchor': 'middle' }, textX(at)),
    ),
  );
  const up = atY.map((at) =>
    s(
      'g',
      {},
      s('line', { class: 'grid', x1: left, x2: width - 4, y1: y(at), y2: y(at) }),
      s('text', { x: left - 6, y: y(at) + 4, 'text-anchor': 'end' }, textY(at)),
    ),
  );
  const title = `mean of measured − predicted ${channel.symbol} over ${variable.name}`;
  return s(
    'svg',
    { class: 'chart', viewBox: `0 0 ${width} ${height}`, role: 'img', 'aria-label': title },
    across,
    up,
    s('line', { class: 'zero', x1: left, x2: width - 4, y1: y(0), y2: y(0) }),
    found ? null : s('polyline', { class: 'mean', points: bins.map((bin) => `${x(bin.at)},${y(bin.mean)}`).join(' ') }),
    bins.map(dot),
    found?.after.map((bin) =>
      s(
        'rect',
        { class: 'left-over', x: x(bin.at) - 3.5, y: within(bin.mean) - 3.5, width: 7, height: 7 },
        s('title', {}, `left with what was found: ${measure(bin.mean, channel.unit)} [${interval(bin.ci95)}]`),
      ),
    ),
    found ? s('polyline', { class: 'curve c2', 'stroke-width': 2, 'stroke-dasharray': '8 4', points: found.change.map((bin) => `${x(bin.at)},${within(bin.mean)}`).join(' ') }) : null,
    s(
      'text',
      { class: 'name', x: (left + width) / 2, y: height - 6, 'text-anchor': 'middle' },
      variable.unit === '1' ? variable.name : `${variable.name}, ${variable.unit}`,
    ),
    s(
      'text',
      { class: 'name', transform: `translate(14 ${(height - bottom) / 2}) rotate(-90)`, 'text-anchor': 'middle' },
      `residual of ${channel.symbol}, ${channel.unit}`,
    ),
  );
}

/**
 * Means of the residual in cells of two variables: orange above the prediction, blue below; small where few blocks carry a cell.
 * @param {import('./api.js').Surface} over
 * @param {import('./api.js').Channel} channel
 */
export function surface(over, channel) {
  const found = over.surface;
  if (!found) return h('p', { class: 'quiet' }, 'These two variables hardly vary here.');
  const [width, height, left, bottom, top] = [520, 330, 60, 44, 8];
  const [xs, ys] = found.edges;
  const x = scale(xs[0], xs[xs.length - 1], left, width - 12);
  const y = scale(ys[0], ys[ys.length - 1], height - bottom, top);
  const most = Math.max(...found.cells.filter((cell) => !cell.thin).map((cell) => Math.abs(cell.mean)), 1e-12);
  const cell = (/** @type {typeof found.cells[number]} */ one) => {
    const [x0, x1, y0, y1] = [x(xs[one.column]), x(xs[one.column + 1]), y(ys[one.row + 1]), y(ys[one.row])];
    const shrink = one.thin ? 0.25 : 0;
    const rect = s(
      'rect',
      {
        class: one.mean < 0 ? 'below' : 'above',
        x: x0 + shrink * (x1 - x0) + 0.5,
        y: y0 + shrink * (y1 - y0) + 0.5,
        width: (1 - 2 * shrink) * (x1 - x0) - 1,
        height: (1 - 2 * shrink) * (y1 - y0) - 1,
        'fill-opacity': Math.max(0.06, Math.min(1, Math.abs(one.mean) / most)).toFixed(3),
      },
      s(
        'title',
        {},
        `${number(one.mean)} ${channel.unit} [${interval(one.ci95)}], ${one.n} rows in ${one.blocks} blocks`,
      ),
    );
    return rect;
  };
  const [atX, atY] = [ticks(xs[0], xs[xs.length - 1], 7), ticks(ys[0], ys[ys.length - 1], 5)];
  const [textX, textY] = [tickText(atX), tickText(atY)];
  const named = (/** @type {number} */ index) =>
    over.units[index] === '1' || over.units[index] === ''
      ? found.variables[index]
      : `${found.variables[index]}, ${over.units[index]}`;
  return s(
    'svg',
    {
      class: 'chart',
      viewBox: `0 0 ${width} ${height}`,
      role: 'img',
      'aria-label': `mean of measured − predicted ${channel.symbol} over ${found.variables.join(' and ')}`,
    },
    found.cells.map(cell),
    atX.map((at) => s('text', { x: x(at), y: height - bottom + 16, 'text-anchor': 'middle' }, textX(at))),
    atY.map((at) => s('text', { x: left - 6, y: y(at) + 4, 'text-anchor': 'end' }, textY(at))),
    s('text', { class: 'name', x: (left + width) / 2, y: height - 6, 'text-anchor': 'middle' }, named(0)),
    s(
      'text',
      { class: 'name', transform: `translate(14 ${(height - bottom) / 2}) rotate(-90)`, 'text-anchor': 'middle' },
      named(1),
    ),
  );
}

/**
 * A number with its interval in what is usual.
 * @param {number} value
 * @param {[number, number] | null | undefined} ci95
 * @param {[number, number] | null | undefined} usual
 */
export function range(value, ci95, usual) {
  const places = [value, 0, ...(ci95 ?? []), ...(usual ?? [])];
  const x = scale(Math.min(...places), Math.max(...places), 6, 154);
  const says = `${number(value)}${ci95 ? `, interval ${interval(ci95)}` : ''}${usual ? `, usually ${interval(usual)}` : ''}`;
  return s(
    'svg',
    { class: 'range', viewBox: '0 0 160 18', role: 'img', 'aria-label': says },
    s('title', {}, says),
    s('line', { class: 'grid', x1: 4, x2: 156, y1: 9, y2: 9 }),
    usual
      ? s('rect', { class: 'usual', x: x(usual[0]), width: Math.max(2, x(usual[1]) - x(usual[0])), y: 4, height: 10 })
      : null,
    s('line', { class: 'zero', x1: x(0), x2: x(0), y1: 2, y2: 16 }),
    ci95 ? s('line', { class: 'whisker', x1: x(ci95[0]), x2: x(ci95[1]), y1: 9, y2: 9 }) : null,
    s('circle', { class: 'dot', cx: x(value), cy: 9, r: 3.5 }),
  );
}

/**
 * The error of one channel over the steps taken.
 * @param {import('./api.js').Channel} channel
 * @param {import('./api.js').Step[]} steps up to the present one
 * @param {boolean} chosen
 * @param {() => void} choose
 */
export function waterfall(channel, steps, chosen, choose) {
  const key = /** @type {keyof import('./api.js').PerChannel} */ (channel.symbol);
  const shown = steps.filter((step) => step.rmse?.[key] !== null && step.rmse !== null).slice(-12);
  const values = shown.map((step) => step.rmse?.[key] ?? 0);
  const ends = shown.map((step) => step.ci95?.[channel.symbol] ?? null);
  const high = Math.max(...values, ...ends.flatMap((end) => (end ? [end[1]] : []))) || 1;
  const [width, height, left, bottom, top] = [250, 120, 40, 18, 10];
  const y = scale(0, high * 1.05, height - bottom, top);
  const pitch = (width - left - 4) / Math.max(shown.length, 3);
  const bar = (/** @type {import('./api.js').Step} */ step, /** @type {number} */ index) => {
    const x = left + index * pitch + 0.15 * pitch;
    const end = ends[index];
    return s(
      'g',
      {},
      s('title', {}, `${step.did}: ${measure(values[index], channel.unit)} [${interval(end)}]`),
      s('rect', {
        class: index === shown.length - 1 ? 'bar now' : 'bar',
        x,
        width: 0.7 * pitch,
        y: y(values[index]),
        height: height - bottom - y(values[index]),
      }),
      end
        ? s('line', { class: 'whisker', x1: x + 0.35 * pitch, x2: x + 0.35 * pitch, y1: y(end[0]), y2: y(end[1]) })
        : null,
      s('text', { x: x + 0.35 * pitch, y: height - 5, 'text-anchor': 'middle' }, String(steps.indexOf(step) + 1)),
    );
  };
  const places = ticks(0, high, 3);
  const text = tickText(places);
  const grid = places.map((at) =>
    s(
      'g',
      {},
      s('line', { class: 'grid', x1: left, x2: width, y1: y(at), y2: y(at) }),
      s('text', { x: left - 4, y: y(at) + 4, 'text-anchor': 'end' }, text(at)),
    ),
  );
  const [first, now] = [values[0], values[values.length - 1]];
  const change = first ? now / first - 1 : 0;
  return h(
    'button',
    {
      type: 'button',
      class: 'fallbox',
      'aria-pressed': String(chosen),
      onclick: choose,
      'data-channel': channel.symbol,
      'data-rmse': String(now),
    },
    h(
      'span',
      {},
      h('b', {}, channel.symbol),
      ` ${channel.unit}`,
      h(
        'em',
        { class: change < -0.0005 ? 'fall' : change > 0.0005 ? 'rise' : 'quiet' },
        Math.abs(change) < 0.0005 ? '' : `${change < 0 ? '▼' : '▲'} ${percent(Math.abs(change))}`,
      ),
    ),
    s(
      'svg',
      {
        class: 'chart',
        viewBox: `0 0 ${width} ${height}`,
        role: 'img',
        'aria-label': `${channel.name}: root mean square error from ${number(first)} to ${number(now)} ${channel.unit} over ${shown.length} steps`,
      },
      grid,
      shown.map(bar),
    ),
  );
}

// @ts-check
// Lines over time, by uPlot: measured and predicted, the residual, the sticks, on one time axis with one cursor.

import uPlot from './vendor/uPlot.esm.js';
import { h } from './dom.js';
import { number } from './format.js';

/** Colours of this theme, as the style sheet has them. */
export function colours() {
  const style = getComputedStyle(document.documentElement);
  const of = (/** @type {string} */ name) => style.getPropertyValue(name).trim();
  return {
    ink: of('--ink'),
    quiet: of('--quiet'),
    grid: of('--grid'),
    lines: [1, 2, 3, 4, 5, 6].map((index) => of(`--line-${index}`)),
  };
}

/** Pictures that are shown: their colours are asked for each time they are drawn. @type {Set<uPlot>} */
const shown = new Set();

/** Draws all again, in the colours that the style sheet has now: for paper, before it is printed. */
export function repaint() {
  shown.forEach((made) => made.redraw(false, true));
}

const DASHES = [[], [8, 4], [2, 3], [10, 3, 2, 3]];
const STICKS = ['u1 lateral', 'u2 longitudinal', 'u3 tail', 'u4 collective'];

/**
 * Pixels that the time axis has of a width: axis and margins take the rest.
 * @param {number} width
 */
export function timeWidth(width) {
  return Math.max(100, Math.floor(width) - 76);
}

/**
 * @typedef {object} Stack
 * @property {(trace: import('./api.js').Trace) => void} draw
 * @property {() => void} destroy
 * @property {() => number} width pixels of the time axis
 */

/**
 * @typedef {{ label: string, stroke: () => string, width?: number, dash?: number[] }} Line
 */

/**
 * What a person may do in a picture.
 * @typedef {object} Acts
 * @property {(from: number, to: number) => void} zoom
 * @property {() => void} whole
 * @property {'all' | 'residual'} [which] of the pictures
 * @property {(at: number) => void} [pick] a moment is clicked
 * @property {[number, number]} [mark] a stretch that is marked
 */

/**
 * @param {string} title
 * @param {number} height
 * @param {Line[]} lines
 * @param {string} unit
 * @param {boolean} last whether it carries the time axis
 * @param {Acts} acts
 */
function plot(title, height, lines, unit, last, { zoom, whole, pick, mark }) {
  const grid = () => colours().grid;
  const axis = {
    stroke: () => colours().quiet,
    grid: { stroke: grid, width: 1 },
    ticks: { stroke: grid, width: 1 },
    font: '12px system-ui, sans-serif',
  };
  const holder = h('figure', { class: 'plot', 'aria-label': title });
  const text = (/** @type {any} */ _plot, /** @type {number | null} */ value) =>
    value === null || value === undefined ? '–' : number(value, 4);
  const time = {
    label: 't',
    value: (/** @type {any} */ _plot, /** @type {number | null} */ value) =>
      value === null || value === undefined ? '–' : `${value.toFixed(2)} s`,
  };
  const made = new uPlot(
    {
      width: 600,
      height,
      scales: { x: { time: false } },
      cursor: {
        sync: { key: 'time' },
        drag: { x: true, y: false, setScale: false },
        points: { size: 5 },
        bind: {
          dblclick: () => () => {
            whole();
            return null;
          },
        },
      },
      legend: { live: true },
      axes: [
        {
          ...axis,
          size: last ? 44 : 12,
          label: last ? 'time, s' : undefined,
          labelSize: 18,
          labelFont: '12px system-ui, sans-serif',
          values: last ? undefined : () => [],
        },
        { ...axis, size: 58, label: `${title}, ${unit}`, labelSize: 18, labelFont: '12px system-ui, sans-serif' },
      ],
      series: [
        time,
        ...lines.map((line) => ({
          label: line.label,
          stroke: line.stroke,
          width: line.width ?? 1.25,
          dash: line.dash,
          value: text,
          points: { show: false },
        })),
      ],
      hooks: {
        setSelect: [
          (/** @type {any} */ self) => {
            const { left, width } = self.select;
            if (width > 4) zoom(self.posToVal(left, 'x'), self.posToVal(left + width, 'x'));
            self.setSelect({ left: 0, width: 0, top: 0, height: 0 }, false);
          },
        ],
        drawClear: mark ? [(/** @type {any} */ self) => shade(self, mark)] : [],
      },
    },
    [[], ...lines.map(() => [])],
    holder,
  );
  shown.add(made);
  if (pick) picks(made.over, (left) => pick(made.posToVal(left, 'x')));
  return { holder, made };
}

/**
 * Marks a stretch behind the lines.
 * @param {any} self
 * @param {[number, number]} mark
 */
function shade(self, [from, to]) {
  const { left, top, width, height } = self.bbox;
  const inside = (/** @type {number} */ at) => Math.min(left + width, Math.max(left, self.valToPos(at, 'x', true)));
  const [start, end] = [inside(from), inside(to)];
  self.ctx.save();
  self.ctx.fillStyle = colours().lines[1];
  self.ctx.globalAlpha = 0.25;
  self.ctx.fillRect(start, top, Math.max(3 * devicePixelRatio, end - start), height);
  self.ctx.restore();
}

/**
 * A click that is no drag.
 * @param {HTMLElement} over
 * @param {(left: number) => void} pick
 */
function picks(over, pick) {
  let pressed = 0;
  over.addEventListener('mousedown', (event) => (pressed = event.clientX));
  over.addEventListener('click', (event) => {
    if (Math.abs(event.clientX - pressed) < 4) pick(event.clientX - over.getBoundingClientRect().left);
  });
}

/**
 * The three pictures of a stretch of flight.
 * @param {HTMLElement} into
 * @param {import('./api.js').Channel} channel
 * @param {string} now what the present state is called
 * @param {string | null} against what the other state is called
 * @param {Acts} acts
 * @returns {Stack}
 */
export function stack(into, channel, now, against, acts) {
  const ink = () => colours().ink;
  const line = (/** @type {number} */ index) => () => colours().lines[index];
  const other = against === null ? [] : [{ label: against, stroke: line(1), dash: DASHES[1] }];
  const all = (acts.which ?? 'all') === 'all';
  // All three on one screen: what is left of the window below head and controls, less a legend each.
  const left = Math.max(360, Math.min(820, window.innerHeight - 330));
  const [tall, middle, low] = [0.46, 0.26, 0.28].map((share) => Math.round(share * left));
  const top = all
    ? [
        plot(
          channel.symbol,
          tall,
          [{ label: 'measured', stroke: ink, width: 1.5 }, { label: now, stroke: line(0) }, ...other],
          channel.unit,
          false,
          acts,
        ),
      ]
    : [];
  const residual = plot(
    'residual',
    all ? middle : 170,
    [
      { label: `measured − ${now}`, stroke: line(0) },
      ...other.map((one) => ({ ...one, label: `measured − ${against}` })),
    ],
    channel.unit,
    !all,
    acts,
  );
  const sticks = all
    ? [
        plot(
          'sticks',
          low,
          STICKS.map((label, index) => ({ label, stroke: line([4, 1, 2, 3][index]), dash: DASHES[index] })),
          '1',
          true,
          acts,
        ),
      ]
    : [];
  const plots = [...top, residual, ...sticks];
  into.replaceChildren(...plots.map((one) => one.holder));
  const width = () => Math.max(200, Math.floor(into.clientWidth));
  const resize = () => plots.forEach((one) => one.made.setSize({ width: width(), height: one.made.height }));
  const watch = new ResizeObserver(resize);
  watch.observe(into);
  return {
    draw(trace) {
      const { t } = trace;
      /** @type {(number | null)[][][]} */
      const sets = [
        ...top.map(() => [t, trace.measured, trace.predicted, ...(trace.against ? [trace.against] : [])]),
        [t, trace.residual, ...(trace.against_residual ? [trace.against_residual] : [])],
        ...sticks.map(() => [t, ...trace.sticks]),
      ];
      plots.forEach((one, index) =>
        one.made.setData(/** @type {uPlot.AlignedData} */ (/** @type {unknown} */ (sets[index]))),
      );
      // The key names no line that is not there.
      into.classList.toggle('alone', other.length > 0 && !trace.against?.length);
      resize();
    },
    destroy() {
      watch.disconnect();
      plots.forEach((one) => {
        shown.delete(one.made);
        one.made.destroy();
      });
    },
    width: () => timeWidth(into.clientWidth),
  };
}

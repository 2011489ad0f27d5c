// @ts-check
// Numbers and units for a person.

/**
 * Three significant digits, without an exponent where that is readable.
 * @param {number | null | undefined} value
 * @param {number} [digits]
 */
export function number(value, digits = 3) {
  if (value === null || value === undefined || !Number.isFinite(value)) return '–';
  if (value === 0) return '0';
  const size = Math.abs(value);
  if (size >= 1e5 || size < 1e-4) return value.toExponential(digits - 1).replace('-', '−');
  const places = Math.max(0, digits - 1 - Math.floor(Math.log10(size)));
  return value.toFixed(Math.min(places, 8)).replace('-', '−');
}

/**
 * With its unit; `1` is none.
 * @param {number | null | undefined} value
 * @param {string} unit
 */
export function measure(value, unit) {
  return unit === '1' || unit === '' ? number(value) : `${number(value)} ${unit}`;
}

/**
 * A share as per cent.
 * @param {number | null | undefined} share
 */
export function percent(share) {
  if (share === null || share === undefined || !Number.isFinite(share)) return '–';
  const value = 100 * share;
  return `${Math.abs(value) < 9.95 ? value.toFixed(1) : value.toFixed(0)} %`.replace('-', '−');
}

/**
 * An interval.
 * @param {[number, number] | null | undefined} ends
 */
export function interval(ends) {
  return ends ? `${number(ends[0])} … ${number(ends[1])}` : '';
}

/**
 * A formula with its numbers cut to five digits.
 * @param {string} text
 */
export function shorter(text) {
  return text.replace(/\d+\.\d{5,}(e-?\d+)?/g, (found) => String(Number(Number(found).toPrecision(5))));
}

/**
 * A time of flight.
 * @param {number} seconds
 */
export function time(seconds) {
  return seconds >= 600 ? `${(seconds / 60).toFixed(0)} min` : `${number(seconds)} s`;
}

/**
 * Ticks as text, all with the places that the finest of them needs.
 * @param {number[]} places
 * @returns {(value: number) => string}
 */
export function tickText(places) {
  const step = places.length > 1 ? Math.abs(places[1] - places[0]) : 1;
  const digits = step >= 1 ? 0 : Math.min(6, Math.ceil(-Math.log10(step) - 1e-9));
  return (value) => (Math.abs(value) < 1e-9 * step ? '0' : value.toFixed(digits).replace('-', '−'));
}

/**
 * Round ticks over a range.
 * @param {number} low
 * @param {number} high
 * @param {number} wanted
 * @returns {number[]}
 */
export function ticks(low, high, wanted) {
  const raw = (high - low) / Math.max(1, wanted);
  if (!(raw > 0) || !Number.isFinite(raw)) return [low];
  const power = 10 ** Math.floor(Math.log10(raw));
  const step = [1, 2, 5, 10].map((factor) => factor * power).find((size) => size >= raw) ?? 10 * power;
  const found = [];
  for (let index = Math.ceil(low / step); index * step <= high + 1e-9 * step; index += 1) found.push(index * step);
  return found;
}

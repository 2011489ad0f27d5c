// @ts-check
// Elements, made in one call. Text is always set as text, never as markup.

/**
 * @typedef {Node | string | number | null | undefined | false} Child
 * @typedef {Record<string, any>} Props
 */

/**
 * Sets attributes, properties and listeners: `onclick` and the like are listeners, `class` and `data-…` attributes, the rest by kind.
 * @param {Element} element
 * @param {Props} props
 */
function dress(element, props) {
  for (const [name, value] of Object.entries(props)) {
    if (value === null || value === undefined || value === false) continue;
    if (name.startsWith('on')) element.addEventListener(name.slice(2), value);
    else if (name === 'value' || name === 'checked' || name === 'selected') /** @type {any} */ (element)[name] = value;
    else element.setAttribute(name, value === true ? '' : String(value));
  }
}

/**
 * @param {Element} element
 * @param {(Child | Child[])[]} children
 */
function fill(element, children) {
  for (const child of children.flat()) {
    if (child === null || child === undefined || child === false) continue;
    element.append(child instanceof Node ? child : String(child));
  }
}

/**
 * An HTML element.
 * @template {keyof HTMLElementTagNameMap} T
 * @param {T} tag
 * @param {Props} [props]
 * @param {...(Child | Child[])} children
 * @returns {HTMLElementTagNameMap[T]}
 */
export function h(tag, props = {}, ...children) {
  const element = document.createElement(tag);
  fill(element, children);
  dress(element, props);
  return element;
}

/**
 * A sentence in which what stands between backticks is code: names of effects, columns, formulas.
 * @param {string} text
 * @returns {Child[]}
 */
export function prose(text) {
  return text.split('`').map((part, index) => (index % 2 === 1 ? h('code', {}, part) : part));
}

/**
 * An SVG element.
 * @param {string} tag
 * @param {Props} [props]
 * @param {...(Child | Child[])} children
 * @returns {SVGElement}
 */
export function s(tag, props = {}, ...children) {
  const element = document.createElementNS('http://www.w3.org/2000/svg', tag);
  fill(element, children);
  dress(element, props);
  return element;
}

/**
 * The element with an id, which the page has.
 * @param {string} id
 * @returns {HTMLElement}
 */
export function byId(id) {
  const found = document.getElementById(id);
  if (!found) throw new Error(`the page has no #${id}`);
  return found;
}

/**
 * A choice.
 * @param {string} label
 * @param {string} id
 * @param {[string, string][]} options value and text
 * @param {string} value
 * @param {(value: string) => void} chosen
 */
export function choice(label, id, options, value, chosen) {
  const select = h(
    'select',
    { id, onchange: () => chosen(select.value) },
    options.map(([key, text]) => h('option', { value: key }, text)),
  );
  select.value = value;
  return h('label', { class: 'field', for: id }, h('span', {}, label), select);
}

/**
 * Two or more buttons of which one is pressed.
 * @param {string} label
 * @param {[string, string][]} options
 * @param {string} value
 * @param {(value: string) => void} chosen
 */
export function toggle(label, options, value, chosen) {
  const button = (/** @type {[string, string]} */ [key, text]) =>
    h(
      'button',
      { type: 'button', 'aria-pressed': String(key === value), 'data-key': key, onclick: () => chosen(key) },
      text,
    );
  return h('div', { class: 'toggle', role: 'group', 'aria-label': label }, options.map(button));
}

/**
 * What is wider than its place and is moved sideways there, by keys as well.
 * @param {string} label
 * @param {...Child} content
 */
export function scroller(label, ...content) {
  return h('div', { class: 'scroll', tabindex: '0', role: 'group', 'aria-label': label }, ...content);
}

"use strict";
// The page is whole without this. Here: tables that sort, legends that hide a line, and in linked figures a cross-hair that reads the values
// under it and a zoom along the common horizontal axis, by pointer and by keys.

const number = (text) => {
  const found = text.replace(/−/g, "-").match(/-?\d+(\.\d+)?(e-?\d+)?/);
  return found ? Number(found[0]) : NaN;
};

for (const table of document.querySelectorAll("table")) {
  const body = table.tBodies[0];
  if (!body || body.rows.length < 3) continue;
  table.querySelectorAll("thead th").forEach((head, column) => {
    const button = document.createElement("button");
    button.type = "button";
    button.title = "sort";
    button.append(...head.childNodes);
    head.append(button);
    button.addEventListener("click", () => {
      const up = head.getAttribute("aria-sort") !== "ascending";
      for (const other of table.querySelectorAll("thead th")) other.removeAttribute("aria-sort");
      head.setAttribute("aria-sort", up ? "ascending" : "descending");
      const key = (row) => row.cells[column].textContent.trim();
      const order = (a, b) => {
        const [x, y] = [number(key(a)), number(key(b))];
        const numbers = column > 0 && !Number.isNaN(x) && !Number.isNaN(y);
        return (numbers ? x - y : key(a).localeCompare(key(b))) * (up ? 1 : -1);
      };
      body.append(...[...body.rows].sort(order));
    });
  });
}

// A button in the item of a list: the item itself has to stay one.
const pressed = (item, act) => {
  const key = document.createElement("span");
  key.append(...item.childNodes);
  item.append(key);
  key.setAttribute("role", "button");
  key.setAttribute("aria-pressed", "true");
  key.tabIndex = 0;
  const turn = () => {
    const on = key.getAttribute("aria-pressed") === "false";
    key.setAttribute("aria-pressed", String(on));
    act(on);
  };
  key.addEventListener("click", turn);
  key.addEventListener("keydown", (event) => {
    if (event.key === "Enter" || event.key === " ") { event.preventDefault(); turn(); }
  });
};

// Points of a path in inner units: an absolute start, then steps.
const points = (path) => {
  if (path.points) return path.points;
  const found = [];
  let [x, y, step] = [0, 0, false];
  const tokens = path.getAttribute("d").match(/[Ml]|-?\d+/g) || [];
  for (let at = 0; at < tokens.length; at++) {
    if (tokens[at] === "M" || tokens[at] === "l") { step = tokens[at] === "l"; continue; }
    const [a, b] = [Number(tokens[at]), Number(tokens[++at])];
    [x, y] = step ? [x + a, y + b] : [a, b];
    found.push([x, y]);
  }
  found.sort((a, b) => a[0] - b[0]);
  return (path.points = found);
};

const nearest = (found, x) => {
  let [low, high] = [0, found.length - 1];
  while (high - low > 1) {
    const middle = (low + high) >> 1;
    if (found[middle][0] < x) low = middle; else high = middle;
  }
  return Math.abs(found[low][0] - x) < Math.abs(found[high][0] - x) ? found[low] : found[high];
};

const written = (value) => {
  if (value === 0) return "0";
  const size = Math.abs(value);
  return (size < 1e-3 || size >= 1e5 ? value.toExponential(2) : value.toPrecision(3)).replace("-", "−");
};

const steps = (low, high, count) => {
  const wanted = (high - low) / count;
  const power = 10 ** Math.floor(Math.log10(wanted));
  const step = [1, 2, 5, 10].map((factor) => factor * power).find((step) => step >= wanted * (1 - 1e-9));
  const found = [];
  for (let n = Math.ceil(low / step - 1e-9); n * step <= high + 1e-9 * step; n++) found.push(n * step);
  return [found, Math.max(0, -Math.floor(Math.log10(step)))];
};

for (const figure of document.querySelectorAll("figure.linked")) {
  const panels = [...figure.querySelectorAll("svg.panel")];
  const areas = (panel) => [...panel.querySelectorAll("svg.d")];
  const first = panels[0] && areas(panels[0])[0];
  if (!first) continue;
  for (const key of figure.querySelectorAll(".keys li")) {
    const named = (path) => [key.textContent, "left of " + key.textContent].includes(path.dataset.name);
    pressed(key, (on) => figure.querySelectorAll("path.l").forEach((path) => named(path) && path.classList.toggle("off", !on)));
  }
  const [low, high] = first.dataset.x.split(" ").map(Number);
  const box = (name) => Number(first.getAttribute(name));
  const [left, width, inner] = [box("x"), box("width"), 10 * box("width")];
  let [from, to, here] = [0, 1, null];
  const read = document.createElement("div");
  read.className = "read";
  read.hidden = true;
  read.setAttribute("role", "status");
  figure.append(read);

  const cross = (share) => {
    const x = left + width * (share - from) / (to - from);
    for (const line of figure.querySelectorAll(".cross")) {
      const shown = share !== null && x >= left && x <= left + width;
      line.setAttribute("d", shown ? `M${x} ${line.dataset.from}V${line.dataset.to}` : "");
    }
  };
  const tell = (panel, share) => {
    here = share;
    cross(share);
    read.textContent = "";
    const row = (text, bold) => {
      const element = document.createElement(bold ? "b" : "div");
      element.textContent = text;
      read.append(element);
    };
    row(written(low + share * (high - low)), true);
    for (const area of areas(panel)) {
      const [bottom, top] = area.dataset.y.split(" ").map(Number);
      const tall = 10 * Number(area.getAttribute("height"));
      for (const path of area.querySelectorAll("path.l:not(.off)")) {
        const found = points(path);
        if (!found.length) continue;
        const up = 1 - nearest(found, share * inner)[1] / tall;
        const value = area.dataset.log ? bottom * (top / bottom) ** up : bottom + up * (top - bottom);
        row(`${path.dataset.name} ${written(value)}`);
      }
    }
    read.hidden = false;
    const [inside, outer] = [panel.getBoundingClientRect(), figure.getBoundingClientRect()];
    const x = inside.left + inside.width * (left + width * (share - from) / (to - from)) / 420;
    const side = x - outer.left > outer.width / 2 ? -read.offsetWidth - 12 : 12;
    read.style.left = `${Math.max(0, Math.min(x - outer.left + side, outer.width - read.offsetWidth))}px`;
    read.style.top = `${inside.top - outer.top + 20}px`;
  };
  const zoom = (a, b) => {
    [from, to] = [Math.max(0, Math.min(a, b)), Math.min(1, Math.max(a, b))];
    if (to - from < 0.002) [from, to] = [0, 1];
    for (const area of figure.querySelectorAll("svg.d")) {
      area.setAttribute("viewBox", `${from * inner} 0 ${(to - from) * inner} ${10 * Number(area.getAttribute("height"))}`);
    }
    const [ticks, decimals] = steps(low + from * (high - low), low + to * (high - low), 6);
    for (const group of figure.querySelectorAll(".xt")) {
      const model = group.querySelector("text");
      if (!model) continue;
      group.replaceChildren(...ticks.map((value) => {
        const label = model.cloneNode();
        label.setAttribute("x", left + width * ((value - low) / (high - low) - from) / (to - from));
        label.textContent = value.toFixed(decimals).replace("-", "−");
        return label;
      }));
    }
    if (here !== null) cross(here);
  };
  const share = (panel, event) => {
    const inside = panel.getBoundingClientRect();
    const x = (event.clientX - inside.left) / inside.width * 420;
    return from + (to - from) * Math.min(1, Math.max(0, (x - left) / width));
  };
  for (const panel of panels) {
    let begun = null;
    panel.addEventListener("pointermove", (event) => tell(panel, share(panel, event)));
    panel.addEventListener("pointerleave", () => { read.hidden = true; cross(null); begun = null; });
    panel.addEventListener("pointerdown", (event) => { begun = share(panel, event); event.preventDefault(); panel.focus(); });
    panel.addEventListener("pointerup", (event) => {
      const end = share(panel, event);
      if (begun !== null && Math.abs(end - begun) > 0.02 * (to - from)) zoom(begun, end);
      begun = null;
    });
    panel.addEventListener("dblclick", () => zoom(0, 1));
    panel.addEventListener("blur", () => { read.hidden = true; cross(null); });
    panel.addEventListener("keydown", (event) => {
      const at = here === null ? (from + to) / 2 : here;
      const length = to - from;
      const move = { ArrowLeft: -0.01, ArrowRight: 0.01, PageUp: -0.1, PageDown: 0.1 }[event.key];
      if (move) tell(panel, Math.min(to, Math.max(from, at + move * length)));
      else if (event.key === "+" || event.key === "=") zoom(at - length / 4, at + length / 4);
      else if (event.key === "-") zoom(at - length, at + length);
      else if (event.key === "0" || event.key === "Escape") zoom(0, 1);
      else return;
      event.preventDefault();
    });
  }
}

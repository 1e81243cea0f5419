"use strict";
// Draws the plots of the report as SVG. Every curve is a least and a largest value per piece of time.
(() => {
  const data = JSON.parse(document.getElementById("data").textContent);
  const LEFT = 58, RIGHT = 10, TOP = 8, BOTTOM = 20;
  const whole = [0, Math.max(data.count * data.width, 1e-9)];
  let view = whole;

  const decode = (text, curve) => {
    const bytes = Uint8Array.from(atob(text), (c) => c.charCodeAt(0));
    const whole = new Int16Array(bytes.buffer);
    return Float64Array.from(whole, (v) => (v === -32768 ? NaN : curve.middle + v * curve.step));
  };
  const curves = data.curves.map((c) => ({ low: decode(c.low, c), high: decode(c.high, c) }));

  const clock = (t) => data.start - data.origin + t;
  const node = (name, attributes, parent) => {
    const made = document.createElementNS("http://www.w3.org/2000/svg", name);
    for (const key in attributes) made.setAttribute(key, attributes[key]);
    return parent ? parent.appendChild(made) : made;
  };
  const ticks = (low, high, count) => {
    const raw = (high - low) / count, power = 10 ** Math.floor(Math.log10(raw));
    const step = power * [1, 2, 5, 10].find((m) => m * power >= raw);
    const list = [];
    for (let v = Math.ceil(low / step) * step; v <= high + step * 1e-9; v += step)
      list.push(Math.abs(v) < step * 1e-9 ? 0 : v);
    return { list, digits: Math.max(0, -Math.floor(Math.log10(step) + 1e-9)) };
  };

  // Least and largest of pieces [from, to) of a curve.
  const extremes = (column, from, to) => {
    const { low, high } = curves[column];
    let least = Infinity, largest = -Infinity;
    for (let i = Math.max(from, 0); i < Math.min(to, data.count); i++) {
      if (low[i] < least) least = low[i];
      if (high[i] > largest) largest = high[i];
    }
    return [least, largest];
  };
  const pieces = () => [
    Math.max(0, Math.floor(view[0] / data.width) - 1),
    Math.min(data.count, Math.ceil(view[1] / data.width) + 1),
  ];

  const range = (panel) => {
    const [from, to] = pieces();
    let low = 0, high = 0;
    for (const curve of panel.curves) {
      const [a, b] = extremes(curve.column, from, to);
      low = Math.min(low, a); high = Math.max(high, b);
    }
    if (panel.band !== null) {
      const [a, b] = extremes(panel.band, from, to);
      if (a <= b) { low = Math.min(low, a - panel.limit); high = Math.max(high, b + panel.limit); }
    } else if (panel.limit !== null) high = Math.max(high, panel.limit * 1.2);
    const room = (high - low || 1) * 0.06;
    return [panel.band === null && panel.limit !== null ? 0 : low - room, high + room];
  };

  const steps = (width) => {  // groups of pieces, one per pixel where there are more than pixels
    const [from, to] = pieces();
    const size = Math.max(1, Math.floor((to - from) / Math.max(width, 1)));
    const list = [];
    for (let i = from - (from % size); i < to; i += size) list.push([i, i + size]);
    return list;
  };
  const outline = (column, x, y, width) => {
    const groups = steps(width);
    const wide = groups.length > 0 && x(data.width) - x(0) > 3;
    let path = "", up = true, broken = true;
    for (const [from, to] of groups) {
      const [low, high] = extremes(column, from, to);
      if (low > high) { broken = true; continue; }
      if (wide && low !== high) {  // a box: where in it the values lie is not known
        path += `M${x(from * data.width).toFixed(1)} ${y(low).toFixed(1)}` +
          `H${x(to * data.width).toFixed(1)}V${y(high).toFixed(1)}` +
          `H${x(from * data.width).toFixed(1)}Z`;
        broken = true;
        continue;
      }
      const at = x(((from + to) / 2) * data.width).toFixed(1);
      const ends = up ? [low, high] : [high, low];
      path += `${broken ? "M" : "L"}${at} ${y(ends[0]).toFixed(1)}`;
      if (low !== high) { path += `L${at} ${y(ends[1]).toFixed(1)}`; up = !up; }
      broken = false;
    }
    return { path, wide };
  };
  const band = (panel, x, y, width) => {
    const top = [], bottom = [];
    for (const [from, to] of steps(width)) {
      const [low, high] = extremes(panel.band, from, to);
      if (low > high) continue;
      const at = x(((from + to) / 2) * data.width).toFixed(1);
      top.push(`${at} ${y(high + panel.limit).toFixed(1)}`);
      bottom.unshift(`${at} ${y(low - panel.limit).toFixed(1)}`);
    }
    return top.length ? `M${top.join("L")}L${bottom.join("L")}Z` : "";
  };

  const frame = (svg, width, height) => {
    svg.replaceChildren();
    svg.setAttribute("viewBox", `0 0 ${width} ${height}`);
    const scale = (width - LEFT - RIGHT) / (view[1] - view[0]);
    return (t) => LEFT + (t - view[0]) * scale;
  };
  const axis = (svg, x, width, height) => {
    const { list, digits } = ticks(clock(view[0]), clock(view[1]), Math.max(width / 110, 2));
    for (const value of list) {
      const at = x(value - clock(0));
      node("line", { x1: at, x2: at, y1: TOP, y2: height - BOTTOM, class: "grid" }, svg);
      const label = { x: at, y: height - 5, "text-anchor": "middle" };
      node("text", label, svg).textContent = value.toFixed(digits);
    }
  };
  const clip = (t, x, width) => Math.min(Math.max(x(t), LEFT), width - RIGHT);
  const shade = (svg, x, width, event, y, height, more) => {
    const from = clip(event.from, x, width), to = clip(event.to, x, width);
    if (event.to < view[0] || event.from > view[1]) return;
    const size = { x: from, y, width: Math.max(to - from, 1), height };
    const rect = node("rect", { ...size, class: `event ${event.level} ${more}` }, svg);
    node("title", {}, rect).textContent = event.title;
  };

  let clips = 0;
  const clipTo = (svg, width, height) => {
    const id = `clip${clips++}`;
    node("rect", { x: LEFT, y: TOP, width, height }, node("clipPath", { id }, svg));
    return { "clip-path": `url(#${id})` };
  };

  const drawPanel = (panel, svg) => {
    const width = Math.max(svg.clientWidth, 320), height = 120;
    const x = frame(svg, width, height), [low, high] = range(panel);
    const y = (v) => TOP + ((high - v) / (high - low)) * (height - TOP - BOTTOM);
    const inner = width - LEFT - RIGHT;
    axis(svg, x, width, height);
    const { list, digits } = ticks(low, high, 5);
    for (const v of list) {
      const kind = v === 0 ? "zero" : "grid";
      node("line", { x1: LEFT, x2: width - RIGHT, y1: y(v), y2: y(v), class: kind }, svg);
      const label = { x: LEFT - 8, y: y(v) + 4, "text-anchor": "end" };
      node("text", label, svg).textContent = v.toFixed(digits);
    }
    for (const event of data.events)
      if (panel.segment === null || event.segment === panel.segment)
        shade(svg, x, width, event, TOP, height - TOP - BOTTOM, "");
    const clipped = clipTo(svg, inner, height - TOP - BOTTOM);
    if (panel.band !== null)
      node("path", { d: band(panel, x, y, inner), class: "band", ...clipped }, svg);
    else if (panel.limit !== null)
      node("line", { x1: LEFT, x2: width - RIGHT, y1: y(panel.limit), y2: y(panel.limit),
        class: "limit" }, svg);
    // Drawn last to first: the first curve is the one that matters most.
    panel.curves.map((c, i) => [c, i]).reverse().forEach(([curve, i]) =>
{
      const { path, wide } = outline(curve.column, x, y, inner);
      node("path", { d: path, class: `curve s${i}${wide ? " boxes" : ""}`, ...clipped }, svg);
    });
  };

  const drawStrip = (svg) => {
    const rows = data.segments, each = 20;
    const width = Math.max(svg.clientWidth, 320), height = TOP + rows.length * each + BOTTOM;
    const x = frame(svg, width, height);
    axis(svg, x, width, height);
    rows.forEach((name, row) => {
      const label = { x: LEFT - 8, y: TOP + row * each + 14, "text-anchor": "end" };
      node("text", label, svg).textContent = name;
      for (const event of data.events)
        if (event.segment === name)
          shade(svg, x, width, event, TOP + row * each + 4, each - 8, "strip");
    });
  };

  const plots = [];
  const addPlot = (holder, draw) => {
    const svg = holder.querySelector("svg");
    plots.push({ svg, draw: () => draw(svg) });
    interact(svg);
    return svg;
  };
  const redraw = () => {
    plots.forEach((plot) => plot.draw());
    const shown = document.getElementById("shown");
    if (shown) shown.textContent =
      `${clock(view[0]).toFixed(2)} s to ${clock(view[1]).toFixed(2)} s`;
  };
  const show = (from, to) => {
    const least = Math.min(4 * data.width, whole[1]);
    const room = Math.max(0, (least - (to - from)) / 2);
    const low = Math.max(whole[0], from - room), high = Math.min(whole[1], to + room);
    view = high > low ? [low, high] : whole;
    redraw();
  };

  const timeAt = (svg, event) => {
    const box = svg.getBoundingClientRect();
    const part = (event.clientX - box.left - LEFT) / (box.width - LEFT - RIGHT);
    return view[0] + Math.min(Math.max(part, 0), 1) * (view[1] - view[0]);
  };
  let begun = null;
  const interact = (svg) => {
    svg.addEventListener("pointerdown", (e) => {
      if (e.button !== 0 || e.pointerType === "touch") return;
      begun = { svg, time: timeAt(svg, e) };
      svg.setPointerCapture(e.pointerId);
    });
    svg.addEventListener("pointermove", (e) => cursor(svg, timeAt(svg, e)));
    svg.addEventListener("pointerup", (e) => {
      if (!begun) return;
      const [a, b] = [begun.time, timeAt(svg, e)].sort((p, q) => p - q);
      begun = null;
      if ((b - a) > (view[1] - view[0]) / 200) show(a, b); else redraw();
    });
    svg.addEventListener("dblclick", () => show(...whole));
    svg.addEventListener("pointerleave", () => cursor(svg, null));
  };
  const cursor = (source, time) => {
    for (const { svg } of plots) {
      svg.querySelectorAll(".cursor, .drag").forEach((old) => old.remove());
      if (time === null) continue;
      const box = svg.viewBox.baseVal, scale = (box.width - LEFT - RIGHT) / (view[1] - view[0]);
      const x = (t) => LEFT + (t - view[0]) * scale;
      node("line", { x1: x(time), x2: x(time), y1: TOP, y2: box.height - BOTTOM,
        class: "cursor" }, svg);
      if (begun) {
        const [a, b] = [begun.time, time].sort((p, q) => p - q);
        node("rect", { x: x(a), y: TOP, width: x(b) - x(a), height: box.height - TOP - BOTTOM,
          class: "drag" }, svg);
      }
    }
    const at = time === null ? -1 : Math.floor(time / data.width);
    document.querySelectorAll("[data-curve]").forEach((span) => {
      const { low, high } = curves[Number(span.dataset.curve)];
      const value = at >= 0 && at < data.count ? (low[at] + high[at]) / 2 : NaN;
      span.textContent = Number.isFinite(value) ? value.toFixed(3) : "";
    });
    const readout = document.getElementById("at");
    if (readout) readout.textContent = time === null ? "" : `at ${clock(time).toFixed(3)} s`;
  };

  document.querySelectorAll("[data-panel]").forEach((holder) => {
    const panel = data.panels[Number(holder.dataset.panel)];
    addPlot(holder, (svg) => drawPanel(panel, svg));
  });
  document.querySelectorAll("[data-strip]").forEach((holder) => addPlot(holder, drawStrip));
  document.querySelectorAll("[data-event]").forEach((row) =>
    row.addEventListener("click", () => {
      const event = data.events[Number(row.dataset.event)];
      const room = 0.5 * (event.to - event.from) + 0.2;
      show(event.from - room, event.to + room);
      document.getElementById("plots").scrollIntoView({ behavior: "smooth" });
    }));
  const reset = document.getElementById("reset");
  if (reset) reset.addEventListener("click", () => show(...whole));
  let late = 0;
  window.addEventListener("resize", () => { clearTimeout(late); late = setTimeout(redraw, 120); });
  redraw();
})();

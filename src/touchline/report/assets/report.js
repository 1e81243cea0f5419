"use strict";
// Makes the plots of the report zoomable. Every curve is a least and a largest value per piece of
// time. Plots of events carry theirs in the paths that are drawn without this script; those of
// the whole recording come with more pieces than are drawn, packed. Plots of one group move together.
(() => {
  const data = JSON.parse(document.getElementById("data").textContent);
  const LEFT = 58, RIGHT = 10, TOP = 8, BOTTOM = 20, TURN = 1.25, STEP = 0.2;
  const GAP = 3;  // periods without a sample
  const clock = (t) => data.start - data.origin + t;  // of seconds since the first sample

  const unpack = (curve) => {
    const decode = (text) => {
      const bytes = Uint8Array.from(atob(text), (c) => c.charCodeAt(0));
      const numbers = new Int16Array(bytes.buffer);
      return Float64Array.from(numbers, (v) =>
        (v === -32768 ? NaN : curve.middle + v * curve.step));
    };
    return { low: decode(curve.low), high: decode(curve.high) };
  };
  // A path as the report writes it: "Mx y v dy l dx dy v dy ..."; x counts pieces, y the steps from
  // the top of the range downwards.
  const readPath = (path, plot) => {
    const low = new Float64Array(plot.count).fill(NaN), high = new Float64Array(plot.count).fill(NaN);
    const value = (y) => plot.high - (y / plot.steps) * (plot.high - plot.low);
    let x = 0, y = 0;
    const meet = () => {
      const v = value(y);
      if (!(low[x] <= v)) low[x] = v;
      if (!(high[x] >= v)) high[x] = v;
    };
    for (const [, command, rest] of path.matchAll(/([Mlv])([^Mlv]*)/g)) {
      const numbers = rest.match(/-?\d+/g).map(Number);
      if (command === "M") [x, y] = numbers;
      else if (command === "l") { x += numbers[0]; y += numbers[1]; }
      else y += numbers[0];
      meet();
    }
    return { low, high };
  };

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

  // What is shown of a plot, and where: `x` and `y` take seconds and values to the picture.
  class Frame {
    constructor(plot, height) {
      this.plot = plot;
      this.width = Math.max(plot.svg.clientWidth, 240);
      this.height = height;
      this.inner = this.width - LEFT - RIGHT;
      [this.from, this.to] = plot.group.view;
      plot.svg.replaceChildren();
      plot.svg.setAttribute("viewBox", `0 0 ${this.width} ${height}`);
    }
    x(t) { return LEFT + ((t - this.from) / (this.to - this.from)) * this.inner; }
    clip(t) { return Math.min(Math.max(this.x(t), LEFT), this.width - RIGHT); }
    range(low, high) {
      this.y = (v) => TOP + ((high - v) / (high - low)) * (this.height - TOP - BOTTOM);
    }
  }

  // Numbers of the pieces in view, and groups of them, one per pixel where there are more.
  const pieces = (source, frame) => [
    Math.max(0, Math.floor((frame.from - source.start) / source.width) - 1),
    Math.min(source.count, Math.ceil((frame.to - source.start) / source.width) + 1),
  ];
  const groups = (source, frame) => {
    const [from, to] = pieces(source, frame);
    const size = Math.max(1, Math.floor((to - from) / Math.max(frame.inner, 1)));
    const list = [];
    for (let i = from - (from % size); i < to; i += size) list.push([i, i + size]);
    return list;
  };
  const extremes = (source, column, from, to) => {
    const { low, high } = source.curves[column];
    let least = Infinity, largest = -Infinity;
    for (let i = Math.max(from, 0); i < Math.min(to, source.count); i++) {
      if (low[i] < least) least = low[i];
      if (high[i] > largest) largest = high[i];
    }
    return [least, largest];
  };
  const range = (source, panel, frame) => {
    const [from, to] = pieces(source, frame);
    let low = 0, high = 0;
    for (const column of panel.columns) {
      const [a, b] = extremes(source, column, from, to);
      low = Math.min(low, a); high = Math.max(high, b);
    }
    if (panel.band !== null) {
      const [a, b] = extremes(source, panel.band, from, to);
      if (a <= b) { low = Math.min(low, a - panel.limit); high = Math.max(high, b + panel.limit); }
    } else if (panel.limit !== null) high = Math.max(high, panel.limit * 1.2);
    const room = (high - low || 1) * 0.06;
    return [panel.band === null && panel.limit !== null ? 0 : low - room, high + room];
  };

  const outline = (source, column, frame) => {
    const at = (piece) => frame.x(source.start + piece * source.width).toFixed(1);
    const values = groups(source, frame).map(([from, to]) =>
      [from, to, ...extremes(source, column, from, to)]);
    // Boxes where most pieces are wide and hold several samples, not for one here and there.
    const several = values.filter(([, , low, high]) => low < high).length;
    const wide = (source.width / (frame.to - frame.from)) * frame.inner > 3 &&
      several > values.length / 2;
    const join = Math.max(Math.ceil((GAP * data.period) / source.width - 1e-6), 1);
    let path = "", up = true, broken = true, last = -Infinity;
    for (const [from, to, low, high] of values) {
      if (low > high) continue;
      if (from - last >= join) broken = true;  // a gap, not a piece between two samples
      last = to;
      if (wide && low !== high) {  // a box: where in it the values lie is not known
        path += `M${at(from)} ${frame.y(low).toFixed(1)}H${at(to)}V${frame.y(high).toFixed(1)}` +
          `H${at(from)}Z`;
        broken = true;
        continue;
      }
      const ends = up ? [low, high] : [high, low];
      path += `${broken ? "M" : "L"}${at((from + to) / 2)} ${frame.y(ends[0]).toFixed(1)}`;
      if (low !== high) {
        path += `L${at((from + to) / 2)} ${frame.y(ends[1]).toFixed(1)}`;
        up = !up;
      }
      broken = false;
    }
    return { path, wide };
  };
  const band = (source, panel, frame) => {
    const top = [], bottom = [];
    for (const [from, to] of groups(source, frame)) {
      const [low, high] = extremes(source, panel.band, from, to);
      if (low > high) continue;
      const at = frame.x(source.start + ((from + to) / 2) * source.width).toFixed(1);
      top.push(`${at} ${frame.y(high + panel.limit).toFixed(1)}`);
      bottom.unshift(`${at} ${frame.y(low - panel.limit).toFixed(1)}`);
    }
    return top.length ? `M${top.join("L")}L${bottom.join("L")}Z` : "";
  };

  const axis = (svg, frame) => {
    const { list, digits } = ticks(clock(frame.from), clock(frame.to), Math.max(frame.width / 110, 2));
    for (const value of list) {
      const at = frame.x(value - clock(0));
      node("line", { x1: at, x2: at, y1: TOP, y2: frame.height - BOTTOM, class: "grid" }, svg);
      const label = { x: at, y: frame.height - 5, "text-anchor": "middle" };
      node("text", label, svg).textContent = value.toFixed(digits);
    }
    const unit = { x: 2, y: frame.height - 5, "text-anchor": "start" };
    node("text", unit, svg).textContent = "time [s]";
  };
  const rule = (svg, frame, v, kind) => node("line",
    { x1: LEFT, x2: frame.width - RIGHT, y1: frame.y(v), y2: frame.y(v), class: kind }, svg);
  const scale = (svg, frame, low, high) => {
    const { list, digits } = ticks(low, high, 5);
    for (const v of list) {
      rule(svg, frame, v, v === 0 ? "zero" : "grid");
      const label = { x: LEFT - 8, y: frame.y(v) + 4, "text-anchor": "end" };
      node("text", label, svg).textContent = v.toFixed(digits);
    }
  };
  const shade = (svg, frame, event, y, height, more) => {
    const from = frame.clip(event.from), to = frame.clip(event.to);
    const size = { x: from, y, width: Math.max(to - from, 1), height };
    const rect = node("rect", { ...size, class: `event ${event.level} ${more}` }, svg);
    node("title", {}, rect).textContent = event.title;
  };
  const inView = (frame, event) => event.to >= frame.from && event.from <= frame.to;
  // The numbers of events, where they begin; those that would lie on each other stand in one line.
  const LETTER = 7, MOST_NUMBERS = 4; // pixels; numbers in a line
  const numbers = (svg, frame, events, y) => {
    const lines = [];
    for (const event of [...events].sort((a, b) => a.from - b.from)) {
      const from = frame.clip(event.from), last = lines[lines.length - 1];
      if (last !== undefined && from < last.from + LETTER * last.text.length + 6) {
        last.to = Math.max(last.to, frame.clip(event.to));
        last.left += last.ids.length < MOST_NUMBERS ? 0 : 1;
        if (last.ids.length < MOST_NUMBERS) last.ids.push(event.id);
        last.text = last.ids.join(", ") + (last.left ? ` +${last.left}` : "");
      } else
        lines.push({ from, to: frame.clip(event.to), ids: [event.id], left: 0, text: `${event.id}` });
    }
    for (const { from, to, text } of lines)
      if (to - from >= LETTER * text.length + 4) // pixels: otherwise it would not fit
        node("text", { x: from + 3, y, class: "number" }, svg).textContent = text;
  };
  let clips = 0;
  const clipTo = (svg, frame) => {
    const id = `clip${clips++}`, height = frame.height - TOP - BOTTOM;
    const holder = node("clipPath", { id }, svg);
    node("rect", { x: LEFT, y: TOP, width: frame.inner, height }, holder);
    return { "clip-path": `url(#${id})` };
  };

  const drawPanel = (plot) => {
    const { svg, source, panel } = plot, frame = new Frame(plot, plot.height);
    const [low, high] = range(source, panel, frame);
    frame.range(low, high);
    axis(svg, frame);
    scale(svg, frame, low, high);
    const events = data.events.filter((event) => !event.beside && inView(frame, event) &&
      (panel.segment === null || event.segment === panel.segment));
    for (const event of events) shade(svg, frame, event, TOP, frame.height - TOP - BOTTOM, "");
    numbers(svg, frame, events, TOP + 10);
    const clipped = clipTo(svg, frame);
    if (panel.band !== null)
      node("path", { d: band(source, panel, frame), class: "band", ...clipped }, svg);
    else if (panel.limit !== null) rule(svg, frame, panel.limit, "limit");
    // Drawn last to first: the first curve is the one that matters most.
    for (let i = panel.columns.length - 1; i >= 0; i--) {
      const { path, wide } = outline(source, panel.columns[i], frame);
      // Where two or three curves lie on each other, the lower ones are seen beside the upper.
      const under = panel.columns.length <= 3 && !wide ? ` under${i}` : "";
      const kind = `${plot.kinds[i]}${wide ? " boxes" : ""}${under}`;
      node("path", { d: path, class: kind, ...clipped }, svg);
    }
  };
  const drawStrip = (plot) => {
    const rows = data.segments, each = 20;
    const frame = new Frame(plot, TOP + rows.length * each + BOTTOM);
    axis(plot.svg, frame);
    rows.forEach((name, row) => {
      const label = { x: LEFT - 8, y: TOP + row * each + 14, "text-anchor": "end" };
      node("text", label, plot.svg).textContent = name;
      for (const event of data.events)
        if (event.segment === name && inView(frame, event)) {
          const [lane, lanes] = event.lane, high = (each - 8) / lanes - (lanes > 1 ? 1 : 0);
          const top = TOP + row * each + 4 + (lane * (each - 8)) / lanes;
          shade(plot.svg, frame, event, top, high, "strip");
          if (high > 9) numbers(plot.svg, frame, [event], top + Math.min(high - 1, 10));
        }
    });
  };

  // Plots that show the same time.
  class Group {
    constructor(whole, least) {
      this.whole = whole;
      this.least = Math.min(least, whole[1] - whole[0]);
      this.view = whole;
      this.plots = [];
    }
    draw() { this.plots.forEach((plot) => plot.draw(plot)); shown(this); }
    show(from, to) {
      const size = Math.min(Math.max(to - from, this.least), this.whole[1] - this.whole[0]);
      const middle = (from + to) / 2;
      const low = Math.min(Math.max(middle - size / 2, this.whole[0]), this.whole[1] - size);
      this.view = [low, low + size];
      this.draw();
    }
    zoom(factor, around) {
      const [from, to] = this.view;
      const size = Math.min((to - from) * factor, this.whole[1] - this.whole[0]);
      const low = around - ((around - from) * Math.max(size, this.least)) / (to - from);
      this.show(low, low + Math.max(size, this.least));
    }
    move(part) {
      const by = part * (this.view[1] - this.view[0]);
      this.show(this.view[0] + by, this.view[1] + by);
    }
    reset() { this.show(...this.whole); }
  }
  const shown = (group) => {
    const field = document.getElementById("shown");
    if (field && group === recording)
      field.textContent = `${clock(group.view[0]).toFixed(2)} s to ${clock(group.view[1]).toFixed(2)} s`;
  };

  const timeAt = (plot, event) => {
    const box = plot.svg.getBoundingClientRect(), [from, to] = plot.group.view;
    const width = plot.svg.viewBox.baseVal.width;
    const part = (((event.clientX - box.left) / box.width) * width - LEFT) / (width - LEFT - RIGHT);
    return from + Math.min(Math.max(part, 0), 1) * (to - from);
  };
  let begun = null;  // a drag: where it began, and whether it moves or frames
  const finish = (plot, event) => {
    if (!begun) return;
    const [a, b] = [begun.time, timeAt(plot, event)].sort((p, q) => p - q);
    const { moves } = begun, [from, to] = plot.group.view;
    begun = null;
    if (!moves && b - a > (to - from) / 200) plot.group.show(a, b);
    else plot.group.draw();
    if (plot.group === recording && recording.view !== recording.whole)
      setFragment(`t=${recording.view.map((t) => clock(t).toFixed(3)).join(",")}`);
  };
  const KEYS = {
    "+": (g, t) => g.zoom(1 / TURN, t), "=": (g, t) => g.zoom(1 / TURN, t),
    "-": (g, t) => g.zoom(TURN, t), ArrowLeft: (g) => g.move(-STEP), ArrowRight: (g) => g.move(STEP),
    0: (g) => g.reset(), Home: (g) => g.reset(), Escape: (g) => g.reset(),
  };
  const interact = (plot) => {
    const { svg, group } = plot;
    svg.setAttribute("tabindex", "0");
    svg.setAttribute("aria-label", `${svg.getAttribute("aria-label")}; arrow keys move, ` +
      "plus and minus zoom, 0 shows all");
    svg.addEventListener("pointerdown", (e) => {
      if (e.button !== 0 || e.pointerType === "touch") return;
      begun = { time: timeAt(plot, e), moves: e.shiftKey };
      svg.setPointerCapture(e.pointerId);
    });
    svg.addEventListener("pointermove", (e) => {
      if (begun && begun.moves) {
        const by = begun.time - timeAt(plot, e);
        group.show(group.view[0] + by, group.view[1] + by);
      } else cursor(group, timeAt(plot, e));
    });
    svg.addEventListener("pointerup", (e) => finish(plot, e));
    svg.addEventListener("dblclick", () => group.reset());
    svg.addEventListener("pointerleave", () => cursor(group, null));
    svg.addEventListener("wheel", (e) => {
      // A page full of plots must scroll: the wheel zooms the plot that was clicked, or with Ctrl.
      if (!e.ctrlKey && document.activeElement !== svg) return;
      e.preventDefault();
      if (Math.abs(e.deltaX) > Math.abs(e.deltaY)) group.move(Math.sign(e.deltaX) * 0.05);
      else group.zoom(TURN ** Math.sign(e.deltaY), timeAt(plot, e));
    }, { passive: false });
    svg.addEventListener("keydown", (e) => {
      const act = KEYS[e.key];
      if (!act || e.ctrlKey || e.metaKey || e.altKey) return;
      e.preventDefault();
      act(group, (group.view[0] + group.view[1]) / 2);
    });
  };
  const cursor = (group, time) => {
    for (const plot of group.plots) {
      const { svg, source } = plot;
      svg.querySelectorAll(".cursor, .drag").forEach((old) => old.remove());
      plot.values.forEach((span, i) => {
        const at = time === null || !source ? -1 : Math.floor((time - source.start) / source.width);
        const { low, high } = source.curves[plot.panel.columns[i]];
        const value = at >= 0 && at < source.count ? (low[at] + high[at]) / 2 : NaN;
        span.textContent = Number.isFinite(value) ? value.toFixed(3) : "";
      });
      if (time === null) continue;
      const box = svg.viewBox.baseVal, [from, to] = group.view;
      const x = (t) => LEFT + ((t - from) / (to - from)) * (box.width - LEFT - RIGHT);
      node("line", { x1: x(time), x2: x(time), y1: TOP, y2: box.height - BOTTOM,
        class: "cursor" }, svg);
      if (begun && !begun.moves) {
        const [a, b] = [begun.time, time].sort((p, q) => p - q);
        node("rect", { x: x(a), y: TOP, width: x(b) - x(a), height: box.height - TOP - BOTTOM,
          class: "drag" }, svg);
      }
    }
    const readout = document.getElementById("at");
    if (readout && group === recording)
      readout.textContent = time === null ? "" : `at ${clock(time).toFixed(3)} s`;
  };

  // Links: `#event-3` shows an event, `#t=2.5,4` the recording from 2.5 s to 4 s.
  const setFragment = (words) => history.replaceState(null, "", `#${words}`);
  const follow = () => {
    const times = /^#t=(-?[\d.]+),(-?[\d.]+)$/.exec(location.hash);
    const number = /^#event-(\d+)$/.exec(location.hash);
    if (times) {
      recording.show(Number(times[1]) - clock(0), Number(times[2]) - clock(0));
      document.getElementById("plots").scrollIntoView();
    } else if (number) {
      const index = data.events.findIndex((event) =>
        event.id === Number(number[1]) && !event.beside);
      if (index >= 0) goTo({ dataset: { event: index } });
    }
  };

  // What a plot shows, as a file: its pieces of time as CSV, the picture as PNG.
  const save = (name, blob) => {
    const link = document.createElement("a");
    link.href = URL.createObjectURL(blob);
    link.download = name;
    link.click();
    setTimeout(() => URL.revokeObjectURL(link.href), 1000);
  };
  const csv = (plot, names, unit) => {
    const { source, panel } = plot, frame = { from: plot.group.view[0], to: plot.group.view[1] };
    const lines = [["time [s]", ...names.flatMap((name) =>
      [`${name} least [${unit}]`, `${name} largest [${unit}]`])]];
    const [from, to] = pieces(source, frame);
    for (let i = from; i < to; i++) {
      const values = panel.columns.flatMap((column) =>
        [source.curves[column].low[i], source.curves[column].high[i]]);
      if (values.some(Number.isFinite))
        lines.push([clock(source.start + i * source.width).toFixed(6),
          ...values.map((v) => (Number.isFinite(v) ? v.toPrecision(7) : ""))]);
    }
    return lines.map((cells) => cells.join(",")).join("\n") + "\n";
  };
  const PAINT = ["fill", "fill-opacity", "stroke", "stroke-width", "stroke-opacity", "font",
    "stroke-dasharray", "vector-effect", "color"];
  const HEAD = 26;  // pixels above the picture: title, unit, and the key in the curves' colours
  const title = (pen, header, scale) => {
    let at = 8;
    pen.scale(scale, scale);
    for (const part of header.querySelectorAll("b, .soft, .key")) {
      const style = getComputedStyle(part), words = part.firstChild?.textContent ?? "";
      pen.font = `${style.fontWeight} 13px ${style.fontFamily}`;
      pen.fillStyle = style.color;
      if (part.classList.contains("key")) {
        pen.fillRect(at, 13, 14, 2);
        at += 20;
      }
      pen.fillText(words, at, 18);
      at += pen.measureText(words).width + 14;
    }
    pen.setTransform(1, 0, 0, 1, 0, 0);
  };
  const png = (plot, header, done) => {
    const { svg } = plot, copy = svg.cloneNode(true), { width, height } = svg.viewBox.baseVal;
    const own = [...svg.querySelectorAll("*")];
    [...copy.querySelectorAll("*")].forEach((one, i) => {
      const style = getComputedStyle(own[i]);
      one.setAttribute("style", PAINT.map((key) => `${key}:${style.getPropertyValue(key)}`).join(";"));
    });
    copy.setAttribute("xmlns", "http://www.w3.org/2000/svg");
    copy.setAttribute("width", 2 * width);
    copy.setAttribute("height", 2 * height);
    const image = new Image();
    image.onload = () => {
      const canvas = document.createElement("canvas");
      [canvas.width, canvas.height] = [2 * width, 2 * (height + HEAD)];
      const pen = canvas.getContext("2d");
      pen.fillStyle = getComputedStyle(document.body).backgroundColor;
      pen.fillRect(0, 0, canvas.width, canvas.height);
      pen.drawImage(image, 0, 2 * HEAD);
      title(pen, header, 2);
      canvas.toBlob(done, "image/png");
    };
    image.src = "data:image/svg+xml;charset=utf-8," +
      encodeURIComponent(new XMLSerializer().serializeToString(copy));
  };
  const offer = (holder, plot) => {
    const header = holder.querySelector("header");
    const name = header.querySelector("b").textContent;
    const names = [...header.querySelectorAll(".key")].map((key) => key.firstChild.textContent);
    const unit = header.querySelector(".soft").textContent;
    const saves = document.createElement("span");
    saves.className = "saves";
    header.append(saves);
    const file = name.replace(/[^A-Za-z0-9]+/g, "_");
    const button = (kind, act) => {
      const made = document.createElement("button");
      made.className = "save";
      made.textContent = kind;
      made.setAttribute("aria-label", `save ${name} as ${kind}`);
      made.addEventListener("click", act);
      saves.append(made);
    };
    button("CSV", () => save(`${file}.csv`, new Blob([csv(plot, names, unit)], { type: "text/csv" })));
    button("PNG", () => png(plot, header, (blob) => save(`${file}.png`, blob)));
  };

  const length = Math.max(data.count * data.width, 1e-9);
  const recording = new Group([0, length], 4 * data.width);
  const overall = { start: 0, width: data.width, count: data.count, curves: data.curves.map(unpack) };
  const add = (holder, group, source, panel, draw) => {
    const svg = holder.querySelector("svg"), values = [], kinds = [];
    if (panel) holder.querySelectorAll(".key").forEach((key) => {
      kinds.push(key.className.replace("key", "curve"));  // a curve has the colour of its key
      values.push(key.appendChild(document.createElement("span")));
      key.lastChild.className = "value";
    });
    const height = svg.viewBox.baseVal.height;
    const plot = { svg, group, source, panel, draw, values, kinds, height };
    group.plots.push(plot);
    interact(plot);
    if (panel) offer(holder, plot);
  };
  document.querySelectorAll("[data-panel]").forEach((holder) => {
    const panel = data.panels[Number(holder.dataset.panel)];
    add(holder, recording, overall, panel, drawPanel);
  });
  document.querySelectorAll("[data-strip]").forEach((holder) =>
    add(holder, recording, null, null, drawStrip));
  const besides = [];
  const takeOver = (figure) => {
    const [start, width, count] = JSON.parse(figure.dataset.window);
    const group = new Group([start, start + width * count], 4 * width);
    besides.push(group);
    figure.querySelectorAll("[data-plot]").forEach((holder) => {
      const plot = JSON.parse(holder.dataset.plot);
      const paths = [...holder.querySelectorAll("path.curve")];
      const read = (path) => readPath(path.getAttribute("d"), { ...plot, count });
      const curves = paths.map(read), columns = paths.map((_, i) => i);
      const panel = { segment: plot.segment, columns, band: null, limit: plot.limit };
      add(holder, group, { start, width, count, curves }, panel, drawPanel);
    });
    group.draw();
  };
  // There may be hundreds; each is drawn anew once it comes near the window.
  const watch = new IntersectionObserver((entries) => {
    for (const { isIntersecting, target } of entries)
      if (isIntersecting) { watch.unobserve(target); takeOver(target); }
  }, { rootMargin: "300px" });
  document.querySelectorAll("[data-window]").forEach((figure) => watch.observe(figure));

  const goTo = (row) => {
    const event = data.events[Number(row.dataset.event)];
    if (event === undefined) return;
    const room = 0.5 * (event.to - event.from) + 0.2;
    recording.show(event.from - room, event.to + room);
    setFragment(`event-${event.id}`);
    const place = document.getElementById(`event-${event.id}`) || document.getElementById("plots");
    place.scrollIntoView();
  };
  document.querySelectorAll("[data-event]").forEach((row) =>
    row.addEventListener("click", () => goTo(row)));

  const button = document.getElementById("reset");
  if (button) button.addEventListener("click", () => recording.reset());
  const redraw = () => [recording, ...besides].forEach((group) => group.draw());
  let late = 0;
  window.addEventListener("resize", () => { clearTimeout(late); late = setTimeout(redraw, 120); });
  redraw();
  window.addEventListener("hashchange", follow);
  follow();
})();

// Figures that zoom, their axes with them: each number is mapped as p -> k p + d, and ticks are chosen anew.
document.querySelectorAll("svg.figure").forEach((svg) => {
  const NUMBER = "(-?[\\d.]+(?:e[-+]?\\d+)?)", PAIR = new RegExp(`${NUMBER} ${NUMBER}`, "g");
  const find = (node, what) => [...node.querySelectorAll(what)];
  const words = (tick) => {
    const walker = document.createTreeWalker(tick, NodeFilter.SHOW_COMMENT);
    return walker.nextNode() ? walker.currentNode.data.trim() : "";
  };

  // An axis: where its ticks are, and which number stands at a place, if it has numbers.
  function axisOf(axes, name, box) {
    const across = name === "x", ticks = find(axes, `[id*="-${name}tick_"]`).map((node) => {
      const mark = node.querySelector("use[x]"), said = words(node).replace("\u2212", "-");
      return mark && { node, at: +mark.getAttribute(name), said, value: said === "" ? NaN : +said };
    }).filter(Boolean);
    const named = ticks.filter((tick) => tick.said), [a, b] = [named[0], named[named.length - 1]];
    const fits = (f) => named.length > 1 && named.every((tick) =>
      Math.abs(f(tick.value) - f(a.value) - (tick.at - a.at) * (f(b.value) - f(a.value)) / (b.at - a.at)) <
      0.01 * Math.abs(f(b.value) - f(a.value)));
    const scale = [[(x) => x, (x) => x], [Math.log10, (x) => 10 ** x]].find(([f]) => fits(f));
    const from = across ? box.x : box.y, size = across ? box.width : box.height;
    const axis = { across, ticks, from, size, k: 1, d: 0, drawn: [], sample: named[0] };
    if (scale) {
      const [f, inverse] = scale, slope = (f(b.value) - f(a.value)) / (b.at - a.at);
      axis.value = (at) => inverse(f(a.value) + ((at - axis.d) / axis.k - a.at) * slope);
      axis.place = (value) => ((f(value) - f(a.value)) / slope + a.at) * axis.k + axis.d;
    }
    return axis;
  }

  function niceTicks(axis) {
    const [low, high] = [axis.value(axis.from), axis.value(axis.from + axis.size)].sort((a, b) => a - b);
    const rough = (high - low) * (axis.across ? 44 : 28) / axis.size, power = 10 ** Math.floor(Math.log10(rough));
    const step = power * [1, 2, 5, 10].find((each) => each * power >= rough);
    const digits = Math.max(0, -Math.floor(Math.log10(step) + 1e-9));
    const values = [];
    for (let n = Math.ceil(low / step); n * step <= high; n++) values.push((n * step).toFixed(digits));
    return values;
  }

  function drawTicks(axis) {
    axis.drawn.splice(0).forEach((node) => node.remove());
    const zoomed = axis.k > 1, numbers = zoomed && axis.value;
    axis.ticks.forEach(({ node }) => { node.style.display = numbers ? "none" : ""; });
    if (!numbers) return;
    for (const said of niceTicks(axis)) {
      const tick = axis.sample.node.cloneNode(true), at = axis.place(+said), shift = at - axis.sample.at;
      find(tick, '[id*="-text_"]').forEach((node) => node.remove());
      tick.style.display = "";
      tick.setAttribute("transform", axis.across ? `translate(${shift} 0)` : `translate(0 ${shift})`);
      const label = axis.sample.label, text = document.createElementNS(svg.namespaceURI, "text");
      const y = axis.across ? label.y + label.height : axis.sample.at + label.height / 2;
      const place = { x: axis.across ? axis.sample.at : label.x + label.width, y, "font-size": 9.5 };
      Object.entries({ ...place, "text-anchor": axis.across ? "middle" : "end" })
        .forEach(([name, value]) => text.setAttribute(name, value));
      text.textContent = said.replace("-", "\u2212");
      if (axis.labelled) tick.append(text);
      axis.sample.node.parentNode.append(tick);
      axis.drawn.push(tick);
    }
  }

  // The axes of the figure; those above each other share x where only the lowest has numbers.
  const all = find(svg, '[id*="-axes_"]').map((node) => {
    const box = node.querySelector('[id*="-patch_"] path').getBBox();
    const axes = { node, box, x: axisOf(node, "x", box), y: axisOf(node, "y", box), marks: [] };
    find(node, "[clip-path]").filter((each) => !each.closest('[id*="matplotlib.axis"]')).forEach((each) => {
      const outer = document.createElementNS(svg.namespaceURI, "g");
      outer.setAttribute("clip-path", each.getAttribute("clip-path"));
      each.removeAttribute("clip-path");
      each.replaceWith(outer);
      outer.append(each);
      const area = each.closest('[id*="PolyCollection"], [id*="FillBetween"]');
      for (const part of [each, ...find(each, "*")]) {
        if (part.tagName === "use" && area) axes.marks.push({ part, matrix: true });
        else if (part.tagName === "use") axes.marks.push({ part, x: +part.getAttribute("x"), y: +part.getAttribute("y") });
        else if (part.tagName === "path" && !part.closest("defs")) axes.marks.push({ part, d: part.getAttribute("d") });
      }
    });
    find(node, ':scope > [id*="-text_"]').forEach((part) => {
      const place = part.getBBox(), x = place.x + place.width / 2, y = place.y + place.height / 2;
      const inside = x > box.x && x < box.x + box.width && y > box.y && y < box.y + box.height;
      if (inside) axes.marks.push({ part, x, y, text: true });
    });
    return axes;
  });
  for (const axes of all) {
    for (const name of ["x", "y"]) {
      const axis = axes[name], twin = all.find((each) => each !== axes && each[name].value &&
        each[name].from === axis.from && each[name].size === axis.size);
      axis.labelled = Boolean(axis.value);
      if (!axis.value && twin && !axis.sample) Object.assign(axis, { twin: twin[name], sample: axis.ticks[0] });
      if (axis.sample) axis.sample.label = (find(axis.sample.node, '[id*="-text_"]')[0] || axis.sample.node).getBBox();
    }
  }
  const linked = (axes, name) => all.map((each) => each[name]).filter((axis) => axis === axes[name] ||
    axis.twin === axes[name] || (axes[name].twin && (axis === axes[name].twin || axis.twin === axes[name].twin)));
  const canZoom = (axis) => axis.value || axis.twin;

  function draw() {
    for (const { x, y, box, marks } of all) {
      for (const axis of [x, y]) {
        if (axis.twin) Object.assign(axis, { value: axis.twin.value, place: axis.twin.place });
        drawTicks(axis);
      }
      for (const mark of marks) {
        const at = [x.k * mark.x + x.d, y.k * mark.y + y.d];
        if (mark.matrix) mark.part.setAttribute("transform", `matrix(${x.k} 0 0 ${y.k} ${x.d} ${y.d})`);
        else if (mark.d) mark.part.setAttribute("d", mark.d.replace(PAIR, (_, a, b) => `${x.k * a + x.d} ${y.k * b + y.d}`));
        else if (mark.text) {
          mark.part.setAttribute("transform", `translate(${at[0] - mark.x} ${at[1] - mark.y})`);
          const seen = at[0] > box.x && at[0] < box.x + box.width && at[1] > box.y && at[1] < box.y + box.height;
          mark.part.style.display = seen ? "" : "none";
        } else { mark.part.setAttribute("x", at[0]); mark.part.setAttribute("y", at[1]); }
      }
    }
    const zoomed = all.some(({ x, y }) => x.k > 1 || y.k > 1);
    svg.style.touchAction = zoomed ? "none" : "pan-y";
    svg.style.cursor = zoomed ? "grab" : "";
  }

  function change(axes, factors, at, shift) {
    for (const name of ["x", "y"]) {
      if (!canZoom(axes[name])) continue;
      for (const axis of linked(axes, name)) {
        const k = Math.min(Math.max(axis.k * factors[name], 1), 1000), used = k / axis.k, end = axis.from + axis.size;
        const d = at[name] - (at[name] - axis.d) * used + shift[name];
        Object.assign(axis, { k, d: Math.max(Math.min(d, axis.from * (1 - k)), end * (1 - k)) });
      }
    }
    draw();
  }

  const pointAt = (event) => new DOMPoint(event.clientX, event.clientY).matrixTransform(svg.getScreenCTM().inverse());
  const axesAt = ({ x, y }) => all.find(({ box }) => x >= box.x && x <= box.x + box.width && y >= box.y && y <= box.y + box.height);
  const STILL = { x: 1, y: 1 }, NOWHERE = { x: 0, y: 0 };
  const reset = () => { all.forEach(({ x, y }) => [x, y].forEach((axis) => Object.assign(axis, { k: 1, d: 0 }))); draw(); };
  const pointers = new Map();
  let held = null;
  svg.addEventListener("wheel", (event) => {
    const at = pointAt(event), axes = axesAt(at), by = Math.exp(-event.deltaY * (event.deltaMode ? 0.05 : 0.002));
    if (!axes || !(event.ctrlKey || document.activeElement === svg)) return;
    event.preventDefault();
    change(axes, { x: by, y: by }, at, NOWHERE);
  }, { passive: false });
  svg.addEventListener("pointerdown", (event) => {
    pointers.set(event.pointerId, pointAt(event));
    held = held && pointers.size > 1 ? held : axesAt(pointAt(event));
    svg.focus({ preventScroll: true });
  });
  svg.addEventListener("pointermove", (event) => {
    const before = pointers.get(event.pointerId), now = pointAt(event);
    if (!before || !held) return;
    const other = [...pointers].find(([id]) => id !== event.pointerId);
    pointers.set(event.pointerId, now);
    if (!other) change(held, STILL, now, { x: now.x - before.x, y: now.y - before.y });
    else {
      const apart = (point) => Math.hypot(point.x - other[1].x, point.y - other[1].y) || 1, by = apart(now) / apart(before);
      change(held, { x: by, y: by }, other[1], NOWHERE);
    }
  });
  for (const end of ["pointerup", "pointercancel", "pointerleave"])
    svg.addEventListener(end, (event) => pointers.delete(event.pointerId));
  svg.addEventListener("dblclick", reset);
  svg.addEventListener("keydown", (event) => {
    const by = { "+": 1.5, "=": 1.5, "-": 1 / 1.5 }[event.key];
    const shift = { ArrowLeft: [25, 0], ArrowRight: [-25, 0], ArrowUp: [0, 25], ArrowDown: [0, -25] }[event.key];
    if (event.key === "Escape" || event.key === "0") return reset();
    if (!by && !shift) return;
    event.preventDefault();
    const { box } = all[0], [x, y] = shift || [0, 0];
    change(all[0], by ? { x: by, y: by } : STILL, { x: box.x + box.width / 2, y: box.y + box.height / 2 }, { x, y });
  });
  svg.tabIndex = 0;
  draw();
});

// What stands beside the scene: plots over time with a cursor, events, and keys that step. The scene's own slider has the time.
(() => {
  const { t, plots, events } = JSON.parse(document.getElementById("rover-pin-data").textContent);
  const panel = document.getElementById("rover-pin-panel"), space = "http://www.w3.org/2000/svg";
  const COLOURS = ["#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9"];
  const [W, H, LEFT, TOP, BOTTOM] = [340, 130, 44, 8, 18], last = t[t.length - 1], cursors = [];
  const make = (parent, name, values, words) => {
    const node = document.createElementNS(space, name);
    Object.entries(values).forEach(([key, value]) => node.setAttribute(key, value));
    if (words) node.textContent = words;
    parent.append(node);
    return node;
  };
  const x = (time) => LEFT + (W - LEFT - 6) * time / last;
  const slider = () => document.querySelector("#root [role=slider]");

  function goTo(time) { // as the slider does, but to any time: its field would round it; at the very end it begins anew
    const bar = slider();
    let part = bar[Object.keys(bar).find((name) => name.startsWith("__reactFiber$"))];
    while (!(part.memoizedProps && part.memoizedProps.onChange && part.memoizedProps.max)) part = part.return;
    part.memoizedProps.onChange(Math.min(Math.max(time, 0), last - 1e-3));
  }

  function ticks(low, high, most) {
    const rough = (high - low) / most, power = 10 ** Math.floor(Math.log10(rough));
    const step = power * [1, 2, 5, 10].find((each) => each * power >= 0.7 * rough), found = [];
    for (let n = Math.ceil(low / step); n * step <= high + 1e-9 * step; n++)
      found.push([n * step, (n * step).toFixed(Math.max(0, -Math.floor(Math.log10(step) + 1e-9))).replace("-", "\u2212")]);
    return found;
  }

  for (const { label, lines } of plots) {
    const seen = Object.values(lines).flat().filter((value) => value !== null);
    const [least, most] = [Math.min(...seen), Math.max(...seen)], room = 0.05 * (most - least) || 0.05;
    const [low, high] = [least - room, most + room], y = (value) => TOP + (H - TOP - BOTTOM) * (high - value) / (high - low);
    panel.querySelector(".plots").append(Object.assign(document.createElement("div"), { textContent: label }));
    const svg = make(panel.querySelector(".plots"), "svg", { viewBox: `0 0 ${W} ${H}`, role: "img", "aria-label": `${label} over time` });
    for (const [value, words] of ticks(low, high, 5)) {
      make(svg, "line", { x1: LEFT, x2: W - 6, y1: y(value), y2: y(value), class: "grid" });
      make(svg, "text", { x: LEFT - 4, y: y(value) + 3.5, "text-anchor": "end" }, words);
    }
    for (const [value, words] of ticks(0, last, 6)) make(svg, "text", { x: x(value), y: H - 5, "text-anchor": "middle" }, words);
    for (const [time, words] of events) make(make(svg, "line", { x1: x(time), x2: x(time), y1: TOP, y2: H - BOTTOM, class: "event" }), "title", {}, words);
    Object.entries(lines).forEach(([name, values], n) => {
      let path = "", on = false;
      values.forEach((value, at) => {
        if (value !== null) path += `${on ? "L" : "M"}${x(t[at]).toFixed(1)} ${y(value).toFixed(1)}`;
        on = value !== null;
      });
      const dashed = name.endsWith("r") && name.length > 1;
      make(svg, "path", { d: path, fill: "none", stroke: COLOURS[Math.floor(n / 2) % 6], "stroke-width": 1.3, ...(dashed && { "stroke-dasharray": "4 3" }) });
    });
    cursors.push(make(svg, "line", { x1: LEFT, x2: LEFT, y1: TOP, y2: H - BOTTOM, class: "cursor" }));
    const seek = (event) => {
      const box = svg.getBoundingClientRect();
      if (event.buttons) goTo(((event.clientX - box.left) * W / box.width - LEFT) / (W - LEFT - 6) * last);
    };
    svg.addEventListener("pointerdown", seek);
    svg.addEventListener("pointermove", seek);
  }
  const key = panel.querySelector(".key");
  Object.keys(plots.length ? plots[0].lines : {}).forEach((name, n) => {
    const entry = Object.assign(document.createElement("span"), { textContent: name });
    const style = name.endsWith("r") && name.length > 1 ? "dashed" : "solid";
    entry.style.borderBottom = `2px ${style} ${COLOURS[Math.floor(n / 2) % 6]}`;
    key.append(entry);
  });
  const marks = events.map(([time, words]) => {
    const button = Object.assign(document.createElement("button"), { textContent: words });
    button.addEventListener("click", () => goTo(time));
    panel.querySelector(".events").append(button);
    return [time, document.body.appendChild(Object.assign(document.createElement("i"), { className: "rover-pin-mark", title: words }))];
  });

  window.addEventListener("keydown", (event) => { // before the scene, which would turn with the arrows
    const now = slider() && +slider().getAttribute("aria-valuenow"), step = event.shiftKey ? 1 : 0.05;
    const to = { ArrowRight: now + step, ArrowLeft: now - step, Home: 0, End: last }[event.key];
    if (to === undefined || now === null) return;
    event.preventDefault();
    event.stopImmediatePropagation();
    goTo(to);
  }, true);

  setInterval(() => {
    const bar = slider(), now = bar && +bar.getAttribute("aria-valuenow");
    if (bar) {
      cursors.forEach((cursor) => { cursor.setAttribute("x1", x(now)); cursor.setAttribute("x2", x(now)); });
      panel.querySelector(".now").textContent = `t = ${now.toFixed(2)} s`;
      const box = bar.closest(".mantine-Slider-root").getBoundingClientRect();
      for (const [time, mark] of marks)
        Object.assign(mark.style, { left: `${box.left + box.width * time / last - 1}px`, top: `${box.top - 4}px`, height: `${box.height + 8}px` });
    }
  }, 50);
})();

"use strict";
// Charts are drawn when they come near the window, in the colours of the page's theme; tables sort; the map turns.
(() => {
  const json = id => JSON.parse(document.getElementById(id).textContent);
  const charts = json("charts");
  const dark = matchMedia("(prefers-color-scheme: dark)");
  const coarse = matchMedia("(pointer: coarse)").matches;
  const config = { responsive: true, displayModeBar: false, doubleClick: "reset" };
  const ink = name => getComputedStyle(document.documentElement).getPropertyValue(name).trim();

  // --- charts
  function themed(chart, width) {
    const layout = structuredClone(chart.layout);
    const soft = ink("--soft"), grid = ink("--grid");
    for (const key of Object.keys(layout).filter(key => /^[xy]axis/.test(key))) {
      const one = layout[key];
      Object.assign(one, { gridcolor: grid, linecolor: grid, tickfont: { color: soft }, fixedrange: coarse });
      one.title = { ...one.title, font: { color: soft, size: 13 }, standoff: 10 };
    }
    const map = chart.aspect !== undefined;
    const entries = chart.data.filter(trace => trace.showlegend !== false).length;
    if (map) layout.height = Math.round(Math.min(Math.max(width * chart.aspect, 260), 640)) + 90;
    if (width < 560) layout.height += 18 * Math.ceil(entries / 2);
    return Object.assign(layout, {
      paper_bgcolor: "rgba(0,0,0,0)", plot_bgcolor: "rgba(0,0,0,0)", autosize: true,
      font: { family: getComputedStyle(document.body).fontFamily, size: 13, color: ink("--ink") },
      margin: { l: 48, r: 8, t: 8, b: 40 }, hovermode: map ? "closest" : "x", dragmode: coarse ? false : "zoom",
      legend: { orientation: "h", x: 0, y: 1.01, yanchor: "bottom", font: { size: 12.5 }, bgcolor: "rgba(0,0,0,0)" },
      showlegend: entries > 1, bargap: 0.25,
      hoverlabel: { bgcolor: ink("--raised"), bordercolor: ink("--line"), font: { color: ink("--ink") } }
    });
  }
  function draw(element) {
    const chart = charts[element.dataset.chart];
    for (const trace of chart.data.filter(trace => trace.truth)) trace.line.color = trace.marker.color = ink("--truth");
    return Plotly.react(element, chart.data, themed(chart, element.clientWidth), config).then(() => {
      if (!element.dataset.drawn) performance.mark("drawn-" + element.dataset.chart);
      element.dataset.drawn = "yes";
    });
  }

  // --- the map
  const unpacked = (packed, kind) => {
    const text = atob(packed.bdata), bytes = new Uint8Array(text.length);
    for (let k = 0; k < text.length; k++) bytes[k] = text.charCodeAt(k);
    return new kind(bytes.buffer);
  };
  const space = document.getElementById("space");
  const chosen = name => document.querySelector(`input[name="${name}"]:checked`)?.value;
  const cache = {};
  let view = null;
  function points(label) {
    if (cache[label]) return cache[label];
    const map = view.maps[label], raw = unpacked(map.xyz, Uint16Array), count = raw.length / 3;
    const columns = [0, 1, 2].map(() => new Float32Array(count));
    for (let k = 0; k < count; k++)
      for (let c = 0; c < 3; c++) columns[c][k] = view.low[c] + view.scale[c] * raw[3 * k + c];
    const track = unpacked(map.track, Float32Array);
    return cache[label] = {
      xyz: columns, intensity: unpacked(map.intensity, Uint8Array),
      camera: map.camera && unpacked(map.camera, Uint8Array), palette: map.palette,
      track: [0, 1, 2].map(c => track.filter((_, k) => k % 3 === c)), colour: map.colour
    };
  }
  // half way to white, so that the line stands out from the points
  const pale = hex => `rgb(${[1, 3, 5].map(k => Math.round((parseInt(hex.slice(k, k + 2), 16) + 255) / 2))})`;
  function coloured(map) {
    const by = chosen("colour");
    if (by === "camera" && map.camera) {
      const last = map.palette.length - 1;
      return { color: map.camera, cmin: 0, cmax: last, colorscale: map.palette.map((rgb, k) => [k / last, rgb]) };
    }
    if (by === "intensity") return { color: map.intensity, cmin: 0, cmax: 255, colorscale: "Cividis" };
    const [cmin, cmax] = view.heights;
    return { color: map.xyz[2], cmin, cmax, colorscale: "Viridis" };
  }
  function drawMap() {
    view ??= json("view");
    const label = chosen("map") ?? Object.keys(view.maps)[0], map = points(label);
    const [x, y, z] = map.xyz, [tx, ty, tz] = map.track;
    const scene = name => ({
      title: { text: name }, color: "#9fb0bc", gridcolor: "#26303a", zeroline: false, showspikes: false,
      showbackground: false
    });
    const layout = {
      paper_bgcolor: "#101418", margin: { l: 0, r: 0, t: 0, b: 0 }, showlegend: false, uirevision: "kept",
      font: { family: getComputedStyle(document.body).fontFamily, size: 12, color: "#d8e4ec" },
      scene: {
        xaxis: scene("x [m]"), yaxis: scene("y [m]"), zaxis: scene("z [m]"), aspectmode: "data", bgcolor: "#101418",
        camera: space.camera ?? { eye: { x: -0.75, y: -0.75, z: 0.6 } }, dragmode: "orbit"
      }
    };
    const data = [
      { type: "scatter3d", mode: "markers", x, y, z, hoverinfo: "skip",
        marker: { size: 1.4, opacity: 1, line: { width: 0 }, ...coloured(map) } },
      { type: "scatter3d", mode: "lines", x: tx, y: ty, z: tz, hoverinfo: "skip",
        line: { color: pale(map.colour), width: 7 } }
    ];
    return Plotly.react(space, data, layout, config).then(() => {
      if (!space.dataset.drawn) performance.mark("drawn-space");
      space.dataset.drawn = "yes";
    });
  }
  const turned = { above: { x: 0, y: -0.001, z: 1.25 }, side: { x: -0.4, y: -1.2, z: 0.25 }, start: { x: -0.75, y: -0.75, z: 0.6 } };
  function look(how) {
    const eye = space.layout.scene.camera?.eye ?? turned.start;
    const turn = { left: 0.26, right: -0.26 }[how], near = { nearer: 0.8, farther: 1.25 }[how];
    let next = turned[how];
    if (turn) next = {
      x: eye.x * Math.cos(turn) - eye.y * Math.sin(turn), y: eye.x * Math.sin(turn) + eye.y * Math.cos(turn), z: eye.z
    };
    if (near) next = { x: eye.x * near, y: eye.y * near, z: eye.z * near };
    Plotly.relayout(space, { "scene.camera.eye": next });
  }

  // --- drawing when in sight
  const paint = element => element === space ? drawMap() : draw(element);
  const drawings = [...document.querySelectorAll(".chart"), ...(space ? [space] : [])];
  const sight = new IntersectionObserver(entries => {
    for (const entry of entries.filter(entry => entry.isIntersecting)) {
      sight.unobserve(entry.target);
      paint(entry.target);
    }
  }, { rootMargin: "400px 0px" });
  // Text and tables are painted first: the library is compiled after the page is complete.
  addEventListener("load", () => requestAnimationFrame(() => setTimeout(() => {
    const library = document.createElement("script");
    library.textContent = document.getElementById("plotly").textContent;
    document.body.append(library);
    drawings.slice(1).forEach(element => sight.observe(element));
    if (drawings.length) paint(drawings[0]);
  })));
  addEventListener("beforeprint", () => drawings.filter(one => !one.dataset.drawn).forEach(paint));
  dark.addEventListener("change", () => drawings.filter(one => one !== space && one.dataset.drawn).forEach(draw));
  if (space) {
    document.querySelectorAll("input[name=map], input[name=colour]").forEach(input =>
      input.addEventListener("change", drawMap));
    document.querySelectorAll("button[data-look]").forEach(button =>
      button.addEventListener("click", () => look(button.dataset.look)));
  }

  // --- tables
  for (const table of document.querySelectorAll("table.sortable")) {
    const heads = [...table.tHead.rows[0].cells], body = table.tBodies[0];
    heads.forEach((head, column) => head.querySelector("button").addEventListener("click", () => {
      const up = head.getAttribute("aria-sort") !== "ascending";
      heads.forEach(other => other.setAttribute("aria-sort", "none"));
      head.setAttribute("aria-sort", up ? "ascending" : "descending");
      const value = row => {
        const cell = row.cells[column];
        return cell.dataset.value === undefined ? cell.textContent : Number(cell.dataset.value);
      };
      const missing = row => row.cells[column].textContent === "-";
      const sorted = [...body.rows].sort((a, b) => {
        if (missing(a) || missing(b)) return missing(a) - missing(b);  // unknown figures stand last
        const [p, q] = [value(a), value(b)];
        const order = typeof p === "number" && typeof q === "number" ? p - q
          : String(p).localeCompare(String(q), "en", { numeric: true });
        return up ? order : -order;
      });
      body.append(...sorted);
    }));
  }
})();

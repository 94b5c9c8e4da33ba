// SPDX-License-Identifier: GPL-3.0-or-later
// Draws the charts after the first paint, plays the animated ones, and makes all of it work by keyboard.
"use strict";
(() => {
  const all = (selector) => [...document.querySelectorAll(selector)];
  const read = (selector) => JSON.parse(document.querySelector(selector).textContent);
  const dark = matchMedia("(prefers-color-scheme: dark)");
  const still = matchMedia("(prefers-reduced-motion: reduce)");
  const TOOL_BAR = 32; // pixels below the chart, where datasheet.css puts it
  const themes = {};
  for (const [name, ink, grid] of [["light", "#1b1f24", "#d5d9de"], ["dark", "#e6e8eb", "#3a4048"]]) {
    // titles close to the axis, so that they stay clear of the tool bar
    const axis = { gridcolor: grid, zerolinecolor: grid, linecolor: ink, automargin: true, title: { font: { size: 13 }, standoff: 6 } };
    themes[name] = {
      layout: {
        font: { color: ink, family: "system-ui, sans-serif", size: 13 }, paper_bgcolor: "rgba(0,0,0,0)", plot_bgcolor: "rgba(0,0,0,0)",
        xaxis: axis, yaxis: { ...axis }, legend: { orientation: "h", yanchor: "bottom", y: 1.06, x: 0 },
        margin: { l: 60, r: 12, t: 48, b: 48 + TOOL_BAR }, hovermode: "closest",
      },
    };
  }
  const theme = (paper) => themes[dark.matches && !paper ? "dark" : "light"];
  // The tool bar holds only what stays on this page: no link, no button that sends data anywhere.
  const CONFIG = {
    responsive: true, displaylogo: false, showLink: false, showEditInChartStudio: false, plotlyServerURL: "",
    modeBarButtons: [["zoom2d", "pan2d", "zoomIn2d", "zoomOut2d", "autoScale2d", "resetScale2d", "toImage"]],
  };
  const charts = () => all(".chart[data-drawn]");

  async function draw(chart) {
    const figure = read(`[data-figure="${chart.id}"]`);
    const { frames } = figure.layout.meta ?? {};
    Object.assign(figure.layout, { template: theme(), autosize: true, dragmode: "zoom" });
    await Plotly.newPlot(chart, figure.data, figure.layout, CONFIG);
    if (frames) await Plotly.addFrames(chart, frames);
    chart.addEventListener("keydown", (event) => move(chart, event));
    chart.dataset.drawn = "yes";
  }

  // keys on a chart: plus and minus zoom, arrows move, 0 shows all
  function move(chart, event) {
    const steps = { "+": [0, 0, 0.5], "=": [0, 0, 0.5], "-": [0, 0, 2], ArrowLeft: [-0.2, 0, 1], ArrowRight: [0.2, 0, 1],
                    ArrowUp: [0, 0.2, 1], ArrowDown: [0, -0.2, 1] };
    if (event.ctrlKey || event.metaKey || event.altKey || !(event.key in steps || event.key === "0")) return;
    event.preventDefault();
    const change = {};
    for (const [name, axis] of Object.entries(chart._fullLayout)) {
      if (!/^[xy]axis\d*$/.test(name)) continue;
      if (event.key === "0") {
        change[`${name}.autorange`] = true;
        continue;
      }
      const [right, up, zoom] = steps[event.key];
      const [low, high] = axis.range;
      const middle = (low + high) / 2 + (name[0] === "x" ? right : up) * (high - low);
      change[`${name}.range`] = [middle - (zoom * (high - low)) / 2, middle + (zoom * (high - low)) / 2];
    }
    Plotly.relayout(chart, change);
  }

  function player(box) {
    const chart = document.getElementById(box.dataset.plays);
    const [button, position, speed] = ["button", "input", "select"].map((name) => box.querySelector(name));
    const order = chart.layout.meta.order;
    let at = 0, last = null, playing = false, visible = true;

    const show = () => Plotly.animate(chart, [order[Math.floor(at)]], {
      mode: "immediate", transition: { duration: 0 }, frame: { duration: 0, redraw: false },
    });
    function tick(now) {
      if (!playing) return;
      if (visible) {
        const before = Math.floor(at);
        at = (at + ((now - last) / 1000 / box.dataset.seconds) * speed.value * order.length) % order.length;
        if (Math.floor(at) !== before) {
          position.value = at;
          show();
        }
      }
      last = now;
      requestAnimationFrame(tick);
    }
    function play(on) {
      playing = on;
      button.textContent = on ? "Pause" : "Play";
      last = performance.now();
      if (on) requestAnimationFrame(tick);
    }
    position.max = order.length - 1;
    position.addEventListener("input", () => { play(false); at = Number(position.value); show(); });
    button.addEventListener("click", () => play(!playing));
    new IntersectionObserver(([entry]) => { visible = entry.isIntersecting; }).observe(chart);
    for (const control of [button, position, speed]) control.disabled = false;
    if (!still.matches) play(true);
  }

  function connections() {
    const choice = document.getElementById("connection");
    const choose = () => {
      for (const chart of charts()) {
        const groups = chart.layout.meta && chart.layout.meta.groups;
        if (groups) Plotly.restyle(chart, { visible: groups.map((name) => name === choice.value) });
      }
    };
    choice.addEventListener("change", choose);
    choice.disabled = false;
    if (choice.value !== choice.options[0].value) choose(); // the browser keeps the choice over a reload
  }

  const recolour = (paper) => charts().forEach((chart) => Plotly.relayout(chart, { template: theme(paper) }));

  // text that the page holds compressed, in base64
  async function unpacked(id) {
    const bytes = Uint8Array.from(atob(document.getElementById(id).textContent), (letter) => letter.charCodeAt(0));
    return new Response(new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"))).text();
  }

  // the motor or transducer to play with is a page of its own, with its own content security policy
  async function playground() {
    const frame = document.createElement("iframe");
    frame.title = "Live model";
    frame.srcdoc = await unpacked("live-page");
    document.getElementById("live").replaceChildren(frame);
    document.getElementById("start-live").disabled = true;
  }

  async function start() {
    const library = document.createElement("script");
    library.textContent = await unpacked("plotly");
    document.head.append(library);
    const button = document.getElementById("start-live");
    button.addEventListener("click", playground);
    button.disabled = false;
    for (const chart of all(".chart")) {
      await draw(chart);
      await new Promise((done) => setTimeout(done)); // the page answers between two charts
    }
    all(".player").forEach(player);
    connections();
    dark.addEventListener("change", () => recolour(false));
    addEventListener("beforeprint", () => recolour(true));
    addEventListener("afterprint", () => recolour(false));
    document.documentElement.dataset.ready = "yes";
  }

  // after the first paint: the second frame begins when the first has been shown
  addEventListener("DOMContentLoaded", () => requestAnimationFrame(() => setTimeout(start)));
})();

// Draws each figure when it comes near the window or the browser is idle, links the time axes of a run, and readies the page for print.
"use strict";
(() => {
  const PRINT_WIDTH = 680; // px; what an A4 page holds between its margins
  const SCENES = { seen: 8, printed: 16 }; // drawn at once; browsers drop the oldest WebGL context beyond 16
  const REST = 1500; // ms after which a page that nobody scrolls draws what is further down
  const touch = matchMedia("(pointer: coarse)").matches;
  const plots = [...document.querySelectorAll(".plot")];
  const ranges = new Map(); // part -> [from, to] of its time axes in s, once someone has zoomed
  const scenes = []; // drawn 3D plots, the latest last
  let most = SCENES.seen;

  function config(plot) {
    return {
      responsive: true,
      displaylogo: false,
      showSendToCloud: false, // nothing leaves the page
      plotlyServerURL: "",
      displayModeBar: touch ? false : "hover",
      scrollZoom: false, // the wheel scrolls the page
      modeBarButtonsToRemove: ["select2d", "lasso2d", "autoScale2d"],
      toImageButtonOptions: { format: isScene(plot) ? "png" : "svg", filename: plot.dataset.name },
    };
  }

  function isScene(plot) {
    return plot.classList.contains("space");
  }

  function draw(plot) {
    if (plot.dataset.drawn) return;
    plot.dataset.drawn = "yes";
    const spec = JSON.parse(plot.nextElementSibling.textContent);
    if (isScene(plot)) {
      if (plot.camera) spec.layout.scene.camera = plot.camera;
      scenes.push(plot);
      while (scenes.length > most) release(scenes[0]);
    } else if (touch) {
      spec.layout.dragmode = false; // a finger scrolls the page
    }
    try {
      Plotly.newPlot(plot, spec.data, spec.layout, config(plot));
      if (isScene(plot)) return;
      if (ranges.has(plot.dataset.link)) show(plot, ranges.get(plot.dataset.link));
      plot.on("plotly_relayout", () => follow(plot));
    } catch (error) {
      plot.textContent = "This figure could not be drawn: " + error.message;
    }
  }

  // Gives a scene's WebGL context back; it is drawn again, turned as it was, when it is next seen.
  function release(plot) {
    scenes.splice(scenes.indexOf(plot), 1);
    plot.camera = plot.layout && plot.layout.scene.camera;
    Plotly.purge(plot);
    delete plot.dataset.drawn;
    watcher.unobserve(plot);
    watcher.observe(plot);
  }

  // Shows the stretch of time that one figure shows in the other figures of its part.
  function follow(plot) {
    const link = plot.dataset.link;
    const range = plot.layout.xaxis.range.slice();
    ranges.set(link, range);
    for (const other of plots) {
      const linked = other !== plot && other.dataset.link === link && !isScene(other);
      if (linked && other.dataset.drawn) show(other, range);
    }
  }

  function show(plot, range) {
    const shown = plot.layout.xaxis.range;
    if (shown[0] !== range[0] || shown[1] !== range[1]) Plotly.relayout(plot, { "xaxis.range": range.slice() });
  }

  function beforePrint() {
    most = SCENES.printed;
    for (const folded of document.querySelectorAll("details:not([open])")) {
      folded.dataset.folded = "yes";
      folded.open = true;
    }
    for (const plot of plots) {
      draw(plot);
      if (plot.layout) Plotly.relayout(plot, { width: PRINT_WIDTH });
    }
  }

  function afterPrint() {
    most = SCENES.seen;
    for (const folded of document.querySelectorAll("details[data-folded]")) {
      delete folded.dataset.folded;
      folded.open = false;
    }
    for (const plot of plots) {
      if (plot.layout) Plotly.relayout(plot, { width: null, autosize: true });
    }
  }

  const watcher = new IntersectionObserver(
    (entries) => entries.filter((entry) => entry.isIntersecting).forEach((entry) => draw(entry.target)),
    { rootMargin: "300px 0px" },
  );
  plots.forEach((plot) => watcher.observe(plot));

  // Draws the others one after the other when there is nothing else to do: a picture of the whole page, a search and
  // a jump find them drawn. Scenes only as many as may be drawn at once.
  function drawIdle() {
    const next = plots.find((plot) => !plot.dataset.drawn && !(isScene(plot) && scenes.length >= most));
    if (!next) return;
    draw(next);
    whenIdle();
  }

  function whenIdle() {
    if (window.requestIdleCallback) requestIdleCallback(drawIdle);
    else setTimeout(drawIdle, 200);
  }

  addEventListener("load", () => setTimeout(whenIdle, REST));
  addEventListener("beforeprint", beforePrint);
  addEventListener("afterprint", afterPrint);
})();

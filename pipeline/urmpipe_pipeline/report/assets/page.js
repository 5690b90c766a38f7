// Draws each figure when it comes near the window or the browser is idle, links the time axes of a run, follows the
// reader's light or dark setting, and readies the page for print.
"use strict";
(() => {
  const PRINT_WIDTH = 686; // px; what an A4 page holds between its margins
  const PRINT_FONT = 9; // px; what fits between the panels of a figure on paper
  const PRINT_HEIGHT = { plot: 320, scene: 230 }; // px at most, so that a log stands on a page
  const SCENES = { seen: 8, printed: 16 }; // drawn at once; browsers drop the oldest WebGL context beyond 16
  const REST = 1500; // ms after which a page that nobody scrolls draws what is further down
  const touch = matchMedia("(pointer: coarse)").matches;
  const darkly = matchMedia("(prefers-color-scheme: dark)");
  const DARK = JSON.parse(document.body.dataset.dark);
  const plots = [...document.querySelectorAll(".plot")];
  const ranges = new Map(); // part -> [from, to] of its time axes in s, once someone has zoomed
  const scenes = []; // drawn 3D plots, the latest last
  let most = SCENES.seen;
  let printing = false;

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

  // In a part that is closed there is no room to draw.
  function isHidden(plot) {
    return !plot.checkVisibility();
  }

  // Returns the figure in the colours of the reader's setting; paper is light.
  function specOf(plot) {
    const dark = darkly.matches && !printing;
    const text = plot.nextElementSibling.textContent;
    const spec = JSON.parse(text, (key, value) => {
      if (printing && (key === "font" || key === "tickfont")) value.size = Math.min(value.size, PRINT_FONT);
      return (dark && typeof value === "string" && DARK[value]) || value;
    });
    spec.layout.uirevision = "kept"; // zoom and hidden lines stay when the colours change
    if (isScene(plot)) {
      if (plot.camera) spec.layout.scene.camera = plot.camera;
    } else if (touch) {
      spec.layout.dragmode = false; // a finger scrolls the page
    }
    if (printing) Object.assign(spec.layout, { width: widthOnPaper(plot), height: heightOnPaper(plot) });
    return spec;
  }

  function widthOnPaper(plot) {
    return plot.closest(".multiples") ? PRINT_WIDTH / 2 - 10 : PRINT_WIDTH;
  }

  function heightOnPaper(plot) {
    return Math.min(parseFloat(plot.style.height), isScene(plot) ? PRINT_HEIGHT.scene : PRINT_HEIGHT.plot);
  }

  function draw(plot) {
    if (plot.dataset.drawn) return;
    plot.dataset.drawn = "yes";
    if (isScene(plot)) {
      scenes.push(plot);
      while (scenes.length > most) release(scenes[0]);
    }
    const spec = specOf(plot);
    try {
      Plotly.newPlot(plot, spec.data, spec.layout, config(plot));
      if (isScene(plot)) return;
      if (ranges.has(plot.dataset.link)) show(plot, ranges.get(plot.dataset.link));
      plot.on("plotly_relayout", () => follow(plot));
    } catch (error) {
      plot.textContent = "This figure could not be drawn: " + error.message;
    }
  }

  function redraw() {
    for (const plot of plots) {
      if (!plot.layout || !plot.dataset.drawn) continue;
      const spec = specOf(plot);
      Plotly.react(plot, spec.data, spec.layout, config(plot));
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
    if (printing) return;
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

  // Paper shows what is open, and each part that passed.
  function beforePrint() {
    if (printing) return;
    printing = true;
    most = SCENES.printed;
    for (const folded of document.querySelectorAll("details.passed:not([open])")) {
      folded.dataset.folded = "yes";
      folded.open = true;
    }
    redraw();
    for (const plot of plots) {
      if (isHidden(plot)) continue;
      draw(plot);
      plot.dataset.height = plot.style.height;
      plot.style.height = heightOnPaper(plot) + "px";
    }
  }

  function afterPrint() {
    if (!printing) return;
    printing = false;
    most = SCENES.seen;
    for (const plot of plots) {
      if (!plot.dataset.height) continue;
      plot.style.height = plot.dataset.height;
      delete plot.dataset.height;
    }
    for (const folded of document.querySelectorAll("details[data-folded]")) {
      delete folded.dataset.folded;
      folded.open = false;
    }
    redraw();
    for (const plot of plots) {
      if (plot.layout && !isHidden(plot)) Plotly.Plots.resize(plot);
    }
  }

  // A link into a part that is closed opens it.
  function openTarget() {
    const target = document.getElementById(decodeURIComponent(location.hash.slice(1)));
    if (!target) return;
    const inside = target.querySelector(":scope > details");
    if (inside) inside.open = true;
    for (let one = target.closest("details"); one; one = one.parentElement.closest("details")) one.open = true;
    target.scrollIntoView();
  }

  const watcher = new IntersectionObserver(
    (entries) => entries.filter((entry) => entry.isIntersecting).forEach((entry) => draw(entry.target)),
    { rootMargin: "300px 0px" },
  );
  plots.forEach((plot) => watcher.observe(plot));

  // Draws the others one after the other when there is nothing else to do: a picture of the whole page, a search and
  // a jump find them drawn. Scenes only as many as may be drawn at once.
  function drawIdle() {
    const next = plots.find(
      (plot) => !plot.dataset.drawn && !isHidden(plot) && !(isScene(plot) && scenes.length >= most),
    );
    if (!next) return;
    draw(next);
    whenIdle();
  }

  function whenIdle() {
    if (window.requestIdleCallback) requestIdleCallback(drawIdle);
    else setTimeout(drawIdle, 200);
  }

  addEventListener("load", () => {
    openTarget();
    setTimeout(whenIdle, REST);
  });
  addEventListener("hashchange", openTarget);
  addEventListener("beforeprint", beforePrint);
  addEventListener("afterprint", afterPrint);
  matchMedia("print").addEventListener("change", (media) => (media.matches ? beforePrint() : afterPrint()));
  darkly.addEventListener("change", redraw);
})();

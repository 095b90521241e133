"use strict";
// Draws the charts of the page and gives them keys. Bokeh has been loaded before.
(() => {
  const made = JSON.parse(document.getElementById("charts-document").textContent);
  const STEP = 0.2; // of the range, for a key that moves or zooms
  const TABLE_NAMES = 12; // curves that are read out

  function ready(part) {
    const drawn = Bokeh.documents.find((one) => one.get_model_by_id(Object.keys(part.roots)[0]) !== null);
    const cursor = drawn.get_model_by_name("cursor");
    for (const [model, place] of Object.entries(part.roots)) {
      const figure = drawn.get_model_by_id(model);
      const start = range(figure);
      const element = document.getElementById(place);
      element.addEventListener("keydown", (event) => key(event, figure, cursor, start));
      for (const button of element.parentElement.querySelectorAll(".curves button")) {
        button.addEventListener("click", () => toggled(figure, button));
      }
    }
  }

  function toggled(figure, button) {
    const visible = button.getAttribute("aria-pressed") !== "true";
    button.setAttribute("aria-pressed", String(visible));
    for (const renderer of figure.renderers) if (renderer.name === button.value) renderer.visible = visible;
  }

  function range(figure) {
    return { x: [figure.x_range.start, figure.x_range.end], y: [figure.y_range.start, figure.y_range.end] };
  }

  function key(event, figure, cursor, start) {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const overTurns = cursor !== null && shares(figure, cursor);
    const back = event.key === "ArrowLeft";
    if (back || event.key === "ArrowRight") {
      if (overTurns && !event.shiftKey) moveCursor(figure, cursor, back ? -1 : 1);
      else moved(figure.x_range, back ? -STEP : STEP);
    } else if (event.key === "+" || event.key === "=") zoomed(figure.x_range, 1 - STEP);
    else if (event.key === "-") zoomed(figure.x_range, 1 / (1 - STEP));
    else if (event.key === "0") {
      figure.x_range.setv({ start: start.x[0], end: start.x[1] });
      figure.y_range.setv({ start: start.y[0], end: start.y[1] });
    } else return;
    event.preventDefault();
  }

  function shares(figure, cursor) {
    return figure.toolbar.tools.some((tool) => Array.isArray(tool.overlay) && tool.overlay.includes(cursor));
  }

  function moved(range, share) {
    const by = share * (range.end - range.start);
    range.setv({ start: range.start + by, end: range.end + by });
  }

  function zoomed(range, factor) {
    const middle = 0.5 * (range.start + range.end), half = 0.5 * factor * (range.end - range.start);
    range.setv({ start: middle - half, end: middle + half });
  }

  function moveCursor(figure, cursor, by) {
    const low = figure.x_range.start, high = figure.x_range.end;
    const now = typeof cursor.location === "number" ? cursor.location : Math.floor(low);
    const turn = Math.round(now) + by;
    cursor.setv({ location: turn, visible: true });
    if (turn < low || turn > high) moved(figure.x_range, (turn < low ? turn - low : turn - high) / (high - low) * 1.5);
    const read = [];
    for (const renderer of figure.renderers) {
      const columns = renderer.data_source ? renderer.data_source.data : {};
      if (!renderer.name || !columns.x || !columns.y || read.some(([name]) => name === renderer.name)) continue;
      const place = nearest(columns.x, turn);
      if (place >= 0) read.push([renderer.name, columns.y[place]]);
    }
    const label = figure.left.length ? figure.left[0].axis_label : "";
    document.getElementById("reading").textContent = `turn ${turn}: ` + read.slice(0, TABLE_NAMES)
      .map(([name, value]) => `${name} ${Number.isFinite(value) ? value.toPrecision(7) : "-"}`).join("; ") + ` ${label}`;
  }

  function nearest(values, wanted) {
    let best = -1;
    for (let place = 0; place < values.length; place += 1) {
      if (best < 0 || Math.abs(values[place] - wanted) < Math.abs(values[best] - wanted)) best = place;
    }
    return best >= 0 && Math.abs(values[best] - wanted) <= 1 ? best : -1;
  }

  // A long table stands in the page as text, and gets its cells when it is opened.
  for (const body of document.querySelectorAll("tbody[data-rows]")) {
    body.closest("details").addEventListener("toggle", () => {
      if (body.dataset.rows === undefined) return;
      const rows = body.dataset.rows.split("\n").map((line) => {
        const row = document.createElement("tr");
        for (const text of line.split("\t")) row.appendChild(document.createElement("td")).textContent = text;
        return row;
      });
      delete body.dataset.rows;
      body.append(...rows);
    });
  }
  window.addEventListener("beforeprint", () => {
    for (const one of document.querySelectorAll("details")) one.open = true;
  });
  // The charts over the turn come first, the others when there is time: the page is there at once.
  async function draw(number) {
    if (number < made.length) {
      const part = made[number], identity = `part-${number}`;
      await Bokeh.embed.embed_items({ [identity]: part.document },
        [{ docid: identity, root_ids: Object.keys(part.roots), roots: part.roots }]);
      ready(part);
    }
    document.documentElement.dataset.drawn = number + 1 < made.length ? "first" : "all";
    if (number + 1 < made.length) setTimeout(() => draw(number + 1), 0);
  }
  requestAnimationFrame(() => setTimeout(() => draw(0), 0)); // words and tables are on the screen before
})();

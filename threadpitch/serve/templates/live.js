"use strict";
// Fills the chart of the live page with revolutions as the store gets them.
(() => {
  const SLOTS = 8, NEWEST = 30;
  let slots = new Map(), waiting = [], turns = 0;
  const state = document.getElementById("state"), newest = document.getElementById("newest");
  const buttons = [...document.querySelectorAll("#section-live .curves button")];

  const sourceOf = (number) => Bokeh.documents[0].roots()[0].renderers[2 * number].data_source;

  function begun(told) {
    slots = new Map();
    turns = 0;
    for (let number = 0; number < SLOTS; number += 1) {
      sourceOf(number).data = { x: [], y: [] };
      buttons[number].parentElement.hidden = true;
    }
    newest.replaceChildren();
    state.textContent = `Running: ${[told.machine, told.program, told.thread, told.serial_number, told.source]
      .filter((word) => word).join(", ")}`;
  }

  function revolution(told) {
    const name = [told.calculator, told.group, `${told.start_angle_deg} deg`].filter((word) => word).join(", ");
    let slot = slots.get(name);
    if (slot === undefined && slots.size < SLOTS) {
      slot = { number: slots.size, zero: typeof told.target_mm === "number" ? told.target_mm : told.pitch_mm };
      slots.set(name, slot);
      buttons[slot.number].querySelector("span").textContent = name;
      buttons[slot.number].parentElement.hidden = false;
    }
    turns += 1;
    if (slot !== undefined) {
      slot.x = [...(slot.x ?? []), told.turn];
      slot.y = [...(slot.y ?? []), 1e3 * (told.pitch_mm - slot.zero)];
      slot.changed = true;
    }
    const row = document.createElement("tr");
    const figures = [told.pitch_mm, told.min_mm, told.max_mm, told.mean_mm].map((value) => Number(value).toFixed(4));
    for (const text of [told.turn, told.calculator, told.group, told.start_angle_deg, ...figures]) {
      row.appendChild(document.createElement("td")).textContent = String(text ?? "");
    }
    newest.prepend(row);
    while (newest.children.length > NEWEST) newest.lastElementChild.remove();
  }

  function ended(told) {
    const verdict = told.verdict ? told.verdict.sentence : "no verdict";
    state.textContent = `Complete: run ${told.run_number ?? ""}, ${turns} revolutions; ${verdict}`;
  }

  // Events come in bursts: the chart is drawn once for all of them.
  function shown() {
    if (document.documentElement.dataset.drawn !== "all") return;
    const events = waiting;
    waiting = [];
    for (const [kind, told] of events) ({ begin: begun, revolution, result: ended })[kind](told);
    const values = [];
    for (const slot of slots.values()) {
      values.push(...slot.y.filter(Number.isFinite));
      if (slot.changed) sourceOf(slot.number).data = { x: slot.x, y: slot.y };
      slot.changed = false;
    }
    if (events.length > 0 && values.length > 0) scale(values);
  }

  // The range of the middle of the values: the start of the feed does not hide the others.
  function scale(values) {
    const sorted = [...values].sort((one, other) => one - other);
    const at = (share) => sorted[Math.min(sorted.length - 1, Math.floor(share * sorted.length))];
    const margin = Math.max(2 * (at(0.9) - at(0.1)), 0.05);
    const low = Math.max(sorted[0], at(0.1) - margin), high = Math.min(sorted[sorted.length - 1], at(0.9) + margin);
    const room = 0.08 * (high - low) || 0.05;
    const figure = Bokeh.documents[0].roots()[0];
    figure.y_range.setv({ start: low - room, end: high + room });
    figure.x_range.setv({ start: 0, end: 1 + Math.max(...[...slots.values()].map((slot) => slot.x[slot.x.length - 1])) });
  }

  const stream = new EventSource("/live/events");
  for (const kind of ["begin", "revolution", "result"]) {
    stream.addEventListener(kind, (event) => waiting.push([kind, JSON.parse(event.data)]));
  }
  stream.addEventListener("error", () => { state.textContent = "The server does not answer; trying again"; });
  setInterval(shown, 200);
})();

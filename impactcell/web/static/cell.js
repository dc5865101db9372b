// One cell in depth: its last tap, its trend, its signature.
import { Chart } from "./charts.js";
import { moment } from "./frame.js";
import { TOLD_STDS, beside, coefficient, follow, hasCycle, number, set, showAlarm, showFriction, showState, showValues, stdOf, texts, toldStd, withUnit } from "./live.js";

const root = document.querySelector(".cell"), cell = root.dataset.cell;
// A band of one value at each x is nothing but its edges.
const edges = [{ colour: "edge", width: 1.5 }, { colour: "edge", width: 1.5 }];
const tapSeries = [...edges, { colour: "curve", width: 1.5 }, { colour: "curve", width: 1.5 }];
const millimetres = (value) => (value === null ? "–" : value.toLocaleString(document.documentElement.lang, { minimumFractionDigits: 3, maximumFractionDigits: 3, useGrouping: false }));
const place = (id) => document.getElementById(id);
const SHOWN_SHIFTS = 5; // in words; more make a text that nobody reads
const isEmpty = (series) => series.every((value) => value === null);
const sign = (shift) => (shift.size > 0 ? "▲" : "▼");
let limit = null, past = null, span = "hour", lastTrend = 0, charts = null, waiting = null;

function makeCharts() {
  return {
    force: new Chart(place("force"), { unit: "N", xUnit: `${texts.time} / ms`, series: tapSeries }),
    position: new Chart(place("position"), { unit: "mm", xUnit: `${texts.time} / ms`, series: tapSeries }),
    signature: new Chart(place("signature"), { unit: "µk", xUnit: `${texts.distance_axis} / mm`, series: [...edges, { colour: "curve", width: 2 }, { colour: "curve", width: 0.5 }, { colour: "curve", width: 0.5 }, { colour: "bad", width: 1.5, dash: [6, 4] }] }),
    trend: new Chart(place("trend"), { unit: "µs", time: true, series: [...edges, { colour: "curve", width: 2 }] }),
  };
}

function showCurve(chart, curve, describe) {
  if (!curve || !curve.x || !curve.x.length) return chart.clear(texts.not_recorded);
  const none = curve.x.map(() => null);
  chart.show([curve.x, curve.usual_low ?? none, curve.usual_high ?? none, curve.low, curve.high]);
  chart.element.setAttribute("aria-label", describe);
}

function showDetail(detail) {
  if (!charts) { waiting = detail; return; }
  set(root, "usual", detail.usual_taps ? `${texts.compared_with} ${detail.usual_taps}` : "");
  if (detail.force !== undefined) {
    showCurve(charts.force, detail.force, place("force").getAttribute("aria-label"));
    showCurve(charts.position, detail.position, place("position").getAttribute("aria-label"));
    const s = detail.signature, none = s.x.map(() => null);
    const edge = (sign) => s.low.map((value, i) => (value === null || s.std[i] === null ? null : value + sign * TOLD_STDS * s.std[i]));
    const deviant = detail.deviant?.friction.length === s.x.length ? detail.deviant : null;
    const curves = [s.low, s.usual_low ?? none, s.usual_high ?? none, deviant?.friction ?? none];
    if (curves.every((curve) => curve.every((value) => value === null))) charts.signature.clear(texts.not_recorded);
    else charts.signature.show([s.x, s.usual_low ?? none, s.usual_high ?? none, s.low, edge(1), edge(-1), deviant?.friction ?? none],
      deviant ? [{ x: deviant.at, text: `▼ ${texts.cycle} ${deviant.cycle} ${texts.deviates}`, colour: "bad" }] : []);
  } else for (const id of ["force", "position", "signature"]) charts[id].clear(texts.no_tap);
  const table = place("taps");
  if (!table) return; // a cell that places nothing
  table.hidden = detail.taps.length === 0;
  table.tBodies[0].replaceChildren(...detail.taps.slice().reverse().map((tap) => {
    const row = document.createElement("tr");
    for (const text of [number(tap.cycle, 10), number(tap.velocity), millimetres(tap.remaining)]) row.insertCell().textContent = text;
    return row;
  }));
}

function showCard(card) {
  const { values } = card;
  showState(root, card);
  if (!hasCycle(card)) return;
  const reasons = card.reasons[document.documentElement.lang];
  if (limit !== values["Wear/Limit"]) {
    limit = values["Wear/Limit"];
    drawTrend();
  }
  showFriction(root, card);
  showValues(root, card);
  const offset = values["Batch/Offset"], std = stdOf(values, "Batch/Offset"), gap = values["Model/Gap"];
  const said = {
    cycle_time: moment(card.time_ms),
    batch_offset: offset === null ? "" : std === 0 ? texts.reference_batch : `${std === null ? coefficient(offset) : `${beside(std, offset)} ${toldStd(std)}`} ${texts.batch_offset}`,
    estimator: texts[card.estimator],
    mass: withUnit(card.mass, "kg"),
    signature_reason: reasons.signature,
    wear_reason: reasons.wear,
    batch_reason: reasons.batch,
    positioning_reason: values["Positioning/Target"] === null ? texts.no_task : reasons.positioning,
    gap_meaning: gap === null ? "" : texts[gap < 1.5 ? "at_noise" : "above_noise"],
  };
  for (const [field, text] of Object.entries(said)) set(root, field, text);
  root.dataset.cycle = values["Friction/CycleNumber"];
  if (Date.now() - lastTrend > { hour: 3e3, shift: 15e3, month: 60e3 }[span]) loadTrend();
}

async function loadTrend() {
  if (!charts) return;
  lastTrend = Date.now();
  const asked = span;
  const answer = await fetch(`/cells/${encodeURIComponent(cell)}/trend?span=${asked}`).catch(() => null);
  if (!answer || asked !== span) return;
  if (answer.status === 204) return clearTrend(texts.no_past);
  if (!answer.ok) return;
  past = await answer.json();
  drawTrend();
}

function clearTrend(text) {
  charts.trend.clear(text);
  tellShifts([]);
}

/** A mark is seen by some only, and has no room for more than a sign: what was found stands below in words. */
function tellShifts(shifts, before = "") {
  const told = shifts.slice(-SHOWN_SHIFTS).reverse().map((shift) => {
    const size = Math.abs(shift.size), by = shift.size_std ? `${beside(shift.size_std, size)} ${toldStd(shift.size_std)}` : number(size, 2);
    return `${sign(shift)} ${texts.since_cycle} ${number(shift.cycle, 10)} (${moment(shift.time_ms)}) ${texts.friction} ${by} ${texts[shift.size > 0 ? "higher" : "lower"]}`;
  });
  if (shifts.length > told.length) told.push(`${texts.earlier_shifts} ${shifts.length - told.length}`);
  const note = place("trend-note"), found = told.length ? `${texts.shifts}: ${told.join("; ")}` : "";
  const text = [before, found].filter(Boolean).map((said) => `${said}.`).join(" ");
  if (note.textContent !== text) note.textContent = text;
}

function drawTrend() {
  if (!past) return;
  if (!past.time_ms.length) return clearTrend(texts.no_trend);
  const isBlind = isEmpty(past.mu_s_low);
  if (isBlind && isEmpty(past.level)) return clearTrend(texts.no_friction);
  const marks = past.batches.map(([ms, id]) => ({ x: ms / 1e3, text: id, colour: "soft" }));
  if (limit !== null) marks.push({ y: limit, text: texts.limit, colour: "bad", dashed: true });
  marks.push(...past.shifts.map((shift) => ({ x: shift.time_ms / 1e3, text: sign(shift), colour: "warn", dashed: true })));
  marks.sort((a, b) => (a.x ?? Infinity) - (b.x ?? Infinity)); // a word that would stand on one before is left out
  tellShifts(past.shifts, isBlind ? texts.no_friction : "");
  charts.trend.show([past.time_ms.map((ms) => ms / 1e3), past.mu_s_low, past.mu_s_high, past.level], marks);
}

for (const button of document.querySelectorAll("[data-span]")) {
  button.addEventListener("click", () => {
    span = button.dataset.span;
    for (const other of document.querySelectorAll("[data-span]")) other.setAttribute("aria-pressed", String(other === button));
    loadTrend();
  });
}
addEventListener("DOMContentLoaded", start);
if (document.readyState !== "loading") start();
function start() {
  if (charts || !window.uPlot) return;
  charts = makeCharts();
  loadTrend();
  if (waiting) showDetail(waiting);
}
follow(`/live?cell=${encodeURIComponent(cell)}`, {
  card: showCard,
  detail: showDetail,
  alarms: (news) => { if (news.cell === cell) showAlarm(root.querySelector(".alarm"), news.alarms, ""); },
});

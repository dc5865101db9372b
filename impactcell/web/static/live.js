// The stream of what changes, and how it is written: numbers in the reader's language, texts never as markup.
import { moment } from "./frame.js";

export const texts = JSON.parse(document.getElementById("texts").textContent);
const language = document.documentElement.lang;

/** A number with so many significant digits, its digits not in groups, as in what the service writes; a dash where there is none. */
export function number(value, digits = 4) {
  if (value === null || value === undefined) return "–";
  return new Intl.NumberFormat(language, { maximumSignificantDigits: digits, useGrouping: false }).format(value);
}
/** A friction coefficient: four decimals, as its scatter asks for. */
export function coefficient(value) {
  if (value === null || value === undefined) return "–";
  return new Intl.NumberFormat(language, { minimumFractionDigits: 4, maximumFractionDigits: 4 }).format(value);
}
/** What stands behind a "±": as many standard deviations as the service tells everywhere. */
export const TOLD_STDS = Number(document.body.dataset.toldStds);
/** Two significant digits, also where the second is a 0: 0.0020 beside 0.0137. */
export const toldStd = (std) => `± ${new Intl.NumberFormat(language, { minimumSignificantDigits: 2, maximumSignificantDigits: 2, useGrouping: false }).format(TOLD_STDS * std)}`;
/** A value with as many decimals as stand behind its "±": 0.5600 beside 0.0011. */
export function beside(std, value) {
  if (value === null || value === undefined) return "–";
  const decimals = Math.min(Math.max(1 - Number((TOLD_STDS * std).toExponential(1).split("e")[1]), 0), 15);
  return new Intl.NumberFormat(language, { minimumFractionDigits: decimals, maximumFractionDigits: decimals, useGrouping: false }).format(value);
}
/** Cycles still to come: whole ones, none that is not sure, and three digits of them. */
export function wholeCycles(value) {
  if (!Number.isFinite(value)) return value === Infinity ? texts.never : "–";
  const whole = Math.floor(value), unit = 10 ** Math.max(String(whole).length - 3, 0);
  return number(Math.floor(whole / unit) * unit, 3);
}
/** One standard deviation of a value; null where it is not known. */
export const stdOf = (values, path) => (Number.isFinite(values[`${path}StdDev`]) ? values[`${path}StdDev`] : null);
export const withUnit = (value, unit, digits) => (value === null || value === undefined ? "–" : `${number(value, digits)} ${unit}`);

export function set(root, field, text) {
  for (const place of root.querySelectorAll(`[data-field="${field}"]`)) if (place.textContent !== text) place.textContent = text;
}

/** Where a published value is not good it says so: `card.qualities` has only those. */
export const quality = (card, path) => card.qualities[path] ?? "good";

/** Writes every published value that the page has a place for, each in the form of its unit. */
export function showValues(root, card) {
  for (const place of root.querySelectorAll("[data-quantity]")) {
    const { quantity: path, unit, form } = place.dataset, value = card.values[path];
    const std = stdOf(card.values, path);
    let text = "–";
    if (typeof value === "boolean") text = value ? texts.yes : texts.no;
    else if (path === "Model/Name") text = card.model[language] || "–";
    else if (typeof value === "string") text = value || "–";
    else if (path === "Batch/Offset" && std === 0) text = texts.reference_batch;
    else if (std !== null && Number.isFinite(value)) text = [beside(std, value), toldStd(std), unit].filter(Boolean).join(" ");
    else if (form === "band") text = Number.isFinite(value) ? toldStd(value) : "–";
    else if (form === "coefficient") text = coefficient(value);
    else if (form === "cycle") text = value ? number(value, 10) : "–";
    else if (form === "cycles") text = wholeCycles(value);
    else if (form === "count") text = number(value, 10);
    else text = unit ? withUnit(value, unit) : number(value);
    const kind = quality(card, path);
    if (text !== "–" && text !== texts.reference_batch && kind !== "good") text += ` (${texts[kind]})`;
    if (place.textContent !== text) place.textContent = text;
  }
}

export function showState(root, card) {
  const kind = card.freshness === "live" && !hasCycle(card) ? "waiting" : card.freshness;
  const sign = { live: "●", starting: "○", compiling: "○", waiting: "○", stale: "!", lost: "✕" }[kind];
  for (const place of root.querySelectorAll('[data-field="state"]')) {
    place.className = `state ${{ live: "good", starting: "plain", compiling: "plain", waiting: "plain", stale: "warn", lost: "bad" }[kind]}`;
    place.textContent = `${sign} ${texts[kind]}`;
    place.title = card.link_reason[language];
  }
}
export const hasCycle = (card) => card.time_ms !== undefined;

export function cyclesLeft(values) {
  const level = values["Wear/Level"], limit = values["Wear/Limit"], cycles = values["Wear/CyclesToLimit"];
  const low = values["Wear/CyclesToLimitLow"], high = values["Wear/CyclesToLimitHigh"];
  if (level === null) return "–"; // not known, which is not the same as a limit that is out of sight
  if (limit !== null && level > limit) return high === 0 ? texts.passed : texts.perhaps_passed;
  if (cycles === Infinity) return texts.not_reached;
  if (high === Infinity && low >= 1) return `${texts.more_than} ${wholeCycles(low)}`;
  const range = low === null ? "" : ` (${texts.from} ${wholeCycles(low)} ${texts.to} ${wholeCycles(high)})`;
  return `${wholeCycles(cycles)}${range}`;
}

export function showFriction(root, card) {
  const { values } = card, level = values["Wear/Level"], limit = values["Wear/Limit"] ?? 1;
  const std = stdOf(values, "Friction/StaticFriction"), kind = quality(card, "Friction/StaticFriction");
  const mu_s = values["Friction/StaticFriction"];
  set(root, "mu_s", std === null ? coefficient(mu_s) : beside(std, mu_s));
  set(root, "mu_s_band", std === null ? "" : toldStd(std));
  set(root, "mu_s_quality", kind === "good" ? "" : `${texts[kind]}: ${card.reasons[language].mu_s}`);
  const wear = quality(card, "Wear/Level"), doubt = level === null || wear === "good" ? "" : ` (${texts[wear]})`;
  const levelStd = stdOf(values, "Wear/Level"), commonStd = stdOf(values, "Wear/LevelCommon");
  const told = level === null || levelStd === null ? coefficient(level) : `${beside(levelStd, level)} ${toldStd(levelStd)}`;
  set(root, "wear", `${told} / ${coefficient(values["Wear/Limit"])}${doubt}`);
  set(root, "wear_common", level === null || !commonStd ? "" : `${toldStd(commonStd)} ${texts.common}`);
  for (const meter of root.querySelectorAll('[data-field="wear_meter"]')) {
    // Red from the limit on, amber from nine tenths of it: a value beyond `high` is far from an optimum below `low`.
    Object.assign(meter, { max: limit, value: level ?? 0, low: 0.9 * limit, high: 0.999 * limit, optimum: 0 });
  }
  set(root, "cycles_left", cyclesLeft(values));
  set(root, "batch", values["Batch/BatchId"] || "–");
}

/** The alarm that matters most: open before shelved, active before cleared, then the latest. */
export function lastAlarm(alarms) {
  const told = alarms.filter((alarm) => alarm.message.en);
  const rank = (alarm) => (isOpen(alarm) ? 4 : 0) + (alarm.active ? 2 : 0) + (alarm.acknowledged ? 0 : 1);
  return told.sort((a, b) => rank(b) - rank(a) || b.time_ms - a.time_ms)[0];
}
const isShelved = (alarm) => alarm.shelved !== "unshelved";
export const isOpen = (alarm) => alarm.enabled && !isShelved(alarm) && (alarm.active || !alarm.acknowledged);

export function evidence(alarm) {
  const e = alarm.evidence, parts = [];
  if (e.compared[language]) parts.push(e.compared[language]);
  if (e.size !== null) parts.push(`${texts.size} ${e.size_std === null ? number(e.size, 2) : `${beside(e.size_std, e.size)} ${toldStd(e.size_std)}`}`);
  if (e.change_cycle) parts.push(`${texts.since_cycle} ${e.change_cycle}`);
  return parts.join(", ");
}

/** What an alarm says, or said before it cleared. */
function reason(alarm) {
  const message = alarm.message[language] || alarm.message.en;
  return alarm.active ? message : `${texts.cleared} ${message}`;
}

function headline(alarm) {
  const sign = isOpen(alarm) ? "▲" : isShelved(alarm) ? "‖" : "○";
  const state = [isShelved(alarm) && texts.shelved, !alarm.acknowledged && texts.acknowledge].filter(Boolean).join(", ");
  return `${sign} ${texts[alarm.name]}${state && ` (${state})`}: ${reason(alarm)}`;
}

export function showAlarm(place, alarms, emptyText) {
  const alarm = lastAlarm(alarms);
  place.classList.toggle("is-open", Boolean(alarm && isOpen(alarm)));
  const lines = alarm ? [headline(alarm), evidence(alarm)] : [emptyText];
  place.replaceChildren(...lines.filter(Boolean).map((line, index) => {
    const paragraph = document.createElement("p");
    if (index) paragraph.className = "help";
    paragraph.textContent = line;
    return paragraph;
  }));
}

/** A demo's tour: what has happened is ticked off, what comes is said to come. */
export function showTour(card) {
  const cycle = card.values["Friction/CycleNumber"] ?? 0;
  for (const stop of document.querySelectorAll(`[data-tour="${CSS.escape(card.cell)}"] [data-cycle-from]`)) {
    const from = Number(stop.dataset.cycleFrom);
    stop.className = cycle >= from ? "happened" : "";
    stop.dataset.when = cycle >= from ? `✓ ${texts.since_cycle} ${from}` : `${texts.in_cycles} ${from - cycle}`;
  }
}

/** Without the service nothing on the page is live: it says so at the top, and wherever it said that it was. */
function showOffline(since) {
  const notice = document.getElementById("offline");
  if (!notice.hidden) return;
  notice.textContent = `✕ ${texts.offline} (${moment(since)})`;
  notice.hidden = false;
  document.body.classList.add("is-offline");
  showUnknown(texts.offline);
}

/** What was said of the cells is from before. */
function showUnknown(why) {
  for (const place of document.querySelectorAll('[data-field="state"]')) {
    place.className = "state plain";
    place.textContent = `? ${texts.unknown}`;
    place.title = why;
  }
}

const SILENCE_MS = 25000; // two and a half signs of life: a link that is cut without a word ends no stream
const AGAIN_MS = 5000; // where somebody answers in place of the service, as a proxy does, the browser gives up
const USED_MS = 600000; // a tab behind others asks so often, for its session to go on as that of one in front

/**
 * Keeps a stream open while the tab is in front, for a browser opens six connections to a host and no more;
 * the browser reconnects by itself, the end of a session leads to the login. Nothing else loads the page anew:
 * while the service is away, nothing would come in its place.
 */
export function follow(address, handlers) {
  const openAlarms = new Map();
  const count = document.getElementById("open-alarms");
  let source, heard = new Date(), asked = heard;
  const ask = () => {
    asked = new Date();
    return fetch("/alarms/rows", { method: "HEAD", redirect: "manual" }).catch(() => null);
  };
  const hear = () => {
    heard = new Date();
    document.getElementById("offline").hidden = true;
    document.body.classList.remove("is-offline");
  };
  const lose = async () => {
    showOffline(heard);
    const answer = await ask();
    if (answer && answer.status === 401) location.reload();
    else if (source.readyState === EventSource.CLOSED) setTimeout(() => { if (!document.hidden) connect(); }, AGAIN_MS);
  };
  const heardOf = { alive() {} };
  heardOf.alarms = (cell) => {
    openAlarms.set(cell.cell, cell.alarms.filter(isOpen).length);
    const total = [...openAlarms.values()].reduce((sum, n) => sum + n, 0);
    count.hidden = total === 0;
    count.textContent = total;
    count.setAttribute("aria-label", `${total} ${total === 1 ? texts.open_one : texts.open_many}`);
    handlers.alarms?.(cell);
  };
  for (const kind of ["recent", "card", "detail"]) heardOf[kind] = (content) => {
    handlers[kind]?.(content);
    if (kind === "card") showTour(content);
  };
  function connect() {
    source?.close();
    asked = new Date();
    source = new EventSource(address);
    source.addEventListener("open", hear);
    source.addEventListener("error", lose);
    for (const [kind, show] of Object.entries(heardOf)) source.addEventListener(kind, (event) => {
      hear();
      show(JSON.parse(event.data));
    });
  }
  if (!document.hidden) connect();
  document.addEventListener("visibilitychange", () => {
    if (document.hidden) return source?.close();
    showUnknown("");
    connect();
  });
  setInterval(() => {
    const silent = new Date() - Math.max(heard, asked);
    if (document.hidden && silent > USED_MS) ask();
    if (document.hidden || silent < SILENCE_MS) return;
    showOffline(heard);
    if (source.readyState === EventSource.OPEN) connect();
  }, 1000);
  addEventListener("pagehide", () => source?.close());
}

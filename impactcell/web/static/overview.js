// A card a cell.
import { moment } from "./frame.js";
import { follow, hasCycle, isOpen, number, set, showAlarm, showFriction, showState, texts } from "./live.js";

const SHOWN = 120; // cycles of the small curve; the service remembers as many
const curves = new Map();
const cardOf = (cell) => document.querySelector(`[data-cell="${CSS.escape(cell)}"]`);

function spark(svg, recent) {
  const values = recent.map((entry) => entry[1]).filter((value) => value !== null);
  svg.replaceChildren();
  if (values.length < 2) return;
  const low = Math.min(...values), high = Math.max(...values), span = Math.max(high - low, 1e-4);
  const points = values.map((value, i) => `${((i / (values.length - 1)) * 120).toFixed(1)},${(38 - ((value - low) / span) * 36).toFixed(1)}`);
  const line = document.createElementNS("http://www.w3.org/2000/svg", "polyline");
  line.setAttribute("points", points.join(" "));
  svg.append(line);
}

// Where there are more cards than a screen holds, those that somebody should look at are named above them.
const MANY = 6;
const worries = new Map(); // by cell: whether an alarm is open, whether its cycles come
function worry(cell, what) {
  worries.set(cell, { ...worries.get(cell), ...what });
  const links = [...worries].filter(([, { alarm, state }]) => alarm || state).map(([name, { alarm, state }]) => {
    const link = document.createElement("a");
    link.href = `/cells/${encodeURIComponent(name)}`;
    link.className = `tag ${alarm || state === "lost" ? "bad" : "warn"}`;
    link.textContent = `${alarm ? "▲" : state === "lost" ? "✕" : "!"} ${name}`;
    link.title = [alarm && texts.open_one, state && texts[state]].filter(Boolean).join(", ");
    return link;
  });
  const place = document.getElementById("worries");
  place.hidden = worries.size <= MANY || links.length === 0;
  place.querySelector("span").replaceChildren(...links.flatMap((link) => [link, " "]));
}

follow("/live", {
  recent({ cell, recent }) { curves.set(cell, recent); },
  alarms({ cell, alarms }) {
    const root = cardOf(cell);
    if (root) showAlarm(root.querySelector(".alarm"), alarms, `✓ ${texts.last_alarm}: ${texts.no_alarm}`);
    worry(cell, { alarm: alarms.some(isOpen) });
  },
  card(card) {
    const root = cardOf(card.cell);
    if (!root) return;
    showState(root, card);
    worry(card.cell, { state: ["live", "starting", "compiling"].includes(card.freshness) ? "" : card.freshness });
    if (!hasCycle(card)) return;
    const cycle = card.values["Friction/CycleNumber"], curve = curves.get(card.cell) ?? [];
    if (curve.at(-1)?.[0] !== cycle) curve.push([cycle, card.values["Friction/StaticFriction"]]);
    if (curve.length > SHOWN) curve.shift();
    showFriction(root, card);
    set(root, "cycle", number(cycle, 10));
    set(root, "cycle_time", moment(card.time_ms));
    spark(root.querySelector(".spark"), curve);
    root.dataset.cycle = cycle;
  },
});

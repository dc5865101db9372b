// A card a cell.
import { follow, number, set, showAlarm, showFriction, showState, texts } from "./live.js";

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

follow("/live", {
  card(card) {
    const root = document.querySelector(`[data-cell="${CSS.escape(card.cell)}"]`);
    if (!root) return;
    showState(root, card);
    showAlarm(root.querySelector(".alarm"), card, `✓ ${texts.last_alarm}: ${texts.no_alarm}`);
    if (card.cycle === undefined) return;
    showFriction(root, card);
    set(root, "cycle", number(card.cycle, 10));
    spark(root.querySelector(".spark"), card.recent);
    root.dataset.cycle = card.cycle;
  },
});

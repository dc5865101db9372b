// Keeps the open alarms as they are now, but never under somebody's hands.
import { showTimes } from "./frame.js";
import { follow } from "./live.js";

const open = document.getElementById("open"), renew = document.getElementById("renew");
const events = (ids) => ids.sort().join();

async function load() {
  const answer = await fetch("/alarms/rows");
  if (!answer.ok) return;
  open.innerHTML = await answer.text(); // escaped by the service, and the policy runs no script in it
  showTimes(open);
  renew.hidden = true;
}
renew.addEventListener("click", load);

follow("/live/alarms", {
  alarms({ cell, alarms }) {
    const shown = [...open.querySelectorAll("[data-event]")].filter(({ dataset }) => dataset.cell === cell);
    const now = events(alarms.filter((alarm) => alarm.listed).map((alarm) => alarm.event_id));
    if (now === events(shown.map(({ dataset }) => dataset.event))) return;
    const typed = [...open.querySelectorAll('input[name="comment"]')].some((input) => input.value);
    if (typed || open.contains(document.activeElement)) renew.hidden = false;
    else load();
  },
});

// Keeps the open alarms as they are now, but never under somebody's hands.
import { showTimes } from "./frame.js";
import { follow } from "./live.js";

const open = document.getElementById("open"), renew = document.getElementById("renew");
const told = new Map();
let shown = null;

async function load() {
  const answer = await fetch("/alarms/rows");
  if (!answer.ok) return;
  open.innerHTML = await answer.text(); // escaped by the service, and the policy runs no script in it
  showTimes(open);
  renew.hidden = true;
}
renew.addEventListener("click", load);

follow("/live", {
  alarms({ cell, alarms }) {
    told.set(cell, JSON.stringify(alarms.map((alarm) => alarm.event_id)));
    const now = JSON.stringify([...told]);
    const isFirst = shown === null;
    if (now === shown) return;
    shown = now;
    if (isFirst) return;
    const typed = [...open.querySelectorAll('input[name="comment"]')].some((input) => input.value);
    if (typed || open.contains(document.activeElement)) renew.hidden = false;
    else load();
  },
});

// One study: brought up to date while something is done, never under somebody's hands.
import { showTimes } from "./frame.js";

const place = document.getElementById("study"), SECOND = 1000;
const isWorking = () => place.firstElementChild?.dataset.working === "yes";

async function renew() {
  const answer = await fetch(`/studies/${place.dataset.study}/state`).catch(() => null);
  if (answer?.status === 401) return location.reload();
  if (!answer?.ok) return;
  const text = await answer.text();
  if (text === renew.shown) return;
  renew.shown = text;
  place.innerHTML = text; // escaped by the service, and the policy runs no script in it
  showTimes(place);
}
setInterval(() => { if (isWorking()) renew(); }, SECOND);

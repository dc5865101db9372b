// What every page has: the choice of colours, times in the reader's own zone.
const theme = document.getElementById("theme");
theme.addEventListener("change", () => {
  document.cookie = `theme=${theme.value}; path=/; max-age=31536000; samesite=strict`;
  document.documentElement.dataset.theme = theme.value;
  document.dispatchEvent(new Event("themechange"));
});
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => document.dispatchEvent(new Event("themechange")));
// What came of a form is told once: neither a page that is loaded anew nor one that is bookmarked says it again.
const told = new URL(location.href);
for (const name of ["done", "refused"]) told.searchParams.delete(name);
if (told.search !== location.search) history.replaceState(history.state, "", told);
// A form is sent once: pressed twice it would be refused the second time, and the page would tell of a fault. A page
// that is come back to may send it again.
document.addEventListener("submit", (event) => {
  if (event.defaultPrevented || event.target.method !== "post") return;
  if (event.target.dataset.sent) event.preventDefault();
  event.target.dataset.sent = "yes";
});
addEventListener("pageshow", () => { for (const form of document.forms) delete form.dataset.sent; });
// Choosing a language keeps the rest of the address.
for (const link of document.querySelectorAll(".languages a")) {
  const address = new URL(location.href);
  address.searchParams.set("lang", link.hreflang);
  link.href = address.pathname + address.search;
}

const when = new Intl.DateTimeFormat(document.documentElement.lang, { dateStyle: "medium", timeStyle: "medium", hourCycle: "h23" });
export function showTimes(root) {
  for (const time of root.querySelectorAll("time[data-ms]")) {
    const date = new Date(Number(time.dataset.ms));
    time.dateTime = date.toISOString();
    time.textContent = when.format(date);
  }
}
export const moment = (ms) => when.format(new Date(ms));
showTimes(document);

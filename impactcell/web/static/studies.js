// Drop files: they are sent one after the other, then read; the study's own page shows what comes of it.
import { texts } from "./live.js";

const zone = document.getElementById("drop"), form = document.getElementById("drop-form");
const note = document.getElementById("drop-note"), bar = document.getElementById("drop-progress");
let isSending = false;

const say = (text, kind = "") => { note.textContent = text; note.className = kind; };
const post = (address, values) => fetch(address, { method: "POST", body: new URLSearchParams({ csrf: form.dataset.csrf, ...values }) });

function put(id, file, progress) {
  return new Promise((resolve, reject) => {
    const request = new XMLHttpRequest();
    request.open("PUT", `/studies/${id}/files?name=${encodeURIComponent(file.name)}`);
    request.setRequestHeader("X-CSRF-Token", form.dataset.csrf);
    request.upload.addEventListener("progress", (event) => progress(event.loaded));
    request.addEventListener("load", () => {
      if (request.status === 201) return resolve();
      let text = request.statusText;
      try { text = JSON.parse(request.responseText).error; } catch { /* no sentence came */ }
      reject(new Error(`${file.name}: ${text}`));
    });
    request.addEventListener("error", () => reject(new Error(`${file.name}: ${texts.upload_broke}`)));
    request.send(file);
  });
}

/** Why a study could not be begun: the sentence of the page that came in its place. */
async function refusal(answer) {
  if (answer.status === 401) return texts.offline;
  const said = new DOMParser().parseFromString(await answer.text(), "text/html").querySelector("main .panel p");
  return said?.firstChild?.textContent.trim() || texts.upload_refused;
}

async function send(files) {
  if (isSending) return;
  if (!files.length) return say(texts.no_files, "notice bad");
  isSending = true;
  const total = files.reduce((sum, file) => sum + file.size, 0) || 1;
  let before = 0, id = null;
  bar.hidden = false;
  bar.value = 0;
  try {
    const title = files.length === 1 ? files[0].name : `${files[0].name} + ${files.length - 1}`;
    const answer = await post("/studies", { cell: form.elements.cell.value, title });
    if (answer.status !== 201) throw new Error(await refusal(answer));
    id = (await answer.json()).id;
    for (const file of files) {
      say(`${texts.uploading} ${file.name}`);
      await put(id, file, (loaded) => { bar.value = (before + loaded) / total; });
      before += file.size;
    }
    await post(`/studies/${id}/read`, {});
    location.href = `/studies/${id}`;
  } catch (error) {
    say(error.message, "notice bad");
    bar.hidden = true;
    if (id) post(`/studies/${id}/remove`, {}).catch(() => {});
  } finally {
    isSending = false;
  }
}

if (form) {
  form.addEventListener("submit", (event) => { event.preventDefault(); send([...form.elements.files.files]); });
  for (const kind of ["dragenter", "dragover"]) zone.addEventListener(kind, (event) => { event.preventDefault(); zone.classList.add("is-over"); });
  for (const kind of ["dragleave", "drop"]) zone.addEventListener(kind, () => zone.classList.remove("is-over"));
  zone.addEventListener("drop", (event) => { event.preventDefault(); send([...event.dataTransfer.files]); });
}

// The experimenter's page: all sessions, asked for every few seconds.

import { element } from "./sheet.js";

const EVERY_MS = 3000;
const get = (id) => document.getElementById(id);
// The key is not left in the history, but lasts as long as the tab, for when the page is loaded again
const KEPT = `noisefloor.experimenter.${location.pathname}`;
if (location.hash) sessionStorage.setItem(KEPT, location.hash.slice(1));
const key = sessionStorage.getItem(KEPT) ?? "";
history.replaceState(null, "", location.pathname);

const ago = (ms) => {
  const minutes = Math.floor(ms / 60000);
  if (minutes < 1) return "just now";
  return minutes < 120 ? `${minutes} min ago` : `${Math.floor(minutes / 60)} h ago`;
};

function row(session, now) {
  const made = element("tr");
  made.className = session.state;
  const ids = Object.entries(session.ids)
    .map(([name, value]) => `${name} ${value}`)
    .join(", ");
  const code = element("th", session.code.replace(/(....)(?=.)/g, "$1-"));
  code.scope = "row";
  const cells = [
    ids,
    session.group,
    session.state.replace("-", " "),
    session.progress.join(" / "),
    session.trials_per_minute?.toFixed(1) ?? "",
    new Date(session.begun_ms).toLocaleString(),
    ago(now - session.last_ms),
    session.exclusions.join("; "),
  ];
  made.append(code, ...cells.map((text) => element("td", text)));
  return made;
}

function summary(sessions) {
  const count = (state) => sessions.filter((s) => s.state === state).length;
  const excluded = sessions.filter((s) => s.state === "finished" && s.exclusions.length > 0).length;
  const words = [
    sessions.length === 1 ? "1 session" : `${sessions.length} sessions`,
    `${count("active")} active`,
    `${count("finished")} finished`,
    `${excluded} of these would be excluded`,
    `${count("dropped-out")} dropped out`,
    `${count("screened-out")} screened out`,
  ];
  return words.join(" · ");
}

async function refresh() {
  const answer = await fetch("api/overview", {
    headers: { authorization: `Bearer ${key}` },
    cache: "no-store",
  });
  const body = await answer.json();
  if (!answer.ok) throw new Error(`${body.what}: ${body.what_to_do}`);
  get("summary").textContent = summary(body.sessions);
  get("rows").replaceChildren(...body.sessions.map((session) => row(session, body.now_ms)));
  get("status").textContent = `as of ${new Date(body.now_ms).toLocaleTimeString()}`;
}

for (;;) {
  try {
    await refresh();
    get("problem").hidden = true;
  } catch (error) {
    get("problem").textContent =
      error instanceof TypeError ? "The server cannot be reached." : error.message;
    get("problem").hidden = false;
  }
  await new Promise((go) => setTimeout(go, EVERY_MS));
}

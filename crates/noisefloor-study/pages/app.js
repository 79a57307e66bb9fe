// One observer's way through the pages: language, consent, conditions, trials, farewell.

import * as server from "./server.js";
import { crowded, scaled } from "./picture.js";
import * as trials from "./trials.js";
import * as viewing from "./viewing.js";

const main = document.getElementById("main");
const bar = { title: document.getElementById("title"), status: document.getElementById("status"), code: document.getElementById("code") };
const cover = document.getElementById("cover");

let study;
let language;
let t;
let outbox = null;

const spoken = (code) => code.replace(/(....)(?=.)/g, "$1-");

function sheet(title, ...inside) {
  const element = document.createElement("section");
  element.className = "sheet";
  const heading = document.createElement("h1");
  heading.textContent = title;
  element.append(heading, ...inside);
  main.replaceChildren(element);
  window.scrollTo(0, 0);
  main.focus({ preventScroll: true });
  return element;
}

function paragraphs(text) {
  return text.split(/\n\s*\n/).filter((part) => part.trim()).map((part) => {
    const p = document.createElement("p");
    p.textContent = part.trim();
    return p;
  });
}

function actions(...buttons) {
  const row = document.createElement("div");
  row.className = "actions";
  for (const [text, action, first] of buttons) {
    const element = document.createElement("button");
    element.type = "button";
    element.textContent = text;
    if (first) element.className = "main";
    element.addEventListener("click", () => action(element));
    row.append(element);
  }
  return row;
}

async function speak(wanted) {
  const known = Object.keys(study.text);
  language = known.includes(wanted) ? wanted : known[0];
  t = await server.strings(language);
  document.documentElement.lang = language;
  document.title = study.text[language].title;
  bar.title.textContent = study.text[language].title;
}

/** Covers everything while pictures would be scaled or cut off. */
function watch() {
  const count = study.protocol === "forced-choice" ? 1 : 2;
  const problem = outbox && (scaled() ?? study.stacks.map((stack) => crowded(stack, count)).find(Boolean));
  cover.hidden = !problem;
  main.inert = Boolean(problem);
  if (problem) document.getElementById("cover-text").textContent = t[problem];
}

function progress(view) {
  bar.code.textContent = spoken(view.code);
  const bits = [];
  if (view.stage === "trials") {
    const element = document.createElement("progress");
    element.className = "done-so-far";
    Object.assign(element, { max: view.total, value: view.done });
    element.setAttribute("aria-label", t.progress);
    bits.push(element, ` ${view.done} / ${view.total}`);
  }
  bar.status.replaceChildren(...bits);
}

function failed(error) {
  const said = error.body ? `${error.body.what}. ${error.body.what_to_do}` : String(error.message ?? error);
  sheet(t?.problem ?? "Problem", ...paragraphs(said), actions([t?.again ?? "Try again", () => location.reload(), true]));
}

function join(view) {
  outbox = new server.Outbox(
    view,
    (waiting) => { bar.status.textContent = waiting ? t.waiting : ""; },
    () => go().catch(failed),
  );
  server.remember(view.code);
}

/** Shows what the session is at, as the server has it. */
async function go() {
  const code = outbox.code;
  await outbox.settled();
  join(await server.view(code));
  const view = await outbox.settled();
  if (view.language && view.language !== language) await speak(view.language);
  progress(view);
  watch();
  if (view.paused) return paused(view);
  const stages = { consent, conditions, trials: trial, finished };
  return stages[view.stage](view);
}

function welcome() {
  outbox = null;
  bar.code.textContent = "";
  bar.status.textContent = "";
  const page = sheet(study.text[language].title, ...paragraphs(study.text[language].instructions), ...paragraphs(t[`about_${study.protocol}`]));

  const known = Object.keys(study.text);
  if (known.length > 1) {
    const label = document.createElement("label");
    const select = document.createElement("select");
    for (const code of known) select.add(new Option({ en: "English", fr: "Français" }[code], code, false, code === language));
    select.addEventListener("change", async () => { await speak(select.value); welcome(); });
    label.append(`${t.language} `, select);
    label.querySelector("select").id = "language";
    page.append(label);
  }
  let group = "";
  if (study.groups.length > 0) {
    const label = document.createElement("label");
    const select = document.createElement("select");
    select.id = "group";
    for (const name of study.groups) select.add(new Option(name, name));
    group = study.groups[0];
    select.addEventListener("change", () => { group = select.value; });
    label.append(`${t.group} `, select);
    page.append(label);
  }
  page.append(actions([t.begin, async (pressed) => {
    pressed.disabled = true;
    try { join(await server.begin(group)); await go(); } catch (error) { failed(error); }
  }, true]));

  const form = document.createElement("form");
  const set = document.createElement("fieldset");
  const title = document.createElement("legend");
  const label = document.createElement("label");
  const input = document.createElement("input");
  title.textContent = t.resume_title;
  Object.assign(input, { type: "text", id: "resume-code", autocomplete: "off", required: true, maxLength: 40 });
  label.append(`${t.code} `, input);
  const row = document.createElement("div");
  row.className = "actions";
  const resume = document.createElement("button");
  resume.textContent = t.resume;
  row.append(resume);
  const wrong = document.createElement("p");
  wrong.setAttribute("role", "alert");
  set.append(title, label, wrong, row);
  form.className = "resume";
  form.append(set);
  form.addEventListener("submit", async (submitted) => {
    submitted.preventDefault();
    try {
      join(await server.view(encodeURIComponent(input.value.trim())));
      await go();
    } catch (error) {
      wrong.textContent = error.status === 404 ? t.wrong_code : error.message;
    }
  });
  page.append(form);
}

function consent(view) {
  const box = document.createElement("input");
  Object.assign(box, { type: "checkbox", id: "agree" });
  const label = document.createElement("label");
  label.className = "line";
  label.append(box, t.agree);
  const note = document.createElement("p");
  note.className = "note";
  note.textContent = t.code_note.replace("{code}", spoken(view.code));
  const page = sheet(t.consent, ...paragraphs(study.text[language].consent), ...paragraphs(t.stored), note, label);
  const row = actions([t.go_on, () => { outbox.add({ kind: "consent", language }); go().catch(failed); }, true]);
  const next = row.querySelector("button");
  next.disabled = true;
  box.addEventListener("change", () => { next.disabled = !box.checked; });
  page.append(row);
}

function conditions() {
  const page = sheet(t.conditions, ...paragraphs(t.conditions_why));
  viewing.ask(page, t, (event) => { outbox.add(event); go().catch(failed); });
}

async function trial(view) {
  const how = await trials.run(main, study, view.trial, t, (event) => { outbox.add(event); });
  if (how === "pause") outbox.add({ kind: "pause" });
  await go().catch(failed);
}

function paused(view) {
  sheet(t.paused, ...paragraphs(t.paused_how.replace("{code}", spoken(view.code))),
    actions([t.resume, () => { outbox.add({ kind: "resume" }); go().catch(failed); }, true], [t.leave, () => { server.forget(view.code); welcome(); }]));
}

async function save(code) {
  const text = JSON.stringify(await server.exported(code), null, 2);
  const link = document.createElement("a");
  link.href = URL.createObjectURL(new Blob([text], { type: "application/json" }));
  link.download = `noisefloor-${code}.json`;
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 10000);
}

function finished(view) {
  const { code } = view;
  const said = document.createElement("p");
  said.setAttribute("role", "status");
  let sure = false;
  sheet(t.thanks, ...paragraphs(t.thanks_text.replace("{code}", spoken(code))), said,
    actions([t.next_observer, () => { server.forget(code); welcome(); }, true],
      [t.save, () => save(code).catch(failed)],
      [t.erase, async (pressed) => {
        if (!sure) { sure = true; pressed.textContent = t.erase_sure; return; }
        try {
          await server.erase(code);
          server.forget(code);
          bar.code.textContent = "";
          sheet(t.erased, ...paragraphs(t.erased_text), actions([t.next_observer, welcome, true]));
        } catch (error) { failed(error); }
      }]));
}

async function start() {
  study = await server.study();
  await speak(navigator.language.slice(0, 2));
  window.addEventListener("resize", watch);
  window.visualViewport?.addEventListener("resize", watch);
  const code = server.remembered();
  if (code) {
    try {
      join(await server.view(code));
      return await go();
    } catch (error) {
      if (error.status !== 404) throw error;
      server.forget(code);
    }
  }
  return welcome();
}

start().catch(failed);

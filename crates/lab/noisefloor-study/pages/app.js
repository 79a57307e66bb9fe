// One observer's way through the pages.

import * as server from "./server.js";
import { crowded, unfit } from "./picture.js";
import { actions, element, fill, paragraphs, sheet, wayOut } from "./sheet.js";
import * as trials from "./trials.js";
import * as viewing from "./viewing.js";
import { arrival, consent, questions, welcome } from "./welcome.js";

const main = document.getElementById("main");
const bar = Object.fromEntries(["title", "status", "code"].map((id) => [id, document.getElementById(id)]));
const cover = document.getElementById("cover");

let study;
let language;
let t;
let outbox = null;
/** Trials before which a break, or the practice, was announced already. */
const announced = new Set();
/** Counts pages: what was shown before must not answer any more. */
let turn = 0;

const spoken = (code) => code.replace(/(....)(?=.)/g, "$1-");
const send = (event) => {
  outbox.add(event);
  go().catch(failed);
};

async function speak(wanted) {
  const known = Object.keys(study.text);
  language = known.includes(wanted) ? wanted : known[0];
  t = await server.texts(language);
  Object.assign(document.documentElement, { lang: language, dir: study.languages[language].direction });
  document.title = study.text[language].title;
  bar.title.textContent = study.text[language].title;
}

/** Covers everything while pictures would not be shown as they are, and says why. */
function watch() {
  const count = study.protocol === "forced-choice" ? 1 : 2;
  const small = () => study.stacks.map((stack) => crowded(stack, count)).find(Boolean);
  const problem = outbox && (unfit() ?? small());
  cover.hidden = !problem;
  main.inert = Boolean(problem);
  if (problem) document.getElementById("cover-text").textContent = t[problem];
  const trial = !problem && outbox?.view.stage === "trials" && !document.getElementById("card-width");
  if (trial && viewing.changed(outbox.view.conditions)) go().catch(failed);
}

function progress(view) {
  bar.code.textContent = spoken(view.code);
  const bits = [];
  if (view.stage === "trials") {
    const done = element("progress");
    done.className = "done-so-far";
    Object.assign(done, { max: view.total, value: view.done });
    done.setAttribute("aria-label", t.progress);
    bits.push(done, ` ${view.done} / ${view.total}`);
  }
  bar.status.replaceChildren(...bits);
}

function failed(error) {
  const said = error.body ? `${error.body.what}. ${error.body.what_to_do}` : String(error.message ?? error);
  const again = [t?.again ?? "Try again", () => location.reload(), true];
  sheet(t?.problem ?? "Problem", ...paragraphs(said), actions(again));
}

function join(view) {
  const state = (waiting) => {
    bar.status.textContent = waiting ? t.waiting : "";
  };
  outbox = new server.Outbox(view, state, () => go().catch(failed));
  server.remember(view.code);
}

/** Shows what the session is at, as the server has it. */
async function go() {
  const mine = ++turn;
  const code = outbox.code;
  await outbox.settled();
  join(await server.view(code));
  const view = await outbox.settled();
  if (mine !== turn) return undefined;
  if (view.language && view.language !== language) await speak(view.language);
  progress(view);
  if (view.paused) return paused(view);
  // A study in the middle of a session is not announced again
  const pages = {
    consent: agree,
    questions: asked,
    conditions,
    trials: trial,
    finished,
    "screened-out": out,
  };
  pages[view.stage](view);
  return watch();
}

function begin() {
  outbox = null;
  turn += 1;
  bar.code.textContent = "";
  bar.status.textContent = "";
  const begun = (view) => {
    join(view);
    go().catch(failed);
  };
  welcome({
    study,
    language,
    t,
    begun,
    failed,
    speak: async (wanted) => {
      await speak(wanted);
      begin();
    },
  });
}

const agree = (view) => consent({ study, language, t, code: spoken(view.code), send });
const asked = () => questions({ study, language, t, send });

function conditions(view) {
  const why = [t.conditions_why];
  if (view.viewing_problem) why.unshift(t[`viewing_${view.viewing_problem.replaceAll("-", "_")}`]);
  else if (view.conditions) why.unshift(t.conditions_again);
  const page = sheet(t.conditions, ...why.map((text) => element("p", text)));
  if (why.length > 1) page.querySelector("p").setAttribute("role", "alert");
  viewing.ask(page, t, send);
}

/** A page before a trial, once. */
function announce(name, title, text, view) {
  const key = `${name} ${view.trial.number}`;
  if (announced.has(key)) return false;
  announced.add(key);
  sheet(title, ...paragraphs(text), actions([t.go_on, () => go().catch(failed), true]));
  return true;
}

async function trial(view) {
  if (viewing.changed(view.conditions)) return conditions(view);
  const { practice } = view.trial;
  const [n, of] = view.ordinal;
  if (practice && view.practice_round > 1 && n === 1) {
    if (announce("practice", t.practice_again, t.practice_again_text, view)) return undefined;
  }
  if (view.break_due && announce("break", t.break_title, t.break_text, view)) return undefined;
  const heading = fill(practice ? t.practice : t.trial, { n, of });
  const how = await trials.run({
    main,
    study,
    trial: view.trial,
    heading,
    t,
    send: (event) => outbox.add(event),
  });
  if (how === "pause") outbox.add({ kind: "pause" });
  return go().catch(failed);
}

function paused(view) {
  const leave = [
    t.leave,
    () => {
      server.forget(view.code);
      begin();
    },
  ];
  const resume = [t.resume, () => send({ kind: "resume" }), true];
  sheet(t.paused, ...paragraphs(fill(t.paused_how, { code: spoken(view.code) })), actions(resume, leave));
}

async function save(code) {
  const link = element("a");
  link.href = URL.createObjectURL(new Blob([await server.exported(code)], { type: "application/json" }));
  link.download = `noisefloor-${code}.json`;
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 10000);
}

function farewell(view, title, text) {
  const { code, completion } = view;
  let sure = false;
  const erase = async (pressed) => {
    if (!sure) {
      sure = true;
      pressed.textContent = t.erase_sure;
      return;
    }
    try {
      await server.erase(code);
      server.forget(code);
      bar.code.textContent = "";
      sheet(t.erased, ...paragraphs(t.erased_text), actions([t.next_observer, begin, true]));
    } catch (error) {
      failed(error);
    }
  };
  const parts = paragraphs(fill(text, { code: spoken(code) }));
  if (completion.code) {
    const proof = element("p", fill(t.completion, { code: completion.code }));
    proof.className = "proof";
    parts.unshift(proof);
  }
  parts.push(...paragraphs(completion.debriefing));
  const next = [
    t.next_observer,
    () => {
      server.forget(code);
      begin();
    },
    !completion.url,
  ];
  const row = actions(next, [t.save, () => save(code).catch(failed)], [t.erase, erase]);
  if (completion.url) row.firstChild.replaceWith(wayOut(t.completion_return, completion.url));
  sheet(title, ...parts, row);
}

const finished = (view) => farewell(view, t.thanks, t.thanks_text);
const out = (view) => farewell(view, t.screened_out, t.screened_out_text);

async function start() {
  study = await server.study();
  await speak(navigator.language.slice(0, 2));
  window.addEventListener("resize", watch);
  window.visualViewport?.addEventListener("resize", watch);
  matchMedia("(forced-colors: active)").addEventListener("change", watch);
  const code = server.remembered();
  const { link, ids } = arrival(study);
  // A personal link leads to its own session, also where somebody else took part before
  if (code && !link && Object.keys(ids).length === 0) {
    try {
      join(await server.view(code));
      return await go();
    } catch (error) {
      if (error.status !== 404) throw error;
      server.forget(code);
    }
  }
  return begin();
}

start().catch(failed);

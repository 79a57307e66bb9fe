// The first pages: what the study is about, consent, and its questions.

import * as server from "./server.js";
import { actions, choice, element, fill, paragraphs, sheet } from "./sheet.js";

/** What the address of the page says: a personal link, and identifiers that the study asks for. */
export function arrival(study) {
  const given = new URLSearchParams(location.search);
  const ids = {};
  for (const name of study.id_parameters) if (given.get(name)) ids[name] = given.get(name).slice(0, 200);
  return { link: given.get("link"), ids };
}

/** Shows the study; `begun(view)` hears the session, `speak(language)` the language wanted. */
export function welcome({ study, language, t, begun, speak, failed }) {
  const text = study.text[language];
  const about = [...paragraphs(text.instructions), ...paragraphs(t[`about_${study.protocol}`])];
  if (study.minutes) about.push(element("p", fill(t.duration, { minutes: study.minutes })));
  const page = sheet(text.title, ...about);

  const known = Object.entries(study.languages).map(([code, { name }]) => [code, name]);
  if (known.length > 1) {
    const [label, select] = choice("language", t.language, known, t.choose);
    select.value = language;
    select.addEventListener("change", () => speak(select.value));
    page.append(label);
  }
  const { link, ids } = arrival(study);
  if (study.links_only && !link) {
    page.append(element("p", t.invited));
  } else {
    page.append(...beginning({ study, t, link, ids, begun, failed }));
  }
  page.append(resume(t, begun));
}

function beginning({ study, t, link, ids, begun, failed }) {
  const parts = [];
  let group = null;
  const row = actions([
    t.begin,
    async (pressed) => {
      pressed.disabled = true;
      try {
        begun(await server.begin({ group: group?.value ?? "", link, ids }));
        // Neither the link nor the identifiers are needed any more
        history.replaceState(null, "", location.pathname);
      } catch (error) {
        failed(error);
      }
    },
    true,
  ]);
  if (study.groups.length > 0) {
    const options = study.groups.map((name) => [name, name]);
    const [label, select] = choice("group", t.group, options, t.choose);
    group = select;
    const begin = row.querySelector("button");
    begin.disabled = true;
    select.addEventListener("change", () => {
      begin.disabled = false;
    });
    parts.push(label);
  }
  return [...parts, row];
}

function resume(t, begun) {
  const input = element("input");
  Object.assign(input, {
    type: "text",
    id: "resume-code",
    autocomplete: "off",
    required: true,
    maxLength: 40,
  });
  const wrong = element("p");
  wrong.setAttribute("role", "alert");
  const row = element("div", "", element("button", t.resume));
  row.className = "actions";
  const label = element("label", "", `${t.code} `, input);
  const form = element(
    "form",
    "",
    element("fieldset", "", element("legend", t.resume_title), label, wrong, row),
  );
  form.className = "resume";
  form.addEventListener("submit", async (submitted) => {
    submitted.preventDefault();
    try {
      begun(await server.view(encodeURIComponent(input.value.trim())));
    } catch (error) {
      wrong.textContent = error.status === 404 ? t.wrong_code : error.message;
    }
  });
  return form;
}

/** Asks for consent; `send(event)` hears it. */
export function consent({ study, language, t, code, send }) {
  const box = element("input");
  Object.assign(box, { type: "checkbox", id: "agree" });
  const label = element("label", "", box, t.agree);
  label.className = "line";
  const note = element("p", fill(t.code_note, { code }));
  note.className = "note";
  const text = [...paragraphs(study.text[language].consent), ...paragraphs(t.stored)];
  const page = sheet(t.consent, ...text, note, label);
  const row = actions([t.go_on, () => send({ kind: "consent", language }), true]);
  const next = row.querySelector("button");
  next.disabled = true;
  box.addEventListener("change", () => {
    next.disabled = !box.checked;
  });
  page.append(row);
}

/** Asks the questions of the study; `send(event)` hears the answers. */
export function questions({ study, language, t, send }) {
  const form = element("form");
  const fields = study.questions.map((question) => {
    const text = question.text[language] + (question.optional ? ` (${t.optional})` : "");
    const [label, input] = field(question, text, language, t);
    input.required = !question.optional;
    form.append(label);
    return [question.id, input];
  });
  const go = element("button", t.go_on);
  go.className = "main";
  const row = element("div", "", go);
  row.className = "actions";
  form.append(row);
  form.addEventListener("submit", (submitted) => {
    submitted.preventDefault();
    const answers = {};
    for (const [id, input] of fields) if (input.value !== "") answers[id] = input.value;
    send({ kind: "questions", answers });
  });
  sheet(t.questions, form);
}

function field(question, text, language, t) {
  const id = `question-${question.id}`;
  if (question.kind === "choice") {
    const options = question.option.map((o) => [o.id, o.text[language]]);
    const made = choice(id, text, options, t.choose);
    // What is optional can be left, and left again
    if (question.optional) made[1].options[0].disabled = false;
    return made;
  }
  const input = element("input");
  const [min, max] = question.range ?? [null, null];
  if (question.kind === "number")
    Object.assign(input, { type: "number", step: "any", ...(min !== null && { min, max }) });
  else Object.assign(input, { type: "text", maxLength: 500 });
  Object.assign(input, { id, autocomplete: "off" });
  return [element("label", "", `${text} `, input), input];
}

// Pages of text with buttons: what is shown between the trials.

const main = document.getElementById("main");

/** An element with text and children. */
export function element(name, text = "", ...inside) {
  const made = document.createElement(name);
  if (text) made.textContent = text;
  made.append(...inside);
  return made;
}

/** A text with values in its gaps. */
export const fill = (text, values) => text.replace(/\{(\w+)\}/g, (_, key) => values[key] ?? "");

/** One page: a heading and what follows. The focus goes to the page itself, never to a control. */
export function sheet(title, ...inside) {
  const made = element("section", "", element("h1", title), ...inside);
  made.className = "sheet";
  main.replaceChildren(made);
  window.scrollTo(0, 0);
  main.focus({ preventScroll: true });
  return made;
}

/** Paragraphs, which empty lines separate. */
export function paragraphs(text) {
  const parts = text.split(/\n\s*\n/).map((part) => part.trim());
  return parts.filter(Boolean).map((part) => element("p", part));
}

/** A row of buttons: text, action, and whether it is the main one. */
export function actions(...buttons) {
  const row = element("div");
  row.className = "actions";
  for (const [text, action, first] of buttons) {
    const made = element("button", text);
    made.type = "button";
    if (first) made.className = "main";
    made.addEventListener("click", () => action(made));
    row.append(made);
  }
  return row;
}

/** A link that looks like a button. */
export function wayOut(text, url) {
  const made = element("a", text);
  Object.assign(made, { href: url, className: "button main" });
  return made;
}

/** A labelled choice that begins empty. */
export function choice(id, text, options, hint) {
  const select = element("select");
  Object.assign(select, { id, required: true });
  const first = new Option(hint, "", true, true);
  first.disabled = true;
  select.add(first);
  for (const [value, shown] of options) select.add(new Option(shown, value));
  return [element("label", "", `${text} `, select), select];
}

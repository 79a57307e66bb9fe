// Retraining: how far it is, and what it has changed.

import { fill } from "./grid.js";
import * as server from "./server.js";

const POLL_MS = 500;
const get = (id) => document.getElementById(id);

function element(name, text, ...inside) {
  const made = document.createElement(name);
  if (text) made.textContent = text;
  made.append(...inside);
  return made;
}

function table(head, rows) {
  const header = element("tr");
  header.append(
    ...head.map((text) => {
      const cell = element("th", text);
      cell.scope = "col";
      return cell;
    }),
  );
  const body = rows.map(([name, ...values]) => {
    const row = element("tr");
    const first = element("th", name);
    first.scope = "row";
    row.append(first, ...values.map((value) => element("td", value)));
    return row;
  });
  return element("table", "", element("thead", "", header), element("tbody", "", ...body));
}

function report(t, learned, onUse) {
  const { before, after, agreement: a, scenes, worse } = learned;
  const parts = [element("h3", t.on_people)];
  if (before && after) {
    const factor = (value) => `×${value.toFixed(3)}`;
    const share = (value) => `${(100 * value).toFixed(1)} %`;
    parts.push(
      table(
        [t.score, t.before, t.after],
        [
          [t.error, factor(before.error_factor), factor(after.error_factor)],
          [t.early, share(before.early_share), share(after.early_share)],
          [t.bias, factor(before.bias_factor), factor(after.bias_factor)],
        ],
      ),
    );
    const verdict = element(
      "p",
      worse.length > 0 ? fill(t.worse, { what: worse.join("; ") }) : t.not_worse,
    );
    verdict.className = worse.length > 0 ? "worse" : "";
    parts.push(verdict);
  } else {
    parts.push(element("p", t.not_scored));
  }
  const of = (n) => `${n} / ${a.of}`;
  parts.push(
    element("h3", t.on_you),
    table(
      ["", ""],
      [
        [t.before, of(a.before)],
        [t.fitted, of(a.fitted)],
        [t.left_out, of(a.left_out)],
      ],
    ),
  );
  // An empty header has nothing to say
  parts.at(-1).querySelector("thead").remove();
  const why = element("p", scenes.length === 1 ? `${t.fitted_why} ${t.one_scene}` : t.fitted_why);
  why.className = "note";
  const use = element("input");
  Object.assign(use, { type: "checkbox", id: "use" });
  use.addEventListener("change", () => onUse(use.checked));
  const line = element("label", "", use, element("span", t.use));
  line.className = "line";
  const save = element("a", t.save);
  Object.assign(save, { href: "api/retrained.nfm", download: "retrained.nfm", className: "button" });
  parts.push(why, line, element("p", "", save));
  return parts;
}

export class Learning {
  /** `onUse(retrained)` hears which model is to judge; `onProblem(error)` what went wrong. */
  constructor(t, onUse, onProblem) {
    Object.assign(this, { t, onUse, onProblem, polling: false });
    get("retrain").addEventListener("click", () => this.begin());
  }

  async begin() {
    get("retrain").disabled = true;
    get("outcome").hidden = true;
    this.onUse(false);
    try {
      await server.retrain(this.people());
      await this.follow();
    } catch (error) {
      get("retrain").disabled = false;
      this.onProblem(error);
    }
  }

  /** Shows what is under way, or was last done. */
  async follow() {
    for (;;) {
      const job = await server.progress();
      const running = job.state === "running";
      get("retrain").disabled = running;
      get("working").hidden = !running;
      if (running) {
        Object.assign(get("progress"), { max: job.of, value: job.done });
        const said = fill(this.t.doing, { done: job.done + 1, of: job.of, what: job.doing });
        if (get("doing").textContent !== said) get("doing").textContent = said;
        await new Promise((go) => setTimeout(go, POLL_MS));
        continue;
      }
      get("outcome").hidden = job.state === "idle";
      if (job.state === "done") get("outcome").replaceChildren(...report(this.t, job, this.onUse));
      if (job.state === "failed")
        get("outcome").replaceChildren(element("p", fill(this.t.failed, { what: job.what })));
      return;
    }
  }
}

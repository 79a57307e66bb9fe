// The line of the person who answers: learned after every answer, and what it changes.

import { fill } from "./grid.js";
import * as server from "./server.js";

const get = (id) => document.getElementById(id);
const number = (n) => String(Number(n.toPrecision(3)));
const converged = ({ tiles }) => tiles.filter((tile) => tile.converged).length;
const need = ({ tiles }) => tiles.reduce((sum, tile) => sum + (tile.expected_spp ?? NaN), 0) / tiles.length;

export class PersonalLine {
  /** `people()` is the share of people who are to see no noise. */
  constructor(t, people) {
    Object.assign(this, { t, people, learned: null });
  }

  /** Slope and offset. */
  audience() {
    return this.learned ? [this.learned.slope, this.learned.offset] : [1, 0];
  }

  /** Learns from all answers; `use` chooses the line as the audience when it is first there. */
  async learn(use) {
    const first = this.learned === null;
    this.learned = await server.line(this.people());
    const audience = get("audience");
    audience.querySelector('[value="you"]').disabled = this.learned === null;
    if (this.learned === null && audience.value === "you") audience.value = "observers";
    if (this.learned !== null && first && use) audience.value = "you";
  }

  /** What the line changes in the picture of a question: its verdicts beside those for the observers. */
  async show(question) {
    const { t, learned } = this;
    get("yours-none").hidden = learned !== null;
    get("yours-learned").hidden = learned === null;
    if (learned === null) return;
    const { answers, slope, offset, agree_now: now, agreed_before: before } = learned;
    const sign = offset < 0 ? "−" : "+";
    const words = { answers, slope: slope.toFixed(2), offset: `${sign} ${number(Math.abs(offset))}` };
    get("yours-line").textContent = fill(t.yours_line, { ...words, factor: `×${slope.toFixed(2)}` });
    get("yours-agree").textContent = fill(t.yours_agree, { now, of: answers, before });
    get("yours-share").textContent = `--audience ${slope.toFixed(3)},${number(offset)}`;
    const asked = [[1, 0], this.audience()].map((audience) => server.verdicts({ ...question, audience }));
    const [without, having] = await Promise.all(asked);
    const known = Number.isFinite(need(without)) && Number.isFinite(need(having));
    get("yours-here").textContent = fill(known ? t.yours_here : t.yours_here_beyond, {
      before: converged(without),
      after: converged(having),
      of: having.tiles.length,
      from: Math.round(need(without)),
      to: Math.round(need(having)),
    });
  }
}

// Requests to the server. An event is kept in this browser until the server has acknowledged it.

import { ask, json, Refused } from "./ask.js";

const RETRY_MS = [500, 1000, 2000, 4000];
// Servers behind one name have one storage: the path keeps them apart
const HERE = location.pathname;
const CODE = `noisefloor.code.${HERE}`;
const box = (code) => `noisefloor.outbox.${code}`;

// Paths are relative, so that the study may lie under any path of a proxy
export const study = () => ask("api/study");
export const begin = (beginning) => ask("api/sessions", json("POST", beginning));
export const view = (code) => ask(`api/sessions/${code}`);
export const erase = (code) => ask(`api/sessions/${code}`, { method: "DELETE" });
export const texts = (language) => ask(`api/texts/${language}`);
/** The answers as the server wrote them: parsed and written again, large numbers would be rounded. */
export async function exported(code) {
  const answer = await fetch(`api/sessions/${code}/export`, { cache: "no-store" });
  if (!answer.ok) throw new Refused(answer.status, await answer.json());
  return answer.text();
}

export const remembered = () => localStorage.getItem(CODE);
export const remember = (code) => localStorage.setItem(CODE, code);
export function forget(code) {
  localStorage.removeItem(CODE);
  localStorage.removeItem(box(code));
}

/** Sends the events of one session in order, each until it is acknowledged. */
export class Outbox {
  /** `onState(waiting)` hears whether the server is out of reach; `onRefused(error)` that an event did not fit. */
  constructor(view, onState, onRefused) {
    this.code = view.code;
    this.onState = onState;
    this.onRefused = onRefused;
    const kept = JSON.parse(localStorage.getItem(box(this.code)) ?? "[]");
    // Events that the server has were acknowledged to a page that was closed before it heard so
    this.events = kept.filter((e) => e.seq >= view.next_seq);
    this.next = view.next_seq + this.events.length;
    this.view = view;
    this.sending = null;
    this.save();
  }

  save() {
    localStorage.setItem(box(this.code), JSON.stringify(this.events));
  }

  /** Queues an event. */
  add(event) {
    this.events.push({ seq: this.next, at: Date.now(), event });
    this.next += 1;
    this.save();
    this.sending ??= this.send().finally(() => {
      this.sending = null;
    });
    return this.sending;
  }

  /** Waits until everything is acknowledged; the state of the session then. */
  async settled() {
    while (this.events.length > 0) {
      this.sending ??= this.send().finally(() => {
        this.sending = null;
      });
      await this.sending;
    }
    return this.view;
  }

  async send() {
    let failures = 0;
    while (this.events.length > 0) {
      try {
        this.view = await ask(`api/sessions/${this.code}/events`, json("POST", this.events[0]));
        this.events.shift();
        this.save();
        if (failures > 0) this.onState(false);
        failures = 0;
      } catch (error) {
        const final = error instanceof Refused && error.status < 500 && ![408, 429].includes(error.status);
        if (final) {
          this.events = [];
          this.save();
          this.onRefused(error);
          return;
        }
        this.onState(true);
        await new Promise((go) => setTimeout(go, RETRY_MS[Math.min(failures, RETRY_MS.length - 1)]));
        failures += 1;
      }
    }
  }
}

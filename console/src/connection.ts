// The way to the server: requests with the token, and a live socket that comes back by itself.

import type { RefusalOut } from "./wire";

const TOKEN = "aerodaas.token";
const PAUSES = [250, 500, 1000, 2000, 4000];

/** Change words of the address' fragment; null takes one out. */
export function writeFragment(words: Record<string, string | null>): void {
  const fragment = new URLSearchParams(location.hash.slice(1));
  for (const [name, word] of Object.entries(words)) {
    if (word === null) fragment.delete(name);
    else fragment.set(name, word);
  }
  const text = fragment.toString();
  history.replaceState(null, "", location.pathname + location.search + (text && `#${text}`));
}

/** A word of the address' fragment; null without it. */
export function readFragment(name: string): string | null {
  return new URLSearchParams(location.hash.slice(1)).get(name);
}

/** The token of the address' fragment, which is taken out of sight; else the one kept in this tab. */
export function takeToken(): string {
  const given = readFragment("token");
  if (given) {
    keepToken(given);
    writeFragment({ token: null });
  }
  return sessionStorage.getItem(TOKEN) ?? "";
}

export function keepToken(token: string): void {
  sessionStorage.setItem(TOKEN, token);
}

export class Refused extends Error {
  constructor(
    readonly status: number,
    text: string,
  ) {
    super(text);
  }
}

/** Ask the server; throws Refused with its reason. `signal` gives the request up. */
export async function ask<T>(
  path: string,
  token: string,
  body?: unknown,
  signal?: AbortSignal,
): Promise<T> {
  return (await (await answered(path, token, body, signal)).json()) as T;
}

/** As `ask`, for an answer of any kind. */
export async function answered(
  path: string,
  token: string,
  body?: unknown,
  signal?: AbortSignal,
): Promise<Response> {
  const headers: Record<string, string> = { Authorization: `Bearer ${token}` };
  const request: RequestInit = { headers, cache: "no-store", signal: signal ?? null };
  if (body !== undefined) {
    headers["Content-Type"] = "application/json";
    request.method = "POST";
    request.body = JSON.stringify(body);
  }
  const answer = await fetch(new URL(path, document.baseURI), request).catch(() => {
    throw new Refused(0, "the server does not answer");
  });
  if (answer.ok) return answer;
  const said = (await answer.json().catch(() => null)) as RefusalOut | null;
  throw new Refused(answer.status, said?.text ?? `the server answered ${answer.status}`);
}

export interface Ears {
  text(message: Record<string, unknown>): void;
  blob?(message: Record<string, unknown>, data: ArrayBuffer): void | Promise<void>;
  up(connected: boolean): void;
}

/** A WebSocket with the token, which a browser sends as a subprotocol. */
export function openSocket(path: string, token: string): WebSocket {
  const url = new URL(path, document.baseURI);
  url.protocol = url.protocol === "https:" ? "wss:" : "ws:";
  return new WebSocket(url, ["aerodaas", `bearer.${token}`]);
}

/** A WebSocket that is made again, with growing pauses, until it is closed. */
export class LiveSocket {
  private socket: WebSocket | undefined;
  private tries = 0;
  private timer = 0;
  private closed = false;
  private head: Record<string, unknown> | undefined;

  constructor(
    private readonly path: string,
    private readonly token: string,
    private readonly ears: Ears,
  ) {
    this.open();
    addEventListener("online", this.again);
  }

  close(): void {
    this.closed = true;
    clearTimeout(this.timer);
    removeEventListener("online", this.again);
    this.socket?.close();
  }

  private readonly again = (): void => {
    if (this.socket === undefined && !this.closed) this.open();
  };

  private open(): void {
    clearTimeout(this.timer);
    const socket = openSocket(this.path, this.token);
    socket.binaryType = "arraybuffer";
    socket.onopen = () => {
      this.tries = 0;
      this.ears.up(true);
    };
    socket.onmessage = (event: MessageEvent<string | ArrayBuffer>) => this.take(event.data);
    socket.onclose = () => {
      if (this.socket !== socket) return;
      this.socket = undefined;
      this.head = undefined;
      this.ears.up(false);
      if (this.closed) return;
      const pause = PAUSES[Math.min(this.tries, PAUSES.length - 1)] ?? 4000;
      this.tries += 1;
      this.timer = setTimeout(this.again, pause);
    };
    this.socket = socket;
  }

  private take(data: string | ArrayBuffer): void {
    if (typeof data === "string") {
      const message = JSON.parse(data) as Record<string, unknown>;
      this.head = message["blob"] === true ? message : undefined;
      if (message["kind"] === "end") this.closed = true;
      if (this.head === undefined) this.ears.text(message);
    } else if (this.head !== undefined) {
      void this.ears.blob?.(this.head, data);
      this.head = undefined;
    }
  }
}

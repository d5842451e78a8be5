// Connection to the server: requests with the token, and a live socket that reconnects.

import { useEffect, useRef, useState } from "preact/hooks";
import type { EndMessage, ItemMessage, LeftOutMessage, RefusalOut, StateMessage } from "./wire";

export type LiveMessage = StateMessage | ItemMessage | LeftOutMessage | EndMessage;

const TOKEN = "aerodaas.token";
const PAUSES = [250, 500, 1000, 2000, 4000];
/** Milliseconds after which a polled request counts as unanswered. */
const TIMEOUT = 10000;

/** Change words of the address' fragment; null removes one. */
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

/** The token of this tab; one in the address' fragment replaces it and leaves the address. */
export function token(): string {
  const given = readFragment("token");
  if (given) {
    keepToken(given);
    writeFragment({ token: null });
  }
  return sessionStorage.getItem(TOKEN) ?? "";
}

export function keepToken(text: string): void {
  sessionStorage.setItem(TOKEN, text);
}

export class Refused extends Error {
  constructor(
    readonly status: number,
    text: string,
  ) {
    super(text);
  }
}

export function messageOf(error: unknown): string {
  return error instanceof Error ? error.message : String(error);
}

/** Ask the server; throws Refused with its reason. `signal` cancels the request. */
export async function ask<T>(path: string, body?: unknown, signal?: AbortSignal): Promise<T> {
  return (await (await answered(path, body, signal)).json()) as T;
}

/** As `ask`, for an answer of any kind; `method` for one that is neither GET nor POST. */
export async function answered(
  path: string,
  body?: unknown,
  signal?: AbortSignal,
  method = body === undefined ? "GET" : "POST",
): Promise<Response> {
  const headers: Record<string, string> = { Authorization: `Bearer ${token()}` };
  const request: RequestInit = { method, headers, cache: "no-store", signal: signal ?? null };
  if (body !== undefined) {
    headers["Content-Type"] = "application/json";
    request.body = JSON.stringify(body);
  }
  const answer = await fetch(new URL(path, document.baseURI), request).catch(() => {
    throw new Refused(0, "the server does not answer");
  });
  if (answer.ok) return answer;
  const refusal = (await answer.json().catch(() => null)) as RefusalOut | null;
  throw new Refused(answer.status, refusal?.text ?? `the server answered ${answer.status}`);
}

export interface Polled<T> {
  answer: T | null;
  /** When the newest answer came, by this machine's clock. */
  at: number;
  /** Why the newest request failed; null where it did not. */
  error: unknown;
}

/**
 * Ask while `key` is not empty, anew for another key. `pause` returns the milliseconds until the next
 * request, given the newest answer, which is null where that failed; null ends it.
 */
export function usePolled<T>(
  key: string,
  request: (signal: AbortSignal) => Promise<T>,
  pause: (answer: T | null) => number | null,
): Polled<T> {
  const [polled, setPolled] = useState<Polled<T> & { key: string }>();
  const newest = useRef({ request, pause });
  newest.current = { request, pause };
  useEffect(() => {
    if (!key) return;
    let gone = false;
    let timer = 0;
    const poll = async () => {
      let answer: T | null = null;
      try {
        answer = await newest.current.request(AbortSignal.timeout(TIMEOUT));
        if (!gone) setPolled({ key, answer, at: Date.now(), error: null });
      } catch (error) {
        const none = { key, answer: null, at: 0 };
        if (!gone) setPolled((last) => ({ ...(last?.key === key ? last : none), error }));
      }
      const wait = newest.current.pause(answer);
      if (!gone && wait !== null) timer = setTimeout(() => void poll(), wait);
    };
    void poll();
    return () => {
      gone = true;
      clearTimeout(timer);
      setPolled(undefined);
    };
  }, [key]);
  return polled?.key === key ? polled : { answer: null, at: 0, error: null };
}

export interface SocketListener {
  onMessage(message: LiveMessage, blob: ArrayBuffer | null): void;
  onConnected?(connected: boolean): void;
}

/** A WebSocket with the token, which a browser sends as a subprotocol. */
export function openSocket(path: string): WebSocket {
  const url = new URL(path, document.baseURI);
  url.protocol = url.protocol === "https:" ? "wss:" : "ws:";
  return new WebSocket(url, ["aerodaas", `bearer.${token()}`]);
}

/** A WebSocket that reconnects, with growing pauses, until it is closed. */
export class LiveSocket {
  private socket: WebSocket | undefined;
  private attempts = 0;
  private timer = 0;
  private closed = false;
  /** The message whose blob comes next. */
  private head: LiveMessage | undefined;

  constructor(
    private readonly path: string,
    private readonly listener: SocketListener,
  ) {
    this.open();
    addEventListener("online", this.reconnect);
  }

  close(): void {
    this.closed = true;
    clearTimeout(this.timer);
    removeEventListener("online", this.reconnect);
    this.socket?.close();
  }

  private readonly reconnect = (): void => {
    if (this.socket === undefined && !this.closed) this.open();
  };

  private open(): void {
    clearTimeout(this.timer);
    const socket = openSocket(this.path);
    socket.binaryType = "arraybuffer";
    socket.onopen = () => {
      this.attempts = 0;
      this.listener.onConnected?.(true);
    };
    socket.onmessage = (event: MessageEvent<string | ArrayBuffer>) => this.receive(event.data);
    socket.onclose = () => {
      if (this.socket !== socket) return;
      this.socket = undefined;
      this.head = undefined;
      this.listener.onConnected?.(false);
      if (this.closed) return;
      const pause = PAUSES[Math.min(this.attempts, PAUSES.length - 1)] ?? 4000;
      this.attempts += 1;
      this.timer = setTimeout(this.reconnect, pause);
    };
    this.socket = socket;
  }

  private receive(data: string | ArrayBuffer): void {
    if (typeof data !== "string") {
      if (this.head) this.listener.onMessage(this.head, data);
      this.head = undefined;
      return;
    }
    const message = JSON.parse(data) as LiveMessage;
    if (message.kind === "end") this.closed = true;
    this.head = message.kind === "item" && message.blob ? message : undefined;
    if (this.head === undefined) this.listener.onMessage(message, null);
  }
}

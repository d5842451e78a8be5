// A drone's health before take-off: one list, with what refuses it first.

import { useEffect, useState } from "preact/hooks";
import { Refused, ask } from "./connection";
import type { HealthItem, PreflightOut, Verdict } from "./wire";

const LOOK = 2000;
/** Seconds after which the list is shown as old. */
const OLD = 10;
const WORDS: Record<Verdict, { mark: string; word: string; tone: string }> = {
  refused: { mark: "✕", word: "refuses", tone: "bad" },
  warning: { mark: "!", word: "warning", tone: "warn" },
  good: { mark: "✓", word: "ok", tone: "good" },
  unknown: { mark: "?", word: "not known", tone: "" },
};
const ORDER = Object.keys(WORDS) as Verdict[];
const NAMES: Record<string, string> = { gps: "GPS", remote_id: "Remote ID", vehicle: "own checks" };

interface Told {
  list: PreflightOut | null;
  /** When it came, by this machine's clock. */
  at: number;
  problem: string;
}

/** The list of a robot, asked for again and again while `live`. */
function usePreflight(robot: string, token: string, live: boolean): Told {
  const [told, setTold] = useState<Told>({ list: null, at: 0, problem: "" });
  useEffect(() => {
    if (!live || !robot) return;
    let gone = false;
    let timer = 0;
    const look = async () => {
      try {
        const path = `v1/robots/${encodeURIComponent(robot)}/preflight`;
        const list = await ask<PreflightOut>(path, token);
        if (!gone) setTold({ list, at: Date.now(), problem: "" });
      } catch (error) {
        const problem = error instanceof Refused ? error.message : String(error);
        if (!gone) setTold((before) => ({ ...before, problem }));
      }
      if (!gone) timer = setTimeout(() => void look(), LOOK);
    };
    void look();
    return () => {
      gone = true;
      clearTimeout(timer);
    };
  }, [robot, token, live]);
  return told;
}

/** The panel of a drone; open while it stands on the ground. */
export function PreflightPanel(props: {
  robot: string;
  token: string;
  live: boolean;
  open: boolean;
}) {
  return (
    <details class="card preflight" open={props.open} aria-label="Before take-off">
      <PreflightList title="Before take-off" {...props} />
    </details>
  );
}

export function Badge({ verdict, count }: { verdict: Verdict | null; count?: number }) {
  if (verdict === null) return <span class="badge">no list</span>;
  const { mark, tone } = WORDS[verdict];
  const many = count === undefined ? "" : `: ${count}`;
  const text = { refused: `refused${many}`, warning: `warned${many}`, good: "ready", unknown: "" };
  return (
    <span class={`badge ${tone}`} data-testid="preflight">
      <span aria-hidden="true">{mark}</span> {text[verdict]}
    </span>
  );
}

function PreflightList(props: { title: string; robot: string; token: string; live: boolean }) {
  const { list, at, problem } = usePreflight(props.robot, props.token, props.live);
  const known = list?.robot === props.robot ? list : null;
  const items = [...(known?.items ?? [])].sort(
    (one, other) => ORDER.indexOf(one.verdict) - ORDER.indexOf(other.verdict),
  );
  const age = known?.age == null ? null : known.age + (Date.now() - at) / 1000;
  const worst = items.filter((one) => one.verdict === known?.verdict).length;
  return (
    <>
      <summary>
        <h2>{props.title}</h2>
        <Badge verdict={known?.verdict ?? null} count={worst} />
        {age !== null && <span class="hint">{ago(age)}</span>}
      </summary>
      {problem && <p class="hint">{problem}</p>}
      {items.length > 0 ? (
        <ul class={age !== null && age > OLD ? "old" : ""}>
          {items.map((one) => (
            <Item key={one.name} item={one} />
          ))}
        </ul>
      ) : (
        <p class="empty">{known ? "Not gone through yet" : "…"}</p>
      )}
    </>
  );
}

function ago(seconds: number): string {
  if (seconds < 2) return "just now";
  return seconds < 120 ? `${seconds.toFixed(0)} s ago` : `${(seconds / 60).toFixed(0)} min ago`;
}

function Item({ item }: { item: HealthItem }) {
  const { mark, word, tone } = WORDS[item.verdict];
  const grave = item.verdict === "refused" || item.verdict === "warning";
  return (
    <li class={item.verdict} data-item={item.name}>
      <span class={`mark ${tone}`} aria-hidden="true">
        {mark}
      </span>
      <span class="what">
        <strong>{NAMES[item.name] ?? item.name.replaceAll("_", " ")}</strong>{" "}
        {item.verdict !== "unknown" && item.value}
        {grave && item.bound && <span class="hint">, should be {item.bound}</span>}
        {item.remedy && <span class="remedy">{item.remedy}</span>}
      </span>
      <span class={`word ${tone}`}>{word}</span>
    </li>
  );
}

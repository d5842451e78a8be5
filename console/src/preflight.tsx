// A drone's health before take-off: one list, with what refuses it first.

import "./preflight.css";
import { ask, messageOf, usePolled } from "./connection";
import { Badge } from "./widgets";
import { lasting, wordsOf } from "./words";
import type { HealthItem, HealthReport, Verdict } from "./wire";

/** Milliseconds between two requests of the list. */
const PAUSE = 2000;
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

interface PreflightProps {
  robot: string;
  title?: string;
  /** Whether the list is still asked for. */
  live: boolean;
  open: boolean;
}

/** The panel of a drone; open while it stands on the ground. */
export function PreflightPanel({ robot, title = "Before take-off", live, open }: PreflightProps) {
  const path = robot && `v1/robots/${encodeURIComponent(robot)}/preflight`;
  const { answer, at, error } = usePolled(
    path,
    (signal) => ask<HealthReport>(path, undefined, signal),
    () => (live ? PAUSE : null),
  );
  const items = [...(answer?.items ?? [])].sort(
    (one, other) => ORDER.indexOf(one.verdict) - ORDER.indexOf(other.verdict),
  );
  const age = answer?.age == null ? null : answer.age + (Date.now() - at) / 1000;
  const gravest = items[0]?.verdict ?? null;
  const worst = items.filter((one) => one.verdict === gravest).length;
  return (
    <details class="card preflight" open={open} aria-label={title}>
      <summary>
        <h2>{title}</h2>
        <PreflightBadge verdict={gravest} count={worst} />
        {age !== null && <span class="hint">{lasting(age)} ago</span>}
      </summary>
      {error !== null && <p class="hint">{messageOf(error)}</p>}
      {items.length > 0 ? (
        <ul class={age !== null && age > OLD ? "old" : ""}>
          {items.map((one) => (
            <Item key={one.name} item={one} />
          ))}
        </ul>
      ) : (
        <p class="empty">{answer ? "Not checked yet" : "…"}</p>
      )}
    </details>
  );
}

export function PreflightBadge({ verdict, count }: { verdict: Verdict | null; count?: number }) {
  if (verdict === null) return <Badge>no list</Badge>;
  const { mark, tone } = WORDS[verdict];
  const many = count === undefined ? "" : `: ${count}`;
  const text = { refused: `refused${many}`, warning: `warned${many}`, good: "ready", unknown: "" };
  return (
    <Badge tone={tone} testid="preflight">
      <span aria-hidden="true">{mark}</span> {text[verdict]}
    </Badge>
  );
}

function Item({ item }: { item: HealthItem }) {
  const { mark, word, tone } = WORDS[item.verdict];
  const grave = item.verdict === "refused" || item.verdict === "warning";
  return (
    <li class={item.verdict} data-item={item.name}>
      <span class={`mark ${tone}`} aria-hidden="true">{mark}</span>
      <span class="what">
        <strong>{NAMES[item.name] ?? wordsOf(item.name)}</strong>{" "}
        {item.verdict !== "unknown" && item.value}
        {grave && item.bound && <span class="hint">, should be {item.bound}</span>}
        {item.remedy && <span class="remedy">{item.remedy}</span>}
      </span>
      <span class={`word ${tone}`}>{word}</span>
    </li>
  );
}

// Alerts: their log, the list of them, the newest one for the bar, and the sound of a new one.

import { useEffect, useRef, useState } from "preact/hooks";
import { Badge, Button, Card } from "./widgets";
import { wordsOf } from "./words";

/** The kind of alert by which a flight records the commands that it was given. */
const COMMAND_KIND = "console_command";
const MOST = 100;
const SOUND = "aerodaas.sound";
const TONES = [880, 660];
const TONE_SECONDS = 0.14;

export interface Alert {
  id: number;
  /** Whose it is, where several missions are shown; empty for the only one. */
  source: string;
  kind: string;
  text: string;
  count: number;
  acknowledged: boolean;
}

/** Alerts, newest first; the commands that a flight was given are a list of their own. */
export class AlertLog {
  alerts: Alert[] = [];
  commands: string[] = [];
  private readonly received = new Map<string, string[]>();
  private count = 0;

  /** Add the newest alerts of a source, oldest first; those that overlap with the last ones are known. */
  receive(lines: string[], source = ""): void {
    const last = this.received.get(source) ?? [];
    let shared = Math.min(lines.length, last.length);
    const same = (count: number) => last.slice(-count).every((text, place) => text === lines[place]);
    while (shared > 0 && !same(shared)) shared -= 1;
    for (const line of lines.slice(shared)) {
      const [kind = "", ...rest] = line.split(": ");
      this.add(kind, rest.join(": ") || line, source);
    }
    this.received.set(source, lines);
  }

  /** Add one; one that repeats itself counts up, and once acknowledged it is new. */
  add(kind: string, text: string, source = ""): void {
    if (kind === COMMAND_KIND) {
      this.commands = [text, ...this.commands].slice(0, MOST);
      return;
    }
    const known = this.alerts.find(
      (one) => one.kind === kind && one.text === text && one.source === source && !one.acknowledged,
    );
    if (known) {
      known.count += 1;
      return;
    }
    this.count += 1;
    const added = { id: this.count, source, kind, text, count: 1, acknowledged: false };
    this.alerts = [added, ...this.alerts].slice(0, MOST);
  }

  /** Acknowledge one of them, or all for null. */
  acknowledge(id: number | null): void {
    for (const one of this.alerts) if (id === null || one.id === id) one.acknowledged = true;
  }

  get open(): Alert[] {
    return this.alerts.filter((one) => !one.acknowledged);
  }
}

interface AlertsProps {
  log: AlertLog;
  /** Of one of them, or of all for null; missing where nothing is acknowledged, as in a recording. */
  onAcknowledge?: ((id: number | null) => void) | undefined;
}

function AlertText({ alert }: { alert: Alert }) {
  return (
    <span class="text" title={alert.text}>
      {alert.source && <span class="muted">{alert.source}: </span>}
      <strong>{wordsOf(alert.kind)}</strong> {alert.text}
      {alert.count > 1 && <em> ×{alert.count}</em>}
    </span>
  );
}

function Acknowledge({ alert, onAcknowledge }: { alert: Alert } & Pick<AlertsProps, "onAcknowledge">) {
  return (
    <Button class="plain" label={`Acknowledge: ${alert.text}`} onClick={() => onAcknowledge?.(alert.id)}>
      OK
    </Button>
  );
}

/** The list of all alerts. */
export function Alerts({ log, onAcknowledge }: AlertsProps) {
  const live = onAcknowledge !== undefined;
  const open = live ? log.open.length : 0;
  return (
    <Card
      kind="alerts"
      label="Alerts"
      head={
        <>
          <Badge tone={open ? "warn" : "good"} testid="alerts">
            {live ? (open ? `${open} new` : "none new") : `${log.alerts.length} so far`}
          </Badge>
          {live && <Sound log={log} />}
          {open > 1 && <Button class="plain" onClick={() => onAcknowledge?.(null)}>Acknowledge all</Button>}
        </>
      }
    >
      <ul aria-live="polite">
        {log.alerts.map((one) => (
          <li key={one.id} class={live && one.acknowledged ? "old" : "new"}>
            <AlertText alert={one} />
            {live && !one.acknowledged && <Acknowledge alert={one} onAcknowledge={onAcknowledge} />}
          </li>
        ))}
        {log.alerts.length === 0 && <li class="empty">No alert yet</li>}
      </ul>
    </Card>
  );
}

/** The newest alert that is not acknowledged; always there, so that a new one is read out. */
export function NewestAlert({ log, onAcknowledge }: AlertsProps) {
  const { open } = log;
  const [newest] = open;
  return (
    <p class="alert" role="status" data-testid="newest-alert">
      {newest ? (
        <>
          <Badge tone="warn">{open.length > 1 ? `${open.length} alerts` : "alert"}</Badge>
          <AlertText alert={newest} />
          <Acknowledge alert={newest} onAcknowledge={onAcknowledge} />
        </>
      ) : (
        <span class="muted">no new alert</span>
      )}
    </p>
  );
}

/** A switch for two tones at each new alert. */
function Sound({ log }: { log: AlertLog }) {
  const [on, setOn] = useState(() => localStorage.getItem(SOUND) === "on");
  const player = useRef<AudioContext | null>(null);
  const newest = log.alerts[0]?.id ?? 0;
  const played = useRef(newest);
  const play = () => playTones((player.current ??= new AudioContext()));
  useEffect(() => {
    if (newest > played.current && on) play();
    played.current = newest;
  }, [newest, on]);
  useEffect(() => () => void player.current?.close(), []);
  const toggle = () => {
    setOn(!on);
    localStorage.setItem(SOUND, on ? "off" : "on");
    // A browser lets a page sound only from a click on; this is how an alert will sound.
    if (!on) play();
  };
  return (
    <Button class="plain" pressed={on} title={`Sound of alerts: ${on ? "on" : "off"}`} onClick={toggle}>
      {on ? "Sound on" : "Sound off"}
    </Button>
  );
}

function playTones(player: AudioContext): void {
  void player.resume();
  TONES.forEach((pitch, place) => {
    const tone = player.createOscillator();
    const level = player.createGain();
    const start = player.currentTime + place * TONE_SECONDS;
    tone.frequency.value = pitch;
    level.gain.setValueAtTime(0.2, start);
    level.gain.exponentialRampToValueAtTime(0.001, start + TONE_SECONDS);
    tone.connect(level).connect(player.destination);
    tone.start(start);
    tone.stop(start + TONE_SECONDS);
  });
}

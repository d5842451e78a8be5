// A tone for each new alert, where the operator has switched it on.

import { useEffect, useRef, useState } from "preact/hooks";
import type { AlertLog } from "./flight";

const KEPT = "aerodaas.sound";
const TONES = [880, 660];
const EACH = 0.14;

/** A switch that sounds when an alert comes in of which this page has not sounded before. */
export function Sound({ log }: { log: AlertLog }) {
  const [on, setOn] = useState(() => localStorage.getItem(KEPT) === "on");
  const player = useRef<AudioContext | null>(null);
  const newest = log.alerts[0]?.id ?? 0;
  const heard = useRef(newest);
  useEffect(() => {
    const later = newest > heard.current;
    heard.current = newest;
    if (later && on) play((player.current ??= new AudioContext()));
  }, [newest, on]);
  useEffect(() => () => void player.current?.close(), []);
  const toggle = () => {
    setOn(!on);
    localStorage.setItem(KEPT, on ? "off" : "on");
    // A browser lets a page sound only from a click on: this one tells how it will sound.
    if (!on) play((player.current ??= new AudioContext()));
  };
  return (
    <button
      type="button"
      class="plain"
      aria-pressed={on}
      title={`Sound of alerts: ${on ? "on" : "off"}`}
      onClick={toggle}
    >
      {on ? "Sound on" : "Sound off"}
    </button>
  );
}

function play(player: AudioContext): void {
  void player.resume();
  TONES.forEach((pitch, place) => {
    const tone = player.createOscillator();
    const level = player.createGain();
    const start = player.currentTime + place * EACH;
    tone.frequency.value = pitch;
    level.gain.setValueAtTime(0.2, start);
    level.gain.exponentialRampToValueAtTime(0.001, start + EACH);
    tone.connect(level).connect(player.destination);
    tone.start(start);
    tone.stop(start + EACH);
  });
}

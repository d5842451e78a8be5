// Opens the recording of a finished mission: shows how far it has been read, and then what it holds.

import type { ComponentChildren } from "preact";
import { ask, messageOf, usePolled } from "./connection";
import type { MissionOut, PlaybackOut, RecordedOut } from "./wire";

/** Milliseconds between two requests while a recording is read. */
const PAUSE = 300;

export function Recorded(props: { mission: MissionOut; children(flight: RecordedOut): ComponentChildren }) {
  const { mission, children } = props;
  const path = `v1/missions/${mission.id}/playback`;
  const { answer, error } = usePolled(
    path,
    (signal) => ask<PlaybackOut>(path, undefined, signal),
    (found) => (found && found.flight === null ? PAUSE : null),
  );
  if (answer?.flight) return <>{children(answer.flight)}</>;
  return (
    <main class="start">
      <h1>AeroDaaS console</h1>
      {error !== null ? (
        <p class="banner bad" role="alert">{messageOf(error)}</p>
      ) : (
        <label class="reading">
          <span>
            Reading the recording of {mission.name}: {Math.round(100 * (answer?.read ?? 0))} %
          </span>
          <progress max="1" value={answer?.read ?? 0} />
        </label>
      )}
    </main>
  );
}

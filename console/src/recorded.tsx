// A finished mission's recording is opened: how far it has been read, and then what it shows.

import { useEffect, useState } from "preact/hooks";
import { ask } from "./connection";
import type { MissionOut, PlaybackOut, RecordedOut } from "./wire";

const AGAIN = 300;

export function Recorded(props: {
  mission: MissionOut;
  token: string;
  children(flight: RecordedOut): preact.ComponentChildren;
}) {
  const { mission, token } = props;
  const [read, setRead] = useState(0);
  const [flight, setFlight] = useState<RecordedOut | null>(null);
  const [problem, setProblem] = useState("");
  useEffect(() => {
    let gone = false;
    let timer = 0;
    const look = async () => {
      try {
        const found = await ask<PlaybackOut>(`v1/missions/${mission.id}/playback`, token);
        if (gone) return;
        setRead(found.read);
        setFlight(found.flight);
        if (found.flight === null) timer = setTimeout(() => void look(), AGAIN);
      } catch (error) {
        if (!gone) setProblem(error instanceof Error ? error.message : String(error));
      }
    };
    void look();
    return () => {
      gone = true;
      clearTimeout(timer);
    };
  }, [mission.id, token]);
  if (flight) return <>{props.children(flight)}</>;
  return (
    <main class="start">
      <h1>AeroDaaS console</h1>
      {problem ? (
        <p class="banner bad" role="alert">
          {problem}
        </p>
      ) : (
        <label class="reading">
          <span>Reading the recording of {mission.name}: {Math.round(100 * read)} %</span>
          <progress max="1" value={read} />
        </label>
      )}
    </main>
  );
}

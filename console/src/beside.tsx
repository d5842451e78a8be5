// Two recorded flights beside each other, at the same mission time, by one timeline.

import { useEffect, useMemo, useState } from "preact/hooks";
import "./beside.css";
import { AnalyticsCharts, Charts } from "./charts";
import type { Flight } from "./flight";
import { FlightMap } from "./map";
import { Alerts, StatePanel } from "./panels";
import { type Place, placeOf } from "./place";
import { Playback } from "./playback";
import { Timeline, momentOfLink } from "./timeline";
import { useFlight } from "./use_flight";
import { Video } from "./video";
import type { MissionOut, RecordedOut } from "./wire";

export interface BesideProps {
  missions: [MissionOut, MissionOut];
  recorded: [RecordedOut, RecordedOut];
  token: string;
  theme: string;
  themes: preact.ComponentChildren;
  onAlone(mission: string): void;
}

/** What tells two missions apart: their names, with the time at which they began if those are equal. */
function titles([one, other]: [MissionOut, MissionOut]): [string, string] {
  if (one.name !== other.name) return [one.name, other.name];
  const title = ({ name, started }: MissionOut) =>
    started === null ? name : `${name}, ${new Date(1000 * started).toLocaleString()}`;
  return [title(one), title(other)];
}

export function SideBySide({ missions, recorded, token, theme, themes, onAlone }: BesideProps) {
  const [left, right] = [
    useFlight(missions[0], token, () => new Playback(missions[0], recorded[0], token, momentOfLink())),
    useFlight(missions[1], token, () => new Playback(missions[1], recorded[1], token, null)),
  ];
  const [first, setFirst] = useState(() => firstRobot(recorded[0]));
  const [second, setSecond] = useState(() => firstRobot(recorded[1]));
  useEffect(() => {
    if (left?.source instanceof Playback && right?.source instanceof Playback) {
      left.source.lead(right.source);
      // A link may name a moment after the end of the first one.
      left.source.seek(momentOfLink() ?? left.source.time);
    }
  }, [left, right]);
  if (!left || !right || !(left.source instanceof Playback)) return null;
  const [one, other] = titles(missions);
  return (
    <div class="page played">
      <header class="top">
        <h1>AeroDaaS</h1>
        <strong class="name">two flights at the same mission time</strong>
        <span class="grow" />
        <span class="badge">recordings</span>
        {themes}
      </header>
      <main class="besides">
        <Half
          {...{ theme, flight: left, recorded: recorded[0], robot: first, onRobot: setFirst }}
          title={one}
          onAlone={() => onAlone(missions[0].id)}
        />
        <Half
          {...{ theme, flight: right, recorded: recorded[1], robot: second, onRobot: setSecond }}
          title={other}
          onAlone={() => onAlone(missions[1].id)}
        />
      </main>
      <Timeline
        playback={left.source}
        drones={[
          { flight: recorded[0], robot: first },
          { flight: recorded[1], robot: second },
        ]}
      />
    </div>
  );
}

interface HalfProps {
  title: string;
  flight: Flight;
  recorded: RecordedOut;
  robot: string;
  theme: string;
  onRobot(robot: string): void;
  onAlone(): void;
}

function Half({ title, flight, recorded, robot, theme, onRobot, onAlone }: HalfProps) {
  const place: Place = useMemo(() => placeOf({ ...recorded, robots: [] }), [recorded]);
  const robots = Object.keys(recorded.tracks);
  return (
    <section class="half" aria-label={title}>
      <header>
        <h2>{title}</h2>
        {robots.length > 1 && (
          <select
            aria-label={`Drone of ${title}`}
            value={robot}
            onChange={(event) => onRobot(event.currentTarget.value)}
          >
            {robots.map((name) => (
              <option key={name}>{name}</option>
            ))}
          </select>
        )}
        <span class="grow" />
        <button type="button" class="plain" onClick={onAlone}>
          Alone
        </button>
      </header>
      <FlightMap
        {...{ flight, place, robot }}
        scenery={recorded.scenery}
        areas={[]}
        mayFly={false}
        marked={null}
        onMark={() => undefined}
        drawn={null}
        onDraw={() => undefined}
      />
      <Video flight={flight} />
      <StatePanel flight={flight} robot={robot} />
      <Charts flight={flight} robot={robot} theme={theme} />
      <AnalyticsCharts flight={flight} theme={theme} />
      <Alerts log={flight.log} recorded onAcknowledge={() => undefined} />
    </section>
  );
}

function firstRobot(recorded: RecordedOut): string {
  return Object.keys(recorded.tracks)[0] ?? "";
}

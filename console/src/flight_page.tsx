// The pages of one flight, live or recorded, and of two recorded flights side by side.

import type { ComponentChildren } from "preact";
import { useEffect, useState } from "preact/hooks";
import "./flight_page.css";
import { Alerts } from "./alerts";
import { Camera } from "./camera";
import { AnalyticsCharts, Charts } from "./charts";
import { CommandLog, FlightBar } from "./commands";
import { type Flight, GROUNDED, heightOf, useFlight } from "./flight";
import { ManualControlPanel } from "./manual_control_panel";
import { FlightMap } from "./map";
import { Page, Silence } from "./page";
import { StatePanel, WaypointForm } from "./panels";
import { type LeasedArea, type Point, robotsOf } from "./place";
import { Plan } from "./plan";
import { Playback } from "./playback";
import { PreflightPanel } from "./preflight";
import { useScenery } from "./scenery";
import { LiveSource } from "./source";
import { SurveyPanel, useSurvey } from "./survey";
import { Timeline, momentOfLink } from "./timeline";
import { Button, NameChoice, Select } from "./widgets";
import { wordsOf } from "./words";
import type { AccountOut, FleetOut, MissionOut, RecordedOut } from "./wire";

/** Milliseconds since the server's last answer after which it counts as out of reach. */
const REACH = 5000;
const CEILING = 120;

interface FlightPageProps {
  first: MissionOut;
  account: AccountOut;
  fleet: FleetOut;
  areas: LeasedArea[];
  /** When the server answered last, by this machine's clock. */
  answeredAt: number;
  /** The mission's name, or the choice of missions. */
  title: ComponentChildren;
  /** Missions whose recordings can be shown beside this one. */
  others: MissionOut[];
  onBeside(mission: string): void;
  /** Plays the recording of this mission, once there is one. */
  onReplay: (() => void) | undefined;
  recorded?: RecordedOut;
}

/** One flight: map, camera, state, and what its pilot commands. */
export function FlightPage(props: FlightPageProps) {
  const { first, account, recorded, areas, others } = props;
  const flight = useFlight(first.id, [first], () =>
    recorded ? new Playback(first, recorded, momentOfLink()) : new LiveSource(first.id),
  );
  const [robot, setRobot] = useState(() => first.robots[0] ?? firstRobot(recorded));
  const [marked, setMarked] = useState<Point | null>(null);
  /** Whether the camera is large, and the map small in its corner. */
  const [large, setLarge] = useState(false);
  const robots = robotsOf(recorded ?? props.fleet);
  const config = robots.find((one) => one.id === robot);
  const scenery = useScenery(`v1/missions/${first.id}/scenery`, recorded?.scenery);
  const up = heightOf(flight?.status(robot)) ?? 0;
  const height = up > 0.5 ? up : (config?.limits.takeoff_height ?? 2);
  const { survey, begin } = useSurvey(flight, robot, height, config);
  if (!flight) return null;

  const { mission } = flight;
  const may = !recorded && account.role !== "viewer" && account.scopes.includes("fly");
  // A live view may be lost while commands still arrive: only silence on both ways is out of reach.
  const reached = !flight.stale || Date.now() - props.answeredAt < REACH;
  const mayFly = may && reached && !flight.over;
  const pilot = mayFly && {
    ...{ marked, onMark: setMarked, drawn: survey },
    onDraw: () => {
      setMarked(null);
      begin();
    },
  };
  const camera = account.scopes.includes("sense") && (
    <Camera {...{ flight, mission, large }} onLarge={setLarge} />
  );
  const title = (
    <>
      {props.title}
      <NameChoice label="Drone" value={robot} names={mission.robots} onChoose={setRobot} />
      {recorded && others.length > 0 && (
        <Select
          label="Compare with"
          value=""
          options={[["", "compare with…"], ...others.map(({ id, name }): [string, string] => [id, name])]}
          onChoose={props.onBeside}
        />
      )}
    </>
  );
  return (
    <Page title={title} who={account.role} flight={flight}>
      <Silence
        flight={flight}
        unreachable={may && !reached ? "Commands cannot reach the drone until then." : ""}
      />
      {flight.over && (
        <p class="banner" role="status" data-testid="banner">
          The flight is over: {wordsOf(mission.phase)}
          {mission.reason && `, ${mission.reason}`}{" "}
          {props.onReplay && (
            <Button onClick={props.onReplay}>Play its recording</Button>
          )}
        </p>
      )}
      {!recorded && <FlightBar {...{ flight, robot, mayFly }} />}
      <main class="panels">
        <div class="wide">
          <div class={`stage ${large ? "filming" : ""}`}>
            {large && camera}
            <FlightMap
              {...{ flight, robots, scenery, areas: recorded ? [] : areas, chosen: robot }}
              pilot={pilot || undefined}
            />
            {large && (
              <Button class="swap" label="Show the map large" onClick={() => setLarge(false)} />
            )}
          </div>
          <Charts flight={flight} robot={robot} />
        </div>
        <div class="side">
          {survey && <SurveyPanel survey={survey} />}
          {marked && (
            <WaypointForm
              key={marked.join()}
              {...{ flight, robot, height, point: marked }}
              ceiling={config?.limits.geofence.ceiling ?? CEILING}
              onDone={() => setMarked(null)}
            />
          )}
          {!large && camera}
          <StatePanel flight={flight} robot={robot} />
          <Alerts log={flight.log} {...(!recorded && { onAcknowledge: flight.acknowledge })} />
          {!recorded && (
            <PreflightPanel
              robot={robot}
              live={!flight.over}
              open={GROUNDED.has(flight.status(robot)?.mission.state ?? "idle")}
            />
          )}
          <Plan key={`plan ${robot}`} {...{ flight, robot, mayFly }} />
          {!recorded && <ManualControlPanel key={`hand ${robot}`} {...{ flight, robot, mayFly, config }} />}
          <CommandLog
            flight={flight}
            mayFly={may}
            hint={mayFly ? `Click the map to send ${robot} there.` : ""}
          />
          <AnalyticsCharts flight={flight} />
        </div>
      </main>
      {recorded && flight.source instanceof Playback && (
        <Timeline playback={flight.source} drones={[{ flight: recorded, robot }]} />
      )}
    </Page>
  );
}

/** What distinguishes two missions: their names, or the times at which they began. */
function titles([one, other]: [MissionOut, MissionOut]): [string, string] {
  if (one.name !== other.name) return [one.name, other.name];
  const title = ({ name, started }: MissionOut) =>
    started === null ? name : `${name}, ${new Date(1000 * started).toLocaleString()}`;
  return [title(one), title(other)];
}

interface SideBySideProps {
  missions: [MissionOut, MissionOut];
  recorded: [RecordedOut, RecordedOut];
  onAlone(mission: string): void;
}

/** Two recorded flights at the same mission time, by one timeline. */
export function SideBySide({ missions, recorded, onAlone }: SideBySideProps) {
  const [first, second] = [
    useHalf(missions[0], recorded[0], momentOfLink()),
    useHalf(missions[1], recorded[1], null),
  ];
  const [left, right] = [first.flight?.source, second.flight?.source];
  useEffect(() => {
    if (!(left instanceof Playback) || !(right instanceof Playback)) return;
    left.lead(right);
    // A link may name a moment after the end of the first one.
    left.seek(momentOfLink() ?? left.time);
  }, [left, right]);
  if (!first.flight || !second.flight || !(left instanceof Playback)) return null;
  const halves = [{ ...first, flight: first.flight }, { ...second, flight: second.flight }];
  const names = titles(missions);
  return (
    <Page
      title={<strong class="name">Two flights at the same mission time</strong>}
      who=""
      flight={first.flight}
    >
      <main class="besides">
        {halves.map((half, place) => (
          <Half
            key={half.mission.id}
            {...half}
            title={names[place] ?? ""}
            onAlone={() => onAlone(half.mission.id)}
          />
        ))}
      </main>
      <Timeline
        playback={left}
        drones={halves.map(({ recorded: flight, robot }) => ({ flight, robot }))}
      />
    </Page>
  );
}

function useHalf(mission: MissionOut, recorded: RecordedOut, begin: number | null) {
  const flight = useFlight(mission.id, [mission], () => new Playback(mission, recorded, begin));
  const [robot, onRobot] = useState(() => firstRobot(recorded));
  return { mission, flight, recorded, robot, onRobot };
}

interface HalfProps {
  title: string;
  flight: Flight;
  recorded: RecordedOut;
  robot: string;
  onRobot(robot: string): void;
  onAlone(): void;
}

function Half({ title, flight, recorded, robot, onRobot, onAlone }: HalfProps) {
  const names = Object.keys(recorded.tracks);
  return (
    <section class="half" aria-label={title}>
      <header>
        <h2>{title}</h2>
        <NameChoice label={`Drone of ${title}`} value={robot} names={names} onChoose={onRobot} />
        <span class="grow" />
        <Button class="plain" onClick={onAlone}>Show alone</Button>
      </header>
      <FlightMap
        {...{ flight, robots: robotsOf(recorded), scenery: recorded.scenery, areas: [], chosen: robot }}
      />
      <Camera flight={flight} mission={flight.mission} />
      <StatePanel flight={flight} robot={robot} />
      <Charts flight={flight} robot={robot} />
      <AnalyticsCharts flight={flight} />
      <Alerts log={flight.log} />
    </section>
  );
}

function firstRobot(recorded: RecordedOut | undefined): string {
  return Object.keys(recorded?.tracks ?? {})[0] ?? "";
}

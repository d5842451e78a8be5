// The console: signs in, chooses a mission, and lays out the panels.

import { render } from "preact";
import { useEffect, useMemo, useRef, useState } from "preact/hooks";
import { SideBySide } from "./beside";
import { AnalyticsCharts, Charts } from "./charts";
import { Refused, answered, ask, keepToken, readFragment, takeToken, writeFragment } from "./connection";
import { Fleet } from "./fleet";
import { ClockOffset, type Flight, GROUNDED } from "./flight";
import { FlightBar } from "./flight_bar";
import { FlightMap } from "./map";
import { Alerts, CommandLog, StatePanel, WaypointForm } from "./panels";
import { type LeasedArea, type Place, type Point, areasOf, placeOf } from "./place";
import { Playback } from "./playback";
import { PreflightPanel } from "./preflight";
import { Recorded } from "./recorded";
import { useScenery } from "./scenery";
import { LiveSource } from "./source";
import { Timeline, momentOfLink } from "./timeline";
import type { AccountOut, FleetOut, MissionOut, RecordedOut, RobotOut } from "./wire";
import { Video } from "./video";
import { HandPanel } from "./hand_panel";
import { useFlight } from "./use_flight";
import { Plan } from "./plan";
import { SurveyPanel, useSurvey } from "./survey";
import "./console.css";
import "./piloting.css";
import "./preflight.css";

const THEMES = ["auto", "light", "dark"] as const;
type Theme = (typeof THEMES)[number];
/** Milliseconds between two looks at the list of missions, and at the fleet while that is shown. */
const LOOK = 2000;
const FLEET_LOOK = 1000;
/** Milliseconds after which a request for the list of missions counts as unanswered. */
const ANSWER = 10000;
/** Milliseconds since the server's last answer after which it counts as out of reach. */
const REACH = 5000;
/** Tenant of a flight of one's own. */
const OWN = "own";
const DARK = matchMedia("(prefers-color-scheme: dark)");

interface Known {
  account: AccountOut;
  place: Place;
  name: string;
}

function App() {
  const [token, setToken] = useState(takeToken);
  const [known, setKnown] = useState<Known | null>(null);
  const [missions, setMissions] = useState<MissionOut[]>([]);
  const [robots, setRobots] = useState<RobotOut[]>([]);
  const areas = useMemo(() => areasOf(robots), [robots]);
  const [chosen, setChosen] = useState<string | null>(() => readFragment("mission"));
  /** The mission that was seen flying: its end is shown before its recording. */
  const [seen, setSeen] = useState<string | null>(null);
  /** The mission whose recording is played beside the chosen one's. */
  const [beside, setBeside] = useState(() => readFragment("beside"));
  const [problem, setProblem] = useState("");
  /** When the server answered last, by this machine's clock. */
  const [answeredAt, setAnsweredAt] = useState(0);
  const clock = useRef(new ClockOffset()).current;
  const overview = useRef(false);
  const { choice, setChoice, theme } = useTheme();
  const [, tick] = useState(0);

  useEffect(() => {
    if (!token) return;
    let gone = false;
    let timer = 0;
    const look = async () => {
      try {
        const signal = AbortSignal.timeout(ANSWER);
        const [account, answer, all] = await Promise.all([
          ask<AccountOut>("v1/me", token, undefined, signal),
          answered("v1/fleet", token, undefined, signal),
          ask<MissionOut[]>("v1/missions", token, undefined, signal),
        ]);
        const fleet = (await answer.json()) as FleetOut;
        if (gone) return;
        setAnsweredAt(Date.now());
        const date = Date.parse(answer.headers.get("Date") ?? "");
        if (!Number.isNaN(date)) clock.take(date * 1e6);

        setKnown((before) => before ?? { account, place: placeOf(fleet), name: fleet.name });
        setMissions(all);
        setRobots(fleet.robots);
        setProblem("");
      } catch (error) {
        if (gone) return;
        setProblem(error instanceof Error ? error.message : String(error));
        if (error instanceof Refused && error.status === 401) {
          setKnown(null);
          setToken("");
          return;
        }
      }
      timer = setTimeout(() => void look(), overview.current ? FLEET_LOOK : LOOK);
    };
    void look();
    return () => {
      gone = true;
      clearTimeout(timer);
    };
  }, [token]);

  /** Whether this is a provider's page, with a fleet and other missions than one's own. */
  const provided = known !== null && known.account.tenant !== OWN;
  // A provider's first page is its fleet; elsewhere the only mission is shown at once.
  const only = !provided && missions.length === 1 ? missions[0] : undefined;
  const shown = chosen ?? (only?.phase === "flying" || only?.recording ? only.id : null);
  const mission = missions.find((one) => one.id === shown);
  overview.current = provided && mission === undefined;
  // Silence has to show, too.
  useEffect(() => {
    if (!overview.current) return;
    const timer = setInterval(() => tick((count) => count + 1), 1000);
    return () => clearInterval(timer);
  }, [overview.current]);
  // A mission that is shown stays shown after it is over.
  useEffect(() => {
    if (chosen === null && shown !== null) setChosen(shown);
  }, [chosen, shown]);
  useEffect(() => {
    if (mission?.phase === "flying") setSeen(mission.id);
  }, [mission?.id, mission?.phase, seen]);
  const choose = (id: string) => {
    setSeen(null);
    // An empty one is none: the fleet is shown, whatever flies.
    setChosen(id);
    setBeside(null);
    writeFragment({ mission: id, t: null, beside: null });
  };
  const compare = (id: string) => {
    setBeside(id);
    writeFragment({ beside: id });
  };

  const themes = (
    <button
      type="button"
      class="plain theme"
      title={`Colours: ${choice}. Click for the next`}
      aria-label={`Colours: ${choice}`}
      onClick={() => setChoice(THEMES[(THEMES.indexOf(choice) + 1) % THEMES.length] ?? "auto")}
    >
      {{ auto: "◐", light: "☀", dark: "☾" }[choice]}
    </button>
  );
  if (!token) return <SignIn problem={problem} onToken={setToken} />;
  if (known && mission) {
    const shared = {
      ...{ first: mission, missions, known, areas, answeredAt, token, theme, themes },
      onMission: choose,
      onBeside: compare,
    };
    const replayed = mission.recording && known.account.scopes.includes("sense");
    if (!replayed || seen === mission.id) return <Console key={mission.id} {...shared} />;
    const other = missions.find((one) => one.id === beside && one.recording && one !== mission);
    if (other) {
      return (
        <Recorded key={`${mission.id} beside`} mission={mission} token={token}>
          {(left) => (
            <Recorded key={other.id} mission={other} token={token}>
              {(right) => (
                <SideBySide
                  missions={[mission, other]}
                  recorded={[left, right]}
                  {...{ token, theme, themes, onAlone: choose }}
                />
              )}
            </Recorded>
          )}
        </Recorded>
      );
    }
    return (
      <Recorded key={`recorded ${mission.id}`} mission={mission} token={token}>
        {(flight) => <Console {...shared} recorded={flight} />}
      </Recorded>
    );
  }
  if (known && provided) {
    const now = Date.now();
    const reached = now - answeredAt < REACH;
    return (
      <div class="page">
        <header class="top">
          <h1>AeroDaaS</h1>
          <MissionChoice chosen="" fleet missions={missions} onMission={choose} />
          <span class="grow" />
          <span class="badge who">
            {known.account.name}, {known.account.role}
          </span>
          <span class={`badge ${reached ? "good" : "bad"}`} data-testid="connection">
            {reached ? "live" : "not connected"}
          </span>
          {themes}
        </header>
        {!reached && (
          <p class="banner bad" role="alert" data-testid="banner">
            No word from the service for {((now - answeredAt) / 1000).toFixed(0)} s: what is shown is
            old, and commands cannot reach the drones. Connecting again…
          </p>
        )}
        <Fleet
          account={known.account}
          place={known.place}
          {...{ robots, missions, clock, reached, token }}
          onMission={choose}
        />
      </div>
    );
  }
  return (
    <main class="start">
      <h1>AeroDaaS console</h1>
      {problem && <p class="banner bad">{problem}</p>}
      {known ? <Missions missions={missions} onMission={choose} /> : <p>connecting…</p>}
      {themes}
    </main>
  );
}

function MissionChoice(props: {
  missions: MissionOut[];
  chosen: string;
  /** Whether there is a fleet to choose, too. */
  fleet: boolean;
  onMission(id: string): void;
}) {
  return (
    <select
      aria-label="Mission"
      value={props.chosen}
      onChange={(event) => props.onMission(event.currentTarget.value)}
    >
      {props.fleet && <option value="">the fleet</option>}
      {props.missions.map((one) => (
        <option key={one.id} value={one.id}>
          {one.name} · {one.phase.replaceAll("_", " ")}
        </option>
      ))}
    </select>
  );
}

function SignIn({ problem, onToken }: { problem: string; onToken(token: string): void }) {
  return (
    <main class="start">
      <h1>AeroDaaS console</h1>
      {problem && <p class="banner bad">{problem}</p>}
      <form
        class="card"
        onSubmit={(event) => {
          event.preventDefault();
          const token = String(new FormData(event.currentTarget).get("token")).trim();
          keepToken(token);
          onToken(token);
        }}
      >
        <label>
          <span>Token</span>
          <input name="token" type="password" autocomplete="off" required autoFocus />
        </label>
        <button type="submit" class="primary">
          Open
        </button>
        <p class="hint">
          A flight of your own tells its address with the token; a provider's administrator makes
          yours.
        </p>
      </form>
    </main>
  );
}

function Missions(props: { missions: MissionOut[]; onMission(id: string): void }) {
  if (props.missions.length === 0) return <p>No mission yet: this page shows the first one.</p>;
  return (
    <ul class="missions">
      {props.missions.map((one) => (
        <li key={one.id}>
          <button type="button" onClick={() => props.onMission(one.id)}>
            <strong>{one.name}</strong> {one.robots.join(", ")}{" "}
            <span class="badge">{one.phase.replaceAll("_", " ")}</span>
          </button>
        </li>
      ))}
    </ul>
  );
}

interface ConsoleProps {
  first: MissionOut;
  missions: MissionOut[];
  known: Known;
  areas: LeasedArea[];
  answeredAt: number;
  token: string;
  theme: string;
  themes: preact.ComponentChildren;
  onMission(id: string): void;
  onBeside(id: string): void;
  recorded?: RecordedOut;
}

function Console(props: ConsoleProps) {
  const { first, missions, known, token, theme, themes, onMission, onBeside, recorded } = props;
  const flight = useFlight(first, token, () =>
    recorded
      ? new Playback(first, recorded, token, momentOfLink())
      : new LiveSource(first.id, token),
  );
  const [robot, setRobot] = useState(
    () => first.robots[0] ?? Object.keys(recorded?.tracks ?? {})[0] ?? "",
  );
  const [marked, setMarked] = useState<Point | null>(null);
  /** Whether the camera is large, and the map small in its corner. */
  const [large, setLarge] = useState(false);
  const place = useMemo(
    () => (recorded ? placeOf({ ...recorded, robots: [] }) : known.place),
    [recorded, known],
  );
  const scenery = useScenery(`v1/missions/${first.id}/scenery`, token, recorded?.scenery);
  const abilities = place.robots.get(robot);
  const up = flight?.status(robot)?.position?.[2] ?? 0;
  const height = up > 0.5 ? up : place.takeoffHeight;
  const { survey, begin } = useSurvey(flight, robot, height, abilities);
  if (!flight) return null;

  const may = !recorded && known.account.role !== "viewer" && known.account.scopes.includes("fly");
  // A live view may be lost while commands still arrive: only silence on both ways is out of reach.
  const reached = !flight.stale || Date.now() - props.answeredAt < REACH;
  const mayCommand = may && reached && !flight.over;
  const sees = known.account.scopes.includes("sense");
  const fence = place.fences.find((one) => one.robot === robot);
  /** Whether this is a provider's page, with a fleet and other missions than one's own. */
  const provided = first.tenant !== OWN;
  const grounded = GROUNDED.has(flight.status(robot)?.state ?? "idle");
  const others = missions.filter((one) => one.recording && one.id !== first.id);
  return (
    <div class={`page ${recorded ? "played" : ""}`}>
      <header class="top">
        <h1>AeroDaaS</h1>
        {missions.length > 1 || provided ? (
          <MissionChoice chosen={first.id} fleet={provided} {...{ missions, onMission }} />
        ) : (
          <strong class="name">{flight.mission.name}</strong>
        )}
        {flight.mission.robots.length > 1 && (
          <select
            aria-label="Drone"
            value={robot}
            onChange={(event) => setRobot(event.currentTarget.value)}
          >
            {flight.mission.robots.map((name) => (
              <option key={name}>{name}</option>
            ))}
          </select>
        )}
        {recorded && others.length > 0 && (
          <select
            aria-label="Beside it"
            value=""
            onChange={(event) => onBeside(event.currentTarget.value)}
          >
            <option value="">beside…</option>
            {others.map((one) => (
              <option key={one.id} value={one.id}>
                {one.name}
              </option>
            ))}
          </select>
        )}
        <span class="grow" />
        <span class="badge">{known.account.role}</span>
        <Connection flight={flight} />
        {themes}
      </header>
      {flight.stale && (
        <p class="banner bad" role="alert" data-testid="banner">
          No word from the flight for {((Date.now() - flight.heard) / 1000).toFixed(0)} s: what is
          shown is old.{!flight.connected && " Connecting again…"}
          {may && !reached && " Commands cannot reach the drone until then."}
        </p>
      )}
      {flight.over && (
        <p class="banner" role="status" data-testid="banner">
          The flight is over: {flight.mission.phase.replaceAll("_", " ")}
          {flight.mission.reason && `, ${flight.mission.reason}`}{" "}
          {replays(missions, first.id) && (
            <button type="button" onClick={() => onMission(first.id)}>
              Play its recording
            </button>
          )}
        </p>
      )}
      {!recorded && <FlightBar flight={flight} robot={robot} mayFly={mayCommand} />}
      <main class="panels">
        <div class="wide">
          <div class={`stage ${large ? "filming" : ""}`}>
            {large && <Video flight={flight} large onLarge={setLarge} />}
            <FlightMap
              flight={flight}
              place={place}
              scenery={scenery}
              areas={recorded ? [] : props.areas}
              robot={robot}
              mayFly={mayCommand}
              marked={marked}
              onMark={setMarked}
              drawn={survey}
              onDraw={() => {
                setMarked(null);
                begin();
              }}
            />
            {large && (
              <button
                type="button"
                class="swap"
                aria-label="Show the map large"
                onClick={() => setLarge(false)}
              />
            )}
          </div>
          <Charts flight={flight} robot={robot} theme={theme} />
        </div>
        <div class="side">
          {survey && (
            <SurveyPanel
              survey={survey}
              ceiling={fence?.ceiling ?? 120}
              zones={(fence?.noFly.length ?? 0) > 0}
            />
          )}
          {marked && (
            <WaypointForm
              key={marked.join()}
              flight={flight}
              robot={robot}
              point={marked}
              height={height}
              ceiling={fence?.ceiling ?? 120}
              onDone={() => setMarked(null)}
            />
          )}
          {sees && !large && <Video flight={flight} onLarge={setLarge} />}
          <StatePanel flight={flight} robot={robot} />
          <Alerts
            log={flight.log}
            recorded={flight.recorded}
            onAcknowledge={(id) => flight.acknowledge(id)}
          />
          {!recorded && (
            <PreflightPanel robot={robot} token={token} live={!flight.over} open={grounded} />
          )}
          <Plan key={`plan ${robot}`} flight={flight} robot={robot} mayFly={mayCommand} />
          {!recorded && (
            <HandPanel
              key={`hand ${robot}`}
              flight={flight}
              robot={robot}
              mayFly={mayCommand}
              abilities={abilities}
            />
          )}
          <CommandLog flight={flight} robot={robot} mayFly={may} />
          <AnalyticsCharts flight={flight} theme={theme} />
        </div>
      </main>
      {recorded && flight.source instanceof Playback && (
        <Timeline playback={flight.source} drones={[{ flight: recorded, robot }]} />
      )}
    </div>
  );
}

function replays(missions: MissionOut[], id: string): boolean {
  return missions.some((one) => one.id === id && one.recording);
}

function Connection({ flight }: { flight: Flight }) {
  const [tone, text] = flight.recorded
    ? ["", "recording"]
    : flight.over
    ? ["", "over"]
    : flight.stale
      ? ["bad", flight.connected ? "no word" : "not connected"]
      : ["good", "live"];
  return (
    <span class={`badge ${tone}`} data-testid="connection">
      {text}
    </span>
  );
}

/** The colours that were chosen, and those that are shown. */
function useTheme(): { choice: Theme; setChoice(choice: Theme): void; theme: string } {
  const kept = localStorage.getItem("aerodaas.theme");
  const [choice, setChoice] = useState<Theme>(THEMES.find((one) => one === kept) ?? "auto");
  const [dark, setDark] = useState(() => DARK.matches);
  useEffect(() => {
    const watch = () => setDark(DARK.matches);
    DARK.addEventListener("change", watch);
    return () => DARK.removeEventListener("change", watch);
  }, []);
  useEffect(() => {
    localStorage.setItem("aerodaas.theme", choice);
    document.documentElement.dataset["theme"] = choice;
  }, [choice]);
  return { choice, setChoice, theme: choice === "auto" && dark ? "dark" : choice };
}

const root = document.getElementById("console");
if (root) render(<App />, root);

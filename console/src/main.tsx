// The console: signs in, chooses a mission, and lays out the panels.

import { render } from "preact";
import { useEffect, useMemo, useState } from "preact/hooks";
import { SideBySide } from "./beside";
import { AnalyticsCharts, Charts } from "./charts";
import { Refused, ask, keepToken, readFragment, takeToken, writeFragment } from "./connection";
import { type Flight, GROUNDED } from "./flight";
import { FlightMap } from "./map";
import { Alerts, Commands, StatePanel, WaypointForm } from "./panels";
import { type LeasedArea, type Place, type Point, areasOf, placeOf } from "./place";
import { Playback } from "./playback";
import { Garage, PreflightPanel } from "./preflight";
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
const LOOK = 2000;
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
  const { choice, setChoice, theme } = useTheme();

  useEffect(() => {
    if (!token) return;
    let gone = false;
    let timer = 0;
    const look = async () => {
      try {
        const [account, fleet, all] = await Promise.all([
          ask<AccountOut>("v1/me", token),
          ask<FleetOut>("v1/fleet", token),
          ask<MissionOut[]>("v1/missions", token),
        ]);
        if (gone) return;
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
      timer = setTimeout(() => void look(), LOOK);
    };
    void look();
    return () => {
      gone = true;
      clearTimeout(timer);
    };
  }, [token]);

  const flying = missions.filter((one) => one.phase === "flying");
  const only = flying.length === 1 ? flying[0] : missions.length === 1 ? missions[0] : undefined;
  const shown = chosen ?? (only?.phase === "flying" || only?.recording ? only.id : null);
  const mission = missions.find((one) => one.id === shown);
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
      ...{ first: mission, missions, known, areas, token, theme, themes },
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
  return (
    <main class="start">
      <h1>AeroDaaS console</h1>
      {problem && <p class="banner bad">{problem}</p>}
      {known ? <Missions missions={missions} onMission={choose} /> : <p>connecting…</p>}
      {known && <Garage robots={robots} token={token} />}
      {themes}
    </main>
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
  const place = useMemo(
    () => (recorded ? placeOf({ ...recorded, robots: [] }) : known.place),
    [recorded, known],
  );
  const scenery = useScenery(first.id, token, recorded?.scenery);
  const abilities = place.robots.get(robot);
  const up = flight?.status(robot)?.position?.[2] ?? 0;
  const height = up > 0.5 ? up : place.takeoffHeight;
  const { survey, begin } = useSurvey(flight, robot, height, abilities);
  if (!flight) return null;

  const may = !recorded && known.account.role !== "viewer" && known.account.scopes.includes("fly");
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
          <select
            aria-label="Mission"
            value={first.id}
            onChange={(event) => onMission(event.currentTarget.value)}
          >
            {provided && <option value="">the fleet</option>}
            {missions.map((one) => (
              <option key={one.id} value={one.id}>
                {one.name} · {one.phase.replaceAll("_", " ")}
              </option>
            ))}
          </select>
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
      <main class="panels">
        <div class="wide">
        <FlightMap
          flight={flight}
          place={place}
          scenery={scenery}
          areas={recorded ? [] : props.areas}
          robot={robot}
          mayFly={may && !flight.over}
          marked={marked}
          onMark={setMarked}
          drawn={survey}
          onDraw={() => {
            setMarked(null);
            begin();
          }}
        />
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
        {sees && <Video flight={flight} />}
        <StatePanel flight={flight} robot={robot} />
        {!recorded && (
          <PreflightPanel robot={robot} token={token} live={!flight.over} open={grounded} />
        )}
        {!recorded && <Commands flight={flight} robot={robot} mayFly={may} />}
        <Plan key={`plan ${robot}`} flight={flight} robot={robot} mayFly={may} />
        {!recorded && (
          <HandPanel
            key={`hand ${robot}`}
            flight={flight}
            robot={robot}
            mayFly={may}
            abilities={abilities}
          />
        )}
        <Alerts flight={flight} />
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
